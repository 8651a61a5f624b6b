"""What a state store is. The core's own memory always holds the newest state; a store shows it to others."""

from __future__ import annotations

from typing import Any, Protocol

from posecast_relay.core.histogram import Histogram
from posecast_relay.core.state.stream import Stream


class StateStore(Protocol):
    """Never on the fan-out path: `keep` returns at once, whatever the store is doing."""

    def keep(self, stream: Stream) -> None:
        """This stream has changed. The store writes the newest it finds there when it gets to it."""

    def find_trouble(self) -> str | None:
        """One line about what is wrong, None when all is well."""

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """How long those with a server took, and how often it was lost; None where there is no server."""

    def list_robots(self) -> list[dict[str, Any]] | None:
        """The robots on air as others tell of them; None where this process hears them itself."""

    def count_viewers_elsewhere(self, robot: str) -> int:
        """How many watch it at other processes."""
