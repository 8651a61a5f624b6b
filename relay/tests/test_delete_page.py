"""The commands of docs/how-to/operate/delete-the-past.md delete what the page says, and no more."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from .operator_pages import list_commands

HOUR, DAYS, ALL = [
    line for line in list_commands("how-to/operate/delete-the-past.md") if "past delete" in line
]
INSIDE_MS, DAY_BEFORE_MS, LATER_MS = (
    1795357260112,
    1795270860112,
    1795368060112,
)  # 14:21Z, a day before, 17:21Z
Delete = Callable[[str], set[str]]


def name_segment(view: str, from_ms: int) -> str:
    """A segment of two seconds, where the archive has it."""
    ten_minutes = time.strftime("%Y-%m-%d/%H-%M", time.gmtime(from_ms // 600_000 * 600))
    return f"hubo/{view}/{ten_minutes}/{from_ms}-{from_ms + 2000}-8f14e45fceea167b-1-7-a.segment"


def put_segment(store: Path, view: str, from_ms: int) -> None:
    path = store / name_segment(view, from_ms)
    path.parent.mkdir(parents=True)
    path.write_bytes(b"segment")


@pytest.fixture
def delete(tmp_path: Path) -> Delete:
    """Carry out a command of the page; the segments that are left."""
    for view in ("public", "staff"):
        for from_ms in (INSIDE_MS, DAY_BEFORE_MS, LATER_MS):
            put_segment(tmp_path, view, from_ms)

    def carry_out(command: str) -> set[str]:
        environ = os.environ | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "POSECAST_PAST": f"file://{tmp_path}",
            "TZ": "UTC",
        }
        script = ["bash", "-euc", f"{command} --yes"]
        done = subprocess.run(script, env=environ, capture_output=True, text=True, check=False, timeout=60)
        assert done.returncode == 0, done.stderr
        return {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.segment")}

    return carry_out


def test_an_hour_of_all_views(delete: Delete) -> None:
    others = (DAY_BEFORE_MS, LATER_MS)
    assert delete(HOUR) == {name_segment(view, at) for view in ("public", "staff") for at in others}


def test_two_days_of_one_view(delete: Delete) -> None:
    assert delete(DAYS) == {name_segment("public", at) for at in (INSIDE_MS, DAY_BEFORE_MS, LATER_MS)}


def test_everything_until_now(delete: Delete, tmp_path: Path) -> None:
    now_ms = round(time.time() * 1000)
    put_segment(tmp_path, "both", now_ms - 3_600_000)
    put_segment(tmp_path, "both", now_ms + 3_600_000)
    left = delete(ALL)
    assert {name for name in left if "/both/" in name} == {name_segment("both", now_ms + 3_600_000)}
