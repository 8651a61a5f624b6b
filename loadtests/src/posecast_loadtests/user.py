"""Locust's viewers, with sockets under gevent and counts as plain integers."""

from __future__ import annotations

import json
import random
import time
from argparse import ArgumentParser
from typing import Any

from locust import User, events, task
from locust.env import Environment
from websockets.frames import Opcode

from posecast_loadtests.connection import Connection, ProtocolError
from posecast_loadtests.results import Clock, Tally, Viewer
from posecast_loadtests.scenarios import SCENARIOS, SOAK, Scenario, Stage
from posecast_loadtests.verdict import tally

# every tenth frame of a viewer goes into Locust's table; every fiftieth viewer decodes fully
_REPORTED = 10
_DECODING = 50
_SLOW_BYTES_PER_S = 1000
_SLOW_CHUNK = 250
_FROZEN_AFTER_S = 5.0
_FROZEN_FOR_S = 22.0  # by then the relay has cut a viewer that does not read (after at most 20 s)
_STEADY_S = 2.0  # shorter connections say nothing about fairness
_COME_BACK_S = 1.0

clocks: dict[str, Clock] = {}


def scenario(environment: Environment) -> Scenario:
    """Return the scenario chosen by name, or one made from Locust's `-u`."""
    options = environment.parsed_options
    assert options is not None
    named = {**SCENARIOS, SOAK.name: SOAK}.get(options.scenario)
    if named is not None:
        return named.stretched(options.stretch, options.viewers)
    return Scenario("viewers", "viewers", options.num_users or 1, (Stage(0, 1.0),), options.hz)


class ViewerUser(User):
    """One browser tab: joins, reads and acknowledges until the test ends or it leaves."""

    _started = 0

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        number = ViewerUser._started
        ViewerUser._started += 1
        options = environment.parsed_options
        assert options is not None
        asked = scenario(environment)
        robot = f"fleet-{number % asked.robots}" if asked.robots else options.robot
        self._kind = asked.kind(number)
        self._source_hz = float(options.source_hz)
        self._address = f"{self.host}/api/v1/robots/{robot}/live?hz={asked.hz:g}"
        self._step = max(1, round(self._source_hz / asked.hz))
        self._stays_s = 60 / asked.churn_per_min if asked.churn_per_min else float("inf")
        clock = clocks.setdefault(robot, Clock())
        mine = tally if self._kind == "healthy" else Tally()  # a slow phone is expected to miss frames
        self._viewer = Viewer(mine, clock, self._step, decode=number % _DECODING == 0)
        self._mine = mine
        self._link: Connection | None = None
        self._since_s = 0.0
        self._frames_before = 0

    @task
    def watch(self) -> None:
        """Watch through one connection, until it ends."""
        self._viewer.connected()
        self._viewer.paced(self._step)
        began_s = time.monotonic()
        try:
            self._link = Connection(self._address, slow=self._kind == "slow")
            self._fire("join", time.monotonic() - began_s)
            self._read(self._link)
        except (OSError, ProtocolError) as error:
            if self._kind == "frozen" and self._since_s:
                tally.evicted += 1  # a cut connection may also end as a reset
            else:
                tally.refused += 1
                self._fire("join" if not self._since_s else "read", 0.0, error)
            time.sleep(_COME_BACK_S)
        finally:
            self._leave()

    def on_stop(self) -> None:
        """Locust kills the greenlet in the middle of `watch`; what it saw still counts."""
        self._leave()

    def _leave(self) -> None:
        if self._link is not None:
            self._link.close()
            self._link = None
        if not self._since_s:
            return
        seconds, self._since_s = time.monotonic() - self._since_s, 0.0
        frames, self._frames_before = self._viewer.frames - self._frames_before, self._viewer.frames
        if self._kind == "healthy" and seconds >= _STEADY_S:
            tally.viewer(frames / seconds)
        elif self._kind == "slow":
            tally.slow_viewers += 1
            tally.slow_frames += frames
            tally.slow_starved += not frames
        # these must hold for every viewer, however slow
        if self._mine is not tally:
            for name in ("duplicates", "reordered", "undecodable"):
                setattr(tally, name, getattr(tally, name) + getattr(self._mine, name))
                setattr(self._mine, name, 0)

    def _read(self, link: Connection) -> None:
        leaves_s = time.monotonic() + random.expovariate(1 / self._stays_s) if self._stays_s < 1e9 else 1e18
        self._thaw_s = 0.0
        receive = {"slow": self._receive_slowly, "frozen": self._receive_until_frozen}.get(self._kind)
        for opcode, payload, arrival_s in link.messages(receive):
            if opcode is Opcode.BINARY:
                self._frame(payload, arrival_s)
            elif opcode is Opcode.TEXT:
                self._text(payload)
            elif self._kind != "frozen":
                tally.closed += 1
                code = int.from_bytes(payload[:2], "big")
                self._fire("closed", 0.0, ProtocolError(f"{code} {payload[2:].decode(errors='replace')}"))
                return
            if arrival_s >= leaves_s:
                return
            if self._thaw_s and arrival_s > self._thaw_s + _COME_BACK_S:
                tally.unevicted += 1
                return
        if self._kind == "frozen":
            tally.evicted += 1
        else:
            tally.closed += 1

    def _receive_slowly(self) -> bytes:
        assert self._link is not None
        time.sleep(_SLOW_CHUNK / _SLOW_BYTES_PER_S)
        return self._link.socket.recv(_SLOW_CHUNK)

    def _receive_until_frozen(self) -> bytes:
        assert self._link is not None
        if not self._thaw_s and self._since_s and time.monotonic() - self._since_s > _FROZEN_AFTER_S:
            time.sleep(_FROZEN_FOR_S)
            self._thaw_s = time.monotonic()
        return self._link.socket.recv(65536)

    def _text(self, payload: bytes) -> None:
        message = json.loads(payload)
        if message.get("type") == "schema":
            self._viewer.schema(payload.decode())
        elif message.get("type") == "rate":
            tally.lowered += 1
            self._viewer.paced(max(1, round(self._source_hz / max(message["hz"], 0.1))))

    def _frame(self, payload: bytes, arrival_s: float) -> None:
        if not self._since_s:
            self._since_s = arrival_s
        lateness_s = self._viewer.binary(payload, arrival_s)
        if lateness_s is not None and self._viewer.frames % _REPORTED == 0:
            self._fire(f"frame, {self._kind}: 1 in {_REPORTED}", lateness_s, size=len(payload))

    def _fire(self, name: str, seconds: float, error: Exception | None = None, size: int = 0) -> None:
        self.environment.events.request.fire(
            request_type="WS",
            name=name,
            response_time=seconds * 1000,
            response_length=size,
            exception=error,
            context={},
        )


def _arguments(parser: ArgumentParser) -> None:
    parser.add_argument("--robot", default="demo", help="the robot to watch")
    parser.add_argument("--hz", type=float, default=10.0, help="frames per second that each viewer requests")
    parser.add_argument(
        "--source-hz", type=float, default=30.0, help="frames per second that the robot sends"
    )
    parser.add_argument(
        "--scenario", default="", help=f"one of {', '.join(SCENARIOS)}; replaces -u, -r and -t"
    )
    parser.add_argument(
        "--viewers", type=int, default=None, help="number of viewers, instead of the scenario's"
    )
    parser.add_argument("--stretch", type=float, default=1.0, help="factor for the scenario's times")


# Locust's hooks have no types, so ignore that here, once
_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_arguments)
