"""The part of a PastSource for sources that have only the recent past."""

from __future__ import annotations

from typing import Any

from posecast_relay.core.past.day_index import DayIndex
from posecast_relay.core.past.day_reach import DayReach
from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.past_source import ReachedPast


class RecentOnly:
    """Answers for older days, of which there are none. `kept`: as in PastSource."""

    kept: Any  # a KeptPast, as an attribute or a property

    async def reach_span(self, *_asked: object) -> ReachedPast:
        """Return the recent past."""
        return ReachedPast(self.kept, True)

    async def reach_segment(self, *_asked: object) -> KeptPast:
        """Return the recent past."""
        past: KeptPast = self.kept
        return past

    async def load_reaches(self, *_asked: object) -> list[DayReach]:
        """Return no days."""
        return []

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return an empty day."""
        return DayIndex(robot, view, day_ms)
