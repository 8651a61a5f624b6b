"""What is wrong with a call of a program, as that program itself would say, or the file that lists what it
takes. Nothing is started but parsers."""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib.util
import io
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from posecast_command.completion import make_whole_parser
from posecast_edge.cli.settings import UsageError
from posecast_relay.config.settings import SettingsError

from tests.doc_blocks.block import ROOT

# programs of others: their own options are not known here
OTHERS = {
    *("cat", "cd", "chmod", "chown", "cp", "curl", "date", "find", "gcloud", "git", "grep", "groupadd", "id"),
    *(
        "install",
        "journalctl",
        "kubectl",
        "ls",
        "mkdir",
        "mountpoint",
        "mv",
        "nginx",
        "npx",
        "openssl",
        "pytest",
    ),
    *(
        "promtool",
        "redis-cli",
        "rm",
        "rsync",
        "sed",
        "ssh",
        "systemctl",
        "tar",
        "useradd",
        "uv",
        "uvx",
        "vi",
        "wc",
    ),
    "zenohd",
}
FOLDERS = ("benches", "edge-agent", "fuzz", "infra", "loadtests", "relay", "spa", "tests", "tools", "wire")
MADE = ("infra/hosting/firebase/page", "infra/second.env", "spa/dist")  # by the commands of the pages
SERVICES_FOLLOW = ("up", "pull", "stop", "rm", "restart", "logs", "ps", "images", "build")
DOCKER = ("run", "build", "push", "pull", "tag", "image", "stop", "rm", "logs", "volume", "network")
# ends a program once it has read its arguments
PARSE_ONLY = """
import argparse, runpy, sys
parse = argparse.ArgumentParser.parse_args
def parse_and_end(*given, **named):
    parse(*given, **named)
    sys.exit(0)
argparse.ArgumentParser.parse_args = parse_and_end
how, what, *sys.argv[1:] = sys.argv[1:]
sys.path[:0] = ["."]
sys.argv[0] = what
(runpy.run_module if how == "module" else runpy.run_path)(what, run_name="__main__")
sys.exit("it went on without reading its arguments")
"""
Check = Callable[[Sequence[str]], str | None]


def find_fault(words: Sequence[str]) -> str | None:
    """What is wrong with the call, or None. The working directory has the files that it reads."""
    program, *rest = words
    if program in CHECKS:
        return CHECKS[program](rest) or find_missing_file(rest)
    return find_missing_file(rest) if program in OTHERS else f"unknown program: {program}"


def find_missing_file(words: Iterable[str]) -> str | None:
    """The first word that names a file of the repository which does not exist."""
    for word in words:
        inside = word.startswith(tuple(f"{folder}/" for folder in FOLDERS))
        if inside and not word.startswith(MADE) and not (ROOT / word).exists():
            return f"no such file: {word}"
    return None


def skip_options(words: Sequence[str], with_value: Sequence[str] = ()) -> list[str]:
    """The words after a program's own options; `with_value`: those that a value follows."""
    rest = list(words)
    while rest and rest[0].startswith("-"):
        del rest[: 2 if rest[0] in with_value else 1]
    return rest


def check_inner(*with_value: str, operands: int = 0) -> Check:
    """The check of a program that starts another one, behind its options and `operands` words."""

    def check(words: Sequence[str]) -> str | None:
        return find_fault(skip_options(words, with_value)[operands:])

    return check


def check_env(words: Sequence[str]) -> str | None:
    return find_fault([word for word in words if not re.match(r"[A-Z_]+=", word)])


@cache
def make_parser() -> argparse.ArgumentParser:
    return make_whole_parser()


def check_posecast(*prefix: str) -> Check:
    """The check of `posecast`, or of the program of one of its commands."""

    def check(words: Sequence[str]) -> str | None:
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
                make_parser().parse_args([*prefix, *words])
        except (SettingsError, UsageError) as e:
            return str(e)
        except SystemExit:
            return said.getvalue().strip().splitlines()[-1]
        return None

    return check


def check_make(words: Sequence[str]) -> str | None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z0-9-]+):", text, re.MULTILINE))
    for word in words:
        name, is_variable, _ = word.partition("=")
        if is_variable and f"$({name})" not in text and f"$(if $({name})" not in text:
            return f"the Makefile reads no {name}"
        if not is_variable and name not in targets:
            return f"no target {name}"
    return None


def check_npm(words: Sequence[str]) -> str | None:
    run, script, flag, workspace, *rest = words
    if (run, flag) != ("run", "-w"):
        return "not of the form npm run SCRIPT -w WORKSPACE"
    if script not in json.loads((ROOT / workspace / "package.json").read_text())["scripts"]:
        return f"{workspace} has no script {script}"
    parts = [word for word in rest if word != "--"]
    folders = ["e2e"] if script == "e2e" else ["src", "tests"]
    tests = [path for folder in folders for path in (ROOT / workspace / folder).rglob("*.test.ts")]
    files = [path for path in tests if parts[0] in str(path)]
    if not files:
        return f"no test in {' or '.join(folders)} is called {parts[0]}"
    if parts[1:2] == ["-t"] and not any(parts[2] in path.read_text(encoding="utf-8") for path in files):
        return f"no test there is called {parts[2]}"
    return None


