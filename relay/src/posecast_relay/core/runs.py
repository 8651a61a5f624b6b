"""Runs of one robot: which life of its edge counts, and how late its messages are.

A run is a random number, so neither its value nor a clock orders runs: who speaks first is older. A run never
seen becomes current with its first KEY and retires the one before for good, so that two edges that claim one
robot do not take turns: the newest wins, and the other's frames show as a conflict.
"""

from __future__ import annotations

from collections import OrderedDict

from posecast_wire import Stamp

RETIRED_MAX = 64  # remembered; an older one could return as new, which takes 64 restarts within its life
CONFLICT_AFTER_S = 1.0  # frames of a retired run that were still on their way are no conflict
CONFLICT_FOR_S = 3.0  # after the last of them
DRIFT = 1e-4  # two clocks part by up to 100 ppm; without allowing for it, lateness would grow all day


class Runs:
    """The current run (0 = none yet), those retired, and the current one's lateness."""

    def __init__(self) -> None:
        self.current = 0
        self.adopted = 0  # how many runs this robot has had
        self.lateness_s = 0.0  # of the newest stamped message
        self._retired: OrderedDict[int, float] = OrderedDict()  # run → when it was retired
        self._conflict_until = float("-inf")
        self._least_s = float("inf")
        self._least_at = 0.0

    def is_retired(self, run_id: int, now: float) -> bool:
        """Whether messages of this run are to be dropped; one that goes on regardless is a conflict."""
        retired_at = self._retired.get(run_id)
        if retired_at is None:
            return False
        if now - retired_at > CONFLICT_AFTER_S:
            self._conflict_until = now + CONFLICT_FOR_S
        return True

    def adopt(self, run_id: int, now: float) -> None:
        """Make a run current; the caller has seen its first KEY."""
        if self.current:
            self._retired[self.current] = now
            if len(self._retired) > RETIRED_MAX:
                self._retired.popitem(last=False)
        self.current = run_id
        self.adopted += 1
        self._least_s = float("inf")
        self.lateness_s = 0.0

    def conflict(self, now: float) -> bool:
        """Whether another edge claims this robot at present."""
        return now < self._conflict_until

    def arrived(self, stamp: Stamp, now: float) -> float:
        """Lateness, s: (arrival − stamp) above this run's running minimum of it."""
        offset = now - stamp.elapsed_ns / 1e9
        least = self._least_s + DRIFT * (now - self._least_at)
        self._least_s, self._least_at = min(least, offset), now
        self.lateness_s = offset - self._least_s
        return self.lateness_s
