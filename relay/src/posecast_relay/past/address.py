"""The parts of an address of the past: days, pages of ten minutes, takes, indexes, hashes."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import NamedTuple

from posecast_relay.logging import visible
from posecast_relay.past.segment import DAY_MS, PAGE_MS, SHA256, U32_MAX, U64

DAY = re.compile(r"(20[0-9]{2})-([0-9]{2})-([0-9]{2})", re.ASCII)
PAGE = re.compile(r"(20[0-9]{2}-[0-9]{2}-[0-9]{2})T([01][0-9]|2[0-3]):([0-5])0Z", re.ASCII)
INDEX = re.compile(r"0|[1-9][0-9]{0,9}", re.ASCII)
EVERY_MAX = 1000
EVERY_STEPS = 150  # segments of 4 s in ten minutes: larger steps mean the same, one pose for all
TEN_MINUTES = "ten minutes in UTC as 2026-11-22T14:20Z (the minute ends in 0)"
YEARS = "from 2000 to 2099"
SHOWN_MAX = 40  # the most characters that a refusal quotes


class AddressError(ValueError):
    """An invalid part of a URL. The message is one line that names the valid form."""


class PastSpan(NamedTuple):
    """A day or ten minutes in UTC: unix ms, end exclusive."""

    from_ms: int
    to_ms: int

    @property
    def is_day(self) -> bool:
        """Whether it is a day."""
        return self.to_ms - self.from_ms == DAY_MS


def read_span(text: str) -> PastSpan:
    """Parse a day as `2026-11-22` or ten minutes as `2026-11-22T14:20Z`. Raises AddressError."""
    day = DAY.fullmatch(text)
    if day is not None:
        from_ms = _read_day_ms(text)
        return PastSpan(from_ms, from_ms + DAY_MS)
    if not PAGE.fullmatch(text):
        raise AddressError(f"want a day as 2026-11-22, or {TEN_MINUTES}, {YEARS}{_quote(text)}")
    return read_page(text)


def read_page(text: str) -> PastSpan:
    """Parse the ten minutes of a page of KEYs as `2026-11-22T14:20Z`. Raises AddressError."""
    page = PAGE.fullmatch(text)
    if page is None:
        raise AddressError(f"KEYs: want {TEN_MINUTES}, {YEARS}{_quote(text)}")
    from_ms = _read_day_ms(page[1]) + int(page[2]) * 3_600_000 + int(page[3]) * PAGE_MS
    return PastSpan(from_ms, from_ms + PAGE_MS)


def read_take(text: str) -> int:
    """Parse a take: 16 hexadecimal digits. Raises AddressError."""
    if not U64.fullmatch(text):
        raise AddressError(f"a take is 16 lower-case hexadecimal digits{_quote(text)}")
    return int(text, 16)


def read_index(text: str) -> int:
    """Parse a segment's index in its take. Raises AddressError."""
    if not INDEX.fullmatch(text) or int(text) > U32_MAX:
        raise AddressError(f"an index is a number from 0 to {U32_MAX}, without leading zeros{_quote(text)}")
    return int(text)


def read_after(text: str) -> tuple[int, int]:
    """Parse `take,index`. Raises AddressError."""
    take, comma, index = text.partition(",")
    if not comma:
        raise AddressError(f"after: want a take, a comma and an index{_quote(text)}")
    try:
        return read_take(take), read_index(index)
    except AddressError as e:
        raise AddressError(f"after: {e}") from None


def read_every(text: str) -> int:
    """Parse how many segments share one KEY. Values above EVERY_STEPS count as that, so that caches see few
    names for one page.

    Raises AddressError.
    """
    if not INDEX.fullmatch(text) or not 1 <= int(text) <= EVERY_MAX:
        raise AddressError(f"every: want a number from 1 to {EVERY_MAX}, without leading zeros{_quote(text)}")
    return min(int(text), EVERY_STEPS)


def read_sha256(text: str) -> bytes:
    """Parse a SHA-256: 64 hexadecimal digits. Raises AddressError."""
    if not SHA256.fullmatch(text):
        raise AddressError(f"a SHA-256 is 64 lower-case hexadecimal digits{_quote(text)}")
    return bytes.fromhex(text)


def write_day(unix_ms: int) -> str:
    """Return the day of a time as it appears in a URL."""
    return datetime.fromtimestamp(unix_ms // 1000, UTC).strftime("%Y-%m-%d")


def write_minute(unix_ms: int) -> str:
    """Return the minute of a time as it appears in a URL."""
    return datetime.fromtimestamp(unix_ms // 1000, UTC).strftime("%Y-%m-%dT%H:%MZ")


def _read_day_ms(text: str) -> int:
    try:
        return round(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp()) * 1000
    except ValueError:
        raise AddressError(f"there is no such day{_quote(text)}") from None


def _quote(text: str) -> str:
    """Quote the rejected text, shortened and printable."""
    return f"; got '{visible(text, SHOWN_MAX)}'"
