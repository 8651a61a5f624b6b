"""The interface of state stores.

The core always has the newest state. A store shares it with other processes.
"""

from __future__ import annotations

from typing import Any, Protocol

from posecast_relay.core.state.stream import Stream
from posecast_relay.kit import Histogram


class StateStore(Protocol):
    """A state store.

    `keep` always returns at once, so that viewers never wait for the store.
    """

    def keep(self, stream: Stream) -> None:
        """Note that a stream has changed. The store writes its newest state later."""

    def find_trouble(self) -> str | None:
        """Return the store's present problem, in one line; None if it works."""

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return how long exchanges with the server took and how often it was lost; None without a server."""

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return the robots that other processes hear, as documents; None if this process hears them."""

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has in other processes."""
