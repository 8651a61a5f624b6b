"""Viewers on a real relay with the demo robot: small, but the whole way, exit code included."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest


def loaded(out: Path, *arguments: str) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "posecast_loadtests", *arguments, "--out", str(out)],
        capture_output=True,
        text=True,
        timeout=150,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


def counted(out: Path, name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((out / f"{name}.json").read_text())
    return found


# A busy machine may be late and miss frames, so these look at what may never happen, and at who was there.
NEVER = ("refused", "closed", "duplicates", "reordered", "undecodable")


def test_a_short_lecture(tmp_path: Path) -> None:
    _, output = loaded(tmp_path, "lecture", "--viewers", "20", "--stretch", "0.1")
    seen = counted(tmp_path, "lecture")
    assert {name: seen["viewers"][name] for name in NEVER} == dict.fromkeys(NEVER, 0), output
    assert seen["viewers"]["viewers"] >= 16, output
    assert seen["viewers"]["frames"] > 20 * 10, output
    assert seen["control"]["frames"] > 10, output
    assert (tmp_path / "lecture.html").stat().st_size > 1000
    assert "list" in (tmp_path / "lecture_stats.csv").read_text()


@pytest.mark.full
def test_a_short_fleet(tmp_path: Path) -> None:
    _, output = loaded(tmp_path, "fleet", "--viewers", "20", "--stretch", "0.2")
    seen = counted(tmp_path, "fleet")
    assert {name: seen["viewers"][name] for name in NEVER} == dict.fromkeys(NEVER, 0), output
    assert seen["viewers"]["frames"] > 20 * 10, output


def test_a_breach_is_an_exit_code(tmp_path: Path) -> None:
    code, output = loaded(
        tmp_path, "flash-crowd", "--viewers", "3", "--stretch", "0.1", "-H", "ws://127.0.0.1:9"
    )
    assert code == 1, output
    assert "BREACH       no viewer got a frame" in output
    assert "BREACH       the control viewer got no frame" in output


def test_a_name_nobody_knows(tmp_path: Path) -> None:
    code, output = loaded(tmp_path, "picnic")
    assert code == 2
    assert "no scenario 'picnic': use lecture, flash-crowd, fleet, slow-phones" in output
