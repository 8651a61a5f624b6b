"""What the README tells a newcomer to type, typed."""

from __future__ import annotations

import asyncio
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text()


def written(pattern: str) -> str:
    """The one place in the README that matches."""
    found = re.findall(pattern, README, re.DOTALL)
    assert len(found) == 1, f"{pattern}: {len(found)} times in the README"
    return str(found[0])


async def test_ten_lines_put_a_robot_on_air(stack: Any, tmp_path: Path) -> None:
    program = tmp_path / "wave.py"
    program.write_text(written(r"```python\n(# wave\.py\n.*?)```"))
    said = written(r"\n    python wave\.py \| (\.venv/bin/posecast-edge run .*?)\n")
    _, address, zenoh = stack.relay()
    words = shlex.split(said.replace("tcp/127.0.0.1:7447", zenoh))
    words[0] = str(Path(sys.executable).parent / Path(words[0]).name)
    wave = subprocess.Popen([sys.executable, str(program)], stdout=subprocess.PIPE)
    try:
        assert wave.stdout is not None
        stack.start("edge", *words, stdin=wave.stdout.fileno())
        await arm_moves(stack.viewer(address), words[words.index("--robot") + 1])
    finally:
        wave.kill()
        wave.wait()


async def test_three_lines_put_a_robot_on_air(stack: Any) -> None:
    lines = written(r"```python\n(import posecast\n.*?)```")
    assert len(lines.split("\n\n")[1].splitlines()) == 2  # and the import
    _, address, zenoh = stack.relay()
    loop = "import time\nwhile True:\n    time.sleep(0.02)\n    " + lines.splitlines()[-1]
    program = lines.replace("tcp/127.0.0.1:7447", zenoh) + loop
    stack.start("program", sys.executable, "-c", program)
    viewer = stack.viewer(address)
    viewer.url = viewer.url.replace("/demo/", "/my-arm/")
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the arm is seen", lambda v: bool(v.frames))
    frame = viewer.frames[-1][1]
    assert frame.values("pos") == pytest.approx([0.4], abs=0.001)
    assert frame.values("ref") == pytest.approx([0.5], abs=0.001)
    task.cancel()


async def arm_moves(viewer: Any, robot: str) -> None:
    viewer.url = viewer.url.replace("/demo/", f"/{robot}/")
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the arm is seen to move", lambda v: len({f.codes for _, f in v.frames}) > 10)
    frame = viewer.frames[-1][1]
    assert frame.schema.fields[0].labels == ("elbow", "wrist")
    elbow, wrist = frame.values("pos")
    assert elbow is not None
    assert wrist == -elbow
    task.cancel()


def test_targets_and_pages_exist() -> None:
    targets = set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    assert set(re.findall(r"\n    make ([a-z-]+)", README)) <= targets
    for link in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (ROOT / link).exists(), link
