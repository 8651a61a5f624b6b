"""Estimates Redis's clock, so that processes can tell how long ago another one wrote something.

Hosts' clocks differ, and each process's monotonic clock starts at an arbitrary value. Each exchange that
returns Redis's time limits the difference from both sides. The narrowest limits are used until an exchange
contradicts them, which means that a clock was set or stopped.
"""

from __future__ import annotations

ERROR_S = 0.05
DRIFT = 1e-4  # clocks drift apart by up to 100 ppm


class RedisClock:
    """Estimates Redis's clock.

    Times are in seconds; `now`, `asked_at`, `answered_at` of this process's clock.
    """

    def __init__(self) -> None:
        self._least = float("-inf")  # of Redis's clock less this process's
        self._most = float("inf")
        self._seen_at = 0.0

    def record_time(self, redis_s: float, asked_at: float, answered_at: float) -> None:
        """Record the time that Redis returned between these two moments."""
        least, most = redis_s - answered_at, redis_s - asked_at
        parted = DRIFT * max(0.0, answered_at - self._seen_at)
        narrow = max(least, self._least - parted), min(most, self._most + parted)
        self._least, self._most = narrow if narrow[0] <= narrow[1] else (least, most)
        self._seen_at = answered_at

    def estimate_time(self, now: float) -> float | None:
        """Return Redis's time at `now`; None before any exchange."""
        if self._most == float("inf"):
            return None
        return now + (self._least + self._most) / 2

    def compute_elapsed(self, sent_s: float | None, now: float) -> float | None:
        """Return how many seconds before `now` something was sent at Redis's time `sent_s`; None when
        unknown.
        """
        redis_s = self.estimate_time(now)
        if redis_s is None or sent_s is None:
            return None
        error_s = self._most - self._least + ERROR_S  # of the writer's estimate and of this one
        return (
            max(0.0, redis_s - sent_s) if sent_s <= redis_s + error_s else None
        )  # the clock has been set back
