"""Spreads handshakes over turns of the event loop, because a lecture hall opens the link at the same moment.

A handshake takes a few tenths of a millisecond. If a thousand arrive at once and were done in one turn, no
viewer would be served meanwhile.
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable

log = logging.getLogger("posecast_relay")

TURN_S = 0.01


class HandshakeQueue:
    """A first-in, first-out queue of handshakes, at most one per open connection."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._working = False

    def admit(self, enter: Callable[[], None]) -> None:
        """Call `enter` later, when there is time for it."""
        self._waiting.append(enter)
        if not self._working:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)

    def _work(self) -> None:
        until = time.monotonic() + TURN_S
        while self._waiting and time.monotonic() < until:
            enter = self._waiting.popleft()
            try:
                enter()
            except Exception as e:  # go on with the others
                log.error("handshake failed", exc_info=e)
        self._working = bool(self._waiting)
        if self._working:
            asyncio.get_running_loop().call_soon(self._work)
