"""Viewers on a real relay with the demo robot: small, but the whole way, exit code included."""

from __future__ import annotations

import re
import subprocess
import sys


def loaded(*arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "posecast_loadtests", *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def test_fifty_viewers_get_their_frames() -> None:
    # a busy machine may be late; it may not lose, repeat or reorder, and every frame must decode
    code, output = loaded("-u", "50", "-r", "50", "-t", "6s", "--max-p99-ms", "5000", "--max-missed", "0.2")
    assert code == 0, output
    assert "viewers      50 (refused 0, closed early 0)" in output
    frames = int(re.search(r"frames +(\d+)", output)[1])  # type: ignore[index]
    assert frames > 50 * 10, output
    assert "duplicates   0, out of order 0" in output
    assert "undecodable  0" in output


def test_a_breach_is_an_exit_code() -> None:
    code, output = loaded("-u", "3", "-r", "3", "-t", "4s", "--max-p99-ms", "0")
    assert code == 1, output
    assert "BREACH       p99 lateness" in output
