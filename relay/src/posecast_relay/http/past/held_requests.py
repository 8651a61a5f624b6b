"""HTTP requests that wait for the next segment. Their number is bounded, and they end when the relay
stops."""

from __future__ import annotations

import asyncio
import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import islice

log = logging.getLogger("posecast_relay")

HELD_MAX = 1000  # at once, 31 kB each (65 kB with long headers); any more are answered at once
WOKEN_PER_TURN = 8  # each takes a quarter of a millisecond; live data goes out in between
TOLD_EVERY_S = 60.0  # how often to log that the limit is reached


class HeldRequests:
    """The requests of a process that wait for a new segment of a robot's view. `now`: seconds."""

    def __init__(self, most: int = HELD_MAX, now: Callable[[], float] = time.monotonic) -> None:
        self._most = most
        self._now = now
        self._told_s: float | None = None  # when the log last reported the limit
        self._waiting: dict[tuple[str, str], set[asyncio.Future[None]]] = {}
        self._woken: dict[asyncio.Future[None], None] = {}  # to be answered, in this order
        self._released = False
        self.count = 0  # waiting now
        self.turned_away = 0  # answered at once because of the limit
        self.answers: Counter[str] = Counter()  # of all requests for segments, waiting or not, by result

    @contextmanager
    def hold(self) -> Iterator[bool]:
        """Hold one more request within the context. Yields False if it may not wait."""
        if self._released or self.count >= self._most:
            if not self._released:
                self._turn_away()
            yield False
            return
        self.count += 1
        try:
            yield True
        finally:
            self.count -= 1

    async def wait(self, robot: str, view: str, seconds: float) -> bool:
        """Wait until a view has a new segment, at most `seconds`.

        Returns False if the relay is stopping: there is nothing left to wait for.
        """
        if self._released:
            return False
        key = robot, view
        woken: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        waiting = self._waiting.setdefault(key, set())
        waiting.add(woken)
        try:
            await asyncio.wait((woken,), timeout=max(0.0, seconds))
        finally:
            waiting.discard(woken)
            self._woken.pop(woken, None)
            if not waiting and self._waiting.get(key) is waiting:
                del self._waiting[key]
        return not self._released

    def list_waiting(self) -> list[tuple[str, str]]:
        """Return the robots and views with waiting requests."""
        return list(self._waiting)

    def wake(self, robot: str, view: str) -> None:
        """Wake the requests that wait for this view, a few in each turn of the event loop."""
        waiting = self._waiting.get((robot, view))
        if waiting and not self._woken:
            asyncio.get_running_loop().call_soon(self._let_some_go)
        self._woken.update(dict.fromkeys(waiting or ()))

    def _turn_away(self) -> None:
        """Count a request over the limit, and log it from time to time."""
        self.turned_away += 1
        now_s = self._now()
        if self._told_s is None or now_s - self._told_s >= TOLD_EVERY_S:
            self._told_s = now_s
            log.warning(
                "the past: %d requests wait for the next segment, the limit: %d answered at once so far",
                self._most,
                self.turned_away,
            )

    def _let_some_go(self) -> None:
        for woken in list(islice(self._woken, WOKEN_PER_TURN)):
            del self._woken[woken]
            if not woken.done():
                woken.set_result(None)
        if self._woken:
            asyncio.get_running_loop().call_soon(self._let_some_go)

    def wake_all(self) -> None:
        """Wake all requests, because the rules have changed."""
        for robot, view in self._waiting:
            self.wake(robot, view)

    def release(self) -> None:
        """End all waiting requests and accept no more, because the relay is stopping."""
        self._released = True
        self.wake_all()
