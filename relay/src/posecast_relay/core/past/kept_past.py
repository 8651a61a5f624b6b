"""What is known of the kept past, as those who read it need it: the index, and not the bytes."""

from __future__ import annotations

from typing import Protocol

from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import TakeSpan


class KeptPast(Protocol):
    """The segments of all robots and views, each view's in the order in which they were added."""

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment of this name; None when it is not here, not yet or no more."""

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the segment of a view that was added first of those that are here."""

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin from `from_ms` on and before `to_ms`, unix; None: all later."""

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes of which there is something, in the order in which they began."""

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments of its view that were added after the one of this name; all where it is not
        here.
        """
