"""The locustfile of a hall: viewers that try a socket, and use the lane if the relay is full.

locust -f loadtests/src/posecast_loadtests/hall_file.py --headless -u 100 -r 50 -H ws://127.0.0.1:8080
    --counts FILE

FILE receives the counts so far, twice a second.
"""

from __future__ import annotations

import json
import random
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

import gevent
from locust import User, events, task
from locust.env import Environment
from websockets.frames import Opcode

from posecast_loadtests.connection import Connection, ProtocolError
from posecast_loadtests.hall import HallCounts, HallViewer, LaneReader
from posecast_loadtests.results import Clock, Tally, Viewer

FULL, MOVED = 1013, 1012
HZ, SOURCE_HZ = 10, 30
BACK_OFF_S, BACK_OFF_MAX_S = 0.5, 30.0
RETRY_MAX_S = 300.0  # a lane reader retries a socket at least this often
TOLD_EVERY_S = 0.5

counts = HallCounts()
sockets = Tally()  # the results of the sockets' checks
clock = Clock()


class LaneUser(User):
    """One browser tab in a hall: a socket if there is a place, otherwise the lane, and later a socket
    again."""

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        options = environment.parsed_options
        assert options is not None
        self._address = f"{self.host}/api/v1/robots/{options.robot}/live?hz={HZ}"
        self._viewer = HallViewer()
        counts.viewers.append(self._viewer)
        self._link: Connection | None = None
        self._lane: LaneReader | None = None
        self._failures = 0

    @task
    def watch(self) -> None:
        """Watch through one socket until it ends, then through the lane if the relay offered it."""
        bye = self._read_socket()
        lane = bye.get("lane")
        if bye.get("code") == FULL and isinstance(lane, str):
            self._failures = 0
            self._read_lane(urljoin(self._address.replace("ws", "http", 1), lane), float(bye["retry_s"]))
        elif bye.get("code") == MOVED:
            self._failures = 0
            time.sleep(random.uniform(0.0, bye["retry_s"] or 10.0))
        else:
            self._failures += 1
            time.sleep(random.uniform(0.0, min(BACK_OFF_MAX_S, BACK_OFF_S * 2**self._failures)))

    def on_stop(self) -> None:
        """Locust kills the greenlet in the middle of `watch`."""
        self._leave()

    def _leave(self) -> None:
        for each in (self._link, self._lane):
            if each is not None:
                each.close()
        self._link = self._lane = None

    def _read_socket(self) -> dict[str, Any]:
        """Return the relay's `bye`, or an empty document."""
        check, bye = Viewer(sockets, clock, SOURCE_HZ // HZ, decode=False), dict[str, Any]()
        try:
            self._link = Connection(self._address)
            for opcode, payload, arrival_s in self._link.messages():
                if opcode is Opcode.BINARY:
                    check.binary(payload, arrival_s)
                    counts.frames += 1
                    self._viewer.show("socket", arrival_s)
                elif opcode is Opcode.TEXT and (said := json.loads(payload)).get("type") == "bye":
                    bye = said
        except ProtocolError as error:
            counts.note_refusal(f"socket: {error}")
        except OSError:
            counts.away += 1
        finally:
            if self._link is not None:
                self._link.close()
                self._link = None
        counts.told_lane += "lane" in bye
        counts.moved += bye.get("code") == MOVED
        if bye and bye.get("code") != MOVED and "lane" not in bye:
            counts.note_refusal(f"socket: {bye.get('code')} {bye.get('reason')}")
        return bye

    def _read_lane(self, address: str, retry_s: float) -> None:
        """Read the lane until a socket has taken over and ended, or until the lane ends."""
        self._lane = lane = LaneReader(address, counts, self._show)
        tries_s = time.monotonic() + retry_s * random.uniform(1.0, 2.0)
        while not lane.is_over:
            time.sleep(max(0.0, min(lane.due_s, tries_s) - time.monotonic()))
            if time.monotonic() >= lane.due_s:
                lane.ask()
            if time.monotonic() < tries_s:
                continue
            frames = self._viewer.last_s
            bye = self._read_socket()
            if self._viewer.by == "socket" and self._viewer.last_s > frames:
                break  # it took over; how it ended is as if there had been no lane
            retry_s = min(RETRY_MAX_S, 2 * float(bye.get("retry_s") or retry_s))
            tries_s = time.monotonic() + retry_s * random.uniform(1.0, 2.0)
        lane.close()
        self._lane = None

    def _show(self) -> None:
        self._viewer.show("lane", time.monotonic())


def _write(file: Path) -> None:
    counts.repeats += sockets.duplicates + sockets.reordered
    sockets.duplicates = sockets.reordered = 0
    beside = file.with_suffix(".part")
    beside.write_text(json.dumps(counts.write()))
    beside.replace(file)


def _tell(environment: Environment, **_: Any) -> None:
    options = environment.parsed_options
    if options is None or not options.counts:
        return

    def write_on() -> None:
        while True:
            _write(Path(options.counts))
            time.sleep(TOLD_EVERY_S)

    gevent.spawn(write_on)


def _end(environment: Environment, **_: Any) -> None:
    options = environment.parsed_options
    if options is not None and options.counts:
        with suppress(OSError):
            _write(Path(options.counts))
    environment.process_exit_code = 0


def _arguments(parser: Any) -> None:
    parser.add_argument("--robot", default="demo", help="the robot to watch")
    parser.add_argument("--counts", default="", help="file for the counts, as JSON")


# Locust's hooks have no types, so ignore that here, once
_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_arguments)
_hooks.test_start.add_listener(_tell)
_hooks.quitting.add_listener(_end)
