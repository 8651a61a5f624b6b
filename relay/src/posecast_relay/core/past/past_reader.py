"""Finds what a caller may see of the kept past, and what follows a segment."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import TakeSpan
from posecast_relay.core.past.unseen import Unseen
from posecast_relay.core.policy import Grant, PastWindow, Recorded, find_past_window, judge_past


class NotYet(NamedTuple):
    """A segment that can't be sent yet. `due_ms`: unix ms from which the caller may see it; None: it is not
    here."""

    due_ms: int | None = None


class PastReader:
    """Reads the past on behalf of a grant. In each call, `unix_ms` is the time now."""

    def __init__(self, past: KeptPast, unseen: Unseen) -> None:
        self._past = past
        self._unseen = unseen

    def list_shown(
        self, grant: Grant, unix_ms: int, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments the grant may see that begin between `from_ms` and `to_ms` (exclusive), unix
        ms."""
        window = find_past_window(grant, unix_ms)
        found = self._past.list_segments(grant.robot, grant.view, max(from_ms, window.from_ms), to_ms)
        return [segment for segment in found if self._judge(grant, segment, window)]

    def find_segment(
        self, grant: Grant, take: int, index: int, unix_ms: int
    ) -> KeptSegment | SegmentName | NotYet | None:
        """Return the requested segment if the grant may see it.

        A name means: skip this segment, because it is hidden, was dropped, or its take has ended; continue
        with that name. None means that, as far as the caller may know, the segment never existed.
        """
        window = find_past_window(grant, unix_ms)
        asked = self._past.find(SegmentName(grant.robot, grant.view, take, index))
        if asked is not None and self._judge(grant, asked, window):
            return asked
        spans = self._past.list_takes(grant.robot, grant.view)
        own = next((span for span in spans if span.take == take), None)
        if own is None or not self._was_shown(grant, own, index, window):
            return None
        # then what was added after it: with several recorders of one robot, takes overlap. The caller
        # continues
        # with the take that has more, but never goes back
        last = SegmentName(grant.robot, grant.view, take, own.last_index)
        for segment in chain(self._walk_take(grant, own, index, window), self._past.list_after(last)):
            if segment.from_ms >= window.from_ms and self._is_for(grant, segment):
                if self._judge(grant, segment, window):
                    return segment.name
                return NotYet(segment.to_ms + round(1000 * grant.delay_s))
        return NotYet()

    def shows(self, grant: Grant, recorded: Recorded, unix_ms: int) -> bool:
        """Whether the grant may see all of a recorded span of its view."""
        return self._judge(grant, recorded, find_past_window(grant, unix_ms))

    def find_schema(self, grant: Grant, sha256: bytes, unix_ms: int) -> KeptSegment | None:
        """Return the newest segment that names this schema and that the grant may see."""
        shown = reversed(self.list_shown(grant, unix_ms))
        return next((segment for segment in shown if segment.schema == sha256), None)

    def _was_shown(self, grant: Grant, span: TakeSpan, index: int, window: PastWindow) -> bool:
        """Whether the grant may see the segment before `index` in this take, or a later one."""
        return index <= span.last_index + 1 and any(
            self._judge(grant, segment, window) for segment in self._walk_take(grant, span, index - 1, window)
        )

    def _judge(self, grant: Grant, recorded: Recorded, window: PastWindow) -> bool:
        return judge_past(grant, recorded, window) and not self._unseen.has(grant, recorded)

    def _is_for(self, grant: Grant, segment: KeptSegment) -> bool:
        """Whether the grant may see it once it is due."""
        return grant.by in segment.audiences and not self._unseen.has(grant, segment)

    def _walk_take(
        self, grant: Grant, span: TakeSpan, index: int, window: PastWindow
    ) -> Iterator[KeptSegment]:
        """Yield the segments of a take from `index` on that are still in the window, in order."""

        def find(number: int) -> KeptSegment | None:
            return self._past.find(SegmentName(grant.robot, grant.view, span.take, number))

        def get_from_ms(number: int) -> int:
            while (segment := find(number)) is None and number < span.last_index:
                number += 1  # one is missing, for example because it was damaged
            return 0 if segment is None else segment.from_ms

        numbers = range(max(index, span.first_index), span.last_index + 1)
        for number in numbers[bisect_left(numbers, window.from_ms, key=get_from_ms) :]:
            segment = find(number)
            if segment is not None:
                yield segment
