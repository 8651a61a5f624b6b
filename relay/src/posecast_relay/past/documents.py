"""JSON documents about the past. Each contains only data about segments that the caller may see."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

from posecast_wire.messages import RobotStatus
from pydantic import BaseModel, ConfigDict

from posecast_relay.core.policy import Grant
from posecast_relay.kit import json_bytes
from posecast_relay.net.answer_cache import AnswerDocument
from posecast_relay.past.address import PastSpan, write_day, write_minute
from posecast_relay.past.index import MinuteRow
from posecast_relay.past.segment import KeptSegment, SegmentName


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
