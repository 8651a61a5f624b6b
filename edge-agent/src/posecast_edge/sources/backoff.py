"""Decides when to retry a connection. Does no I/O; time is an argument."""

from __future__ import annotations

FIRST_S = 0.2
LONGEST_S = 5.0
STEADY_S = 5.0  # a connection that lasted this long resets the pause


class Backoff:
    """Doubles the pause with every failure; starts again with the shortest one after a connection that lasted
    STEADY_S. Times are monotonic seconds."""

    def __init__(self) -> None:
        self._pause_s = FIRST_S
        self._next_s = float("-inf")
        self._connected_s: float | None = None

    def is_due(self, now_s: float) -> bool:
        """Whether to try now."""
        return now_s >= self._next_s

    def record_success(self, now_s: float) -> None:
        """Record that a connection was made."""
        self._connected_s = now_s

    def record_failure(self, now_s: float) -> None:
        """Record that an attempt failed or a connection ended, and plan the next attempt."""
        if self._connected_s is not None and now_s - self._connected_s >= STEADY_S:
            self._pause_s = FIRST_S
        self._connected_s = None
        self._next_s = now_s + self._pause_s
        self._pause_s = min(LONGEST_S, self._pause_s * 2)
