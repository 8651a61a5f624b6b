"""The past of a process with an archive: recent data from memory or Redis, older data from the store.

The front holds the recent data of a view, back to its oldest segment. Older data is read from the store. For
ten minutes that are in both, segments are merged by name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from posecast_relay.archive.reader import ArchiveReader
from posecast_relay.core.policy import Audience
from posecast_relay.past.index import DayIndex, PageDigest, ShownDay
from posecast_relay.past.memory import MemoryPast, PastByView
from posecast_relay.past.segment import DAY_MS, PAGE_MS, KeptSegment, SegmentName
from posecast_relay.past.source import KeptPast, ListWaiting, PastAway, PastSource, ReachedPast, Wake

UNBOUNDED = 1 << 62  # merges only ten minutes of two bounded sources
LATEST_MS = (1 << 53) - 1


class JoinedPast:
    """A PastSource with recent data in `front` and older data in an archive.

    `find_own_trouble` returns why the archive can't be written or is nearly full; None if all is well.
    """

    def __init__(
        self,
        front: PastSource,
        reader: ArchiveReader,
        find_own_trouble: Callable[[], str | None] = lambda: None,
    ) -> None:
        self._front = front
        self._reader = reader
        self._find_own_trouble = find_own_trouble

    @property
    def kept(self) -> KeptPast:
        """The known part of the recent past."""
        return self._front.kept

    @property
    def is_older(self) -> bool:
        """Whether it may hold data recorded before this process started."""
        return True

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with a robot and view when it has new segments."""
        self._front.follow(list_waiting, wake)

    def find_trouble(self) -> str | None:
        """Return the problem of the front or the archive; None if all is well."""
        own = self._find_own_trouble() or self._reader.find_trouble()
        troubles = (self._front.find_trouble(), own and f"the archive: {own}")
        return "; ".join(filter(None, troubles)) or None

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Update what is known of the recent past of a view. Raises PastAway."""
        await self._front.refresh(robot, view, anew=anew)

    async def reach_span(self, robot: str, view: str, from_ms: int, to_ms: int) -> ReachedPast:
        """Return what is known of the ten minutes from `from_ms` to `to_ms`, unix ms. Raises PastAway."""
        oldest_ms = self._find_oldest_ms(robot, view)
        if oldest_ms <= from_ms:
            return ReachedPast(self.kept, True)
        recent = self.kept.list_segments(robot, view, from_ms, to_ms)
        try:
            archived = await self._reader.load_page(robot, view, from_ms - from_ms % PAGE_MS)
        except PastAway:
            if not recent:
                raise
            return ReachedPast(_put_together((), recent), False)
        return ReachedPast(_put_together(archived, recent), True)

    async def reach_segment(self, name: SegmentName, audience: Audience) -> KeptPast:
        """Return what is known of a segment, and of the next one for an audience. Raises PastAway."""
        spans = self.kept.list_takes(name.robot, name.view)
        own = next((span for span in spans if span.take == name.take), None)
        if own is not None and name.index >= own.first_index:
            return self.kept
        pages = await self._find_pages(name, audience)
        if not pages:
            return self.kept
        archived: list[KeptSegment] = []
        for page_ms in pages:
            archived += await self._reader.load_page(name.robot, name.view, page_ms)
        return _AroundSegment(archived, self.kept)

    async def load_reaches(self, robot: str, view: str, from_ms: int, to_ms: int) -> list[ShownDay]:
        """Return the days between these times that have more than the recent past. Raises PastAway."""
        to_ms = min(to_ms, self._find_oldest_ms(robot, view))
        return await self._reader.load_reaches(robot, view, from_ms, to_ms) if from_ms < to_ms else []

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return the index of one of these days. Raises PastAway."""
        if self._find_oldest_ms(robot, view) <= day_ms:
            return DayIndex(robot, view, day_ms)
        return await self._reader.load_day(robot, view, day_ms)

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, except those that are gone or damaged. Raises PastAway."""
        known = {each.name for each in segments if each.data or self.kept.find(each.name) is not None}
        recent = await self._front.load([each for each in segments if each.name in known])
        found = {each.name: each for each in recent}
        lacking = [each for each in segments if each.name not in found]
        if lacking:
            found |= {each.name: each for each in await self._reader.load_data(lacking)}
        return [found[each.name] for each in segments if each.name in found]

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that one of a view's segments names; None if it is gone.

        Raises PastAway.
        """
        text = None
        if self.kept.find_oldest(robot, view) is not None:
            text = await self._front.load_schema(robot, view, sha256)
        return text or await self._reader.load_schema(robot, sha256)

    def _find_oldest_ms(self, robot: str, view: str) -> int:
        oldest = self.kept.find_oldest(robot, view)
        return LATEST_MS if oldest is None else oldest.from_ms

    async def _find_pages(self, name: SegmentName, audience: Audience) -> list[int]:
        """Find the ten minutes of a segment, or of the last one before it in its take, and the next ones that
        have something for an audience.
        """
        robot, view = name.robot, name.view
        reaches = await self._reader.load_reaches(robot, view, 0, LATEST_MS)
        days = [reach.day_ms for reach in reaches if name.take in reach.takes]
        pages: list[PageDigest] = []
        for day_ms in days:
            pages += (await self._reader.load_day(robot, view, day_ms)).list_pages()
        own = [
            (page, span)
            for page in pages
            for span in page.takes
            if span.take == name.take and span.first_index <= name.index
        ]
        if not own:
            return []
        found = [page.at_ms for page, _ in own[-2:]]  # the page of the segment and that of its predecessor
        next_ms = await self._find_next_page(robot, view, found[-1], pages, reaches, audience)
        return found if next_ms is None else [*found, next_ms]

    async def _find_next_page(
        self,
        robot: str,
        view: str,
        after_ms: int,
        pages: Iterable[PageDigest],
        reaches: Iterable[ShownDay],
        audience: Audience,
    ) -> int | None:
        """Find the next ten minutes with something that an audience could see."""

        def find(among: Iterable[PageDigest]) -> int | None:
            return next(
                (
                    page.at_ms
                    for page in among
                    if page.at_ms > after_ms and any(audience in row.audiences for row in page.minutes)
                ),
                None,
            )

        found = find(pages)
        if found is not None:
            return found
        for reach in reaches:
            if reach.day_ms + DAY_MS > after_ms and any(audience in span.audiences for span in reach.spans):
                found = find((await self._reader.load_day(robot, view, reach.day_ms)).list_pages())
                if found is not None:
                    return found
        return None


