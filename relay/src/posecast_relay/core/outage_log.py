"""Decides what the log says about an unreliable server: each reason once, and its recovery once."""

from __future__ import annotations

CALM_S = 10.0  # without a failure until an outage is over; earlier failures belong to the same outage


class OutageLog:
    """The outages of one connection to a server. A few late answers on a busy machine count as one outage.
    `now` is in seconds of a monotonic clock.
    """

    def __init__(self) -> None:
        self._told: set[str] = set()  # kinds of failure already logged in this outage
        self._failed_at = float("-inf")

    @property
    def is_open(self) -> bool:
        """Whether an outage is in progress."""
        return bool(self._told)

    def note_failure(self, error: BaseException, now: float) -> str | None:
        """Note a failure. Returns its reason, or None if this outage already had such a failure."""
        self._failed_at = now
        kind = type(error).__name__
        if kind in self._told:
            return None
        self._told.add(kind)
        return str(error) or kind

    def note_success(self, now: float) -> bool:
        """Note a success. Returns True once, when it ends an outage: after CALM_S without a failure."""
        if not self._told or now - self._failed_at < CALM_S:
            return False
        self._told.clear()
        return True
