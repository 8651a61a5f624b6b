"""Starts one server on its core, with its robot when it is the relay, and ends them again."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from posecast_testing import Process, is_listened_on, until

from relay.benches.scenarios import RELAYS, Scenario

ROBOT = "bench"
START_LIMIT_S = 20.0
MODULES = {"fastapi": "relay.benches.fastapi_loop", "websockets": "relay.benches.websockets_broadcast"}


class CannotStart(Exception):
    """One line for people."""


@dataclass(frozen=True)
class Server:
    pid: int
    port: int
    path: str
    lag: Path | None


@dataclass(frozen=True)
class Place:
    """Where a run takes place. One core for the server, another for all the rest."""

    server_core: int
    other_core: int
    binaries: dict[str, Path]
    out: Path

    @property
    def stamps(self) -> Path:
        return self.out / "stamps"


def start_on(place: Place, core: int, name: str, *command: str) -> Process:
    """All its threads inherit the core. What it prints goes to files in `place.out`."""
    for file in (f"{name}.out", f"{name}.err"):
        (place.out / file).unlink(missing_ok=True)
    return Process(place.out, name, "taskset", "--cpu-list", str(core), *command)


@contextmanager
def started(place: Place, core: int, name: str, *command: str) -> Iterator[Process]:
    """The same, until the end of the block. Then it is killed: a drain is not what is measured here."""
    process = start_on(place, core, name, *command)
    try:
        yield process
    finally:
        process.kill()


def hear(process: Process, pattern: str) -> re.Match[str]:
    """The newest line of its stdout that matches; CannotStart when it ends or stays silent."""
    try:
        return process.line(pattern, START_LIMIT_S)
    except AssertionError as e:
        raise CannotStart(str(e)) from None


def wait_port(port: int) -> None:
    """Until somebody listens there. CannotStart."""
    try:
        until(f"port {port} is listened on", lambda: is_listened_on(port), START_LIMIT_S)
    except AssertionError as e:
        raise CannotStart(str(e)) from None


@contextmanager
def relay(kind: str, scenario: Scenario, place: Place, lag: Path | None) -> Iterator[Server]:
    settings = ["run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]
    if lag is None and kind == "relay":
        command = [str(Path(sys.executable).with_name("posecast-relay")), *settings]
    else:
        ways = ["--lag", str(lag)] if lag is not None else ["--no-uring"]
        command = [sys.executable, "-m", "relay.benches.odd_relay", *ways, *settings]
    with started(place, place.server_core, "relay", *command) as server:
        said = hear(server, r"serving http://[^ ]*:(\d+), robots on (\S+)\s")
        publisher = [sys.executable, "-m", "relay.benches.publisher", "--relay", said[2], "--robot", ROBOT]
        publisher += ["--hz", str(scenario.robot_hz or scenario.hz), "--stamps", str(place.stamps)]
        publisher += ["--bytes", str(scenario.frame_bytes)]
        with started(place, place.other_core, "robot", *publisher) as robot:
            hear(robot, "^READY$")
            path = f"/api/v1/robots/{ROBOT}/live?hz={scenario.hz:g}"
            yield Server(server.process.pid, int(said[1]), path, lag)


@contextmanager
def comparison(kind: str, scenario: Scenario, place: Place, lag: Path | None) -> Iterator[Server]:
    command = (
        [sys.executable, "-m", MODULES[kind]] if kind in MODULES else [str(place.binaries["bare_server"])]
    )
    command += ["--hz", str(scenario.hz), "--bytes", str(scenario.frame_bytes), "--stamps", str(place.stamps)]
    if lag is not None and kind in MODULES:
        command += ["--lag", str(lag)]
    with started(place, place.server_core, kind, *command) as server:
        port = int(hear(server, r"^PORT (\d+)$")[1])
        yield Server(server.process.pid, port, "/live", lag if kind in MODULES else None)


@contextmanager
def serving(kind: str, scenario: Scenario, place: Place) -> Iterator[Server]:
    """The server `kind` (of scenarios.ALL), fed at the scenario's rate."""
    lag = place.out / "lag" if scenario.lag else None
    if lag is not None:
        lag.unlink(missing_ok=True)
    with (relay if kind in RELAYS else comparison)(kind, scenario, place, lag) as server:
        yield server
