"""The agent's commands as processes."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping


def run_edge(*argv: str, env: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """`posecast-edge` with these arguments and an empty stdin, to its end (120 s at most)."""
    return subprocess.run(
        [sys.executable, "-m", "posecast_edge", *argv],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=120,
        check=False,
        env=env,
    )
