"""The interface through which a process reads the past: from its own memory or from elsewhere.

`kept` holds the known segments and is read without waiting. Reading their bytes, or finding what is new
elsewhere, can take time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol

from posecast_relay.core.policy import Audience
from posecast_relay.past.index import DayIndex, ShownDay
from posecast_relay.past.segment import KeptSegment, SegmentName, TakeSpan


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


ListWaiting = Callable[[], Iterable[tuple[str, str]]]
Wake = Callable[[str, str], None]


class PastAway(Exception):
    """The past can't be read right now; retry in a second. The message is one line with the reason."""


class ReachedPast(NamedTuple):
    """The known segments of a time span. `is_whole` is False if there may be more that can't be read now."""

    past: KeptPast
    is_whole: bool


class PastSource(Protocol):
    """Where a process reads the past. A call that can't reach its data raises PastAway soon."""

    @property
    def kept(self) -> KeptPast:
        """The known part of the recent past. For a view, it is as current as the last `refresh`."""

    @property
    def is_older(self) -> bool:
        """Whether it may hold data recorded before this process started."""

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with a robot and view when it has new segments, at least for those in
        `list_waiting()`."""

    def find_trouble(self) -> str | None:
        """Return why it can't be read right now; None if it can. Shown to the public, so without
        addresses."""

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Update what is known of a view. With `anew` read it now; otherwise an update a moment ago is
        enough.

        Raises PastAway.
        """

    async def reach_span(self, robot: str, view: str, from_ms: int, to_ms: int) -> ReachedPast:
        """Return what is known of the ten minutes from `from_ms` to `to_ms`, unix ms. It may contain more.

        Raises PastAway.
        """

    async def reach_segment(self, name: SegmentName, audience: Audience) -> KeptPast:
        """Return what is known of a segment, its predecessor, and the next one that an audience could see.

        Raises PastAway.
        """

    async def load_reaches(self, robot: str, view: str, from_ms: int, to_ms: int) -> list[ShownDay]:
        """Return the days between these times, unix ms, that have more than the recent past, oldest first.

        Raises PastAway.
        """

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return the index of one of these days. Raises PastAway."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, except those that are gone or damaged. Raises PastAway."""

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that one of a view's segments names; None if it is gone.

        Raises PastAway.
        """


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

    async def load_reaches(self, *_asked: object) -> list[ShownDay]:
        """Return no days."""
        return []

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return an empty day."""
        return DayIndex(robot, view, day_ms)
