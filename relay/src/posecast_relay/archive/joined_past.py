"""The past of a process that has an archive: what is recent from memory or Redis, the rest from the store.

What is recent is all that the front has of a view, back to its oldest segment; what began before that is read
in the store. Ten minutes in which both meet are put together by the segments' names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from posecast_relay.archive.names import PAGE_MS
from posecast_relay.archive.reader import ArchiveReader
from posecast_relay.core.past.day_index import DAY_MS, DayIndex, PageDigest
from posecast_relay.core.past.day_reach import DayReach
from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import MemoryPast, TakeSpan
from posecast_relay.core.policy.policy import Audience
from posecast_relay.past_source import ListWaiting, PastAway, PastSource, ReachedPast, Wake

UNBOUNDED = 1 << 62  # what is put together is ten minutes of two sources that are bounded
LATEST_MS = (1 << 53) - 1


class JoinedPast:
    """A PastSource of what is recent in `front` and of what is older in an archive. `find_own_trouble` tells
    why the archive can't be written, or is nearly full; None when all is well.
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
        """What is known of the recent past."""
        return self._front.kept

    @property
    def is_older(self) -> bool:
        """Whether it may hold what was recorded before this process began."""
        return True

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with a robot and view of which there is something new."""
        self._front.follow(list_waiting, wake)

    def find_trouble(self) -> str | None:
        """Return what is wrong with the front or the archive; None when all is well."""
        own = self._find_own_trouble() or self._reader.find_trouble()
        troubles = (self._front.find_trouble(), own and f"the archive: {own}")
        return "; ".join(filter(None, troubles)) or None

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Bring up to date what is known of the recent past of a view. Raises PastAway."""
        await self._front.refresh(robot, view, anew=anew)

    async def reach_span(self, robot: str, view: str, from_ms: int, to_ms: int) -> ReachedPast:
        """Return what is known of the ten minutes from `from_ms` to `to_ms`, unix. Raises PastAway."""
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
        """Return what is known of a segment, and of what comes next for an audience. Raises PastAway."""
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
        return _AroundSegment(name.robot, name.view, archived, self.kept)

    async def load_reaches(self, robot: str, view: str, from_ms: int, to_ms: int) -> list[DayReach]:
        """Return of which days between these there is more than what is recent. Raises PastAway."""
        to_ms = min(to_ms, self._find_oldest_ms(robot, view))
        return await self._reader.load_reaches(robot, view, from_ms, to_ms) if from_ms < to_ms else []

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return what is known of one of these days. Raises PastAway."""
        if self._find_oldest_ms(robot, view) <= day_ms:
            return DayIndex(robot, view, day_ms)
        return await self._reader.load_day(robot, view, day_ms)

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, without those that are gone or damaged. Raises PastAway."""
        known = {each.name for each in segments if each.data or self.kept.find(each.name) is not None}
        recent = await self._front.load([each for each in segments if each.name in known])
        found = {each.name: each for each in recent}
        lacking = [each for each in segments if each.name not in found]
        if lacking:
            found |= {each.name: each for each in await self._reader.load_data(lacking)}
        return [found[each.name] for each in segments if each.name in found]

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that a segment of a view names; None when it is gone.

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
        """Find the ten minutes in which a segment lies, or the last before it in its take, and the next ones
        in which there is something for an audience.
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
        found = [page.at_ms for page, _ in own[-2:]]  # where it is, and where the one before it is
        next_ms = await self._find_next_page(robot, view, found[-1], pages, reaches, audience)
        return found if next_ms is None else [*found, next_ms]

    async def _find_next_page(
        self,
        robot: str,
        view: str,
        after_ms: int,
        pages: Iterable[PageDigest],
        reaches: Iterable[DayReach],
        audience: Audience,
    ) -> int | None:
        """Find the next ten minutes in which there is something that an audience could see."""

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


class _AroundSegment:
    """What is known of the ten minutes around a segment that somebody asks for, and of what is recent.

    The segment itself is found without more: whoever plays an older past asks for one after the other. All of
    it is put together only when that one is not for them.
    """

    def __init__(self, robot: str, view: str, archived: Sequence[KeptSegment], recent: KeptPast) -> None:
        self._robot = robot
        self._view = view
        self._archived = archived
        self._recent = recent
        self._together: MemoryPast | None = None

    @property
    def _whole(self) -> MemoryPast:
        if self._together is None:
            recent = self._recent.list_segments(self._robot, self._view)
            self._together = _put_together(self._archived, recent)
        return self._together

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment of this name; None when it is not here."""
        if self._together is not None:
            return self._together.find(name)
        found = (each for each in self._archived if each.name.index == name.index and each.name == name)
        return self._recent.find(name) or next(found, None)

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the segment that began first."""
        return self._whole.find_oldest(robot, view)

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin from `from_ms` on and before `to_ms`, unix; None: all later."""
        return self._whole.list_segments(robot, view, from_ms, to_ms)

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes of which there is something, in the order in which they began."""
        return self._whole.list_takes(robot, view)

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments that began after the one of this name."""
        return self._whole.list_after(name)


def _put_together(archived: Iterable[KeptSegment], recent: Iterable[KeptSegment]) -> MemoryPast:
    """Put segments of both into one past, each once, in the order in which they began."""
    by_name = {segment.name: segment for segment in (*archived, *recent)}
    past = MemoryPast(UNBOUNDED)
    for segment in sorted(by_name.values(), key=lambda each: (each.from_ms, each.name.take, each.name.index)):
        past.add(segment, 0.0)
    return past
