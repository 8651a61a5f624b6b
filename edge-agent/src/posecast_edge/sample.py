"""What a robot reported at one instant, as every source delivers it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

# One channel of one sample. A number in the field's unit; None or NaN: no reading; flags: an int mask or
# a list of bit names.
Reading = float | int | Sequence[str] | None
Values = Sequence[Reading] | Mapping[str, Reading]

TIME_MAX_S = 1e12  # robot time: beyond it a double loses the milliseconds
WORDS = (str, bytes, bytearray, bool)  # float() accepts them, but they are not meant as numbers


class SourceError(Exception):
    """A source can't open or can't continue. The message is one line for the user."""


NOTHING: Mapping[str, str] = MappingProxyType({})


class Sample(NamedTuple):
    """What the robot reported at one instant.

    `t_s`: the robot's clock, seconds. `values`: field name → values in the order of the field's labels, or by
    label; the source must not change them afterwards. `info`: strings that change rarely (mode, battery
    name). `where`: the place it was read from, for messages ("line 12"). `exact`: the values follow the
    source's profile: sequences of floats (masks: ints) and None in the order of its labels; a field is then
    read only when it is needed. `links`: site → link of the model, if the robot reports where its sensors are
    mounted. `sliding`: joints that the robot reports as sliding: their units are m, m/s and N.
    `newest`: False when a newer sample follows at once; it then causes events, but no frame.
    """

    t_s: float
    values: Mapping[str, Values]
    info: Mapping[str, str] = NOTHING
    where: str = ""
    exact: bool = False
    links: Mapping[str, str] = NOTHING
    newest: bool = True
    sliding: frozenset[str] = frozenset()


# --- robot time, as programs and files write it

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
    for unit, least in SINCE_1970:
        if times and min(map(abs, times)) >= least:
            return unit, f"it starts at {times[0]:.4g}"
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
