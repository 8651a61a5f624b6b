"""Closes connections that do not complete a request in time, or hold too many bytes together.

uvicorn waits forever for a request's head. A client that sends one byte a minute would keep a socket forever.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from posecast_relay.runtime.boundary import isolated
from posecast_relay.streaming.http_connection import HttpConnection

ASK_S = 5.0  # from connecting, or from a request's first byte, to its end
CROWD = 500  # above this number, those older than HURRIED_S are dropped; a quarter of listener.SPARE_FILES
HURRIED_S = 1.0
SWEEP_S = 0.5
HEADS_BYTES = 8 << 20  # of incomplete requests on all connections; above this, the oldest are dropped


class RequestTimeouts:
    """Connections with an incomplete request, and its age. `cut` is called with the number of drops."""

    def __init__(self, now: Callable[[], float], cut: Callable[[int], None]) -> None:
        self._now = now
        self._cut = cut
        self._since: dict[asyncio.Transport, float] = {}  # the oldest first
        self._heard: dict[asyncio.Transport, int] = {}  # bytes of their requests so far
        self._heard_bytes = 0
        self._timer: asyncio.TimerHandle | None = None

    def start(self, transport: asyncio.Transport) -> None:
        """Start the timeout for a connection's next request, unless it is already running."""
        self._since.setdefault(transport, self._now())
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)

    def record_bytes(self, transport: asyncio.Transport, size: int) -> None:
        """Record how many bytes of an incomplete request have arrived."""
        if transport not in self._since:
            return
        self._heard_bytes += size - self._heard.get(transport, 0)
        self._heard[transport] = size
        while self._heard_bytes > HEADS_BYTES:
            oldest = next(iter(self._heard))
            self.stop(oldest)
            oldest.abort()
            self._cut(1)

    def stop(self, transport: asyncio.Transport) -> None:
        """Stop the timeout: the request is complete, or the connection is gone."""
        self._since.pop(transport, None)
        self._heard_bytes -= self._heard.pop(transport, 0)

    def _sweep(self) -> None:
        self._timer = None
        now, spare = self._now(), len(self._since) - CROWD
        late = []
        for n, (transport, since) in enumerate(self._since.items()):
            if now - since < (HURRIED_S if n < spare else ASK_S):
                break
            late.append(transport)
        for transport in late:
            self.stop(transport)
            transport.abort()
        if late:
            self._cut(len(late))
        if self._since:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)


def add_timeouts(base: type[HttpConnection], unasked: RequestTimeouts) -> type[HttpConnection]:
    """Return a subclass of `base` that limits how long a request may take."""

    class Guarded(base):  # type: ignore[misc, valid-type]
        @isolated
        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            unasked.start(transport)

        @isolated
        def connection_lost(self, exc: Exception | None) -> None:
            unasked.stop(self.transport)
            super().connection_lost(exc)

        @isolated
        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            if self._in_message:
                unasked.record_bytes(self.transport, self.request_bytes)

        def on_message_begin(self) -> None:
            unasked.start(self.transport)
            super().on_message_begin()

        def on_message_complete(self) -> None:
            unasked.stop(self.transport)
            super().on_message_complete()

    return Guarded
