"""Finds what a caller may see of the kept past, and what follows a segment."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

from posecast_relay.core.policy import (
    Audience,
    Grant,
    PastWindow,
    Policy,
    Recorded,
    Rule,
    find_past_window,
    is_past_shown,
    shows_all,
)
from posecast_relay.past.segment import KeptSegment, SegmentName, TakeSpan
from posecast_relay.past.source import KeptPast

# Tracks recordings that an audience was meant to see but never saw live, because the rules changed first.
#
# A segment lists the audiences that could see it when it was recorded. An audience with a delay has not
# seen it yet at that moment. If a blackout begins, the delayed data is never shown live. A robot that is no
# longer in the file has no past, even if another robot gets its name.

SPANS_MAX = 100  # per audience of a view; beyond that the two oldest merge, with the gap between them


class _Span(NamedTuple):
    """A time span, unix ms."""

    from_ms: int
    to_ms: int


class HiddenSpans:
    """What was withdrawn before it was seen, since this process started. It needs each new policy.

    `knows_all`: no recordings predate this process. Otherwise delayed audiences get none of those.
    """

    def __init__(self, knows_all: bool) -> None:
        self._knows_all = knows_all
        self._policy: Policy | None = None
        self._began_ms = 0
        self._gone_ms: dict[str, int] = {}  # by robot: when it was last removed from the file
        self._spans: dict[tuple[str, str, Audience], list[_Span]] = {}  # by robot, view and audience

    def set_policy(self, policy: Policy, unix_ms: int) -> None:
        """Note what the rules in force from `unix_ms` on withdraw."""
        before, self._policy = self._policy, policy
        if before is None:
            self._began_ms = unix_ms
            return
        for robot, rules in (before.rules or {}).items():
            if policy.rules is not None and robot not in policy.rules:
                self._gone_ms[robot] = unix_ms
            for audience, rule in rules.items():
                after = policy.find_rules(robot).get(audience)
                if _shows_late(rule) and not (after and after.view == rule.view and _shows_late(after)):
                    self._add(
                        (robot, rule.view, audience), _Span(unix_ms - round(1000 * rule.delay_s), unix_ms)
                    )

    def has(self, grant: Grant, recorded: Recorded) -> bool:
        """Whether a segment of the grant's robot and view was withdrawn before its audience could see it."""
        began_ms = 0 if self._knows_all or grant.delay_s == 0 else self._began_ms
        return recorded.from_ms < max(began_ms, self._gone_ms.get(grant.robot, 0)) or any(
            recorded.from_ms <= span.to_ms and recorded.to_ms > span.from_ms
            for span in self._spans.get((grant.robot, grant.view, grant.by), ())
        )

    def _add(self, key: tuple[str, str, Audience], span: _Span) -> None:
        spans = self._spans.setdefault(key, [])
        spans.append(span)
        if len(spans) > SPANS_MAX:
            spans[:2] = [_Span(min(spans[0].from_ms, spans[1].from_ms), max(spans[0].to_ms, spans[1].to_ms))]


def _shows_late(rule: Rule) -> bool:
    return rule.delay_s > 0 and shows_all(rule)


class NotYet(NamedTuple):
    """A segment that can't be sent yet. `due_ms`: unix ms from which the caller may see it; None: it is not
    here."""

    due_ms: int | None = None


class PastReader:
    """Reads the past on behalf of a grant. In each call, `unix_ms` is the time now."""

    def __init__(self, past: KeptPast, unseen: HiddenSpans) -> None:
        self._past = past
        self._unseen = unseen

    def list_shown(
        self, grant: Grant, unix_ms: int, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments the grant may see that begin between `from_ms` and `to_ms` (exclusive), unix
        ms."""
        window = find_past_window(grant, unix_ms)
        found = self._past.list_segments(grant.robot, grant.view, max(from_ms, window.from_ms), to_ms)
        return [segment for segment in found if self._is_shown(grant, segment, window)]

    def find_segment(
        self, grant: Grant, take: int, index: int, unix_ms: int
    ) -> KeptSegment | SegmentName | NotYet | None:
        """Return the requested segment if the grant may see it.

        A name means: skip this segment, because it is hidden, was dropped, or its take has ended; continue
        with that name. None means that, as far as the caller may know, the segment never existed.
        """
        window = find_past_window(grant, unix_ms)
        asked = self._past.find(SegmentName(grant.robot, grant.view, take, index))
        if asked is not None and self._is_shown(grant, asked, window):
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
                if self._is_shown(grant, segment, window):
                    return segment.name
                return NotYet(segment.to_ms + round(1000 * grant.delay_s))
        return NotYet()

    def shows(self, grant: Grant, recorded: Recorded, unix_ms: int) -> bool:
        """Whether the grant may see all of a recorded span of its view."""
        return self._is_shown(grant, recorded, find_past_window(grant, unix_ms))

    def find_schema(self, grant: Grant, sha256: bytes, unix_ms: int) -> KeptSegment | None:
        """Return the newest segment that names this schema and that the grant may see."""
        shown = reversed(self.list_shown(grant, unix_ms))
        return next((segment for segment in shown if segment.schema == sha256), None)

    def _was_shown(self, grant: Grant, span: TakeSpan, index: int, window: PastWindow) -> bool:
        """Whether the grant may see the segment before `index` in this take, or a later one."""
        return index <= span.last_index + 1 and any(
            self._is_shown(grant, segment, window)
            for segment in self._walk_take(grant, span, index - 1, window)
        )

    def _is_shown(self, grant: Grant, recorded: Recorded, window: PastWindow) -> bool:
        return is_past_shown(grant, recorded, window) and not self._unseen.has(grant, recorded)

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
