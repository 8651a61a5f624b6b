"""The past that this process keeps in memory itself."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.core.past.kept_segment import KeptSegment
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.past_source import ListWaiting, Wake
from posecast_relay.past_source_recent import RecentOnly


class MemoryPastSource(RecentOnly):
    """A PastSource of what lies in this process: nothing has to be waited for."""

    kept: MemoryPast

    def __init__(self, kept: MemoryPast) -> None:
        self.kept = kept

    @property
    def is_older(self) -> bool:
        """Whether it may hold what was recorded before this process began."""
        return False

    def follow(self, _list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with the robot and view of each segment that is added."""
        self.kept.on_added(lambda segment: wake(segment.name.robot, segment.name.view))

    def find_trouble(self) -> None:
        """Return None: what lies here can be read."""

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Do nothing: all is here."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return them as they are."""
        return list(segments)

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that a segment of a view names."""
        return self.kept.find_schema_text(robot, view, sha256)
