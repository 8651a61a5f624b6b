"""Decides when frames are sent: when a sample arrives, and at most at the requested rate. Does no I/O.

A timer independent of the samples would send samples of any age up to the source's period. So a frame that is
due waits for the next sample; when none arrives in time, the newest sample so far is sent.
"""

from __future__ import annotations

EARLY = 1 / 8  # of the interval: a sample so little before its time is taken
# Of the interval: so long a frame waits for a newer sample than the one there is. More than one interval, or
# of a source hardly faster than `hz` every sample would leave late rather than one in hundreds be skipped.
LATE = 5 / 4


class FramePacer:
    """Paces the frames of one stream. Times are monotonic seconds; `hz` may change at any time."""

    def __init__(self, hz: float, now_s: float) -> None:
        self.hz = hz
        self._next_s = now_s

    @property
    def from_s(self) -> float:
        """Time from which an arriving sample is sent at once."""
        return self._next_s - EARLY / self.hz

    @property
    def longest_s(self) -> float:
        """The longest time that a sample waits, in seconds."""
        return (1 + LATE) / self.hz

    def is_due(self, now_s: float) -> bool:
        """Whether a sample that arrives now is to be sent as a frame at once."""
        return now_s >= self.from_s

    def compute_wait_s(self, now_s: float) -> float:
        """How many more seconds a waiting sample is held if no newer one arrives; 0: send it now."""
        return max(0.0, self._next_s + LATE / self.hz - now_s)

    def record_frame(self, now_s: float) -> None:
        """Note that a frame is sent now. A late frame does not make the next one earlier."""
        self._next_s = max(self._next_s + 1 / self.hz, now_s)
