"""The dependency audit: a known vulnerability stops it, an unreachable service does not."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

AUDIT = Path(__file__).parents[1] / "tools" / "audit"


AWAY = "npm error audit endpoint returned an error: error sending request"


@pytest.mark.parametrize(
    ("says", "status", "strict", "ends", "tells"),
    [
        ("found 0 vulnerabilities", 0, "", 0, "no known vulnerabilities"),
        ("1 high severity vulnerability", 1, "", 1, "1 high severity vulnerability"),
        (AWAY, 1, "", 0, "skipped, its service"),
        (AWAY, 1, "strict", 1, "skipped, its service"),
    ],
)
def test_what_is_known_stops_it_and_silence_does_not(
    tmp_path: Path, says: str, status: int, strict: str, ends: int, tells: str
) -> None:
    for name in ("npm", "uv"):
        double = tmp_path / name
        double.write_text(f"#!/bin/sh\necho '{says}'\nexit {status}\n")
        double.chmod(0o755)
    environ = os.environ | {
        "PATH": f"{tmp_path}:{os.environ['PATH']}",
        "UV": str(tmp_path / "uv"),
        "POSECAST_AUDIT": strict,
    }
    done = subprocess.run([AUDIT], env=environ, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == ends, done
    assert done.stdout.count(tells) == 2
