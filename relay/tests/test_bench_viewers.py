"""The bench's C programs compile, find each other, and count what was sent."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler (cc) here")


@pytest.fixture(scope="module")
def programs() -> dict[str, str]:
    build = [sys.executable, "-m", "relay.benches.build"]
    said = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=True, timeout=60).stdout
    return dict(line.split(" ", 1) for line in said.splitlines())


@pytest.fixture
def stamps(tmp_path: Path) -> Path:
    path = tmp_path / "stamps"
    path.write_bytes(bytes(65537 * 8))
    return path


def watch(programs: dict[str, str], stamps: Path, *more: str) -> dict[str, object]:
    """What 20 viewers of a bare server at 50 Hz saw."""
    command = [programs["bare_server"], "--hz", "50", "--stamps", str(stamps)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            port = server.stdout.readline().split()[1]
            viewers = [programs["viewers"], "--port", port, "--stamps", str(stamps), "--viewers", "20"]
            viewers += ["--server-pid", str(server.pid), *more]
            done = subprocess.run(viewers, capture_output=True, text=True, check=True, timeout=60)
        finally:
            server.kill()
    seen: dict[str, object] = json.loads(done.stdout)
    return seen


def test_twenty_viewers_see_every_frame_once_and_in_order(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2")
    messages = seen["messages"]
    assert isinstance(messages, int)
    assert messages > 0
    assert seen["bytes"] == 200 * messages
    assert seen["keys"] == messages
    assert seen["opened"] == 20
    troubles = ("failed", "duplicates", "reordered", "missed", "orphans", "unreadable", "unstamped", "closed")
    assert {name: seen[name] for name in troubles} == dict.fromkeys(troubles, 0)


def test_viewers_acknowledge_once_a_second_at_most(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2")
    acks = seen["acks"]
    assert isinstance(acks, int)
    assert acks >= 20  # at the first frame
    assert isinstance(seen["wall_s"], float)
    assert acks <= 20 * (seen["wall_s"] + 0.2 + 2)  # the settling and one at either end


def test_frozen_viewers_are_not_counted(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--seconds", "1", "--settle", "0.2", "--frozen", "10")
    assert seen["jain"] == pytest.approx(1.0, abs=0.01)
    assert seen["frozen"] == {"count": 10, "gone": 0, "last_gone_s": 0.0, "backlog_s": 0.0}


def test_all_at_once(programs: dict[str, str], stamps: Path) -> None:
    seen = watch(programs, stamps, "--mode", "storm")
    assert (seen["opened"], seen["failed"]) == (20, 0)
