"""Limits the memory for models (cached files and running fetches), and shares it among robots.

A robot can use all the memory while no other robot needs it. When a robot needs memory, these are dropped, in
this order: files that nobody has requested lately, the robot's own files, and the files of robots that use
more than it does: first their cached files, then their running fetches.
"""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

ENTRY_BYTES = 4096  # added to the size of each entry, so that their number is limited too
IN_USE_S = 60.0  # later requests protect a file, unless its robot uses more memory than the one in need


@dataclass
class Kept:
    """A cached value. Its name never stands for another value."""

    robot: str
    value: object
    size: int  # counted
    asked_at: float


@dataclass(eq=False)
class Claim:
    """Memory for bytes that are being fetched. `give_up` is called when other robots need it more."""

    robot: str
    size: int  # counted
    give_up: Callable[[], None] = field(repr=False)


class ModelMemory:
    """Memory of `most` bytes for all robots together. `now` is a clock in seconds."""

    def __init__(self, most: int, now: Callable[[], float]) -> None:
        self.most = most
        self.used = 0
        self._now = now
        self._kept: OrderedDict[str, Kept] = OrderedDict()  # least recently requested first
        self._claims: OrderedDict[Claim, None] = OrderedDict()  # the oldest first
        self._sums: Counter[str] = Counter()  # bytes by robot, cached and claimed
        self._waiting: list[asyncio.Future[None]] = []

    def get(self, name: str) -> object:
        """Return the cached value of a name, or None, and mark it as requested now."""
        kept = self._kept.get(name)
        if kept is None:
            return None
        kept.asked_at = self._now()
        self._kept.move_to_end(name)
        return kept.value

    def claim(self, robot: str, size: int, give_up: Callable[[], None]) -> Claim | None:
        """Claim memory for `size` more bytes of a robot. Return None, and drop nothing, if there is none."""
        size += ENTRY_BYTES
        lacking = self.used + size - self.most
        if lacking > 0 and not self._take(robot, size, lacking):
            return None
        claim = Claim(robot, size, give_up)
        self._claims[claim] = None
        self._count(robot, size)
        return claim

    def release(self, claim: Claim) -> None:
        """Release the rest of a claim. Does nothing if it was already released."""
        if claim in self._claims:
            del self._claims[claim]
            self._count(claim.robot, -claim.size)
            self._free()

    def keep(self, claim: Claim, name: str, value: object, size: int) -> None:
        """Cache a value of `size` bytes under a name, in memory of the claim, which must be large enough.

        Does nothing if the claim was dropped.
        """
        if claim not in self._claims:
            return
        size += ENTRY_BYTES
        assert size <= claim.size
        claim.size -= size
        self._drop(name)
        self._kept[name] = Kept(claim.robot, value, size, self._now())

    async def wait_for_release(self) -> None:
        """Wait until a claim is released. The free memory may still be too little."""
        waiting = asyncio.get_running_loop().create_future()
        self._waiting.append(waiting)
        await waiting

    def _take(self, robot: str, size: int, lacking: int) -> bool:
        """Drop `lacking` bytes or more and return True. If that is impossible, drop nothing."""
        chosen: list[str | Claim] = []
        for each, of in self._takeable(robot, size):
            chosen.append(each)
            lacking -= of
            if lacking <= 0:
                break
        if lacking > 0:
            return False
        for each in chosen:
            if isinstance(each, str):
                self._drop(each)
            else:
                self.release(each)
                each.give_up()
        return True

    def _takeable(self, robot: str, size: int) -> Iterator[tuple[str | Claim, int]]:
        """Yield what can be dropped, with its size, in the order that the module docstring gives."""
        now, mine, left = self._now(), self._sums[robot] + size, Counter(self._sums)
        files: dict[str, deque[str]] = {}
        for name, kept in self._kept.items():
            if now - kept.asked_at >= IN_USE_S:
                left[kept.robot] -= kept.size
                yield name, kept.size
            else:
                files.setdefault(kept.robot, deque()).append(name)
        for name in files.pop(robot, ()):
            yield name, self._kept[name].size
        while files:
            most = max(files, key=left.__getitem__)
            if left[most] <= mine:
                break
            name = files[most].popleft()
            left[most] -= self._kept[name].size
            yield name, self._kept[name].size
            if not files[most]:
                del files[most]
        claims = [claim for claim in reversed(self._claims) if claim.robot != robot]
        while claims:
            claim = max(claims, key=lambda claim: left[claim.robot])  # the newest claim of that robot
            if left[claim.robot] <= mine:
                break
            claims.remove(claim)
            left[claim.robot] -= claim.size
            yield claim, claim.size

    def _drop(self, name: str) -> None:
        kept = self._kept.pop(name, None)
        if kept is not None:
            self._count(kept.robot, -kept.size)

    def _count(self, robot: str, size: int) -> None:
        self.used += size
        self._sums[robot] += size
        if not self._sums[robot]:
            del self._sums[robot]

    def _free(self) -> None:
        waiting, self._waiting = self._waiting, []
        for each in waiting:
            if not each.done():
                each.set_result(None)
