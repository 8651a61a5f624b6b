"""How far a past goes for somebody."""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.core.past.kept_segment import SegmentName


class PastExtent(NamedTuple):
    """From when to when there is anything, unix ms, on which days (when they begin), and the newest segment.
    None and nothing where there is nothing.
    """

    from_ms: int | None = None
    to_ms: int | None = None
    newest: SegmentName | None = None
    days_ms: tuple[int, ...] = ()
