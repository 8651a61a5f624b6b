"""Shares the event loop's time among robots, because the loop also serves all viewers."""

from __future__ import annotations

from collections.abc import Callable

CREDIT_S = 0.1  # frames arrive in bursts


class Turns:
    """Limits the work per robot, so that no robot's schema or viewers slow down the others."""

    def __init__(self, now: Callable[[], float], robot_per_s: int, all_per_s: int) -> None:
        """`now` is a clock in seconds. `robot_per_s`: work per second for one robot. `all_per_s`: for all
        robots, shared equally."""
        self._now = now
        self._robot_per_s = robot_per_s
        self._all_per_s = all_per_s
        self._next: dict[str, float] = {}  # by robot, not before
        self._tidied_at = float("-inf")

    def takes(self, robot: str, cost: int) -> bool:
        """Whether work of this cost may be done for this robot now. If so, it is counted."""
        now = self._now()
        if now - self._tidied_at >= 1.0:
            self._tidied_at = now
            self._next = {name: at for name, at in self._next.items() if at > now - 1.0}
        free_at = self._next.get(robot, 0.0)
        if now < free_at:
            return False
        share = min(self._robot_per_s, self._all_per_s / max(1, len(self._next)))
        self._next[robot] = max(free_at, now - CREDIT_S) + cost / share
        return True
