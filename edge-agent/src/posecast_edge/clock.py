"""The agent's one clock. Where the platform allows it, it also counts the time this machine was suspended.

A sample taken before a laptop was closed is old when the laptop is opened again, although `time.monotonic()`
stood still meanwhile. Linux has such a clock; elsewhere this is `time.monotonic()`.
"""

from __future__ import annotations

import time

_BOOTTIME: int | None = getattr(time, "CLOCK_BOOTTIME", None)


def now_ns() -> int:
    """Nanoseconds since an arbitrary moment; never goes backwards."""
    return time.monotonic_ns() if _BOOTTIME is None else time.clock_gettime_ns(_BOOTTIME)


def now_s() -> float:
    """Seconds since the same arbitrary moment as `now_ns`; never goes backwards."""
    return now_ns() / 1e9
