"""A past that is recent, all of it: what a PastSource answers that has nothing from before."""

from __future__ import annotations

from typing import Any

from posecast_relay.core.past.day_index import DayIndex
from posecast_relay.core.past.day_reach import DayReach
from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.past_source import ReachedPast


class RecentOnly:
    """The part of a PastSource that tells of days gone by, where there are none. `kept`: see there."""

    kept: Any  # a KeptPast, as an attribute or a property

    async def reach_span(self, *_asked: object) -> ReachedPast:
        """Return all of it."""
        return ReachedPast(self.kept, True)

    async def reach_segment(self, *_asked: object) -> KeptPast:
        """Return all of it."""
        past: KeptPast = self.kept
        return past

    async def load_reaches(self, *_asked: object) -> list[DayReach]:
        """Return none."""
        return []

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return an empty one."""
        return DayIndex(robot, view, day_ms)
