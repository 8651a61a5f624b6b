"""The interface of where a process reads the past: in its own memory, or elsewhere.

What is known of segments is in `kept`, and read there at once; their bytes, and what is new elsewhere, may
have to be waited for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from posecast_relay.core.past.kept_past import KeptPast
from posecast_relay.core.past.kept_segment import KeptSegment

ListWaiting = Callable[[], Iterable[tuple[str, str]]]
Wake = Callable[[str, str], None]


class PastAway(Exception):
    """The past can't be read just now; it may be tried again in a second. The message says why, in a line."""


class PastSource(Protocol):
    """Where a process reads the past. Whatever can't be reached raises PastAway, soon."""

    @property
    def kept(self) -> KeptPast:
        """What is known: of a view, as of the last `refresh`."""

    @property
    def is_older(self) -> bool:
        """Whether it may hold what was recorded before this process began."""

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Call `wake` with a robot and view of which there is something new, at least for those that
        `list_waiting` returns.
        """

    def find_trouble(self) -> str | None:
        """Return why it can't be read just now; None when it can. Public: without addresses."""

    async def refresh(self, robot: str, view: str) -> None:
        """Bring up to date what is known of a view. Raises PastAway."""

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, without those that are gone or damaged. Raises PastAway."""

    async def load_schema(self, segment: KeptSegment) -> str | None:
        """Return the text of the schema that a segment names; None when it is gone. Raises PastAway."""
