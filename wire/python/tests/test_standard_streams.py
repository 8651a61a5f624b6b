"""A program that was started with closed streams has some."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import os, sys
from posecast_wire.command_line.standard_streams import open_closed_streams
open_closed_streams()
print("to stdout")
print("to stderr", file=sys.stderr)
assert sys.stdin.read() == ""
os._exit(min(os.open("/dev/null", os.O_RDONLY), 3))
"""


@pytest.mark.parametrize("closed", ["", "<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_a_closed_stream_leads_nowhere_and_no_file_takes_its_place(closed: str) -> None:
    command = ["bash", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, PROGRAM]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert (ended.stdout, ended.stderr) == (
        "" if ">&-" in closed.replace("2>&-", "") else "to stdout\n",
        "" if "2>&-" in closed else "to stderr\n",
    )
    assert ended.returncode == 3
