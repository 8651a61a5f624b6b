"""The recipes for the containers in docs/how-to/, as scripts for the tests' own project."""

from __future__ import annotations

import re
import shlex
import subprocess
from pathlib import Path
from textwrap import dedent
from typing import Any

from posecast_testing import until

from tests.compose.engine import ROOT, docker
from tests.conftest import BIN


def list_blocks(page: str) -> list[str]:
    """The shell blocks of a page below docs/how-to/, without the indentation of lists."""
    text = (ROOT / "docs/how-to" / page).read_text()
    found = re.findall(r"^( *```sh\n.*?)^ *```", text, re.DOTALL | re.MULTILINE)
    return [dedent(block).partition("\n")[2] for block in found]


BLOCKS = list_blocks("operate/container-recipes.md")
COMPOSE, ADD, RULES, LINK, EDIT, BACK, BEGIN, FINISH, ADMIN = BLOCKS[:9]
BUILD, REPLACE, GATEWAYS, RELAY, REST, GO_BACK = BLOCKS[9:15]
BACKUP, RESTORE, SECOND, HEALTH, NOFILE = BLOCKS[15:]

INSTALL = list_blocks("install/containers.md")
(PAST_BACKUP,) = (block for block in INSTALL if "> past.tar.gz" in block)
(PAST_RESTORE,) = (block for block in INSTALL if "< past.tar.gz" in block)


def adapt(cloud: Any, block: str, folder: Path = ROOT, **settings: str) -> str:
    """A block as a script for the tests' own project, run in `folder`."""
    command = shlex.join(cloud.project.write_command(**settings))
    first = COMPOSE
    for shown, mine in {
        "lab=posecast": f"lab={cloud.project.name}",
        'docker compose -f infra/docker-compose.yml --project-name "$lab"': command,
    }.items():
        assert first.count(shown) == 1
        first = first.replace(shown, mine)
    assert COMPOSE in INSTALL
    return f"set -euo pipefail\ncd {folder}\n{first}{REPLACE}{block}"


def attempt(cloud: Any, block: str, folder: Path = ROOT, **settings: str) -> subprocess.CompletedProcess[str]:
    """Run a block, whatever the result."""
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
    """Waits until a robot outside the containers is on air; creates its credential if needed."""
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
