"""When a frame goes out: as its sample arrives, and no more often than asked for. Pure.

A clock of its own would pick up samples of any age up to the source's period. So a frame that is due waits
for the next sample and leaves with it; when none comes, the last one goes out after all.
"""

from __future__ import annotations

EARLY = 1 / 8  # of the interval: a sample so little before its time is taken
# Of the interval: so long a frame waits for a newer sample than the one there is. More than one interval, or
# of a source hardly faster than `hz` every sample would leave late rather than one in hundreds be skipped.
LATE = 5 / 4


class FramePacer:
    """One stream's rate. Times are monotonic seconds; `hz` may change at any time."""

    def __init__(self, hz: float, now_s: float) -> None:
        self.hz = hz
        self._next_s = now_s

    @property
    def from_s(self) -> float:
        """From when on a sample that arrives makes a frame."""
        return self._next_s - EARLY / self.hz

    @property
    def longest_s(self) -> float:
        """How long a sample waits at most."""
        return (1 + LATE) / self.hz

    def is_due(self, now_s: float) -> bool:
        """A sample arrives: whether a frame leaves with it."""
        return now_s >= self.from_s

    def compute_wait_s(self, now_s: float) -> float:
        """How long a sample that waits goes on waiting when no newer one arrives; 0: it leaves now."""
        return max(0.0, self._next_s + LATE / self.hz - now_s)

    def record_frame(self, now_s: float) -> None:
        """A frame left. One that was late is not made up for: it would be an old pose."""
        self._next_s = max(self._next_s + 1 / self.hz, now_s)
