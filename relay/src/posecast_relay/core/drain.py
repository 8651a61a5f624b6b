"""Disconnects viewers gradually when a relay stops, so that they do not all reconnect at once."""

from __future__ import annotations

from collections.abc import Sequence

from posecast_relay.core.viewer.viewer import Viewer

SPREAD_S = 6.5  # platforms kill a process 10 s after SIGTERM; closing politely takes up to 2 s more
PER_S = 100.0  # a small number of viewers finishes sooner
STEP_S = 0.1


class Drain:
    """Returns viewers in `order`. The caller shuffles it: viewers that joined together should not return
    together."""

    def __init__(self, order: Sequence[Viewer], now: float) -> None:
        self._order = order
        self._began = now
        self._spread_s = min(SPREAD_S, len(order) / PER_S)
        self._gone = 0
        self.wake_at = now

    def take_due(self, now: float) -> Sequence[Viewer]:
        """Return the viewers to close now, and set `wake_at` to when the next ones are due."""
        if now < self.wake_at:
            return ()
        elapsed_s = now + STEP_S - self._began
        upto = len(self._order)
        if elapsed_s < self._spread_s:
            upto = int(upto * elapsed_s / self._spread_s)
        due = self._order[self._gone : upto]
        self._gone = upto
        self.wake_at = float("inf") if upto == len(self._order) else now + STEP_S
        return due
