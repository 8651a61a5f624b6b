"""The past that this process keeps in memory itself."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.core.past.kept_segment import KeptSegment
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.past_source import ListWaiting, Wake


class MemoryPastSource:
    """A PastSource of what lies in this process: nothing has to be waited for."""

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

    async def refresh(self, robot: str, view: str) -> None:
        """Do nothing: all is here."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return them as they are."""
        return list(segments)

    async def load_schema(self, segment: KeptSegment) -> str | None:
        """Return the text of the schema that a segment names."""
        if segment.schema is None:
            return None
        return self.kept.find_schema_text(segment.name.robot, segment.name.view, segment.schema)
