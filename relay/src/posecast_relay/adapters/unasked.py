"""Connections that have not asked for anything yet: each may take a few seconds, and all only so many.

uvicorn waits for a request's head for ever. Whoever sends one byte a minute would hold a socket for ever.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

ASK_S = 5.0  # from connecting, or from a request's first byte, to its end
CROWD = 500  # beyond so many at once, those over HURRIED_S old go: half of the sockets kept beside viewers'
HURRIED_S = 1.0
SWEEP_S = 0.5


class Unasked:
    """Who connected when; `cut` is called with how many were dropped."""

    def __init__(self, now: Callable[[], float], cut: Callable[[int], None]) -> None:
        self._now = now
        self._cut = cut
        self._since: dict[asyncio.Transport, float] = {}  # the oldest first
        self._timer: asyncio.TimerHandle | None = None

    def came(self, transport: asyncio.Transport) -> None:
        """It may ask from now on."""
        self._since.setdefault(transport, self._now())
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)

    def asked(self, transport: asyncio.Transport) -> None:
        """Its request is here, or it is gone."""
        self._since.pop(transport, None)

    def _sweep(self) -> None:
        self._timer = None
        now, spare = self._now(), len(self._since) - CROWD
        late = []
        for n, (transport, since) in enumerate(self._since.items()):
            if now - since < (HURRIED_S if n < spare else ASK_S):
                break
            late.append(transport)
        for transport in late:
            del self._since[transport]
            transport.abort()
        if late:
            self._cut(len(late))
        if self._since:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)


def guarded(base: type[HttpToolsProtocol], unasked: Unasked) -> type[HttpToolsProtocol]:
    """The same HTTP, which does not wait for ever."""

    class Guarded(base):  # type: ignore[misc, valid-type]
        answering: Any = None

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            unasked.came(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            unasked.asked(self.transport)
            if self.answering is not None:
                self.answering.disconnected = True  # else it goes on, and fails with a traceback
            super().connection_lost(exc)

        def _start_asgi_task(self, cycle: Any, app: Any) -> None:
            # uvicorn tells only the newest request that its asker has left, which is another one when several
            # were sent at once
            self.answering = cycle
            super()._start_asgi_task(cycle, app)

        def handle_websocket_upgrade(self) -> None:
            super().handle_websocket_upgrade()
            self.parser = None  # as uvicorn does at an end: the two hold each other, until a rare collection

        def on_message_begin(self) -> None:
            unasked.came(self.transport)
            super().on_message_begin()

        def on_message_complete(self) -> None:
            unasked.asked(self.transport)
            super().on_message_complete()

    return Guarded
