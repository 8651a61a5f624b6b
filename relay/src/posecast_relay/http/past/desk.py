"""What the routes of the past need from a process: what a caller may see of recent and older data.

Months are searched by day, a day by minute, and only ten minutes by segment. All follow the same rules: who
could see it live, how far back they may look, and what was withdrawn.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

from posecast_relay.core.past.day_index import DayIndex, MinuteRow, sum_minutes
from posecast_relay.core.past.day_reach import DayReach
from posecast_relay.core.past.deletions import Deletion, Deletions
from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.past_reader import NotYet, PastReader
from posecast_relay.core.past.unseen import Unseen
from posecast_relay.core.policy import Grant, Policy, find_past_window
from posecast_relay.http.past.address import DAY_MS, PAGE_MS, PastSpan
from posecast_relay.http.past.extent import PastExtent
from posecast_relay.http.past.held_requests import HeldRequests
from posecast_relay.http.past.key_pages import KeyPages
from posecast_relay.net.answer_cache import AnswerCache
from posecast_relay.past_source import PastAway, PastSource

Found = KeptSegment | SegmentName | NotYet | None


class ShownPage(NamedTuple):
    """What a caller may see of ten minutes. `is_whole` is False if there may be more that can't be read
    now."""

    segments: list[KeptSegment]
    is_whole: bool


class PastDesk:
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
        self.unseen = Unseen(knows_all=not source.is_older)
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

    async def _load_reaches(self, grant: Grant) -> list[DayReach]:
        window = find_past_window(grant, self.compute_unix_ms())
        if window.to_ms <= window.from_ms:
            return []
        return await self.source.load_reaches(grant.robot, grant.view, window.from_ms, window.to_ms)

    async def _shows_day(self, grant: Grant, reach: DayReach) -> bool:
        """Whether a day has a minute that the grant may see."""
        spans = [span for span in reach.spans if grant.by in span.audiences]
        unix_ms = self.compute_unix_ms()
        if any(self.reader.shows(grant, span, unix_ms) for span in spans):
            return True  # all of it, so a minute too
        return bool(spans and await self._list_spans(grant, reach))

    async def _list_spans(self, grant: Grant, reach: DayReach) -> list[int]:
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
