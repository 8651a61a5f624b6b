"""A lecture hall opens the link at once: handshakes are spread over turns of the event loop.

One takes a few tenths of a millisecond, and a thousand may have arrived since the last turn: done in one go,
nobody would be served meanwhile.
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
    """First come, first served. As many wait here as there are open connections, at most."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._working = False

    def admit(self, enter: Callable[[], None]) -> None:
        """Call `enter` when there is time for it: not at once."""
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
            except Exception as e:  # no reason to keep the others waiting
                log.error("handshake failed", exc_info=e)
        self._working = bool(self._waiting)
        if self._working:
            asyncio.get_running_loop().call_soon(self._work)
