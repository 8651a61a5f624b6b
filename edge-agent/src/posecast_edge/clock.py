"""The agent's only clock. On Linux it keeps counting while the machine is suspended.

So a sample from before a laptop was closed counts as old when it is opened again, although
`time.monotonic()` stops during suspend. On other platforms this clock is `time.monotonic()`.
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
