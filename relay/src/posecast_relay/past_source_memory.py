"""The past in this process's own memory."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.core.past.kept_segment import KeptSegment
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.past_source import ListWaiting, Wake
from posecast_relay.past_source_recent import RecentOnly


class MemoryPastSource(RecentOnly):
    """A PastSource in this process: it never has to wait."""

    kept: MemoryPast

    def __init__(self, kept: MemoryPast) -> None:
        self.kept = kept

    @property
    def is_older(self) -> bool:
        """Whether it may hold data recorded before this process started."""
        return False

    def follow(self, _list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with the robot and view of each added segment."""
        self.kept.on_added(lambda segment: wake(segment.name.robot, segment.name.view))

    def find_trouble(self) -> None:
        """Return None: memory can always be read."""

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Do nothing: everything is here."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return them unchanged."""
        return list(segments)

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that one of a view's segments names."""
        return self.kept.find_schema_text(robot, view, sha256)
