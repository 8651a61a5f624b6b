"""Decides when the viewers of one rate are due.

The edge's clock (the stamp on each frame) decides, not the arrival time. So network jitter does not turn
every third frame into every second or fourth. If the source's rate is close to a whole multiple of the
viewer's, exactly every n-th frame is due. Otherwise due times advance by the period, so the mean rate is
right.
"""

from __future__ import annotations

from collections import deque

from posecast_wire import clamp_hz

SAMPLES = 16
WHOLE = 0.05  # a ratio of rates this close to a whole number, relatively, counts as whole
BURST = 0.5  # frames that were delayed and arrive together go out at least this part of a period apart


def grant_hz(asked_hz: float, most_hz: float) -> float:
    """Return the rate in Hz that a viewer gets. Rates go in steps, so that there are at most about 300.

    The steps are 0.01 Hz up to 1 Hz, 0.1 Hz up to 10 Hz, then 0.5 Hz. 0 stays 0; any other rate is at least
    0.1 Hz.
    """
    hz = clamp_hz(max(0.0, min(asked_hz, most_hz)))
    steps_per_hz = 100 if hz < 1 else 10 if hz < 10 else 2
    return min(round(hz * steps_per_hz) / steps_per_hz, clamp_hz(most_hz))


class Cadence:
    """A stream's frame interval in seconds, from its stamps.

    A robot that does not change skips frames, so long steps don't count: it is the mean of those near the
    lower quartile.
    """

    def __init__(self) -> None:
        self.interval_s = 0.0  # 0 = not known yet
        # recent frames a second; not 1 / interval_s: an agent that takes 30 of a source's 50 samples a second
        # stamps frames 20 or 40 ms apart, so the quartile is 20 ms
        self.hz = 0.0
        self._last_s = 0.0
        self._steps: deque[float] = deque(maxlen=SAMPLES)

    def record_stamp(self, stamp_s: float) -> None:
        """Note the stamp, in seconds, of an accepted frame."""
        step = stamp_s - self._last_s
        self._last_s = stamp_s
        if 0.0 < step < 10.0:
            self._steps.append(step)
            if len(self._steps) >= 4:
                ordered = sorted(self._steps)
                near = [s for s in ordered if s <= 1.5 * ordered[len(ordered) // 4]]
                self.interval_s = sum(near) / len(near)
                self.hz = len(ordered) / sum(ordered)


class RateTimer:
    """Decides which frames of one stream are due at one rate."""

    def __init__(self, hz: float) -> None:
        self.period_s = 1.0 / hz
        self.sent_at = float("-inf")  # by the relay's clock
        self._due_s = float("-inf")  # by the edge's clock
        self._run_id = 0

    def is_due(self, run_id: int, stamp_s: float, interval_s: float, now: float) -> bool:
        """Whether a frame stamped `stamp_s` that arrives at `now` is due at this rate."""
        if run_id != self._run_id:
            return True
        ratio = self.period_s / interval_s if interval_s else 1.0
        if ratio <= 1.0 + WHOLE:
            return True
        return stamp_s >= self._due_s - interval_s / 2 and now >= self.sent_at + BURST * self.period_s

    def record_sent(self, run_id: int, stamp_s: float, interval_s: float, now: float) -> None:
        """Note that this frame was sent."""
        ratio = self.period_s / interval_s if interval_s else 1.0
        counted = run_id == self._run_id and abs(stamp_s - self._due_s) <= self.period_s
        whole = abs(ratio - round(ratio)) <= WHOLE * ratio
        self._due_s = (self._due_s if counted and not whole else stamp_s) + self.period_s
        self._run_id = run_id
        self.sent_at = now
