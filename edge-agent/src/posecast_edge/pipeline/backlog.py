"""Recognises samples that were delayed on their way to the agent. Does no I/O; time is an argument.

After the source or this process was paused (a link that hung, SIGSTOP), pipes and sockets still hold samples
from before the pause, which then arrive all at once. The robot's clock tells them apart: such a sample shows
less robot time since the last one than has really passed.

A robot's clock may also stop and jump, so it is consulted only in the moment after a pause.
"""

from __future__ import annotations

import math

PAUSE_S = 0.5  # without a sample, and
PAUSE_PERIODS = 2.0  # so many times the interval before
LATE_S = 0.1  # later than before the pause, at most, and it is new
HOLD_S = 1.0  # after the pause; then the robot's clock has stood still as well


class Backlog:
    """Follows the samples of one source. Times are seconds of clock.now_s(), except for robot time."""

    def __init__(self) -> None:
        self._came_s: float | None = None
        self._interval_s = math.inf
        self._way_s = 0.0  # arrival − robot's time, of the newest that was new
        self._pause_s = 0.0  # 0: nothing is held
        self._since_s = 0.0  # the first sample after the pause

    def is_old(self, t_s: float, now_s: float) -> bool:
        """Whether the sample of robot time `t_s` that arrives now was sent long before."""
        if not math.isfinite(t_s):
            return False
        before_s, self._came_s = self._came_s, now_s
        way_s = now_s - t_s
        if before_s is not None:
            gap_s = now_s - before_s
            if not self._pause_s and gap_s > max(PAUSE_S, PAUSE_PERIODS * self._interval_s):
                self._pause_s, self._since_s = gap_s, now_s
            self._interval_s = gap_s
        if self._pause_s:
            late_s = way_s - self._way_s
            # nothing can have waited for longer than the pause: then it was the clock that stepped
            if LATE_S < late_s < self._pause_s + LATE_S and now_s - self._since_s < HOLD_S:
                return True
            self._pause_s = 0.0
        self._way_s = way_s
        return False
