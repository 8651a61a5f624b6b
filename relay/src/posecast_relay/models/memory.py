"""Bounds the memory for models, for files kept and files being fetched, and shares it among robots.

A robot may use all the room while no other needs it. When a robot needs room, these go, in this order: what
nobody has asked for lately, files of its own, and what is held by robots that hold more than it does, first
their kept files, then what is being fetched for them.
"""

from __future__ import annotations

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

ENTRY_BYTES = 4096  # what each counts for beside its bytes, so that there are only so many
IN_USE_S = 60.0  # what was asked for within this is left to robots that have no more than who needs room


@dataclass
class Kept:
    """A value that is kept under a name; the name never means another value."""

    robot: str
    value: object
    size: int  # counted
    asked_at: float


@dataclass(eq=False)
class Claim:
    """Room for bytes that are being fetched. `give_up` is called when other robots need it more."""

    robot: str
    size: int  # counted
    give_up: Callable[[], None] = field(repr=False)


class ModelMemory:
    """Room for `most` bytes, for all robots together. `now` is a clock in seconds."""

    def __init__(self, most: int, now: Callable[[], float]) -> None:
        self.most = most
        self.used = 0
        self._now = now
        self._kept: OrderedDict[str, Kept] = OrderedDict()  # asked for longest ago first
        self._claims: OrderedDict[Claim, None] = OrderedDict()  # the oldest first
        self._sums: Counter[str] = Counter()  # bytes by robot, kept and under way
        self._waiting: list[asyncio.Future[None]] = []

    def get(self, name: str) -> object:
        """Return what is kept under a name, or None, and note that it was asked for now."""
        kept = self._kept.get(name)
        if kept is None:
            return None
        kept.asked_at = self._now()
        self._kept.move_to_end(name)
        return kept.value

    def claim(self, robot: str, size: int, give_up: Callable[[], None]) -> Claim | None:
        """Claim room for `size` more bytes of a robot; return None, and drop nothing, when there is none."""
        size += ENTRY_BYTES
        lacking = self.used + size - self.most
        if lacking > 0 and not self._take(robot, size, lacking):
            return None
        claim = Claim(robot, size, give_up)
        self._claims[claim] = None
        self._count(robot, size)
        return claim

    def release(self, claim: Claim) -> None:
        """Give back what is left of a claim. Does nothing when that has happened already."""
        if claim in self._claims:
            del self._claims[claim]
            self._count(claim.robot, -claim.size)
            self._free()

    def keep(self, claim: Claim, name: str, value: object, size: int) -> None:
        """Keep a value of `size` bytes under a name, in room of the claim, which must be large enough.

        Does nothing when the claim has had to give way.
        """
        if claim not in self._claims:
            return
        size += ENTRY_BYTES
        assert size <= claim.size
        claim.size -= size
        self._drop(name)
        self._kept[name] = Kept(claim.robot, value, size, self._now())

    async def wait_for_release(self) -> None:
        """Wait until a claim is released. The room that has become free may be too little."""
        waiting = asyncio.get_running_loop().create_future()
        self._waiting.append(waiting)
        await waiting

    def _take(self, robot: str, size: int, lacking: int) -> bool:
        """Drop `lacking` bytes or more, and return True; drop nothing when there is not so much to drop."""
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
        """Yield what may be dropped, with its size, in the order that the docstring of this module gives."""
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
            claim = max(claims, key=lambda claim: left[claim.robot])  # of one robot: its newest
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
