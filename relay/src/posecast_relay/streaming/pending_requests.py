"""HTTP requests whose answers have not been taken: whose turn it is, and what they hold together.

Whoever asks and never reads holds an answer, and a thousand who ask at once would be served in one go while
nobody else is. So addresses take turns, a few requests in each turn of the event loop; and beyond a bound in
bytes the address that holds most loses what has lain there longest.
"""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from typing import Protocol

HELD_MOST = 48 << 20  # bytes over all addresses
REQUEST_BYTES = 16 << 10  # what a request under way costs beside its answer: connection, head, task
STARTED_PER_TURN = 8  # one takes half a millisecond
GONE_PER_TURN = 1000


class Requester(Protocol):
    """A connection with a request under way."""

    def cut(self) -> None:
        """Abort the connection. Raises nothing."""


class PendingRequests:
    """The queue of HTTP requests of a process, and the bytes of answers that have not been read."""

    def __init__(self, most: int = HELD_MOST) -> None:
        self._most = most
        self._addresses: dict[Requester, str] = {}
        self._held: dict[
            str, OrderedDict[Requester, int]
        ] = {}  # bytes; who has taken nothing for longest first
        self._sums: Counter[str] = Counter()  # bytes
        self.held_bytes = 0
        self._line: OrderedDict[str, deque[tuple[Requester, Callable[[], None]]]] = OrderedDict()
        self._working = False

    def __len__(self) -> int:
        """Requests under way."""
        return len(self._addresses)

    def wait(self, asker: Requester, address: str, line: str, start: Callable[[], None]) -> None:
        """Call `start` when it is the turn of this `line`, unless the asker has left."""
        if asker not in self._addresses:
            self._addresses[asker] = address
            self._held.setdefault(address, OrderedDict())[asker] = 0
        self._line.setdefault(line, deque()).append((asker, start))
        self.record_held(asker, 0)
        if not self._working:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)

    def record_held(self, asker: Requester, answer_bytes: int) -> None:
        """Note how many bytes of an answer have not been read.

        Beyond the bound, the heaviest address is cut.
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
        """Forget a request that is answered or gone. Does nothing when it is unknown."""
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
