"""Reads days, ten minutes and segments of the past from an object store on demand. It never writes.

Results are cached in bounded memory, and simultaneous requests for the same thing share one read. If the
store does not answer, requests fail within seconds.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import time
from collections.abc import Awaitable, Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

from posecast_relay.archive.index import Known, LoadedPage, list_days, load_day, load_page
from posecast_relay.archive.names import PageKey, make_schema_key, may_be_archived, name_segment
from posecast_relay.archive.store import ArchiveError, ObjectStore
from posecast_relay.kit import ExpiringCache
from posecast_relay.past.index import LONGEST_MS, DayIndex, ShownDay, digest_page, list_shown
from posecast_relay.past.segment import DAY_MS, OBJECT_BYTES, PAGE_MS, KeptSegment, SegmentName
from posecast_relay.past.source import PastAway
from posecast_relay.runtime.tasks import SharedTasks

T = TypeVar("T")
log = logging.getLogger("posecast_relay")

PAGES_BYTES, DAYS_BYTES, REACHES_BYTES = 32 << 20, 16 << 20, 16 << 20
DATA_BYTES, SCHEMAS_BYTES, UNINDEXED_BYTES = 16 << 20, 4 << 20, 16 << 20
AT_ONCE = 16  # concurrent reads
TURN_S = 2.0  # to wait for a free one
ASKED_S = 6.0  # for one read, which can take many calls
YOUNG_S, OLD_S = 5.0, 120.0  # the maximum age of cached data: of the last hours, and of earlier
YOUNG_MS = 2 * 3_600_000
CLOSED_MS = 60_000  # this long after their end, ten minutes have their index
PAUSE_S = (1.0, 15.0)  # without requests after a failure: the first and the longest
TROUBLE_S = 20.0  # after the last failure, until it is forgotten without new requests
REACH_S = 1800.0  # the maximum age of cached summaries of earlier days
REACHES_AT_ONCE = 8
SCHEMA_BYTES_MAX = 1 << 18
AWAY = "this part of the past can't be read right now: retry"
BUSY = "too many requests for the past right now: retry"

Covers = Callable[[str, str, int, int], bool]  # robot, view, start and end in unix ms


class ArchiveReader:
    """Reads a store. `is_deleted` returns whether any part of a robot's view in a time span was deleted."""

    def __init__(
        self,
        store: ObjectStore,
        now: Callable[[], float] = time.monotonic,
        unix_s: Callable[[], float] = time.time,
        is_deleted: Covers = lambda _robot, _view, _from_ms, _to_ms: False,
        mend: Callable[[PageKey], None] = lambda _page: None,
    ) -> None:
        """`mend` gets each ten minutes whose index disagrees with the segments there."""
        self.failures = 0  # how often the store could not be read
        self._store = store
        self._now = now
        self._unix_s = unix_s
        self._is_deleted = is_deleted
        self._mend = mend
        self._pages: ExpiringCache[tuple[KeptSegment, ...]] = ExpiringCache(PAGES_BYTES)
        self._unindexed: ExpiringCache[Known] = ExpiringCache(UNINDEXED_BYTES)
        self._days: ExpiringCache[DayIndex] = ExpiringCache(DAYS_BYTES)
        self._reaches: ExpiringCache[ShownDay] = ExpiringCache(REACHES_BYTES)
        self._lists: ExpiringCache[list[int]] = ExpiringCache(REACHES_BYTES)
        self._data: ExpiringCache[bytes] = ExpiringCache(DATA_BYTES)
        self._schemas: ExpiringCache[str] = ExpiringCache(SCHEMAS_BYTES)
        self._asked = SharedTasks("the archive")
        self._turns = asyncio.Semaphore(AT_ONCE)
        self._forgotten = 0  # count of `forget` calls: data read before one is not cached
        self._failed_at = float("-inf")
        self._pause_s = 0.0
        self._trouble: str | None = None

    def find_trouble(self) -> str | None:
        """Return why it could not be read in the last TROUBLE_S seconds; None if it could, or was not needed.

        The message contains no addresses.
        """
        return self._trouble if self._now() < self._failed_at + TROUBLE_S else None

    def forget(self, robot: str) -> None:
        """Drop all cached data of a robot, because part of it was deleted."""
        self._forgotten += 1
        for cache in (
            self._pages,
            self._unindexed,
            self._days,
            self._reaches,
            self._lists,
            self._schemas,
        ):
            cache.forget(lambda key: isinstance(key, tuple) and key[0] == robot)
        self._data.forget(lambda key: isinstance(key, SegmentName) and key.robot == robot)

    async def list_days(self, robot: str, view: str) -> list[int]:
        """Return the start of each day that has data, unix ms, oldest first. Raises PastAway."""
        if not may_be_archived(robot, view):
            return []
        ask = partial(list_days, self._store, robot, view)
        return await self._find(self._lists, (robot, view), ask, lambda days: 100 + 40 * len(days), YOUNG_S)

    async def load_reaches(self, robot: str, view: str, from_ms: int, to_ms: int) -> list[ShownDay]:
        """Load the summary of each day that overlaps a time span, unix ms, oldest first.

        Raises PastAway.
        """
        days = [day_ms for day_ms in await self.list_days(robot, view) if from_ms - DAY_MS < day_ms < to_ms]
        found: list[ShownDay] = []
        for at in range(0, len(days), REACHES_AT_ONCE):
            part = days[at : at + REACHES_AT_ONCE]
            found += await asyncio.gather(*(self._load_reach(robot, view, day_ms) for day_ms in part))
        return found

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Load the index of a day, without empty ten minutes. Raises PastAway."""
        if not may_be_archived(robot, view):
            return DayIndex(robot, view, day_ms)
        ask = partial(self._read_day, robot, view, day_ms)
        until_s = self._compute_good_s(day_ms + DAY_MS)
        return await self._find(
            self._days, (robot, view, day_ms), ask, lambda day: 1000 + day.cost_bytes, until_s
        )

    async def load_page(self, robot: str, view: str, page_ms: int) -> tuple[KeptSegment, ...]:
        """Load the index entries of the segments that begin in ten minutes, without their bytes, in order.

        Raises PastAway.
        """
        if not may_be_archived(robot, view):
            return ()
        ask = partial(self._read_page, robot, view, page_ms)
        until_s = self._compute_good_s(page_ms + PAGE_MS)
        return await self._find(self._pages, (robot, view, page_ms), ask, _measure_page, until_s)

    async def load_data(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, except those that are gone or damaged. Raises PastAway."""
        found = await asyncio.gather(*(self._load_segment(segment) for segment in segments))
        return [segment for segment in found if segment is not None]

    async def load_schema(self, robot: str, sha256: bytes) -> str | None:
        """Return the text of a schema; None if it is missing or damaged. Raises PastAway."""
        ask = partial(self._read_schema, robot, sha256)
        text = await self._find(self._schemas, (robot, sha256), ask, lambda text: 100 + len(text), OLD_S)
        return text or None

    # ---- what is read ----------------------------------------------------------------

    async def _load_reach(self, robot: str, view: str, day_ms: int) -> ShownDay:
        async def ask() -> ShownDay:
            return await asyncio.to_thread(list_shown, await self._read_day(robot, view, day_ms))

        until_s = self._compute_good_s(day_ms + DAY_MS, REACH_S)
        return await self._find(
            self._reaches, (robot, view, day_ms, "reach"), ask, lambda reach: reach.cost_bytes, until_s
        )

    async def _read_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        day = (await load_day(self._store, robot, view, day_ms, self._load_page)).day
        for page_ms in list(day.pages):
            if self._is_deleted(robot, view, page_ms, page_ms + LONGEST_MS):
                segments = await self._read_page(robot, view, page_ms)  # without deleted segments
                day.pages[page_ms] = digest_page(page_ms, segments)
        return day

    async def _read_page(self, robot: str, view: str, page_ms: int) -> tuple[KeptSegment, ...]:
        page = await self._load_page(self._store, robot, view, page_ms)
        is_over = 1000 * self._unix_s() > page_ms + PAGE_MS + CLOSED_MS
        if not page.is_indexed and is_over and page.segments:
            self._mend((robot, view, page_ms))
        return tuple(
            segment
            for segment in page.segments
            if not self._is_deleted(robot, view, segment.from_ms, segment.to_ms)
        )

    async def _load_page(self, store: ObjectStore, robot: str, view: str, page_ms: int) -> LoadedPage:
        """Load the index of ten minutes.

        While they have no index, as today's last ones never do, only new segments are read: a segment never
        changes.
        """
        key, forgotten = (robot, view, page_ms), self._forgotten
        page = await load_page(store, *key, self._unindexed.find(key, self._now()))
        if not page.is_indexed and forgotten == self._forgotten:
            known = {name_segment(segment): segment for segment in page.segments}
            self._unindexed.put(key, known, _measure_page(page.segments), self._now() + OLD_S)
        return page

    async def _load_segment(self, segment: KeptSegment) -> KeptSegment | None:
        async def ask() -> bytes:
            data = await self._store.get(name_segment(segment).key)
            if data is None or hashlib.sha256(data).digest() != segment.sha256:
                return b""
            return data

        data = await self._find(self._data, segment.name, ask, lambda data: OBJECT_BYTES + len(data), OLD_S)
        if not data:
            return None
        return replace(segment, data=data, elsewhere_bytes=0)

    async def _read_schema(self, robot: str, sha256: bytes) -> str:
        data = await self._store.get(make_schema_key(robot, sha256))
        if data is None or len(data) > SCHEMA_BYTES_MAX or hashlib.sha256(data).digest() != sha256:
            return ""
        return data.decode()  # its hash proves that it is text

    # ---- how -------------------------------------------------------------------------

    def _compute_good_s(self, end_ms: int, old_s: float = OLD_S) -> float:
        """Return for how many seconds the data of a time span may be cached."""
        return YOUNG_S if 1000 * self._unix_s() < end_ms + YOUNG_MS else old_s

    async def _find(
        self,
        cache: ExpiringCache[T],
        key: Hashable,
        ask: Callable[[], Awaitable[T]],
        measure: Callable[[T], int],
        good_s: float,
    ) -> T:
        """Return the cached value of a key, or read and cache it. Raises PastAway."""
        found = cache.find(key, self._now())
        if found is not None:
            return found
        if self._now() < self._failed_at + self._pause_s:
            raise PastAway(AWAY)
        forgotten = self._forgotten
        asked = cache, key, forgotten  # a day and its first ten minutes have the same key
        value = await self._asked.run(asked, partial(self._ask, ask))
        if forgotten == self._forgotten:
            cache.put(key, value, measure(value), self._now() + good_s)
        return value

    async def _ask(self, ask: Callable[[], Awaitable[T]]) -> T:
        try:
            async with asyncio.timeout(TURN_S):
                await self._turns.acquire()
        except TimeoutError:
            raise PastAway(BUSY) from None
        try:
            async with asyncio.timeout(ASKED_S):
                found = await ask()
        except ArchiveError as e:
            self._note_failure(e)
            raise PastAway(AWAY) from None
        except TimeoutError:  # a large read: the store may be fine
            self.failures += 1
            raise PastAway(AWAY) from None
        finally:
            self._turns.release()
        self._pause_s = 0.0
        if self._trouble is not None:
            self._trouble = None
            log.warning("the archive: can be read again")
        return found

    def _note_failure(self, error: ArchiveError) -> None:
        self.failures += 1
        if self._now() >= self._failed_at + self._pause_s:  # the first failure of many concurrent requests
            self._pause_s = min(max(2 * self._pause_s, PAUSE_S[0]), PAUSE_S[1])
        self._failed_at = self._now()
        if self._trouble is None:
            log.warning("the archive: %s; requests for older data are refused, live data continues", error)
        self._trouble = str(error)


def _measure_page(segments: tuple[KeptSegment, ...]) -> int:
    return 200 + sum(segment.cost_bytes for segment in segments)
