"""Recognises samples that were delayed on their way to the agent. Does no I/O; time is an argument.

After a pause of the source or of this process (a stalled link, SIGSTOP), pipes and sockets still hold samples
from before the pause, which then arrive all at once. The robot's clock reveals them: between an old sample
and its predecessor, less robot time has passed than real time.

A robot's clock may also stop and jump, so it is used only right after a pause.
"""

from __future__ import annotations

import math

PAUSE_S = 0.5  # a pause: no sample for this long, and
PAUSE_PERIODS = 2.0  # for this many times the interval before it
LATE_S = 0.1  # a sample is new if its delay has grown by no more than this
HOLD_S = 1.0  # the longest check after a pause; then the robot's clock must have stopped too


class Backlog:
    """Follows the samples of one source. Times are seconds of kit.now_s(), except for robot time."""

    def __init__(self) -> None:
        self._came_s: float | None = None
        self._interval_s = math.inf
        self._way_s = 0.0  # arrival − robot time of the newest sample that was not old
        self._pause_s = 0.0  # 0: no check under way
        self._since_s = 0.0  # arrival of the first sample after the pause

    def is_old(self, t_s: float, now_s: float) -> bool:
        """Whether the sample of robot time `t_s`, which arrives at `now_s`, was sent long ago."""
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
            # no sample can be delayed by more than the pause: then the robot's clock stepped
            if LATE_S < late_s < self._pause_s + LATE_S and now_s - self._since_s < HOLD_S:
                return True
            self._pause_s = 0.0
        self._way_s = way_s
        return False
