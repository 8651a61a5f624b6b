"""`posecast-relay`, and a line in FILE for each HTTP request that it has answered:
python -m relay.benches.lane.origin FILE run …

A line: unix s, the address it was asked at (each node has one of its own), what it was, status, seconds that
it took, CPU time of its handler in µs, path. It costs the origin some µs a request.
"""

from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Awaitable, Callable, Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from posecast_relay.cli import main
from posecast_relay.http.app import make_app
from posecast_relay.server import process

_SEGMENT = re.compile(r"^/api/v1/robots/[^/]+/past/[^/]+/[0-9a-f]{16}/\d+$")
_PAST = re.compile(r"^/api/v1/robots/[^/]+/past$")


@dataclass(frozen=True)
class OriginRequest:
    """One answer of the origin. `kind`: segment, next, not-yet, past, or other (refusals as well)."""

    at_s: float
    node: str
    kind: str
    status: int
    took_s: float
    cpu_us: float
    path: str

    def write(self) -> str:
        """Return it as a line."""
        took = f"{self.took_s:.3f} {self.cpu_us:.1f}"
        return f"{self.at_s:.3f} {self.node} {self.kind} {self.status} {took} {self.path}\n"

    @classmethod
    def read(cls, line: str) -> OriginRequest:
        """Return what `write` wrote."""
        at_s, node, kind, status, took_s, cpu_us, path = line.split()
        return cls(float(at_s), node, kind, int(status), float(took_s), float(cpu_us), path)


def read_requests(log: Path, from_s: float, to_s: float, node: str) -> list[OriginRequest]:
    """Return what a node was answered between two moments, unix s."""
    with log.open() as lines:
        all_ = map(OriginRequest.read, lines)
        return [each for each in all_ if each.node == node and from_s <= each.at_s < to_s]


def name_kind(path: str, status: int, content_type: bytes) -> str:
    """Say what an answer was."""
    if _PAST.match(path) and status == 200:
        return "past"
    if _SEGMENT.match(path):
        if status == 204:
            return "not-yet"
        if status == 200:
            return "next" if content_type.startswith(b"application/json") else "segment"
    return "other"


class TimedCall:
    """Awaits something, and counts the CPU time of its steps: not what others do while it waits."""

    def __init__(self, call: Awaitable[None]) -> None:
        self._call = call
        self.cpu_ns = 0

    def __await__(self) -> Generator[Any, Any, None]:
        steps = self._call.__await__()
        step: Callable[[Any], Any] = steps.send
        given: Any = None
        while True:
            began_ns = time.thread_time_ns()
            try:
                waits_for = step(given)
            except StopIteration:
                return
            finally:
                self.cpu_ns += time.thread_time_ns() - began_ns
            try:
                step, given = steps.send, (yield waits_for)
            except BaseException as e:  # cancelled, or what it waited for has failed
                step, given = steps.throw, e


class CountedApp:
    """An ASGI application that writes a line for each request that it has answered."""

    def __init__(self, app: Any, log: int) -> None:
        self._app = app
        self._log = log

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        began, status, content_type = time.monotonic(), 0, b""

        async def note(message: Any) -> None:
            nonlocal status, content_type
            if message["type"] == "http.response.start":
                headers = {name.lower(): value for name, value in message.get("headers", ())}
                status, content_type = message["status"], headers.get(b"content-type", b"")
            await send(message)

        call = TimedCall(self._app(scope, receive, note))
        try:
            await call
        finally:
            path = scope["path"]
            took_s, node, kind = (
                time.monotonic() - began,
                scope["server"][0],
                name_kind(path, status, content_type),
            )
            line = OriginRequest(time.time(), node, kind, status, took_s, call.cpu_ns / 1000, path)
            os.write(self._log, line.write().encode())


if __name__ == "__main__":
    file = os.open(sys.argv.pop(1), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    process.make_app = lambda *given: CountedApp(make_app(*given), file)  # type: ignore[assignment, attr-defined]
    main()
