"""Token bucket: limits work requested by others to a steady rate with a bounded burst. Does no I/O."""

from __future__ import annotations


class TokenBucket:
    """Holds at most `most` tokens and gains `per_s` of them a second. Times are monotonic seconds."""

    def __init__(self, per_s: float, most: float) -> None:
        self._per_s = per_s
        self._most = most
        self._left = most
        self._at_s: float | None = None

    def take(self, now_s: float, cost: float = 1.0) -> bool:
        """Spend `cost` tokens and return True if the bucket has enough. A cost above `most` is allowed when
        the bucket is full."""
        if self.compute_wait_s(now_s, cost) > 0:
            return False
        self._left -= cost
        return True

    def compute_wait_s(self, now_s: float, cost: float = 1.0) -> float:
        """Seconds until `cost` tokens may be spent; 0 when they may be spent now."""
        passed_s = 0.0 if self._at_s is None else max(0.0, now_s - self._at_s)
        self._left, self._at_s = min(self._most, self._left + self._per_s * passed_s), now_s
        return max(0.0, (min(cost, self._most) - self._left) / self._per_s)
