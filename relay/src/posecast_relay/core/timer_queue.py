"""Who is to be looked at when. A tick touches those whose moment has come, however many others there are."""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Generic, TypeVar

T = TypeVar("T")
NEVER = float("inf")


class TimerQueue(Generic[T]):
    """One moment for each, the earliest given: who is looked at too early is to be put here again."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, T]] = []
        self._at: dict[T, float] = {}
        self._count = 0  # so that equal moments compare

    def put(self, who: T, at: float) -> None:
        """Look at it then, or earlier if that stands here."""
        if at < self._at.get(who, NEVER):
            self._at[who] = at
            self._count += 1
            heappush(self._heap, (at, self._count, who))

    def take_due(self, now: float, most: int | None = None) -> list[T]:
        """Those whose moment has come, `most` of them; they leave the queue."""
        found: list[T] = []
        while self._heap and self._heap[0][0] <= now and len(found) != most:
            at, _, who = heappop(self._heap)
            if self._at.get(who) == at:
                del self._at[who]
                found.append(who)
        return found

    @property
    def next_at(self) -> float:
        """When there is somebody, at the earliest."""
        return self._heap[0][0] if self._heap else NEVER
