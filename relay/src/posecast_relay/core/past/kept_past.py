"""The interface for readers of the kept past: an index of segments, without their bytes."""

from __future__ import annotations

from typing import Protocol

from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import TakeSpan


class KeptPast(Protocol):
    """The segments of all robots and views. Those of a view are in the order in which they were added."""

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment with this name; None if it is not here, or no longer."""

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the oldest segment of a view that is still here, by when it was added."""

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin between `from_ms` and `to_ms` (exclusive), unix ms; None: no end."""

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes that have segments here, in the order in which they began."""

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments of the same view that were added after this one; all of them if it is not
        here."""
