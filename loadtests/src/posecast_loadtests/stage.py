"""Starts a relay for the test, with the demo robot."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import time
import urllib.request
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple, TextIO

_SERVING = re.compile(r"serving http://(\S+), robots on (\S+)")
_GRACE_S = 10.0
_START_LIMIT_S = 60.0


class Address(NamedTuple):
    """A relay's addresses: `ws://host:port` for viewers, a Zenoh endpoint for robots."""

    viewers: str
    robots: str


class OwnRelay(NamedTuple):
    """A relay and the demo robot's edge, started by this test."""

    address: Address
    relay: subprocess.Popen[str]
    edge: subprocess.Popen[str]


def ends_on_term() -> None:
    """Make SIGTERM raise an error, so that everything this process started ends with it."""

    def end(number: int, _frame: object) -> None:
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, end)


def ends_with(stack: ExitStack, process: subprocess.Popen[Any]) -> None:
    """End `process` when `stack` closes."""

    def end() -> None:
        process.terminate()
        try:
            process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    stack.callback(end)


def started(stack: ExitStack, log: TextIO, *command: str, stdin: int | None = None) -> subprocess.Popen[str]:
    """Start a process that ends with `stack`. Its stdout is piped; its stderr goes to `log`."""
    process = subprocess.Popen([*command], stdin=stdin, stdout=subprocess.PIPE, stderr=log, text=True)
    ends_with(stack, process)
    return process


def own_relay(stack: ExitStack, log: TextIO, *flags: str) -> OwnRelay:
    """Start a relay with these extra flags, and the demo robot. Returns once the robot is online."""
    here = Path(sys.executable).parent
    own = ["--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0", *flags]
    relay = started(stack, log, f"{here}/posecast-relay", "run", *own)
    assert relay.stdout is not None
    line = relay.stdout.readline()
    found = _SERVING.search(line)
    if found is None:
        sys.exit(f"the relay didn't start: {line.strip() or f'see {log.name}'}")
    demo = ["--robot", "demo", "--source", "demo", "--relay", found[2]]
    edge = started(stack, log, f"{here}/posecast-edge", "run", *demo)
    _wait_on_air(f"http://{found[1]}/api/v1/robots/demo/state")
    return OwnRelay(Address(f"ws://{found[1]}", found[2]), relay, edge)


def _wait_on_air(state: str) -> None:
    """Wait until the robot's state is available: load on an absent robot would measure nothing."""
    end_s = time.monotonic() + _START_LIMIT_S
    while time.monotonic() < end_s:
        with suppress(OSError), urllib.request.urlopen(state, timeout=2):
            return
        time.sleep(0.1)
    sys.exit(f"no robot online within {_START_LIMIT_S:.0f} s")