def check_python(words: Sequence[str]) -> str | None:
    if words[0] == "-c":
        ast.parse(words[1])
        return None
    if words[0] != "-m":
        path = ROOT / words[0]
        return parse_only("path", words) if path.is_file() else None  # or a program that the page shows
    module, *rest = words[1:]
    if module == "pip":
        return check_pip(rest)
    spec = importlib.util.find_spec(module)
    if spec is None:
        return f"no module {module}"
    ours = spec.origin and Path(spec.origin).is_relative_to(ROOT) and ".venv" not in spec.origin
    return parse_only("module", words[1:]) if ours else None


def parse_only(how: str, words: Sequence[str]) -> str | None:
    """Let a program of ours read its arguments and end. One that reads none is not started."""
    what, *rest = words
    path = ROOT / what
    if how == "module":
        spec = importlib.util.find_spec(f"{what}.__main__" if find_is_package(what) else what)
        path = Path(spec.origin) if spec and spec.origin else path
    if "parse_args" not in path.read_text(encoding="utf-8"):
        return f"{what} takes no arguments" if rest else None
    done = subprocess.run(
        [sys.executable, "-c", PARSE_ONLY, how, what, *rest],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.stderr.strip().splitlines()[-1] if done.returncode else None


def find_is_package(module: str) -> bool:
    spec = importlib.util.find_spec(module)
    return bool(spec and spec.submodule_search_locations)


def check_locust(words: Sequence[str]) -> str | None:
    """Locust's options are its own; a file of ours adds others, which its test tries."""
    return None if words[0] == "-f" else "which file?"


def check_node(words: Sequence[str]) -> str | None:
    return None if (ROOT / words[0]).is_file() else f"no such file: {words[0]}"


def check_pip(words: Sequence[str]) -> str | None:
    for word in words:
        found = re.search(r"posecast(?:_(\w+))?-\S*\[(.+)\]", word)
        if found:
            folders = {None: ("edge-agent", "relay"), "relay": ("relay",), "edge": ("edge-agent",)}
            unknown = set(found[2].split(",")).difference(*map(read_extras, folders[found[1]]))
            if unknown:
                return f"no such extra: {', '.join(sorted(unknown))}"
    return None


def read_extras(folder: str) -> set[str]:
    """The extras of a package; the wheel `posecast` has those of agent and relay."""
    project = tomllib.loads((ROOT / folder / "pyproject.toml").read_text())["project"]
    return set(project["optional-dependencies"])


@cache
def read_services() -> set[str]:
    compose: dict[str, Any] = yaml.safe_load((ROOT / "infra/docker-compose.yml").read_text())
    return set(compose["services"])


def check_docker(words: Sequence[str]) -> str | None:
    command, *rest = words
    if command == "compose":
        return check_compose(rest)
    if command not in DOCKER:
        return f"docker {command} is on no page yet"
    if command == "run":
        values = ("--network", "--user", "--volume", "--name", "--restart", "--tmpfs", "--cap-drop")
        _, *inner = skip_options(rest, (*values, "--security-opt", "-p", "-v", "--env-file"))
        return find_inner_fault(inner)
    return None


def check_compose(words: Sequence[str]) -> str | None:
    given = ("-f", "--project-name", "--profile", "--env-file")
    files = [words[i + 1] for i, word in enumerate(words) if word == "-f"]
    if files != ["infra/docker-compose.yml"]:
        return f"compose files: {files}"
    command, *rest = skip_options(words, given)
    values = ("--scale", "--volume")
    named = [w for i, w in enumerate(rest) if not w.startswith("-") and (i == 0 or rest[i - 1] not in values)]
    if command in ("exec", "run"):
        service, *inner = skip_options(rest, values)
        unknown = {service} - read_services()
        return f"no service {service}" if unknown else find_inner_fault(inner)
    if command in SERVICES_FOLLOW:
        unknown = set(named) - read_services() - {"1", ""}
        return f"no service {', '.join(sorted(unknown))}" if unknown else None
    return None if command in ("down", "cp") else f"docker compose {command} is on no page yet"


def find_inner_fault(words: Sequence[str]) -> str | None:
    """Of a program inside of a container; a shell's script there is read no further."""
    return find_fault(words) if words and words[0] != "sh" else None


CHECKS: dict[str, Check] = {
    "docker": check_docker,
    "env": check_env,
    "locust": check_locust,
    "make": check_make,
    "node": check_node,
    "npm": check_npm,
    "pip": check_pip,
    "posecast": check_posecast(),
    "posecast-edge": check_posecast("edge"),
    "posecast-relay": check_posecast("relay"),
    "python": check_python,
    "python3": check_python,
    "runuser": check_inner("-u"),
    "sudo": check_inner(),
    "timeout": check_inner(operands=1),
    "xargs": check_inner("-n"),
}
