"""A wrong word on the command line gives one line that names it, and exit code 2; never a traceback."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

BIN = Path(sys.executable).parent
EDGE = ["posecast-edge", "run", "--robot", "demo", "--source", "jsonl", "--relay", "tcp/127.0.0.1:1"]
RELAY = ["posecast-relay", "run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]


def changed(command: list[str], flag: str, value: str) -> list[str]:
    at = command.index(flag)
    return [*command[: at + 1], value, *command[at + 2 :]]


@pytest.mark.parametrize(
    ("command", "said"),
    [
        # the other words: edge-agent/tests/test_cli.py and relay/tests/test_settings.py
        (changed(EDGE, "--source", "trajectory:walk.traj"), "--profile"),
        ([*RELAY, "--store", "mongodb://x"], "mongodb://x"),
    ],
)
def test_wrong_configuration(command: list[str], said: str) -> None:
    done = subprocess.run(
        [BIN / command[0], *command[1:]],
        capture_output=True,
        text=True,
        timeout=30,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr


@pytest.mark.parametrize("flag", ["--port", "--zenoh-listen"])
def test_a_port_in_use(flag: str) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        value = str(port) if flag == "--port" else f"tcp/127.0.0.1:{port}"
        command = changed(RELAY, flag, value)
        done = subprocess.run(
            [BIN / command[0], *command[1:]], capture_output=True, text=True, timeout=30, check=False
        )
    assert done.returncode == 2, done.stderr
    assert str(port) in done.stderr
    assert "Traceback" not in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
