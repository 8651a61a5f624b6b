"""Starts one server on its core, with its robot when it is the relay, and ends them again."""

from __future__ import annotations

import os
import re
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from relay.benches.build import ROOT
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


def start_on(core: int, command: Sequence[str], log: IO[bytes]) -> subprocess.Popen[bytes]:
    """All its threads inherit the core."""
    pinned = ["taskset", "--cpu-list", str(core), *command]
    return subprocess.Popen(pinned, cwd=ROOT, stdout=subprocess.PIPE, stderr=log)


def wait_line(child: subprocess.Popen[bytes], pattern: str) -> re.Match[str]:
    """The first line of its stdout that matches; CannotStart when it ends or stays silent."""
    assert child.stdout is not None
    deadline, heard = time.monotonic() + START_LIMIT_S, b""
    while (left := deadline - time.monotonic()) > 0:
        if not select.select([child.stdout], [], [], left)[0]:
            break
        chunk = os.read(child.stdout.fileno(), 65536)
        if not chunk:
            break
        heard += chunk
        if found := re.search(pattern, heard.decode(errors="replace")):
            return found
    raise CannotStart(f"{child.args!r} did not start, see server.log in out/bench; it said {heard[-300:]!r}")


def end(child: subprocess.Popen[bytes]) -> None:
    """At once: a drain is not what is measured here."""
    child.kill()
    child.wait()
    if child.stdout is not None:
        child.stdout.close()


@contextmanager
def relay(kind: str, scenario: Scenario, place: Place, lag: Path | None, log: IO[bytes]) -> Iterator[Server]:
    settings = ["run", "--dev", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]
    if lag is None and kind == "relay":
        command = [str(Path(sys.executable).with_name("posecast-relay")), *settings]
    else:
        ways = ["--lag", str(lag)] if lag is not None else ["--no-uring"]
        command = [sys.executable, "-m", "relay.benches.odd_relay", *ways, *settings]
    child = start_on(place.server_core, command, log)
    robot: subprocess.Popen[bytes] | None = None
    try:
        said = wait_line(child, r"serving http://[^ ]*:(\d+), robots on (\S+)\s")
        robot_hz = scenario.robot_hz or scenario.hz
        publisher = [sys.executable, "-m", "relay.benches.publisher", "--relay", said[2], "--robot", ROBOT]
        publisher += ["--hz", str(robot_hz), "--stamps", str(place.stamps)]
        publisher += ["--bytes", str(scenario.frame_bytes)]
        robot = start_on(place.other_core, publisher, log)
        wait_line(robot, "READY\n")
        yield Server(child.pid, int(said[1]), f"/api/v1/robots/{ROBOT}/live?hz={scenario.hz:g}", lag)
    finally:
        end(child)
        if robot is not None:
            end(robot)


@contextmanager
def comparison(
    kind: str, scenario: Scenario, place: Place, lag: Path | None, log: IO[bytes]
) -> Iterator[Server]:
    command = (
        [str(place.binaries["bare_server"])] if kind == "bare" else [sys.executable, "-m", MODULES[kind]]
    )
    command += ["--hz", str(scenario.hz), "--bytes", str(scenario.frame_bytes), "--stamps", str(place.stamps)]
    if lag is not None and kind != "bare":
        command += ["--lag", str(lag)]
    child = start_on(place.server_core, command, log)
    try:
        said = wait_line(child, r"PORT (\d+)\n")
        yield Server(child.pid, int(said[1]), "/live", lag if kind != "bare" else None)
    finally:
        end(child)


@contextmanager
def serving(kind: str, scenario: Scenario, place: Place) -> Iterator[Server]:
    """The server `kind` (of scenarios.ALL), fed at the scenario's rate."""
    lag = place.out / "lag" if scenario.lag else None
    if lag is not None:
        lag.unlink(missing_ok=True)
    with open(place.out / "server.log", "ab") as log:
        started = (
            relay(kind, scenario, place, lag, log)
            if kind in RELAYS
            else comparison(kind, scenario, place, lag, log)
        )
        with started as server:
            yield server
