"""The edge's one clock. It also counts the time that this machine slept, where the platform can tell.

What was taken before a laptop was closed is old when it is opened again, although `time.monotonic()` stood
still meanwhile. Linux can tell; elsewhere this is `time.monotonic()`.
"""

from __future__ import annotations

import time

_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def now_ns() -> int:
    """Nanoseconds since some moment; never backwards."""
    return time.monotonic_ns() if _BOOTTIME is None else time.clock_gettime_ns(_BOOTTIME)


def now_s() -> float:
    """The same in seconds."""
    return now_ns() / 1e9
