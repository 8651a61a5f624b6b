"""Decides when frames are sent: when a sample arrives, and at most at the requested rate. Does no I/O.

A timer that ignores the samples would send samples of any age up to the source's period. So a due frame waits
for the next sample. If none arrives in time, the newest sample is sent.
"""

from __future__ import annotations

EARLY = 1 / 8  # of the interval: a sample that arrives this little early is sent
# Of the interval: how long a due frame waits for a newer sample. More than one interval: otherwise every
# sample of a source slightly faster than `hz` would be delayed, instead of one in hundreds skipped.
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
        """Whether a sample that arrives at `now_s` should be sent as a frame at once."""
        return now_s >= self.from_s

    def compute_wait_s(self, now_s: float) -> float:
        """How many more seconds a waiting sample is held if no newer one arrives; 0: send it now."""
        return max(0.0, self._next_s + LATE / self.hz - now_s)

    def record_frame(self, now_s: float) -> None:
        """Record that a frame is sent at `now_s`. A late frame does not make the next one earlier."""
        self._next_s = max(self._next_s + 1 / self.hz, now_s)
