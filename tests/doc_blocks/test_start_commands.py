"""The first commands of README.md, docs/index.md and the tutorials, and those of CONTRIBUTING.md."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port, until

from tests.conftest import BIN
from tests.doc_blocks.block import ROOT
from tests.doc_blocks.terminal import START_S, Terminal, fetch, find_line, read_script

CONTRIBUTING = "CONTRIBUTING.md"


@pytest.fixture
def terminal(stack: Any) -> Terminal:
    """In the checkout; a browser is not opened."""
    return Terminal(stack, ROOT, {".venv/bin/python": f"{BIN}/python"}, {"BROWSER": "true"})


def test_the_demo_is_on_air_after_one_command(terminal: Terminal) -> None:
    pages = ("README.md", "docs/index.md", "docs/tutorials/find-the-fault.md", CONTRIBUTING)
    commands = {read_script(page, "make demo").split("\n")[0].split("#")[0].strip() for page in pages}
    (command,) = commands
    demo = terminal.start(command, f"PORT={free_port()}")
    url = find_line(demo, r"on air:  (http://[^/]+)/#/r/demo")[1]
    until("the demo moves", lambda: (fetch(f"{url}/api/v1/robots/demo/state") or {}).get("fields"), START_S)


def test_make_lists_its_targets(terminal: Terminal) -> None:
    *_, last = read_script(CONTRIBUTING, "make demo").splitlines()
    command = last.split("#")[0].strip()
    assert command == "make"
    listed = set(re.findall(r"^ +make ([a-z-]+)", terminal.run(command), re.MULTILINE))
    assert {"demo", "check", "test", "fix", "fuzz", "gallery", "pictures"} <= listed


@pytest.mark.full
def test_readers_are_fuzzed_and_a_case_is_replayed(terminal: Terminal) -> None:
    make, some, replay = read_script(CONTRIBUTING, "-m fuzz").splitlines()
    assert make.startswith("make fuzz ")  # what `make test` ends with
    assert "schema" in terminal.run(some.replace("--seconds 60", "--seconds 1"))
    case = next(path for path in sorted((ROOT / "fuzz/corpus/schema").iterdir()) if path.is_file())
    terminal.run(replay.replace("FILE", str(case)))


def test_the_shell_completes_commands(stack: Any, tmp_path: Path) -> None:
    setup = read_script("docs/how-to/install/install.md", "completion bash")
    assert "posecast" in Terminal(stack, tmp_path).run(f"{setup}\ncomplete -p posecast")


def test_the_virtual_environment_has_locust(stack: Any, tmp_path: Path) -> None:
    activate = read_script("docs/how-to/scale/load-tests.md", "activate")
    terminal = Terminal(stack, tmp_path, {".venv/bin": str(BIN)})
    assert terminal.run(f"PATH=/usr/bin:/bin\n{activate}\ncommand -v locust").strip() == f"{BIN}/locust"
