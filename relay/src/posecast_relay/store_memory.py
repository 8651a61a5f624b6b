"""The store `memory://`. It does nothing, because no other process needs the state."""

from __future__ import annotations

from typing import Any

from posecast_relay.core.state.stream import Stream
from posecast_relay.kit import Histogram


class MemoryStore:
    """A state store for a single process. It stores nothing."""

    def keep(self, stream: Stream) -> None:
        """Do nothing: the stream already has its newest state."""

    def find_trouble(self) -> str | None:
        """Return None: nothing can fail here."""
        return None

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return None: there is no server."""
        return None

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return None: this process hears all robots itself."""
        return None

    def count_viewers_elsewhere(self, robot: str) -> int:  # noqa: ARG002
        """Return 0: there are no other processes."""
        return 0
