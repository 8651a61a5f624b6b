"""A queue of items by due time. Taking the due items costs nothing for the others."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Generic, TypeVar

T = TypeVar("T")
NEVER = float("inf")


class TimerQueue(Generic[T]):
    """Holds one due time per item, the earliest given. A caller that takes an item too early puts it back."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, T]] = []
        self._at: dict[T, float] = {}
        self._count = 0  # a tie-breaker for equal times

    def put(self, who: T, at: float) -> None:
        """Add an item due at `at` seconds, unless it is already due earlier."""
        if at < self._at.get(who, NEVER):
            self._at[who] = at
            self._count += 1
            heappush(self._heap, (at, self._count, who))

    def take_due(self, now: float, most: int | None = None) -> list[T]:
        """Remove and return the due items, at most `most` of them."""
        found: list[T] = []
        while self._heap and self._heap[0][0] <= now and len(found) != most:
            at, _, who = heappop(self._heap)
            if self._at.get(who) == at:
                del self._at[who]
                found.append(who)
        return found

    @property
    def next_at(self) -> float:
        """The earliest due time; NEVER if the queue is empty."""
        return self._heap[0][0] if self._heap else NEVER
