"""Locust's viewers: sockets under gevent, counts in plain integers, a report and an exit code at the end."""

from __future__ import annotations

import json
import os
import socket
import time
from argparse import ArgumentParser
from typing import Any
from urllib.parse import urlsplit

from locust import User, events, task
from locust.env import Environment
from locust.runners import MasterRunner, WorkerRunner

from posecast_loadtests.check import Clock, Viewer
from posecast_loadtests.rfc6455 import (
    Opcode,
    ProtocolError,
    Reader,
    check_upgrade,
    client_frame,
    upgrade_request,
)
from posecast_loadtests.tally import Limits, Tally, breaches, report

_ACK_INTERVAL_S = 1.0
_SILENCE_S = 5.0
# every tenth frame goes into Locust's own statistics, every fiftieth viewer decodes in full
_REPORTED = 10
_DECODING = 50

tally = Tally()
clock = Clock()
_others: dict[str, dict[str, Any]] = {}


class ViewerUser(User):
    """One browser tab: joins, reads, acknowledges, until the test ends."""

    _started = 0

    def __init__(self, environment: Environment) -> None:
        super().__init__(environment)
        ViewerUser._started += 1
        options = environment.parsed_options
        assert options is not None
        self._hz = float(options.hz)
        self._address = f"{self.host}/api/v1/robots/{options.robot}/live?hz={self._hz:g}"
        step = max(1, round(float(options.source_hz) / self._hz))
        self._viewer = Viewer(tally, clock, step, decode=ViewerUser._started % _DECODING == 1)
        self._since_s = 0.0
        self._socket: socket.socket | None = None

    @task
    def watch(self) -> None:
        """One connection, to its end."""
        self._viewer.connected()
        try:
            self._read(*self._join())
        except (OSError, ProtocolError) as error:
            tally.refused += 1
            self._fire("join", 0.0, error)
            time.sleep(1)

    def on_stop(self) -> None:
        """Locust ends the greenlet in the middle of `watch`; what it saw counts."""
        if self._socket is not None:
            self._socket.close()
        if self._since_s:
            tally.viewer(self._viewer.frames / max(1e-9, time.monotonic() - self._since_s))

    def _join(self) -> tuple[socket.socket, bytes]:
        url = urlsplit(self._address)
        began_s = time.monotonic()
        link = socket.create_connection((url.hostname or "127.0.0.1", url.port or 80), timeout=_SILENCE_S)
        link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        key = os.urandom(16)
        link.sendall(upgrade_request(url.netloc, f"{url.path}?{url.query}", key))
        answer = b""
        while (rest := check_upgrade(answer, key)) is None:
            more = link.recv(4096)
            if not more:
                raise ProtocolError("closed instead of an answer")
            answer += more
        self._socket = link
        self._fire("join", time.monotonic() - began_s)
        return link, rest

    def _read(self, link: socket.socket, data: bytes) -> None:
        reader = Reader()
        acknowledged_s, acknowledged = time.monotonic(), 0
        while True:
            arrival_s = time.monotonic()
            for opcode, payload in reader.feed(data):
                if opcode is Opcode.BINARY:
                    self._frame(payload, arrival_s)
                elif opcode is Opcode.TEXT:
                    if json.loads(payload).get("type") == "schema":
                        self._viewer.schema(payload.decode())
                elif opcode is Opcode.PING:
                    link.sendall(client_frame(Opcode.PONG, payload))
                elif opcode is Opcode.CLOSE:
                    tally.closed += 1
                    code = int.from_bytes(payload[:2], "big")
                    self._fire("closed", 0.0, ProtocolError(f"{code} {payload[2:].decode()}"))
                    return
            # after any message, not only a frame: a relay that waits for this sends no frames, but status
            if arrival_s - acknowledged_s >= _ACK_INTERVAL_S and self._viewer.messages > acknowledged:
                acknowledged_s, acknowledged = arrival_s, self._viewer.messages
                ack = json.dumps({"type": "ack", "n": acknowledged})
                link.sendall(client_frame(Opcode.TEXT, ack.encode()))
            data = link.recv(65536)
            if not data:
                tally.closed += 1
                return

    def _frame(self, payload: bytes, arrival_s: float) -> None:
        if not self._since_s:
            self._since_s = arrival_s
        lateness_s = self._viewer.binary(payload, arrival_s)
        if lateness_s is not None and self._viewer.frames % _REPORTED == 0:
            self._fire("frame", lateness_s, size=len(payload))

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
    limits = Limits()
    parser.add_argument("--robot", default="demo", help="whom to watch")
    parser.add_argument("--hz", type=float, default=10.0, help="frames a second each viewer asks for")
    parser.add_argument("--source-hz", type=float, default=30.0, help="frames a second the robot sends")
    parser.add_argument("--max-missed", type=float, default=limits.missed_share, help="share of frames")
    parser.add_argument(
        "--max-p99-ms", type=float, default=limits.p99_ms, help="lateness of 99 %% of the frames"
    )
    parser.add_argument("--min-jain", type=float, default=limits.jain, help="fairness of the viewers' rates")


def _tell(data: dict[str, Any], **_: Any) -> None:
    data["posecast"] = tally.counts()


def _hear(client_id: str, data: dict[str, Any], **_: Any) -> None:
    _others[client_id] = data["posecast"]  # counts are totals: the newest report of a worker stands for it


def _verdict(environment: Environment, **_: Any) -> None:
    if isinstance(environment.runner, WorkerRunner):
        return
    whole = Tally.sum(_others.values()) if isinstance(environment.runner, MasterRunner) else tally
    options = environment.parsed_options
    assert options is not None
    limits = Limits(options.max_missed, options.max_p99_ms, options.min_jain)
    print(report(whole, limits))
    environment.process_exit_code = 1 if breaches(whole, limits) else 0


# Locust's hooks carry no types; told once, here
_hooks: Any = events
_hooks.init_command_line_parser.add_listener(_arguments)
_hooks.report_to_master.add_listener(_tell)
_hooks.worker_report.add_listener(_hear)
_hooks.quitting.add_listener(_verdict)
