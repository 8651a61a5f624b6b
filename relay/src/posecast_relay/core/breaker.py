"""Stops requests to a server that does not answer, and retries after a pause that doubles each time."""

from __future__ import annotations

FAILURES = 3  # in a row until requests stop
PAUSE_S = 5.0
PAUSE_MAX_S = 60.0


class Breaker:
    """closed (requests pass) → open (none pass, for a pause) → half open (one attempt decides)."""

    def __init__(self) -> None:
        self.failures = 0  # in a row
        self.open_until = float("-inf")
        self._pause_s = PAUSE_S

    @property
    def is_open(self) -> bool:
        """Whether requests were stopped and none has succeeded since."""
        return self.failures >= FAILURES

    def allow(self, now: float) -> bool:
        """Whether a request may be made now."""
        return now >= self.open_until

    def record_success(self) -> bool:
        """Note that a request succeeded. Returns True if this ends a pause."""
        was_open = self.is_open
        self.failures, self._pause_s = 0, PAUSE_S
        return was_open

    def postpone(self, seconds: float) -> None:
        """Lengthen the current pause by this many seconds."""
        self.open_until += seconds

    def record_failure(self, now: float) -> bool:
        """Note that a request failed. Returns True if this failure stops further requests."""
        self.failures += 1
        if not self.is_open:
            return False
        self.open_until = now + self._pause_s
        self._pause_s = min(PAUSE_MAX_S, 2 * self._pause_s)
        return self.failures == FAILURES
