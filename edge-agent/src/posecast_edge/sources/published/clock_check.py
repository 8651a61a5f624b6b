"""Compares the robot clock that a program passes with this machine's clock."""

from __future__ import annotations

from posecast_edge.sources.published.problems import ProblemList

LOOK_S = 1.0  # between two checks of the pace
BACK_S = 1.0  # threads that publish with their own times may be a little apart
UNITS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
BACK = "t stepped back by more than a second: does it come from another clock?"


class ClockCheck:
    """Reports to `problems` when the robot's time steps back, or seems to be in another unit."""

    def __init__(self, problems: ProblemList) -> None:
        self._problems = problems
        self._newest: tuple[float, float] | None = None
        self._began: tuple[float, float] | None = None

    def check_time(self, t_s: float, now_s: float) -> None:
        """Check one call. `t_s`: the robot's time that it passed; `now_s`: monotonic seconds."""
        if self._newest is not None and t_s < self._newest[0] - BACK_S:
            self._problems.add(BACK)
            self._began = None
        self._newest = (t_s, now_s)
        if self._began is None:
            self._began = self._newest
        passed_s = now_s - self._began[1]
        if passed_s < LOOK_S:
            return
        pace = (t_s - self._began[0]) / passed_s
        self._began = self._newest
        for factor, unit in UNITS.items():
            if 0.5 < pace / factor < 2:
                self._problems.add(f"t runs {factor:,.0f} times too fast: are these {unit}?")