class _AroundSegment(PastByView):
    """What is known of the ten minutes around a requested segment, and of the recent past.

    The segment itself is found directly, because playback of an older past requests one after the other.
    Everything is merged only if that segment is hidden from the caller.
    """

    def __init__(self, archived: Sequence[KeptSegment], recent: KeptPast) -> None:
        self._archived = archived
        self._recent = recent
        self._together: MemoryPast | None = None

    def get_view(self, robot: str, view: str) -> MemoryPast:
        """Return all of it, merged, in the order in which segments began."""
        if self._together is None:
            self._together = _put_together(self._archived, self._recent.list_segments(robot, view))
        return self._together

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment with this name; None if it is not here."""
        if self._together is not None:
            return self._together.find(name)
        found = (each for each in self._archived if each.name.index == name.index and each.name == name)
        return self._recent.find(name) or next(found, None)


def _put_together(archived: Iterable[KeptSegment], recent: Iterable[KeptSegment]) -> MemoryPast:
    """Merge segments of both sources into one past, each once, in the order in which they began."""
    by_name = {segment.name: segment for segment in (*archived, *recent)}
    past = MemoryPast(UNBOUNDED)
    for segment in sorted(by_name.values(), key=lambda each: (each.from_ms, each.name.take, each.name.index)):
        past.add(segment, 0.0)
    return past
