"""JSON documents about the past. Each contains only data about segments that the caller may see.

Also parses the parts of a past URL: days, pages of ten minutes, takes, indexes, hashes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Literal, NamedTuple

from posecast_wire.messages import RobotStatus
from pydantic import BaseModel, ConfigDict

from posecast_relay.core.policy import Grant
from posecast_relay.kit import json_bytes
from posecast_relay.logging import visible
from posecast_relay.net.answer_cache import AnswerDocument
from posecast_relay.past.index import MinuteRow
from posecast_relay.past.segment import KeptSegment, SegmentName

DAY = re.compile(r"(20[0-9]{2})-([0-9]{2})-([0-9]{2})", re.ASCII)
PAGE = re.compile(r"(20[0-9]{2}-[0-9]{2}-[0-9]{2})T([01][0-9]|2[0-3]):([0-5])0Z", re.ASCII)
U64_HEX = re.compile(r"[0-9a-f]{16}", re.ASCII)
SHA256_HEX = re.compile(r"[0-9a-f]{64}", re.ASCII)
INDEX = re.compile(r"0|[1-9][0-9]{0,9}", re.ASCII)
INDEX_MAX = (1 << 32) - 1
EVERY_MAX = 1000
EVERY_STEPS = 150  # segments of 4 s in ten minutes: larger steps mean the same, one pose for all
DAY_MS = 86_400_000
PAGE_MS = 600_000
MINUTE_MS = 60_000
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
    if not U64_HEX.fullmatch(text):
        raise AddressError(f"a take is 16 lower-case hexadecimal digits{_quote(text)}")
    return int(text, 16)


def read_index(text: str) -> int:
    """Parse a segment's index in its take. Raises AddressError."""
    if not INDEX.fullmatch(text) or int(text) > INDEX_MAX:
        raise AddressError(f"an index is a number from 0 to {INDEX_MAX}, without leading zeros{_quote(text)}")
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
    if not SHA256_HEX.fullmatch(text):
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


class PastExtent(NamedTuple):
    """The first and last time with data, unix ms, the starts of the days that have data, and the newest
    segment.

    None or empty if there is nothing. `deleted`: spans in which nothing is left, unix ms.
    """

    from_ms: int | None = None
    to_ms: int | None = None
    newest: SegmentName | None = None
    days_ms: tuple[int, ...] = ()
    deleted: tuple[tuple[int, int], ...] = ()


INDEX_BYTES_MAX = 1 << 20  # of one page's response; request the rest with `after`
WORDS: tuple[RobotStatus, ...] = ("online", "silent", "offline")  # worst last


class NamedSegment(AnswerDocument):
    """A segment: `take` is 16 hexadecimal digits, `index` counts within it from 0."""

    take: str
    index: int


class DeletedSpan(AnswerDocument):
    """A time span, unix ms: nothing is left of the segments that overlapped it."""

    from_ms: int
    to_ms: int


class PastSummary(AnswerDocument):
    """How far back the caller may look, what exists, and what was deleted. Times are unix ms; null or empty
    if there is nothing."""

    view: str
    from_ms: int | None
    to_ms: int | None
    past_ms: int
    delay_ms: int
    newest: NamedSegment | None
    days: list[str]
    deleted: list[DeletedSpan]


class PastMinute(AnswerDocument):
    """The segments that began in one minute: bytes, frames, the worst status, and how many faults began."""

    minute: str
    bytes: int
    frames: int
    word: Literal["online", "silent", "offline"]
    faults: int


class PastDay(AnswerDocument):
    """The minutes of a day (UTC) that have recordings."""

    view: str
    day: str
    minutes: list[PastMinute]


class PastEventEntry(BaseModel):
    """An event as every viewer got it (SPEC §6), with its number `n` and its time of arrival, unix ms."""

    model_config = ConfigDict(extra="allow")
    n: int
    at_ms: int


class PastWordEntry(AnswerDocument):
    """The robot's status from this time on, unix ms."""

    at_ms: int
    word: Literal["online", "silent", "offline"]


class PastEntry(NamedSegment):
    """A segment in an index. `missing`: frames lost before it; hashes are hexadecimal."""

    run: str
    from_ms: int
    to_ms: int
    frames: int
    first_seq: int
    last_seq: int
    bytes: int
    sha256: str
    schema_: str | None
    model: str | None
    missing: int
    events: list[PastEventEntry]
    words: list[PastWordEntry]


