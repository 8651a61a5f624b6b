"""Reads and writes times in this machine's time zone, unless the text names another zone."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta

FORM = "use 2026-11-22T14:20 with or without a zone, 14:20 for today, or a date as 2026-11-22"
CLOCK = re.compile(r"([01]?\d|2[0-3]):[0-5]\d(:[0-5]\d(\.\d{1,3})?)?", re.ASCII)
DAY = re.compile(r"\d{4}-\d\d-\d\d", re.ASCII)
MOMENT = re.compile(
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,3})?)?(Z|[+-]\d\d:?\d\d)?", re.ASCII | re.IGNORECASE
)
MS_MAX = 253_370_764_800_000  # the year 9999


class TimeError(ValueError):
    """A text is not a time. The message is one line that shows the valid formats."""


def read_moment(text: str, *, is_end: bool = False) -> int:
    """Parse a time and return it in unix ms. Raises TimeError.

    Accepts ISO 8601 (without a zone it is local time), a time of today, or a date. A date means the start of
    that day, or its end with `is_end`.
    """
    if CLOCK.fullmatch(text):
        text = f"{datetime.now().astimezone():%Y-%m-%d}T{text.zfill(len(text) + (text[1] == ':'))}"
    try:
        if DAY.fullmatch(text):
            at = datetime.fromisoformat(text) + timedelta(days=1 if is_end else 0)
        elif MOMENT.fullmatch(text):
            at = datetime.fromisoformat(text.upper())
        else:
            raise TimeError(FORM)
        aware = at if at.tzinfo is not None else at.astimezone()
        unix_ms = (aware - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(milliseconds=1)
    except TimeError:
        raise
    except (ValueError, OverflowError, OSError):
        raise TimeError(f"not a valid time: {FORM}") from None
    if not 0 <= unix_ms <= MS_MAX:
        raise TimeError("use a time in 1970 or later")
    return unix_ms


def write_moment(unix_ms: int) -> str:
    """Write a time in this machine's zone, to the second, in a form that `read_moment` reads."""
    return datetime.fromtimestamp(min(unix_ms, MS_MAX) // 1000).astimezone().isoformat()


def write_moment_utc(unix_ms: int) -> str:
    """Write a time in UTC, to the second, in a form that `read_moment` reads."""
    return datetime.fromtimestamp(min(unix_ms, MS_MAX) // 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def write_length(ms: int) -> str:
    """Write a duration, to the second: 0:02:05."""
    seconds = (ms + 500) // 1000
    return f"{seconds // 3600}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"


def write_span(from_ms: int, to_ms: int) -> str:
    """Write a time span in this machine's zone, and also in UTC if that differs."""
    local, utc = (f"{write(from_ms)} to {write(to_ms)}" for write in (write_moment, write_moment_utc))
    return utc if local.replace("+00:00", "Z") == utc else f"{local} ({utc})"
