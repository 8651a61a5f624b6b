"""Queues HTTP requests, and limits the memory of unread answers.

A client that never reads occupies an answer's memory. A thousand simultaneous requests would delay everybody
else. So addresses take turns, with a few requests per turn of the event loop. Above a limit in bytes, the
address that uses most memory loses its oldest answer.
"""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from typing import Protocol

HELD_MOST = 48 << 20  # bytes over all addresses
REQUEST_BYTES = 16 << 10  # memory of a running request without its answer: connection, head, task
STARTED_PER_TURN = 8  # one takes half a millisecond
GONE_PER_TURN = 1000


class Requester(Protocol):
    """A connection with a running request."""

    def cut(self) -> None:
        """Abort the connection. Raises nothing."""


class PendingRequests:
    """A process's queue of HTTP requests, and the bytes of unread answers."""

    def __init__(self, most: int = HELD_MOST) -> None:
        self._most = most
        self._addresses: dict[Requester, str] = {}
        self._held: dict[str, OrderedDict[Requester, int]] = {}  # bytes; longest without progress first
        self._sums: Counter[str] = Counter()  # bytes
        self.held_bytes = 0
        self._line: OrderedDict[str, deque[tuple[Requester, Callable[[], None]]]] = OrderedDict()
        self._working = False

    def __len__(self) -> int:
        """Return the number of running requests."""
        return len(self._addresses)

    def wait(self, asker: Requester, address: str, line: str, start: Callable[[], None]) -> None:
        """Call `start` when it is this `line`'s turn, unless the client has left."""
        if asker not in self._addresses:
            self._addresses[asker] = address
            self._held.setdefault(address, OrderedDict())[asker] = 0
        self._line.setdefault(line, deque()).append((asker, start))
        self.record_held(asker, 0)
        if not self._working:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)

    def record_held(self, asker: Requester, answer_bytes: int) -> None:
        """Record how many bytes of an answer are unread.

        Above the limit, the address that uses most memory loses a connection.
        """
        address = self._addresses.get(asker)
        if address is None:
            return
        held, size = self._held[address], REQUEST_BYTES + answer_bytes
        self._sums[address] += size - held[asker]
        self.held_bytes += size - held[asker]
        held[asker] = size
        held.move_to_end(asker)
        while self.held_bytes > self._most:
            heaviest = max(self._sums, key=self._sums.__getitem__)
            longest = next(iter(self._held[heaviest]))
            self.leave(longest)
            longest.cut()

    def leave(self, asker: Requester) -> None:
        """Forget a request that is answered or gone. Does nothing if it is unknown."""
        address = self._addresses.pop(asker, None)
        if address is None:
            return
        held = self._held[address]
        size = held.pop(asker)
        self._sums[address] -= size
        self.held_bytes -= size
        if not held:
            del self._held[address], self._sums[address]

    def _work(self) -> None:
        self._working = False
        started = gone = 0
        while self._line and started < STARTED_PER_TURN and gone < GONE_PER_TURN:
            line, waiting = self._line.popitem(last=False)
            asker, start = waiting.popleft()
            if waiting:
                self._line[line] = waiting  # behind all others
            if asker in self._addresses:
                started += 1
                start()
            else:
                gone += 1
        if self._line:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)
