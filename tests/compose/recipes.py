"""The recipes of docs/how-to/operate/container-recipes.md, as scripts for the tests' own project."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path
from textwrap import dedent
from typing import Any

from tests.compose.engine import ROOT, docker
from tests.conftest import BIN, until

PAGE = (ROOT / "docs/how-to/operate/container-recipes.md").read_text()
FOUND = re.findall(r"^( *```sh\n.*?)^ *```", PAGE, re.DOTALL | re.MULTILINE)
BLOCKS = [dedent(block).partition("\n")[2] for block in FOUND]  # those of lists are indented
ALIAS, ADD, RULES, EDIT, BACK, BEGIN, FINISH, ADMIN = BLOCKS[:8]
BUILD, GATEWAYS, RELAY, REST, BACKUP, RESTORE, SECOND, NOFILE = BLOCKS[8:]


def adapt(cloud: Any, block: str, folder: Path = ROOT, **settings: str) -> str:
    """A block as a script for the tests' own project, run in `folder`."""
    assert ALIAS.strip() == "alias compose='docker compose -f infra/docker-compose.yml'"
    command = cloud.project.write_command(**settings)
    script = block.replace("docker compose -f infra/docker-compose.yml", "compose")
    script = re.sub(r"\bposecast_(?=\w+:|web\b)", f"{cloud.project.name}_", script)
    return f'set -euo pipefail\ncd {folder}\ncompose() {{ {shlex.join(command)} "$@"; }}\n{script}'


def attempt(cloud: Any, block: str, folder: Path = ROOT, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run a block, whatever comes of it."""
    return subprocess.run(
        ["bash", "-c", adapt(cloud, block, folder, **settings)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def carry_out(cloud: Any, block: str, folder: Path = ROOT, **settings: str) -> str:
    """Run a block; what it prints."""
    done = attempt(cloud, block, folder, **settings)
    assert done.returncode == 0, f"{block}\n{done.stdout[-4000:]}{done.stderr[-8000:]}"
    return done.stdout


def start_robot(cloud: Any, stack: Any, name: str, credential: Path) -> Any:
    """A robot outside of the containers, once it is on air; its credential is made if there is none."""
    if not credential.exists():
        (relay,) = cloud.project.containers("relay")
        credential.touch(0o600)
        enrol = ("posecast-relay", "robots", "add", name, "--ca", "/secret/ca.pem")
        credential.write_text(docker("exec", relay, *enrol))
    to = f"tls/localhost:{cloud.project.robots_port}"
    words = ("run", "--source", "demo", "--credential", str(credential), "--relay", to)
    robot = stack.start("edge", str(BIN / "posecast-edge"), *words)
    until(f"{name} is on air", lambda: cloud.status(name) == "online", 60)
    return robot
