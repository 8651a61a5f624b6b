"""The README's commands for newcomers, run as written."""

from __future__ import annotations

import asyncio
import json
import re
import shlex
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import free_port, until

from tests.conftest import BIN

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()
ARM = "edge-agent/examples/arm.urdf"
WORDS = 900


def written(pattern: str) -> str:
    """The single place in the README that matches."""
    found = re.findall(pattern, README, re.DOTALL)
    assert len(found) == 1, f"{pattern}: {len(found)} times in the README"
    return str(found[0])


def read_program(name: str) -> str:
    return written(rf"```python\n(# {name}\.py\n.*?)```")


def read_joints_of_model(url: str, robot: str) -> set[str]:
    """The joints of the body that a page would draw; none while there is no model."""

    def ask(path: str) -> Any:
        with urllib.request.urlopen(f"{url}/api/v1/robots/{robot}{path}", timeout=5) as answer:
            return json.load(answer)

    digest = ask("")["model"]
    return {joint["name"] for joint in ask(f"/model/{digest}/manifest.json")["joints"]} if digest else set()


async def test_ten_lines_put_a_robot_with_a_body_on_air(stack: Any, tmp_path: Path) -> None:
    program = read_program("wave")
    assert len(program.splitlines()) <= 10
    (tmp_path / "wave.py").write_text(program)
    said = written(r"```sh\npython3 wave\.py \| \.venv/bin/posecast (run .*?)\n```")
    words = shlex.split(said.replace(ARM, str(ROOT / ARM)))
    wave = subprocess.Popen([sys.executable, str(tmp_path / "wave.py")], stdout=subprocess.PIPE)
    try:
        assert wave.stdout is not None
        rest = ("--no-browser", "--port", str(free_port()))
        run = stack.start("posecast", f"{BIN}/posecast", *words, *rest, stdin=wave.stdout.fileno())
        url, robot = run.line(r"on air:  (http://[^/]+)/#/r/(\S+)").groups()
        await arm_moves(stack.viewer(url.removeprefix("http://")), robot)
        until("it has a body", lambda: read_joints_of_model(url, robot) == {"shoulder", "elbow"})
    finally:
        wave.kill()
        wave.wait()


async def test_a_python_program_puts_a_robot_with_a_body_on_air(stack: Any) -> None:
    program = read_program("my_arm")
    assert len(program.splitlines()) <= 10
    _, address, zenoh = stack.relay()
    program = program.replace("tcp/127.0.0.1:7447", zenoh).replace(ARM, str(ROOT / ARM))
    stack.start("program", sys.executable, "-c", program)
    robot = written(r"open `http://127\.0\.0\.1:8080/#/r/([a-z-]+)`")
    await arm_moves(stack.viewer(address), robot)
    until("it has a body", lambda: read_joints_of_model(f"http://{address}", robot) == {"shoulder", "elbow"})


async def arm_moves(viewer: Any, robot: str) -> None:
    viewer.url = viewer.url.replace("/demo/", f"/{robot}/")
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the arm is seen to move", lambda v: len({f.codes for _, f in v.frames}) > 10)
    frame = viewer.frames[-1][1]
    assert frame.schema.fields[0].labels == ("shoulder", "elbow")
    shoulder, elbow = frame.values("pos")
    assert shoulder is not None
    assert elbow == pytest.approx(-shoulder, abs=0.001)
    task.cancel()


@pytest.mark.docs
def test_it_is_short() -> None:
    text = re.sub(r"[|·]|---", " ", README)
    assert len(text.split()) <= WORDS


@pytest.mark.docs
def test_targets_and_pages_exist() -> None:
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    named = set(re.findall(r"(?:\n|`)(?:[A-Z]+=\S+ )?make ([a-z-]+)", README))
    assert {"demo", "bench"} <= named <= targets
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).exists(), link
