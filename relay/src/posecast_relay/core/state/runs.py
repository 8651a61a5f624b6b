"""The runs of one robot: which run of its edge counts, and how late its messages are.

A run is a random number, so neither its value nor a clock orders runs: the run heard first is the older one.
A new run becomes current with its first KEY and retires the previous one. So two edges that claim one robot
do not alternate: the newest wins, and frames of the other count as a conflict. If the newest falls silent
while the other still sends, the other becomes current again.
"""

from __future__ import annotations

from collections import OrderedDict

from posecast_wire import Stamp

from posecast_relay.core.state.lateness import Lateness

RETIRED_MAX = 64  # remembered runs; one forgotten after 64 restarts could return as new
CONFLICT_AFTER_S = 1.0  # earlier frames of a retired run were still in transit, so no conflict
CONFLICT_FOR_S = 3.0  # how long a conflict lasts after its last frame
RETURN_AFTER_S = 3.0  # without a frame the current run has ended: this exceeds a link's lease


class Runs:
    """The current run (0 = none yet), the retired runs, and the current run's lateness."""

    def __init__(self) -> None:
        self.current = 0
        self.adopted = 0  # how often a run of this robot became current
        self.lateness = Lateness()
        self._heard_at = float("-inf")  # the current run's newest frame
        self._retired: OrderedDict[int, float] = OrderedDict()  # run → when it was retired
        self._conflict_until = float("-inf")

    @property
    def lateness_s(self) -> float:
        """Lateness of the newest frame, in seconds."""
        return self.lateness.seconds

    def is_retired(self, run_id: int, now: float) -> bool:
        """Whether to drop messages of this run. If the run continues to send, that is noted as a conflict.

        A run is no longer retired once the run that replaced it has sent no frame for RETURN_AFTER_S.
        """
        retired_at = self._retired.get(run_id)
        if retired_at is None:
            return False
        if now - max(self._heard_at, retired_at) > RETURN_AFTER_S:
            return False
        if now - retired_at > CONFLICT_AFTER_S:
            self._conflict_until = now + CONFLICT_FOR_S
        return True

    def may_adopt(self, run_id: int, now: float) -> bool:
        """Whether an answer alone, without a frame, may make this run current.

        Not while the current run sends, and not if this run was current before: the answer may be older than
        what was already shown of it.
        """
        if self.current in (0, run_id):
            return True
        return run_id not in self._retired and now - self._heard_at > RETURN_AFTER_S

    def adopt(self, run_id: int, now: float) -> None:
        """Make a run current. The caller has seen a KEY of that run."""
        if self.current:
            self._retired[self.current] = now
            if len(self._retired) > RETIRED_MAX:
                self._retired.popitem(last=False)
        self._retired.pop(run_id, None)
        self.current = run_id
        self.adopted += 1
        self._heard_at = now
        self.lateness = Lateness()

    def is_in_conflict(self, now: float) -> bool:
        """Whether another edge currently claims this robot."""
        return now < self._conflict_until

    def record_arrival(self, stamp: Stamp, now: float) -> float:
        """Note a frame of the current run and return its lateness in seconds."""
        self._heard_at = now
        return self.lateness.record_arrival(stamp.elapsed_ns / 1e9, now)

    def record_answer(self, stamp: Stamp, waited_s: float, now: float) -> None:
        """Note an answer that came `waited_s` seconds after its question, if it belongs to the current
        run."""
        if stamp.run_id == self.current:
            self.lateness.record_answer(stamp.elapsed_ns / 1e9, waited_s, now)
