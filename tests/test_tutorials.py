"""The first tutorial, done as it says; spa/e2e/find_the_fault.test.ts does the second."""

from __future__ import annotations

import asyncio
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import BIN, free_port, until
from tests.test_readme import ROOT, arm_moves, read_joints_of_model

FIRST_ROBOT = (ROOT / "docs/tutorials/first-robot.md").read_text()
PAGES = [*(ROOT / "docs/tutorials").glob("*.md"), ROOT / "docs/index.md", ROOT / "CONTRIBUTING.md"]


def read_block(pattern: str) -> str:
    """The one block of the tutorial that matches."""
    found = [block for block in re.findall(r"```\w+\n(.*?)```", FIRST_ROBOT, re.DOTALL) if pattern in block]
    assert len(found) == 1, f"{pattern}: {len(found)} times in the tutorial"
    return str(found[0])


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """The files that the tutorial has one save."""
    (tmp_path / "arm.urdf").write_text(read_block("<robot"))
    (tmp_path / "wave.py").write_text(read_block('"pos": {"shoulder": angle, "elbow": -angle}'))
    (tmp_path / "fail.py").write_text(read_block('"ref": told'))
    return tmp_path


def test_the_doctor_finds_nothing(checkout: Path) -> None:
    words = shlex.split(read_block("posecast doctor").replace(".venv/bin", str(BIN)))
    done = subprocess.run(words, cwd=checkout, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


async def put_on_air(stack: Any, checkout: Path, name: str) -> tuple[str, str]:
    """The address of the page and the robot's name."""
    command = read_block(f"{name} |").replace(".venv/bin", str(BIN))
    command = command.replace("arm.urdf", f"{checkout}/arm.urdf")
    program, _, rest = command.partition(" | ")
    robot = subprocess.Popen(
        [sys.executable, *shlex.split(program)[1:]], cwd=checkout, stdout=subprocess.PIPE
    )
    assert robot.stdout is not None
    words = (*shlex.split(rest), "--no-browser", "--port", str(free_port()))
    run = stack.start("posecast", *words, stdin=robot.stdout.fileno())
    robot.stdout.close()  # it ends when nobody reads it
    url, name = run.line(r"on air:  (http://[^/]+)/#/r/(\S+)").groups()
    return url, name


async def test_the_arm_waves(stack: Any, checkout: Path) -> None:
    url, robot = await put_on_air(stack, checkout, "wave.py")
    await arm_moves(stack.viewer(url.removeprefix("http://")), robot)
    until("it has a body", lambda: read_joints_of_model(url, robot) == {"shoulder", "elbow"})


async def test_the_elbow_is_stuck(stack: Any, checkout: Path) -> None:
    program = checkout / "fail.py"
    program.write_text(program.read_text().replace("t0 = time.monotonic()", "t0 = time.monotonic() - 6"))
    url, robot = await put_on_air(stack, checkout, "fail.py")
    viewer = stack.viewer(url.removeprefix("http://"))
    viewer.url = viewer.url.replace("/demo/", f"/{robot}/")

    def elbow_is_off(seen: Any) -> bool:
        elbows = ((frame.values("pos")[1], frame.values("ref")[1]) for _, frame in seen.frames)
        return any(pos == 0 and ref is not None and abs(ref) > 0.1 for pos, ref in elbows)

    task = asyncio.create_task(viewer.watch())
    await viewer.until("the elbow is off", elbow_is_off)
    task.cancel()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_targets_exist(page: Path) -> None:
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"(?:\n *|`)(?:[A-Z]+=\S+ )?make ([a-z-]+)", page.read_text())) <= targets
