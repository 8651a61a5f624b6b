"""Lowers the rates of viewers when the process can't keep up. Rates fall before any viewer is refused.

Load is judged once a second by three figures: the median lateness of the event loop, its share of a core, and
the share of viewers that could not take their last frame (their sockets are full or, behind a proxy, their
acknowledgements are late). One bad second means nothing: it can be a burst of joins or a paused process.
After a step down that helped, steps up are tried. Each step up that proves too early doubles the wait.
"""

from __future__ import annotations

from collections import deque
from statistics import median

RUNGS = (30.0, 15.0, 10.0, 5.0, 2.0, 1.0)
NO_CEILING = float("inf")
LATE_S, IN_TIME_S = 0.15, 0.05  # above the first: overload; below the second: calm; in between: no change
BUSY, IDLE = 0.92, 0.6
PRESSED, EASY = 0.5, 0.2
# A viewer that does not read is throttled alone and soon cut, so only a crowd counts. Viewers control this
# figure and none may hurt another, so it never lowers the rate below this.
CROWD, PRESSED_FLOOR_HZ = 20, 10.0
BAD_SECONDS = 3  # of overload before a step down
CALM_SECONDS, CALM_SECONDS_MAX = 5, 80  # of calm before a step up
TOO_EARLY_S = 15.0  # a step down this soon means that the step up was too early


class LoadShedder:
    """Sets `ceiling_hz`, the highest rate in Hz at which any viewer is served, from the measured load."""

    def __init__(self) -> None:
        self.ceiling_hz = NO_CEILING
        self._lags: deque[float] = deque(maxlen=100)
        self._bad = 0
        self._calm = 0
        self._patience = CALM_SECONDS
        self._raised_at = float("-inf")

    def record_lag(self, lag_s: float) -> None:
        """Note how many seconds late a timer of the event loop fired. Called about ten times a second."""
        self._lags.append(lag_s)

    def measure_load(self, busy: float, behind: int, viewers: int, fastest_hz: float, now: float) -> bool:
        """Judge the last second. Returns True if `ceiling_hz` has changed. Called once a second.

        `busy`: the share of that second, 0 to 1, that the loop spent computing; `behind`: viewers that could
        not take their last frame; `fastest_hz`: the highest rate that is served or, under a ceiling,
        requested.
        """
        lag_s = median(self._lags) if self._lags else 0.0
        self._lags.clear()
        pressed = behind / viewers if viewers >= CROWD else 0.0
        loop_bad = lag_s > LATE_S or busy > BUSY
        bad = loop_bad or (pressed > PRESSED and min(self.ceiling_hz, fastest_hz) > PRESSED_FLOOR_HZ)
        calm = lag_s < IN_TIME_S and busy < IDLE and pressed < EASY
        self._bad = self._bad + 1 if bad else 0
        self._calm = self._calm + 1 if calm else 0
        if self._bad >= BAD_SECONDS:
            self._bad = 0
            return self._lower(fastest_hz, now)
        if self._calm >= self._patience and self.ceiling_hz != NO_CEILING:
            self._calm = 0
            return self._raise(fastest_hz, now)
        return False

    def _lower(self, fastest_hz: float, now: float) -> bool:
        served_hz = min(self.ceiling_hz, fastest_hz)
        below = [hz for hz in RUNGS if hz < served_hz]
        if not below:
            return False
        too_early = now - self._raised_at < TOO_EARLY_S
        self._patience = min(2 * self._patience, CALM_SECONDS_MAX) if too_early else CALM_SECONDS
        self.ceiling_hz = below[0]
        return True

    def _raise(self, fastest_hz: float, now: float) -> bool:
        above = [hz for hz in RUNGS if hz > self.ceiling_hz]
        self.ceiling_hz = above[-1] if above and above[-1] < fastest_hz else NO_CEILING
        self._raised_at = now
        return True
