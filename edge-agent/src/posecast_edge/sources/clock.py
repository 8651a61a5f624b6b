"""The robot's clock as programs and files write it: in which unit, and whether it runs as a clock does."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Sequence

from posecast_edge.sample import WORDS

# unit → its seconds, and its name
UNITS_OF_TIME = {
    "s": (1.0, "seconds"),
    "ms": (1e-3, "milliseconds"),
    "us": (1e-6, "microseconds"),
    "ns": (1e-9, "nanoseconds"),
}
# time since 1970 is larger than this: in 1973 for seconds
SINCE_1970 = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
NO_TIME = 1e20  # three thousand years in nanoseconds
# from one row or line to the next, in that unit; a second is 1000 ms
STEPS = (("ns", 5e6), ("us", 5e3), ("ms", 5.0))


def guess_time_unit(times: Sequence[float], what: str) -> tuple[str, str]:
    """The unit of the first times of a file, or of a single time, and the reason for it; "" for seconds, the
    default. `what`: what has these times, "rows" or "lines"."""
    times = [t for t in times if abs(t) < NO_TIME]
    # of two clocks in one file, the one that counts since 1970 tells the unit; a stray time does not
    large = sorted(times, key=abs)[(len(times) - 1) * 3 // 4] if times else 0.0
    for unit, least in SINCE_1970:
        if abs(large) >= least:
            first = abs(times[0]) >= least
            return unit, f"it starts at {times[0]:.4g}" if first else f"it has times such as {large:.4g}"
    steps = sorted(b - a for a, b in itertools.pairwise(times) if b > a)
    for unit, least in STEPS:
        if len(steps) > 1 and steps[len(steps) // 2] >= least:
            return unit, f"its {what} are {steps[len(steps) // 2]:.4g} apart"
    return "s", ""


def read_time(t: object, unit: str = "s") -> float | None:
    """The robot time that a program gave as `t`, in seconds; None if it is no time: then the time of arrival
    counts (see `explain_time`). A number that is too large for `unit`, as a time since 1970, is in a smaller
    one."""
    try:
        number = math.nan if isinstance(t, WORDS) else float(t)  # type: ignore[arg-type]
    except Exception:  # a foreign __float__ may raise anything
        return None
    if not abs(number) < NO_TIME:
        return None
    if unit == "s" and abs(number) >= SINCE_1970[-1][1]:
        unit = guess_time_unit([number], "")[0]
    return number * UNITS_OF_TIME[unit][0]


def explain_time(t: object, shown: Callable[[object], str]) -> str:
    """What is to be said of `t`, which a program gave; "" if it is seconds. `shown`: makes a text of it."""
    if read_time(t) is None:
        return f"t is {shown(t)}, not a number of seconds; the time of arrival counts"
    number = float(t)  # type: ignore[arg-type]
    unit, why = guess_time_unit([number], "")
    return f"t is read as {UNITS_OF_TIME[unit][1]}, because {why}" if why else ""


def explain_step_back(before_s: float, t_s: float) -> str:
    """What is said of a file whose clock steps back from one time to another, in seconds."""
    return f"its clock steps back from {before_s:.3f} s to {t_s:.3f} s; the order in the file counts"


# --- does it run?

LOOK_S = 1.0  # between two checks of the pace
STANDS_S = 2.0  # a clock that has not moved for so long
BACK_S = 1.0  # threads that publish with their own times may be a little apart
BACK = "t stepped back by more than a second: does it come from another clock?"
BACK_A_LITTLE = "t stepped back: let it run on, also from one episode to the next"
STANDS = f"t has not changed for {STANDS_S:g} s: give the robot's clock, or leave t out"
CALLERS_MAX = 64


class ClockCheck:
    """Compares the robot clock that a program passes with this machine's clock. `say` is called with a line,
    the same for each problem of a kind, when the robot's time steps back, stands still, or seems to be in
    another unit."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._newest: tuple[float, float] | None = None
        self._began: tuple[float, float] | None = None
        self._moved_s = 0.0

    def check_time(self, t_s: float, now_s: float) -> None:
        """Check one call. `t_s`: the robot's time that it passed; `now_s`: monotonic seconds."""
        if self._newest is None or t_s != self._newest[0]:
            self._moved_s = now_s
        elif now_s - self._moved_s >= STANDS_S:
            self._say(STANDS)
        if self._newest is not None and t_s < self._newest[0] - BACK_S:
            self._say(BACK)
            self._began = None
        self._newest = (t_s, now_s)
        if self._began is None:
            self._began = self._newest
        passed_s = now_s - self._began[1]
        if passed_s < LOOK_S:
            return
        pace = (t_s - self._began[0]) / passed_s
        self._began = self._newest
        for unit_s, unit in list(UNITS_OF_TIME.values())[1:]:
            if 0.5 < pace * unit_s < 2:
                self._say(f"t runs {1 / unit_s:,.0f} times too fast: are these {unit}?")


class StepCheck:
    """Finds small steps back of `t` (ClockCheck finds large ones): each thread, and each set of fields that a
    thread publishes, may have its own clock. May be used from any thread."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._newest: dict[tuple[int, tuple[str, ...]], float] = {}

    def check_step(self, fields: tuple[str, ...], t_s: float) -> None:
        """Check the robot's time that one call passed together with these fields."""
        caller = (threading.get_ident(), fields)
        before_s = self._newest.get(caller)
        if before_s is not None or len(self._newest) < CALLERS_MAX:
            self._newest[caller] = t_s
        if before_s is not None and before_s - BACK_S <= t_s < before_s:
            self._say(BACK_A_LITTLE)
