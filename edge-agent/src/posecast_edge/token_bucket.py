"""How much may be done for strangers: so much a second, and some of it in advance. Pure."""

from __future__ import annotations


class TokenBucket:
    """Fills up by `per_s` a second, to `most`. Times are monotonic seconds."""

    def __init__(self, per_s: float, most: float) -> None:
        self._per_s = per_s
        self._most = most
        self._left = most
        self._at_s: float | None = None

    def take(self, now_s: float, cost: float = 1.0) -> bool:
        """Spend `cost` if there is as much, or if it is full: what costs more than `most` waits for that."""
        if self.compute_wait_s(now_s, cost) > 0:
            return False
        self._left -= cost
        return True

    def compute_wait_s(self, now_s: float, cost: float = 1.0) -> float:
        """How long until `cost` may be spent."""
        passed_s = 0.0 if self._at_s is None else max(0.0, now_s - self._at_s)
        self._left, self._at_s = min(self._most, self._left + self._per_s * passed_s), now_s
        return max(0.0, (min(cost, self._most) - self._left) / self._per_s)
