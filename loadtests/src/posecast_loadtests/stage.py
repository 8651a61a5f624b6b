"""Starts a relay for the test, with the demo robot."""

from __future__ import annotations

import signal
import sys
import urllib.request
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NamedTuple

from posecast_testing import Process, until

_START_LIMIT_S = 60.0


class Address(NamedTuple):
    """A relay's addresses: `ws://host:port` for viewers, a Zenoh endpoint for robots."""

    viewers: str
    robots: str


class OwnRelay(NamedTuple):
    """A relay and the demo robot's edge, started by this test."""

    address: Address
    relay: Process
    edge: Process


def ends_on_term() -> None:
    """Make SIGTERM raise an error, so that everything this process started ends with it."""

    def end(number: int, _frame: object) -> None:
        sys.exit(128 + number)

    signal.signal(signal.SIGTERM, end)


def started(stack: ExitStack, folder: Path, name: str, *command: str, stdin: int | None = None) -> Process:
    """Start a process that ends with `stack`. What it prints goes to files in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for file in folder.glob(f"{name}.*"):  # of an earlier run
        file.unlink()
    process = Process(folder, name, *command, stdin=stdin)
    stack.callback(process.stop)
    return process


def own_relay(stack: ExitStack, folder: Path, *flags: str) -> OwnRelay:
    """Start a relay with these extra flags, and the demo robot. Returns once the robot is online: load on an
    absent robot would measure nothing. Raises SystemExit if one does not start."""
    here = Path(sys.executable).parent
    own = ["--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0", *flags]
    try:
        relay = started(stack, folder, "relay", f"{here}/posecast-relay", "run", *own)
        found = relay.line(r"serving http://(\S+), robots on (\S+)", _START_LIMIT_S)
        demo = ["--robot", "demo", "--source", "demo", "--relay", found[2]]
        edge = started(stack, folder, "edge", f"{here}/posecast-edge", "run", *demo)

        def answers() -> bool:
            state = f"http://{found[1]}/api/v1/robots/demo/state"
            with suppress(OSError), urllib.request.urlopen(state, timeout=2):
                return True
            return False

        until("the robot is online", answers, _START_LIMIT_S)
    except AssertionError as error:
        sys.exit(f"{error}, see {folder}")
    return OwnRelay(Address(f"ws://{found[1]}", found[2]), relay, edge)
