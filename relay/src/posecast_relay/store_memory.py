"""`memory://`: nobody outside this process asks, so the core's memory is all the store there is."""

from __future__ import annotations

from typing import Any

from posecast_relay.core.histogram import Histogram
from posecast_relay.core.state.stream import Stream


class MemoryStore:
    """Keeps nothing of its own."""

    def keep(self, stream: Stream) -> None:
        """The stream holds its newest state already."""

    def find_trouble(self) -> str | None:
        """Memory does not fail by itself."""
        return None

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """There are none."""
        return None

    def list_robots(self) -> list[dict[str, Any]] | None:
        """The core knows them."""
        return None

    def count_viewers_elsewhere(self, robot: str) -> int:  # noqa: ARG002
        """There is no elsewhere."""
        return 0
