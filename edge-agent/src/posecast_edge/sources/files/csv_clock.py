"""Finds the clock column of a table, and its unit. Does no I/O.

The unit comes from the name (`t_ms`, `time [us]`), from the program that wrote it (`%time` of `rostopic echo
-p` is nanoseconds), or from the values: ISO 8601, or numbers as large as the time since 1970. Otherwise it is
seconds, unless the rows would then be too far apart.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone

CLOCK = re.compile(r"(?:__|%)?(?:t|time|timestamp|stamp|datetime)(?:_(s|ms|us|ns))?", re.IGNORECASE)
STAMP = re.compile(r"(?:.*[/.])?header[/.]stamp")
UNNAMED = re.compile(r"|index|date|unnamed: 0", re.IGNORECASE)  # where pandas writes a time
UNIT = re.compile(r"(.*\S)\s*[\[(](s|ms|us|µs|ns)[\])]")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9})\d*)?)?\s?(?:(Z)|([+-])(\d\d):?(\d\d))?"
)
NUMBER = re.compile(r"[-+]?\d{1,30}(?:[.,]\d{0,30})?(?:[eE][-+]?\d{1,3})?")
# time since 1970 is larger than this: in 1973 for seconds
SINCE_1970 = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
NO_TIME = 1e20  # three thousand years in nanoseconds
STEPS = (("ns", 5e6), ("us", 5e3), ("ms", 5.0))  # from one row to the next, in that unit; a second is 1000 ms


@dataclass(frozen=True)
class TableClock:
    """The column (counted from 0) and its unit, `iso` for ISO 8601. `guessed`: the reason for a guessed unit,
    "" for one that the name states."""

    index: int
    unit: str
    guessed: str = ""

    def convert_cell(self, cell: str, number: float | None) -> float | None:
        """The time in a cell, in seconds; None when it has none. `number`: the cell as a number."""
        if self.unit == "iso":
            return parse_iso_time(cell)
        return None if number is None else number * SECONDS[self.unit]


def find_clock(names: Sequence[str], rows: Sequence[Sequence[str]]) -> TableClock | None:
    """The clock among the columns; None if there is none. `rows`: the table's first rows."""
    for pattern, only_iso in ((CLOCK, False), (STAMP, False), (UNNAMED, True)):
        for i, name in enumerate(names):
            said = UNIT.fullmatch(name)
            found = pattern.fullmatch(said[1] if said else name)
            cells = [row[i] for row in rows if i < len(row) and row[i]]
            is_iso = bool(cells) and parse_iso_time(cells[0]) is not None
            if not found or (only_iso and not is_iso):
                continue
            if is_iso:
                return TableClock(i, "iso")
            told = said[2] if said else found[1] if pattern is CLOCK else None
            if told or name.startswith("%"):
                return TableClock(i, told.lower() if told else "ns")
            return TableClock(i, *_guess_unit(cells))
    return None


def _guess_unit(cells: Sequence[str]) -> tuple[str, str]:
    """The unit, and the reason for it; "" for seconds, the default."""
    numbers = (float(cell.replace(",", ".")) for cell in cells if NUMBER.fullmatch(cell))
    times = [number for number in numbers if abs(number) < NO_TIME]
    for unit, least in SINCE_1970:
        if times and min(map(abs, times)) >= least:
            return unit, f"it starts at {times[0]:.4g}"
    steps = sorted(b - a for a, b in itertools.pairwise(times) if b > a)
    for unit, least in STEPS:
        if len(steps) > 1 and steps[len(steps) // 2] >= least:
            return unit, f"its rows are {steps[len(steps) // 2]:.4g} apart"
    return "s", ""


def parse_iso_time(cell: str) -> float | None:
    """Parse `2026-11-23T10:00:00.123456789+01:00` to seconds since 1970; None for anything else. Without a
    time zone it is UTC."""
    found = ISO.fullmatch(cell)
    if found is None:
        return None
    year, month, day, hour, minute, second = (int(part or 0) for part in found.groups()[:6])
    try:
        at = datetime(year, month, day, hour, minute, second, tzinfo=timezone.utc)
    except ValueError:
        return None
    if found[9]:
        ahead = timedelta(hours=int(found[10]), minutes=int(found[11]))
        seconds = at.timestamp() - ahead.total_seconds() * (1 if found[9] == "+" else -1)
    else:
        seconds = at.timestamp()
    return seconds + float(f"0.{found[7] or 0}")