class PastPage(AnswerDocument):
    """The segments that begin in ten minutes. `more`: there are more; request them with `after` and the last
    one."""

    view: str
    from_: str
    segments: list[PastEntry]
    more: bool


class NextSegment(AnswerDocument):
    """The segment that follows one that is hidden or gone, or the last one of a take."""

    next: NamedSegment


def make_summary(grant: Grant, extent: PastExtent) -> bytes:
    """Return how far back a caller may look, as JSON."""
    return json_bytes(
        {
            "view": grant.view,
            "from_ms": extent.from_ms,
            "to_ms": extent.to_ms,
            "past_ms": round(1000 * grant.past_s),
            "delay_ms": round(1000 * grant.delay_s),
            "newest": None if extent.newest is None else _name(extent.newest),
            "days": [write_day(day_ms) for day_ms in extent.days_ms],
            "deleted": [{"from_ms": from_ms, "to_ms": to_ms} for from_ms, to_ms in extent.deleted],
        }
    )


def make_no_summary(grant: Grant) -> bytes:
    """Return that the caller may not look back at all, as JSON."""
    return make_summary(replace(grant, past_s=0.0), PastExtent())


def make_day(view: str, day: PastSpan, shown: Iterable[MinuteRow]) -> bytes:
    """Return a row for each minute of a day, as JSON."""
    minutes: dict[int, list[MinuteRow]] = {}
    for row in shown:
        minutes.setdefault(row.at_ms, []).append(row)
    found = [_sum_minute(at_ms, rows) for at_ms, rows in sorted(minutes.items())]
    return json_bytes({"view": view, "day": write_day(day.from_ms), "minutes": found})


def make_page(view: str, page: PastSpan, shown: Iterable[KeptSegment]) -> bytes:
    """Return the index of ten minutes, or of a single segment, as JSON of at most INDEX_BYTES_MAX."""
    entries: list[bytes] = []
    size, more = 0, False
    for segment in shown:
        entry = _write_entry(segment)
        size += len(entry) + 1
        if entries and size > INDEX_BYTES_MAX:
            more = True
            break
        entries.append(entry)
    head = json_bytes({"view": view, "from": write_minute(page.from_ms)})[:-1]
    return head + b',"segments":[' + b",".join(entries) + b'],"more":' + (b"true}" if more else b"false}")


def make_next(name: SegmentName) -> bytes:
    """Return the name of the next segment, as JSON."""
    return json_bytes({"next": _name(name)})


def _name(name: SegmentName) -> dict[str, object]:
    return {"take": f"{name.take:016x}", "index": name.index}


def _sum_minute(at_ms: int, rows: Sequence[MinuteRow]) -> dict[str, object]:
    return {
        "minute": write_minute(at_ms),
        "bytes": sum(row.bytes for row in rows),
        "frames": sum(row.frames for row in rows),
        "word": max((row.word for row in rows), key=WORDS.index),
        "faults": sum(row.faults for row in rows),
    }


ENTRY = (
    '{"take":"%016x","index":%d,"run":"%016x","from_ms":%d,"to_ms":%d,"frames":%d,"first_seq":%d,"last_seq":%d,'
    '"bytes":%d,"sha256":"%s","schema":%s,"model":%s,"missing":%d,"words":[%s],"events":[%s]}'
)


def _write_entry(segment: KeptSegment) -> bytes:
    """Write a segment's entry by hand: there are hundreds, and their values need no escaping."""
    name, schema = segment.name, segment.schema
    numbers = (name.take, name.index, segment.run, segment.from_ms, segment.to_ms, segment.frames)
    words = ",".join(f'{{"at_ms":{each.at_ms},"word":"{each.word}"}}' for each in segment.words)
    # copy events as they are, without parsing them
    events = ",".join(f'{{"at_ms":{each.at_ms},{each.text[1:]}' for each in segment.events)
    hashes = (
        segment.sha256.hex(),
        "null" if schema is None else f'"{schema.hex()}"',
        "null" if segment.model is None else f'"{segment.model}"',
    )
    seqs = (segment.first_seq, segment.last_seq, segment.size)
    return (ENTRY % (*numbers, *seqs, *hashes, segment.missing, words, events)).encode(errors="replace")
