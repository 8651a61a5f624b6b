"""The interface of where a process reads the past: in its own memory, or elsewhere.

What is known of segments is in `kept`, and read there at once; their bytes, and what is new elsewhere, may
have to be waited for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, Protocol

from posecast_relay.core.past.day_index import DayIndex
from posecast_relay.core.past.day_reach import DayReach
from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.policy.policy import Audience

ListWaiting = Callable[[], Iterable[tuple[str, str]]]
Wake = Callable[[str, str], None]


class PastAway(Exception):
    """The past can't be read just now; it may be tried again in a second. The message says why, in a line."""


class ReachedPast(NamedTuple):
    """What is known of a stretch of time. `is_whole`: False when there may be more that can't be read now."""

    past: KeptPast
    is_whole: bool


class PastSource(Protocol):
    """Where a process reads the past. Whatever can't be reached raises PastAway, soon."""

    @property
    def kept(self) -> KeptPast:
        """What is known of the recent past: of a view, as of the last `refresh`."""

    @property
    def is_older(self) -> bool:
        """Whether it may hold what was recorded before this process began."""

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with a robot and view of which there is something new, at least for those that
        `list_waiting` returns.
        """

    def find_trouble(self) -> str | None:
        """Return why it can't be read just now; None when it can. Public: without addresses."""

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Bring up to date what is known of a view: as of a moment ago, or `anew`, as of now.

        Raises PastAway.
        """

    async def reach_span(self, robot: str, view: str, from_ms: int, to_ms: int) -> ReachedPast:
        """Return what is known of the ten minutes from `from_ms` to `to_ms`, unix; more may be in it.

        Raises PastAway.
        """

    async def reach_segment(self, name: SegmentName, audience: Audience) -> KeptPast:
        """Return what is known of a segment, of the one before, and of what comes next that an audience could
        see. Raises PastAway.
        """

    async def load_reaches(self, robot: str, view: str, from_ms: int, to_ms: int) -> list[DayReach]:
        """Return of which days between these, unix ms, there is more than what is recent, oldest first.

        Raises PastAway.
        """

    async def load_day(self, robot: str, view: str, day_ms: int) -> DayIndex:
        """Return what is known of one of these days. Raises PastAway."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, without those that are gone or damaged. Raises PastAway."""

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:
        """Return the text of a schema that a segment of a view names; None when it is gone.

        Raises PastAway.
        """
