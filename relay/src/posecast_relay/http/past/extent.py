"""The extent of the past for a caller."""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.core.past.kept_segment import SegmentName


class PastExtent(NamedTuple):
    """The first and last time with data, unix ms, the starts of the days that have data, and the newest
    segment.

    None or empty if there is nothing. `deleted`: spans in which nothing is left, unix ms.
    """

    from_ms: int | None = None
    to_ms: int | None = None
    newest: SegmentName | None = None
    days_ms: tuple[int, ...] = ()
    deleted: tuple[tuple[int, int], ...] = ()
