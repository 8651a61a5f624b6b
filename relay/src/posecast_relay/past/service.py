"""What the routes of the past need from a process: what a caller may see of recent and older data.

Months are searched by day, a day by minute, and only ten minutes by segment. All follow the same rules: who
could see it live, how far back they may look, and what was withdrawn.
"""

from __future__ import annotations

import asyncio
import logging
import math
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
from typing import NamedTuple

from posecast_wire.key_page import KeyPose, encode_key_page, pick_pose

from posecast_relay.core.policy import Grant, Policy, find_past_window
from posecast_relay.kit import NEVER, ExpiringCache
from posecast_relay.net.answer_cache import AnswerCache
from posecast_relay.past.address import PastSpan
from posecast_relay.past.deletions import Deletion, Deletions
from posecast_relay.past.documents import PastExtent
from posecast_relay.past.index import DayIndex, MinuteRow, ShownDay, sum_minutes
from posecast_relay.past.reading import HiddenSpans, NotYet, PastReader
from posecast_relay.past.segment import DAY_MS, PAGE_MS, KeptSegment, SegmentName
from posecast_relay.past.source import PastAway, PastSource

log = logging.getLogger("posecast_relay")

POSES_BYTES = 4 << 20  # cached poses: picking one takes a tenth of a millisecond
POSE_BYTES = 500  # Python's overhead for each
WAITING_MAX = 32  # concurrent requests for pages; any more are refused
LOADED_BYTES = 1 << 20  # of stored segments loaded at a time, except for a single one
LOADED_BYTES_MAX = 16 << 20  # of them for one page; a page that needs more has fewer poses

Load = Callable[[Sequence[KeptSegment]], Awaitable[list[KeptSegment]]]


class KeyPages:
    """Makes pages of KEYs and caches some of the poses picked for them."""

    def __init__(self) -> None:
        self._worker = ThreadPoolExecutor(1, "key pages")
        self._waiting = 0
        self._poses: ExpiringCache[KeyPose] = ExpiringCache(POSES_BYTES)  # by SegmentName

    async def make_page(
        self, grant: Grant, from_ms: int, segments: Sequence[KeptSegment], every: int, load: Load
    ) -> bytes | None:
        """Return the page of the ten minutes from `from_ms`, unix ms, with a pose from every `every`-th
        segment that has frames.

        None if WAITING_MAX pages are already being made. `segments`: those that the grant may see; `load`
        returns them with their bytes, without those that are gone.
        """
        if self._waiting >= WAITING_MAX:
            return None
        with_frames = sorted((each for each in segments if each.frames), key=lambda each: each.from_ms)
        while len(with_frames[::every]) > 1 and self._sum_lacking(with_frames[::every]) > LOADED_BYTES_MAX:
            every *= 2
        loop = asyncio.get_running_loop()
        poses: list[KeyPose] = []
        self._waiting += 1
        try:
            for part in self._divide(with_frames[::every]):
                whole = await load(part) if self._sum_lacking(part) else part
                poses += await loop.run_in_executor(self._worker, self._pick_all, whole)
            return await loop.run_in_executor(
                self._worker, encode_key_page, grant.robot, grant.view, from_ms, poses
            )
        finally:
            self._waiting -= 1

    def forget(self, robot: str) -> None:
        """Forget the poses of a robot because part of its past was deleted."""
        self._poses.forget(lambda name: isinstance(name, SegmentName) and name.robot == robot)

    def _divide(self, segments: Sequence[KeptSegment]) -> list[list[KeptSegment]]:
        """Divide them into parts that can be loaded at a time."""
        parts: list[list[KeptSegment]] = [[]]
        size = 0
        for segment in segments:
            size += (more := self._sum_lacking([segment]))
            if size > LOADED_BYTES and parts[-1]:
                parts.append([])
                size = more
            parts[-1].append(segment)
        return parts

    def _sum_lacking(self, segments: Sequence[KeptSegment]) -> int:
        """Return how many bytes must be loaded because their pose is not cached."""
        return sum(each.elsewhere_bytes for each in segments if each.name not in self._poses)

    def _pick_all(self, segments: Sequence[KeptSegment]) -> list[KeyPose]:
        return [pose for segment in segments if (pose := self._pick(segment)) is not None]

    def _pick(self, segment: KeptSegment) -> KeyPose | None:
        pose = self._poses.find(segment.name, 0.0)
        if pose is None and segment.data:  # without its bytes, its pose was cached a moment ago
            pose = pick_pose(segment.data)
            if pose is not None:
                size = POSE_BYTES + len(pose.frame) + sum(map(len, pose.copies))
                self._poses.put(segment.name, pose, size, NEVER)
        return pose


# HTTP requests that wait for the next segment. Their number is bounded, and they end when the relay stops.


HELD_MAX = 1000  # at once, 31 kB each (65 kB with long headers); any more are answered at once
WOKEN_PER_TURN = 8  # each takes a quarter of a millisecond; live data goes out in between
REPORTED_EVERY_S = 60.0  # how often to log that the limit is reached


