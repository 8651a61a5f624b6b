"""Keeps the indexes of an object store correct and deletes expired data: in the background, one task at a
time.

An index is written after its ten minutes have ended, and when the process stops. After a start it checks
all days, newest first. An index that disagrees with the listing, for example after a crash, is rebuilt.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Callable, Mapping

from posecast_relay.archive.index import (
    check_day,
    delete_page,
    list_days,
    list_pages,
    list_views,
    load_day,
    mend_day,
    mend_page,
)
from posecast_relay.archive.names import TOMBSTONES, ArchivedName, PageKey, make_day_key
from posecast_relay.archive.store import ArchiveError, BackgroundTrouble, ObjectStore, SpaceWatch
from posecast_relay.archive.writer import ArchiveWriter
from posecast_relay.kit import write_count
from posecast_relay.past.segment import DAY_MS, PAGE_MS

log = logging.getLogger("posecast_relay")

SPARE_MS = 10_000  # this long after their end, the last segment that began in ten minutes has ended


async def _delete_old(
    store: ObjectStore, robot: str, keep_s: float, unix_ms: int
) -> AsyncIterator[tuple[str, int, list[ArchivedName]]]:
    """Delete a robot's data that is older than `keep_s` at the time `unix_ms`, day by day, oldest first.

    Yields what was deleted, by view and day, after each. Raises ArchiveError; you can then start again.
    """
    before_ms = unix_ms - round(1000 * keep_s)
    for view in await list_views(store, robot):
        for day_ms in await list_days(store, robot, view):
            if day_ms + PAGE_MS + SPARE_MS > before_ms:
                break
            gone: list[ArchivedName] = []
            pages = await list_pages(store, robot, view, day_ms)
            old = [page_ms for page_ms in pages if page_ms + PAGE_MS + SPARE_MS <= before_ms]
            for page_ms in old:
                gone += await delete_page(store, robot, view, page_ms)
            if day_ms + DAY_MS + SPARE_MS <= before_ms:
                await store.delete(make_day_key(robot, view, day_ms))
            elif gone:
                await mend_day(store, robot, view, day_ms, dict.fromkeys(old))
            if gone or day_ms + DAY_MS + SPARE_MS <= before_ms:
                yield view, day_ms, gone


LOOK_S = 1.0  # between two looks for work
ENDED_S = 15.0  # between two looks for ten minutes that have ended
SPACE_S = 10.0  # between two looks at the free space
RETAIN_S = 600.0  # between two looks for expired data
WALK_S = 2.0  # between checks of two days
RETRY_S = (1.0, 30.0)  # the first and the longest pause after a failure
STOP_S = 3.0  # to write indexes when the process stops
PROBE_KEY = f"{TOMBSTONES}/.probe"  # written and deleted once
PAGES_MAX = 10_000  # waiting for repair; any more are found in the next check of the days

DayKey = tuple[str, str, int]  # robot, view, and when the day begins, unix ms


class Indexer:
    """The work in a store other than writing segments. `unix_s` reads the wall clock."""

    def __init__(self, store: ObjectStore, unix_s: Callable[[], float] = time.time) -> None:
        self.mended = 0  # indexes repaired since the process started
        self.expired = 0  # expired segments deleted
        self.failures = 0
        self.space = SpaceWatch(store)
        self.trouble = BackgroundTrouble(lambda: self.writer is not None and bool(self.writer.find_trouble()))
        self.writer: ArchiveWriter | None = None
        self._store = store
        self._unix_s = unix_s
        self._on_deleted: Callable[[str], None] = lambda _robot: None
        self._keeps: Mapping[str, float] = {}
        self._pages: dict[PageKey, None] = {}  # to repair
        self._to_walk: list[DayKey] | None = None  # days to check; None: not listed yet
        self._bytes: dict[DayKey, int] = {}  # of the days that were checked or written to
        self._retain_at = self._walk_at = self._space_at = self._ended_at = self._probe_at = float("-inf")
        self._task: asyncio.Task[None] | None = None

    @property
    def stored_bytes(self) -> int:
        """The total bytes of the segments in the store, as far as it was checked."""
        return sum(list(self._bytes.values()))  # another thread may call this

    def on_deleted(self, listener: Callable[[str], None]) -> None:
        """From now on, call `listener` with each robot that had expired data deleted."""
        self._on_deleted = listener

    def set_keeps(self, keeps_s: Mapping[str, float]) -> None:
        """Set which robots are kept, each for how many seconds. Other robots' data is never deleted."""
        if dict(keeps_s) != dict(self._keeps):
            self._retain_at = float("-inf")
            self._to_walk = None
        self._keeps = dict(keeps_s)

    def mend(self, page: PageKey) -> None:
        """Compare the index of ten minutes with the segments there, soon, and rebuild it if they differ."""
        if len(self._pages) < PAGES_MAX:
            self._pages[page] = None

    def start(self) -> None:
        """Start the background task."""
        self._task = asyncio.create_task(self._work(), name="the archive's indexes")

    async def stop(self, stop_s: float = STOP_S) -> None:
        """Write the indexes of what was written, within `stop_s` seconds, then end."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self.writer is not None:
            self.writer.end_pages(1 << 62)
            for page in self.writer.list_open_pages():
                self.mend(page)
        with contextlib.suppress(TimeoutError, ArchiveError):  # the next start finds it
            async with asyncio.timeout(stop_s):
                await self._mend_all()

    async def _work(self) -> None:
        pause_s = RETRY_S[0]
        while True:
            try:
                await self.do_due()
            except ArchiveError as e:
                self.failures += 1
                self.trouble.note_failure("indexes", str(e))
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, RETRY_S[1])
                continue
            except Exception as e:  # a bug of ours: continue with the rest
                log.error("the archive: an index", exc_info=e)
                await asyncio.sleep(RETRY_S[1])
                continue
            pause_s = RETRY_S[0]
            self.trouble.note_success("indexes")
            await asyncio.sleep(LOOK_S)

    async def do_due(self) -> None:
        """Do what is due now. Raises ArchiveError if the store fails; the rest is then done later."""
        now = time.monotonic()
        if now >= self._space_at:
            self._space_at = now + SPACE_S
            await self.space.look()
        if now >= self._probe_at:
            self._probe_at = now + RETRY_S[1] if await self._finds_trouble() else float("inf")
        if self.writer is not None and now >= self._ended_at:
            self._ended_at = now + ENDED_S
            self.writer.end_pages(round(1000 * self._unix_s()) - PAGE_MS - SPARE_MS)
        await self._mend_all()
        if now >= self._retain_at:
            await self.delete_old()
            self._retain_at = now + RETAIN_S
        if now >= self._walk_at:
            self._walk_at = now + WALK_S
            await self._walk()

    async def _finds_trouble(self) -> bool:
        """Check that the store can be written, so that problems are logged before anything is recorded.

        Work that is possible in a full store still goes on.
        """
        try:
            await self._store.put(PROBE_KEY, b"")
            await self._store.delete(PROBE_KEY)
        except ArchiveError as e:
            self.failures += 1
            self.trouble.note_failure("writing", str(e))
            return True
        self.trouble.note_success("writing")
        return False

    async def delete_old(self) -> None:
        """Delete expired data. Raises ArchiveError."""
        unix_ms = round(1000 * self._unix_s())
        for robot, keep_s in self._keeps.items():
            count = 0
            async for view, day_ms, gone in _delete_old(self._store, robot, keep_s, unix_ms):
                count += len(gone)
                left = self._bytes.pop((robot, view, day_ms), 0) - sum(name.size for name in gone)
                if left > 0:
                    self._bytes[robot, view, day_ms] = left
            self.expired += count
            if count:
                segments = write_count(count, "segment")
                log.info("the archive: %s: deleted %s older than `keep`", robot, segments)
                self._on_deleted(robot)

    async def walk_all(self) -> None:
        """Check all days now. Raises ArchiveError."""
        self._to_walk = None
        while self._to_walk is None or self._to_walk:
            await self._walk()

    async def _walk(self) -> None:
        """Check one more day."""
        if self._to_walk is None:
            found: list[DayKey] = []
            for robot in self._keeps:
                for view in await list_views(self._store, robot):
                    found += [(robot, view, day_ms) for day_ms in await list_days(self._store, robot, view)]
            self._to_walk = sorted(found, key=lambda day: day[2])
        if not self._to_walk:
            return
        robot, view, _ = day = self._to_walk[-1]
        for page_ms in await check_day(self._store, *day, round(1000 * self._unix_s())):
            self.mend((robot, view, page_ms))
        await self._mend_all()
        await self._sum_day(day)
        if self._to_walk and self._to_walk[-1] == day:
            self._to_walk.pop()

    async def _mend_all(self) -> None:
        """Repair what is waiting, day by day."""
        while self._pages:
            robot, view, page_ms = next(iter(self._pages))
            day_ms = page_ms - page_ms % DAY_MS
            view_pages = [page for page in self._pages if page[:2] == (robot, view)]
            of_day = [page for page in view_pages if 0 <= page[2] - day_ms < DAY_MS]
            for page in of_day:
                del self._pages[page]  # if it is noted again from now on, it is repaired again
            try:
                await self._mend_pages((robot, view, day_ms), of_day)
            except ArchiveError:
                self._pages.update(dict.fromkeys(of_day))
                raise

    async def _mend_pages(self, day: DayKey, pages: list[PageKey]) -> None:
        digests = {}
        for page in pages:
            known = None if self.writer is None else self.writer.find_known(page)
            digests[page[2]] = await mend_page(self._store, *page, known)
            self.mended += 1
        await mend_day(self._store, *day, digests)
        for page in pages:
            if self.writer is not None:
                self.writer.forget_known(page)
        await self._sum_day(day)

    async def _sum_day(self, day: DayKey) -> None:
        size = (await load_day(self._store, *day)).day.bytes
        if size:
            self._bytes[day] = size
        else:
            self._bytes.pop(day, None)
