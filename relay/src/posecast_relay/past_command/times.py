"""Reads times as people write them, and writes them so that they can be read again."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

FORM = "use a day as 2026-11-22, or a time with its zone as 2026-11-22T14:20:00Z"
DAY = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
MOMENT = re.compile(
    r"\d{4}-\d\d-\d\dT\d\d:\d\d(:\d\d(\.\d{1,3})?)?(Z|[+-]\d\d:\d\d)", re.ASCII | re.IGNORECASE
)
MS_MAX = 253_370_764_800_000  # the year 9999


class TimeError(ValueError):
    """No time. The message is one line that says how to write one."""


def read_time(text: str, *, is_end: bool = False) -> int:
    """Read a time, unix ms: ISO 8601 with a zone, or a day of this machine's own zone, of which it is the
    beginning, or the end with `is_end`. Raises TimeError.
    """
    try:
        if DAY.fullmatch(text):
            day = datetime.fromisoformat(text) + timedelta(days=1 if is_end else 0)
            at = day.astimezone()
        elif MOMENT.fullmatch(text):
            at = datetime.fromisoformat(text.upper())
        else:
            raise TimeError(FORM)
        unix_ms = (at - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(milliseconds=1)
    except TimeError:
        raise
    except (ValueError, OverflowError, OSError):
        raise TimeError(f"there is no such day or time: {FORM}") from None
    if not 0 <= unix_ms <= MS_MAX:
        raise TimeError("use a time from 1970 on")
    return unix_ms


def write_time(unix_ms: int) -> str:
    """Write a time in UTC, to the second, as `read_time` reads it."""
    return datetime.fromtimestamp(min(unix_ms, MS_MAX) // 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
