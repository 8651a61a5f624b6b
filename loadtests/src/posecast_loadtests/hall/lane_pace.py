"""Decides when a lane viewer requests the next segment, by the page's rule (spa/src/stream/lane/)."""

from __future__ import annotations

from collections import deque

AHEAD_S = 0.8
HELD_FROM_S = 0.3  # the relay held a request that took longer than this
FOUND_AFTER = 3
RETRY_S = 1.0


class LanePace:
    """The time of the next request, in seconds of the viewer's clock.

    Segments carry times of the relay's clock. The viewer compares clocks only by how long after its end a
    segment arrived, taking the minimum of the last ten.
    """

    def __init__(self) -> None:
        self.due_s = 0.0
        self.is_found = False  # a request was held, so the rhythm of segments is known
        self._closes_s: deque[float] = deque(maxlen=10)
        self._spans_s: deque[float] = deque(maxlen=3)
        self._came = 0
        self._was_told_not_yet = False

    def take_segment(self, from_s: float, to_s: float, asked_s: float, now_s: float) -> None:
        """Note a segment that arrived. `from_s`, `to_s`: its own times; the others are by the viewer's
        clock."""
        self._closes_s.append(now_s - to_s)
        self._spans_s.append(to_s - from_s)
        self.is_found = (
            self.is_found
            or self._was_told_not_yet
            or now_s - asked_s > HELD_FROM_S
            or self._came >= FOUND_AFTER
        )
        self._came += 1
        self._was_told_not_yet = False
        due_s = to_s + min(self._closes_s) + min(self._spans_s) - AHEAD_S
        self.due_s = max(now_s, due_s) if self.is_found else now_s

    def take_not_yet(self, retry_s: float, now_s: float) -> None:
        """Note that the next segment does not exist yet. `retry_s`: the relay's retry time."""
        self._was_told_not_yet = True
        self.due_s = now_s + max(RETRY_S, retry_s)

    def wait(self, seconds: float, now_s: float) -> None:
        """Ask again after this time, for any reason."""
        self.due_s = now_s + seconds
