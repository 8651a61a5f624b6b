"""The state store's interface.

The newest state is always in the core; a store shares it with other processes.
"""

from __future__ import annotations

from typing import Any, Protocol

from posecast_relay.core.histogram import Histogram
from posecast_relay.core.state.stream import Stream


class StateStore(Protocol):
    """A state store.

    `keep` returns at once, whatever the store is doing, so that viewers never wait for it.
    """

    def keep(self, stream: Stream) -> None:
        """Note that a stream has changed. The store writes its newest state later."""

    def find_trouble(self) -> str | None:
        """Return one line about what is wrong; None when all is well."""

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return how long exchanges with the server took and how often it was lost; None without one."""

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return the robots that other processes hear, as documents; None where this process hears them
        itself.
        """

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has at other processes."""