class HeldRequests:
    """The requests of a process that wait for a new segment of a robot's view. `now`: seconds."""

    def __init__(self, most: int = HELD_MAX, now: Callable[[], float] = time.monotonic) -> None:
        self._most = most
        self._now = now
        self._reported_s: float | None = None  # when the log last reported the limit
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
        if self._reported_s is None or now_s - self._reported_s >= REPORTED_EVERY_S:
            self._reported_s = now_s
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


Found = KeptSegment | SegmentName | NotYet | None


class ShownPage(NamedTuple):
    """What a caller may see of ten minutes. `is_whole` is False if there may be more that can't be read
    now."""

    segments: list[KeptSegment]
    is_whole: bool


class PastService:
    """Combines the source of the past, the waiting requests and the clocks.

    `now` is the core's clock in seconds. `unix_s` is the wall clock that segments' times refer to. Methods
    that wait raise PastAway if the data can't be read.
    """

    def __init__(
        self,
        source: PastSource,
        now: Callable[[], float],
        unix_s: Callable[[], float],
        deletions: Deletions | None = None,
        *,
        has_models: bool = False,
    ) -> None:
        """`has_models`: models of the past are kept too, for callers that may see a past that names them."""
        self.source = source
        self.policy: Policy | None = None
        self.deletions = deletions or Deletions()
        self.deletions.on_added(self._forget)
        self.has_models = has_models
        self.unseen = HiddenSpans(knows_all=not source.is_older)
        self.reader = PastReader(source.kept, self.unseen)
        self.held = HeldRequests()
        self.answers = AnswerCache(now)
        self.keys = KeyPages()
        self._unix_s = unix_s
        source.follow(self.held.list_waiting, self.held.wake)

    def set_policy(self, policy: Policy) -> None:
        """Note what the rules in force from now on withdraw. Waiting requests are judged again."""
        self.policy = policy
        self.unseen.set_policy(policy, self.compute_unix_ms())
        self.held.wake_all()

    def compute_unix_ms(self) -> int:
        """Return the time now, in unix ms."""
        return math.floor(1000 * self._unix_s())

    def _forget(self, deletion: Deletion) -> None:
        self.answers.clear()
        self.keys.forget(deletion.robot)

    # ---- months ----------------------------------------------------------------------

    async def has_any(self, grant: Grant) -> bool:
        """Whether there is anything that the grant may see."""
        if self.reader.list_shown(grant, self.compute_unix_ms()):
            return True
        for reach in reversed(await self._load_reaches(grant)):
            if await self._shows_day(grant, reach):
                return True
        return False

    async def find_extent(self, grant: Grant) -> PastExtent:
        """Return the extent of the past for a grant."""
        unix_ms = self.compute_unix_ms()
        recent = self.reader.list_shown(grant, unix_ms)
        try:
            older = [each for each in await self._load_reaches(grant) if await self._shows_day(grant, each)]
            from_ms = min((each.from_ms for each in recent), default=None)
            if older:
                from_ms = min(await self._list_spans(grant, older[0]), default=from_ms)
            if recent or not older:
                newest = recent[-1] if recent else None
            else:
                newest = await self._find_newest(grant, older[-1].day_ms)
        except PastAway:
            if not recent:
                raise
            older, newest = [], recent[-1]
            from_ms = min(each.from_ms for each in recent)
        to_ms = max((each.to_ms for each in recent), default=None if newest is None else newest.to_ms)
        days = {each.from_ms - each.from_ms % DAY_MS for each in recent} | {each.day_ms for each in older}
        window = find_past_window(grant, self.compute_unix_ms())
        deleted = tuple(
            span
            for span in self.deletions.list_spans(grant.robot, grant.view)
            if span[1] > window.from_ms and span[0] < window.to_ms
        )
        return PastExtent(
            from_ms, to_ms, None if newest is None else newest.name, tuple(sorted(days)), deleted
        )

    async def _load_reaches(self, grant: Grant) -> list[ShownDay]:
        window = find_past_window(grant, self.compute_unix_ms())
        if window.to_ms <= window.from_ms:
            return []
        return await self.source.load_reaches(grant.robot, grant.view, window.from_ms, window.to_ms)

    async def _shows_day(self, grant: Grant, reach: ShownDay) -> bool:
        """Whether a day has a minute that the grant may see."""
        spans = [span for span in reach.spans if grant.by in span.audiences]
        unix_ms = self.compute_unix_ms()
        if any(self.reader.shows(grant, span, unix_ms) for span in spans):
            return True  # all of it, so a minute too
        return bool(spans and await self._list_spans(grant, reach))

    async def _list_spans(self, grant: Grant, reach: ShownDay) -> list[int]:
        """Return the start of each minute of a day that the grant may see, unix ms."""
        day = await self.source.load_day(grant.robot, grant.view, reach.day_ms)
        return [row.from_ms for row in self._list_rows(grant, day)]

    async def _find_newest(self, grant: Grant, day_ms: int) -> KeptSegment | None:
        """Return the newest segment of a day that the grant may see."""
        day = await self.source.load_day(grant.robot, grant.view, day_ms)
        pages = {row.at_ms - row.at_ms % PAGE_MS for row in self._list_rows(grant, day)}
        for page_ms in sorted(pages, reverse=True):
            shown = (await self.list_page(grant, PastSpan(page_ms, page_ms + PAGE_MS))).segments
            if shown:
                return shown[-1]
        return None

    # ---- a day -------------------------------------------------------------------------

    async def list_minutes(self, grant: Grant, day: PastSpan) -> list[MinuteRow]:
        """Return a row for each minute of a day that the grant may see."""
        recent = sum_minutes(self.reader.list_shown(grant, self.compute_unix_ms(), day.from_ms, day.to_ms))
        if find_past_window(grant, self.compute_unix_ms()).from_ms >= day.to_ms:
            return recent
        try:
            older = await self.source.load_day(grant.robot, grant.view, day.from_ms)
        except PastAway:
            if not recent:
                raise
            return recent
        oldest = self.source.kept.find_oldest(grant.robot, grant.view)
        found: dict[int, list[MinuteRow]] = {}
        for row in self._list_rows(grant, older):
            if oldest is None or row.at_ms < oldest.from_ms:
                found.setdefault(row.at_ms, []).append(row)
        newer: dict[int, list[MinuteRow]] = {}
        for row in recent:
            newer.setdefault(row.at_ms, []).append(row)
        for at_ms, rows in newer.items():  # for the minute that is in both, take the one with more
            if _count(rows) > _count(found.get(at_ms, ())):
                found[at_ms] = rows
        return [row for at_ms in sorted(found) for row in found[at_ms]]

    def _list_rows(self, grant: Grant, day: DayIndex) -> list[MinuteRow]:
        unix_ms = self.compute_unix_ms()
        return [row for row in day.list_minutes() if self.reader.shows(grant, row, unix_ms)]

    # ---- ten minutes, a segment, a schema ------------------------------------------------

    async def list_page(self, grant: Grant, page: PastSpan) -> ShownPage:
        """Return the segments that begin in ten minutes and that the grant may see."""
        window = find_past_window(grant, self.compute_unix_ms())
        if window.from_ms >= page.to_ms or window.to_ms <= page.from_ms:
            return ShownPage([], True)
        reached = await self.source.reach_span(grant.robot, grant.view, page.from_ms, page.to_ms)
        reader = PastReader(reached.past, self.unseen)
        shown = reader.list_shown(grant, self.compute_unix_ms(), page.from_ms, page.to_ms)
        return ShownPage(shown, reached.is_whole)

    async def find_segment(self, grant: Grant, take: int, index: int) -> Found:
        """Return the segment with this name and its bytes, or what replaces it."""
        if grant.past_s <= 0:
            return None
        name = SegmentName(grant.robot, grant.view, take, index)
        past = await self.source.reach_segment(name, grant.by)
        reader = self.reader if past is self.source.kept else PastReader(past, self.unseen)
        found = reader.find_segment(grant, take, index, self.compute_unix_ms())
        if not isinstance(found, KeptSegment):
            return found
        whole = await self.source.load([found])
        if whole and not self.deletions.cover_segment(found):  # it may have been deleted in the meantime
            return whole[0]
        found = self.reader.find_segment(grant, take, index, self.compute_unix_ms())  # gone, or damaged
        return None if isinstance(found, KeptSegment) else found

    async def find_schema(self, grant: Grant, sha256: bytes) -> tuple[str, int] | None:
        """Return the text of a schema named by a segment that the grant may see, and that segment's start,
        unix ms.

        None if there is none.
        """
        unix_ms = self.compute_unix_ms()
        found = self.reader.find_schema(grant, sha256, unix_ms)
        from_ms = None if found is None else found.from_ms
        if from_ms is None:
            from_ms = await self._find_naming(grant, sha256.hex())
        if from_ms is None:
            return None
        text = await self.source.load_schema(grant.robot, grant.view, sha256)
        if text is None or (found is not None and self.deletions.cover_segment(found)):
            return None
        return text, from_ms

    async def shows_model(self, grant: Grant, digest: str) -> bool:
        """Whether the grant may see a segment that names this model."""
        unix_ms = self.compute_unix_ms()
        if any(segment.model == digest for segment in self.reader.list_shown(grant, unix_ms)):
            return True
        for reach in reversed(await self._load_reaches(grant)):
            if digest in reach.models:
                day = await self.source.load_day(grant.robot, grant.view, reach.day_ms)
                spans = [span for span in day.list_models() if span.sha256 == digest]
                if any(self.reader.shows(grant, span, unix_ms) for span in spans):
                    return True
        return False

    async def _find_naming(self, grant: Grant, sha256: str) -> int | None:
        """Return the start, unix ms, of an older segment that names a schema and that the grant may see."""
        unix_ms = self.compute_unix_ms()
        for reach in reversed(await self._load_reaches(grant)):
            if sha256 in reach.schemas:
                day = await self.source.load_day(grant.robot, grant.view, reach.day_ms)
                for span in day.list_schemas():
                    if span.sha256 == sha256 and self.reader.shows(grant, span, unix_ms):
                        return span.from_ms
        return None


def _count(rows: Iterable[MinuteRow]) -> int:
    return sum(row.segments for row in rows)
