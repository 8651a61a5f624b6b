"""Writes closed segments to an object store: several robots at once, each in order, without delaying live
data.

The queue is bounded in bytes, per robot and in total. If the store is slow, full or away, it retries with
growing pauses. Beyond the bounds it drops and counts the oldest segments, and the past has a gap there.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable, Mapping
from itertools import islice

from posecast_relay.archive.index import Known, forget_bytes
from posecast_relay.archive.names import ArchivedName, PageKey, make_schema_key, may_be_archived, name_segment
from posecast_relay.archive.store import ArchiveError, ObjectStore
from posecast_relay.kit import RecentDict, write_count
from posecast_relay.past.segment import KeptSegment

log = logging.getLogger("posecast_relay")

ROBOT_BYTES = 16 << 20  # queued for one robot
ALL_BYTES = 128 << 20  # queued for all robots
ROBOTS_AT_ONCE = 16  # robots written concurrently
PUTS_AT_ONCE = 4  # concurrent writes for one robot with a long queue
BACKOFF_S = (0.5, 10.0)  # the first and the longest pause after a failure
STOP_S = 2.0  # to write the queue when the process stops
SCHEMAS_MAX = 10_000  # schemas known to be in the store
RECENT_MAX = 2000  # index entries remembered per view


class ArchiveWriter:
    """Writes the segments of the robots that are to be kept.

    `on_page_ended` gets each ten minutes after something later was written for their view: their index can be
    made.
    """

    def __init__(
        self,
        store: ObjectStore,
        on_page_ended: Callable[[PageKey], None] = lambda _page: None,
        is_deleted: Callable[[KeptSegment], bool] = lambda _segment: False,
        robot_bytes: int = ROBOT_BYTES,
        all_bytes: int = ALL_BYTES,
        backoff_s: tuple[float, float] = BACKOFF_S,
    ) -> None:
        self.written = 0  # segments written
        self.written_bytes = 0
        self.dropped = 0  # segments that were lost
        self.failures = 0  # failed calls to the store
        self.waiting_bytes = 0
        self._store = store
        self._on_page_ended = on_page_ended
        self._is_deleted = is_deleted
        self._robot_bytes, self._all_bytes, self._backoff_s = robot_bytes, all_bytes, backoff_s
        self._keeps: Mapping[str, float] = {}
        self._waiting: dict[str, deque[KeptSegment]] = {}  # by robot, oldest first
        self._sizes: Counter[str] = Counter()  # of those, by robot
        self._schemas: RecentDict[tuple[str, bytes], None] = RecentDict(SCHEMAS_MAX)  # by robot, stored
        self._recent: dict[PageKey, dict[ArchivedName, KeptSegment]] = {}
        self._open: dict[PageKey, None] = {}  # the ten minutes being written
        self._tasks: dict[str, asyncio.Task[None]] = {}  # the writing tasks, by robot
        self._trouble: dict[str, str] = {}  # why writing currently fails, by robot
        self._turns = asyncio.Semaphore(ROBOTS_AT_ONCE)
        self._dropped_before = 0  # the value of `dropped` when all was last well
        self._refused_views: set[tuple[str, str]] = set()
        self._stopping = False

    # ---- input -----------------------------------------------------------------------

    def set_keeps(self, keeps_s: Mapping[str, float]) -> None:
        """Set which robots are kept, each for how many seconds. Queued segments of other robots are
        dropped."""
        self._keeps = keeps_s
        for robot in [robot for robot in self._waiting if robot not in keeps_s]:
            while self._waiting.get(robot):
                self._take_oldest(robot)

    def keep(self, segment: KeptSegment) -> None:
        """Queue a segment that has just closed. Returns at once."""
        robot, view = segment.name.robot, segment.name.view
        if robot not in self._keeps:
            return
        if not may_be_archived(robot, view):
            if (robot, view) not in self._refused_views:
                self._refused_views.add((robot, view))
                log.warning(
                    "the archive: %s/%s: not kept: the archive has a folder of that name", robot, view
                )
            return
        self._waiting.setdefault(robot, deque()).append(segment)
        self._add(robot, segment.cost_bytes)
        while self._sizes[robot] > self._robot_bytes:
            self._drop_oldest(robot)
        while self.waiting_bytes > self._all_bytes:
            self._drop_oldest(max(self._sizes, key=self._sizes.__getitem__))
        if robot not in self._tasks and not self._stopping and robot in self._waiting:
            self._tasks[robot] = asyncio.create_task(self._write_robot(robot), name=f"the archive: {robot}")

    def drop_waiting(self, is_gone: Callable[[KeptSegment], bool]) -> None:
        """Drop queued segments that must not be stored any more, and forget such segments that were. They are
        not counted as lost.
        """
        for robot, segments in list(self._waiting.items()):
            kept = [segment for segment in segments if not is_gone(segment)]
            while self._waiting.get(robot):
                self._take_oldest(robot)
            for segment in kept:
                self._waiting.setdefault(robot, deque()).append(segment)
                self._add(robot, segment.cost_bytes)
        for recent in self._recent.values():
            for name in [name for name, segment in recent.items() if is_gone(segment)]:
                del recent[name]

    def list_waiting(self, robot: str) -> list[KeptSegment]:
        """Return the segments of a robot that are queued or being written."""
        return list(self._waiting.get(robot, ()))

    def find_known(self, page: PageKey) -> Known:
        """Return the index entries of the recently written segments of ten minutes."""
        return self._recent.get(page, {})

    def forget_known(self, page: PageKey) -> None:
        """Forget those entries, because their index is written; but not while segments are still being
        added."""
        if page not in self._open:
            self._recent.pop(page, None)

    def end_pages(self, before_ms: int) -> None:
        """Note that the ten minutes that began before `before_ms`, unix ms, have ended: nothing is
        recording."""
        self._end([page for page in self._open if page[2] < before_ms])

    def _end(self, pages: list[PageKey]) -> None:
        for page in pages:
            del self._open[page]
            self._on_page_ended(page)

    def list_open_pages(self) -> list[PageKey]:
        """Return the ten minutes that have new segments and no written index."""
        return list(self._recent)

    def find_trouble(self) -> str | None:
        """Return why writing currently fails; None if all is well. Without addresses."""
        return next(iter(list(self._trouble.values())), None)  # another thread may call this

    async def stop(self, stop_s: float = STOP_S) -> None:
        """Write the queue, within `stop_s` seconds, then end."""
        self._stopping = True
        tasks = list(self._tasks.values())
        if tasks:
            await asyncio.wait(tasks, timeout=stop_s)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if lost := sum(map(len, self._waiting.values())):
            log.warning("the archive: stopped before %s could be written", write_count(lost, "segment"))

    # ---- the queue ---------------------------------------------------------------------

    def _add(self, robot: str, size: int) -> None:
        self.waiting_bytes += size
        self._sizes[robot] += size

    def _take_oldest(self, robot: str) -> KeptSegment:
        segments = self._waiting[robot]
        segment = segments.popleft()
        self._add(robot, -segment.cost_bytes)
        if not segments:
            del self._waiting[robot], self._sizes[robot]
        return segment

    def _drop_oldest(self, robot: str) -> None:
        self._take_oldest(robot)
        self.dropped += 1

    # ---- to the store ------------------------------------------------------------------

    async def _write_robot(self, robot: str) -> None:
        """Write the queue of one robot, then end."""
        pause_s = self._backoff_s[0]
        try:
            while waiting := self._waiting.get(robot):
                # one by one while it keeps up; several at once to a slow store
                batch = list(islice(waiting, PUTS_AT_ONCE))
                async with self._turns:
                    results = await asyncio.gather(*map(self._write, batch), return_exceptions=True)
                pairs = list(zip(batch, results, strict=True))
                self._take_done(robot, {id(each) for each, e in pairs if not isinstance(e, ArchiveError)})
                for segment, error in pairs:
                    if error is not None and not isinstance(error, ArchiveError):  # a bug of ours
                        log.error("the archive: %s/%s", robot, segment.name.view, exc_info=error)
                        self.dropped += 1
                failed = [str(error) for error in results if isinstance(error, ArchiveError)]
                if failed:
                    self.failures += len(failed)
                    self._note_failure(robot, failed[0])
                    await asyncio.sleep(pause_s)
                    pause_s = min(2 * pause_s, self._backoff_s[1])
                else:
                    pause_s = self._backoff_s[0]
                    self._note_success(robot)
        finally:
            self._tasks.pop(robot, None)

    def _take_done(self, robot: str, done: set[int]) -> None:
        """Remove what was written, unless it was dropped in the meantime."""
        kept: list[KeptSegment] = []
        while done and self._waiting.get(robot):
            segment = self._take_oldest(robot)
            if id(segment) in done:
                done.discard(id(segment))
            else:
                kept.append(segment)
        for segment in reversed(kept):
            self._waiting.setdefault(robot, deque()).appendleft(segment)
            self._add(robot, segment.cost_bytes)

    async def _write(self, segment: KeptSegment) -> None:
        name = name_segment(segment)
        robot, view, schema = segment.name.robot, segment.name.view, segment.schema
        if self._is_deleted(segment):
            return
        if schema is not None and (robot, schema) not in self._schemas and segment.schema_text is not None:
            await self._store.put(make_schema_key(robot, schema), segment.schema_text.encode())
            self._schemas[robot, schema] = None
        await self._store.put(name.key, segment.data)
        if self._is_deleted(segment):  # deleted in the meantime
            await self._store.delete(name.key)
            return
        self.written += 1
        self.written_bytes += segment.size
        page = robot, view, name.page_ms
        recent = self._recent.setdefault(page, {})
        if len(recent) < RECENT_MAX:
            recent[name] = forget_bytes(segment)
        self._open[page] = None
        self._end([each for each in self._open if each[:2] == (robot, view) and each[2] < name.page_ms])

    def forget_schemas(self, robot: str) -> None:
        """Write a robot's schemas again when they are named: some may have been deleted."""
        for known in [known for known in self._schemas if known[0] == robot]:
            del self._schemas[known]

    def _note_failure(self, robot: str, why: str) -> None:
        if not self._trouble:
            self._dropped_before = self.dropped
            log.warning(
                "the archive: %s; queueing up to %d MB per robot, live data continues",
                why,
                self._robot_bytes >> 20,
            )
        self._trouble[robot] = why

    def _note_success(self, robot: str) -> None:
        if self._trouble.pop(robot, None) is not None and not self._trouble:
            lost = self.dropped - self._dropped_before
            told = f"dropped {write_count(lost, 'segment')}" if lost else "nothing was lost"
            log.warning("the archive is back; %s", told)
