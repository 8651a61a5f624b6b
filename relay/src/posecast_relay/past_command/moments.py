"""Reads moments as somebody at this machine would say them."""

from __future__ import annotations

import re
from datetime import datetime

from posecast_relay.past_command.times import TimeError, read_time

FORM = "use 2026-11-22T14:20, with or without a zone, 14:20 of today, or a day as 2026-11-22"
CLOCK = re.compile(r"([01]?\d|2[0-3]):[0-5]\d(:[0-5]\d(\.\d{1,3})?)?", re.ASCII)
LOCAL = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d{1,3})?)?", re.ASCII | re.IGNORECASE)


def read_moment(text: str, *, is_end: bool = False) -> int:
    """Read a moment, unix ms: as `read_time` does, without a zone in that of this machine, or a time of
    today. Raises TimeError.
    """
    clock = CLOCK.fullmatch(text)
    said = (
        f"{datetime.now().astimezone():%Y-%m-%d}T{text.zfill(len(text) + (text[1] == ':'))}"
        if clock
        else text
    )
    try:
        if not LOCAL.fullmatch(said):
            return read_time(said, is_end=is_end)
        return read_time(datetime.fromisoformat(said.upper()).astimezone().isoformat(timespec="milliseconds"))
    except TimeError:
        raise TimeError(FORM) from None
    except (ValueError, OverflowError, OSError):
        raise TimeError(f"there is no such time: {FORM}") from None


def write_moment(unix_ms: int) -> str:
    """Write a moment in this machine's own zone, to the second, as `read_moment` reads it."""
    return datetime.fromtimestamp(unix_ms // 1000).astimezone().isoformat()
