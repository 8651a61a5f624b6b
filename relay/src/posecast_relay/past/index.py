"""The index of one day of a robot's view: a row per minute and, per ten minutes, the takes, schemas and
models.

It is built from segments alone, so it can be rebuilt at any time. Input is not trusted: malformed input
raises ValueError with a one-line message.

From it follows a summary for looking through months: which audiences could see anything of a day, and when.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

from posecast_wire.checked import loads
from posecast_wire.messages import RobotStatus

from posecast_relay.core.policy import Audience
from posecast_relay.past.segment import (
    DAY_MS,
    MINUTE_MS,
    PAGE_MS,
    SHA256,
    U32_MAX,
    U64,
    WHOLE_MAX,
    WORDS,
    KeptSegment,
    PastWord,
    TakeSpan,
    dump_json,
    pack_audiences,
    unpack_audiences,
)

T = TypeVar("T")

VERSION = 1
DAY_BYTES_MAX = 8 << 20
ROWS_MAX = 4096  # of one kind, in ten minutes
LONGEST_MS = 1_200_000  # from the start of ten minutes to the end of the last segment that began in them
ROW_BYTES, PAGE_BYTES = 320, 1200  # overhead of Python objects


class MinuteRow(NamedTuple):
    """The segments that begin in one minute and have the same audiences.

    `at_ms`: the minute; `from_ms`, `to_ms`: the first begin and the last end, unix ms; `word`: the robot's
    status for this minute; `faults`: how many faults began.
    """

    at_ms: int
    audiences: frozenset[Audience]
    segments: int
    bytes: int
    frames: int
    word: RobotStatus
    faults: int
    from_ms: int
    to_ms: int


class HashSpan(NamedTuple):
    """A schema or model, with the time span (unix ms) and audiences of the newest segment that names it."""

    sha256: str
    audiences: frozenset[Audience]
    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True)
class PageDigest:
    """The index of the ten minutes from `at_ms`, unix ms. `count`, `bytes`: totals of their segments."""

    at_ms: int
    count: int
    bytes: int
    takes: tuple[TakeSpan, ...]
    minutes: tuple[MinuteRow, ...]
    schemas: tuple[HashSpan, ...]
    models: tuple[HashSpan, ...]


@dataclass
class DayIndex:
    """The index of the day (UTC) that begins at `day_ms`, unix ms: its ten-minute pages by start time."""

    robot: str
    view: str
    day_ms: int
    pages: dict[int, PageDigest] = field(default_factory=dict)

    @property
    def bytes(self) -> int:
        """The total bytes of its segments."""
        return sum(page.bytes for page in self.pages.values())

    @property
    def cost_bytes(self) -> int:
        """Roughly how many bytes of memory it takes."""
        rows = sum(len(page.minutes) + len(page.takes) + len(page.schemas) for page in self.pages.values())
        return ROW_BYTES * rows + PAGE_BYTES * len(self.pages)

    def list_pages(self) -> list[PageDigest]:
        """Return its ten-minute pages in order."""
        return [self.pages[at_ms] for at_ms in sorted(self.pages)]

    def list_minutes(self) -> Iterator[MinuteRow]:
        """Yield its minutes in order."""
        for page in self.list_pages():
            yield from page.minutes

    def list_schemas(self) -> Iterator[HashSpan]:
        """Yield the schemas that its segments name, newest ten minutes first."""
        for page in reversed(self.list_pages()):
            yield from page.schemas

    def list_models(self) -> Iterator[HashSpan]:
        """Yield the models that its segments name, newest ten minutes first."""
        for page in reversed(self.list_pages()):
            yield from page.models

    def find_schemas(self) -> set[str]:
        """Return the SHA-256 of all schemas that its segments name."""
        return {span.sha256 for page in self.pages.values() for span in page.schemas}

    def find_models(self) -> dict[str, frozenset[Audience]]:
        """Return the SHA-256 of all models that its segments name, each with the audiences of those
        segments."""
        found: dict[str, frozenset[Audience]] = {}
        for page in self.pages.values():
            for span in page.models:
                found[span.sha256] = found.get(span.sha256, frozenset()) | span.audiences
        return found


def digest_page(at_ms: int, segments: Sequence[KeptSegment]) -> PageDigest:
    """Make the index of the ten minutes from `at_ms`, unix ms. `segments`: all that begin in them."""
    minutes: dict[tuple[int, str], list[KeptSegment]] = {}
    takes: dict[int, TakeSpan] = {}
    schemas: dict[tuple[str, str], HashSpan] = {}
    models: dict[tuple[str, str], HashSpan] = {}
    for segment in sorted(segments, key=lambda each: (each.from_ms, each.name.take, each.name.index)):
        letters = pack_audiences(segment.audiences)
        minutes.setdefault((segment.from_ms // MINUTE_MS, letters), []).append(segment)
        take, index = segment.name.take, segment.name.index
        span = takes.get(take, TakeSpan(take, index, index))
        takes[take] = TakeSpan(take, min(span.first_index, index), max(span.last_index, index))
        schema = None if segment.schema is None else segment.schema.hex()
        for found, sha256 in ((schemas, schema), (models, segment.model)):
            if sha256 is not None:
                found[sha256, letters] = HashSpan(sha256, segment.audiences, segment.from_ms, segment.to_ms)
    rows = tuple(_sum_minutes(minutes))
    size = sum(segment.size for segment in segments)
    spans = tuple(takes.values())
    return PageDigest(
        at_ms, len(segments), size, spans, rows, tuple(schemas.values()), tuple(models.values())
    )


def _sum_minutes(minutes: Mapping[tuple[int, str], list[KeptSegment]]) -> list[MinuteRow]:
    """Sum up each minute's segments with the same audiences, in order of time."""
    rows: list[MinuteRow] = []
    last: dict[str, RobotStatus] = {}
    for minute, letters in sorted(minutes):
        found = minutes[minute, letters]
        words = [word for segment in found for word in segment.words]
        rows.append(_sum_minute(MINUTE_MS * minute, found, words, last.get(letters, "online")))
        last[letters] = words[-1].word if words else "online"
    return rows


def _sum_minute(
    at_ms: int, segments: Sequence[KeptSegment], words: Sequence[PastWord], before: RobotStatus
) -> MinuteRow:
    return MinuteRow(
        at_ms,
        segments[0].audiences,
        len(segments),
        sum(segment.size for segment in segments),
        sum(segment.frames for segment in segments),
        _find_main_word(at_ms, words, before),
        sum(segment.faults for segment in segments),
        min(segment.from_ms for segment in segments),
        max(segment.to_ms for segment in segments),
    )


def _find_main_word(at_ms: int, words: Sequence[PastWord], before: RobotStatus) -> RobotStatus:
    """Return the status that a minute is shown with.

    It is "offline" if the minute ended so, "silent" if the robot was away for at least half of it, and
    "online" otherwise. The page draws a minute as a whole, and 5 s of silence must not look like 60 s.
    `words`: of the segments that begin in the minute; the last may come after its end. `before`: the status
    when the minute began.
    """
    end_ms = at_ms + MINUTE_MS
    away_ms, since_ms, word = 0, at_ms, before
    for change in words:
        if change.at_ms >= end_ms:
            break
        if word != "online":
            away_ms += max(change.at_ms - since_ms, 0)
        since_ms, word = max(change.at_ms, since_ms), change.word
    if word == "offline":
        return word
    if word == "silent":
        away_ms += end_ms - since_ms
    return "silent" if away_ms >= MINUTE_MS // 2 else "online"


def sum_minutes(segments: Iterable[KeptSegment]) -> list[MinuteRow]:
    """Sum up segments by minute and audiences. `segments`: in order of time."""
    minutes: dict[tuple[int, str], list[KeptSegment]] = {}
    for segment in segments:
        key = segment.from_ms // MINUTE_MS, pack_audiences(segment.audiences)
        minutes.setdefault(key, []).append(segment)
    return _sum_minutes(minutes)


def pack_day(day: DayIndex) -> bytes:
    """Encode a day as JSON. Times count from the start of the ten minutes."""
    return dump_json(
        {
            "v": VERSION,
            "robot": day.robot,
            "view": day.view,
            "day_ms": day.day_ms,
            "pages": [_write_page(page) for page in day.list_pages()],
        }
    )


def unpack_day(robot: str, view: str, day_ms: int, data: bytes) -> DayIndex:
    """Parse a day of this robot and view. Raises ValueError if it is malformed or belongs to another day."""
    if len(data) > DAY_BYTES_MAX:
        raise ValueError("day: too long")
    doc = loads(data)
    if not isinstance(doc, dict) or doc.get("v") != VERSION:
        raise ValueError("day: unsupported version")
    if [doc.get(name) for name in ("robot", "view", "day_ms")] != [robot, view, day_ms]:
        raise ValueError("day: belongs to another robot, view or day")
    pages = _list(doc.get("pages"), DAY_MS // PAGE_MS)
    read = [_read_page(page, day_ms) for page in pages]
    return DayIndex(robot, view, day_ms, {page.at_ms: page for page in read})


def _write_page(page: PageDigest) -> dict[str, object]:
    def write_hashes(spans: tuple[HashSpan, ...]) -> list[object]:
        return [
            (each.sha256, pack_audiences(each.audiences), each.from_ms - page.at_ms, each.to_ms - page.at_ms)
            for each in spans
        ]

    return {
        "at_ms": page.at_ms,
        "count": page.count,
        "bytes": page.bytes,
        "takes": [(f"{each.take:016x}", each.first_index, each.last_index) for each in page.takes],
        "minutes": [
            (
                *((row.at_ms - page.at_ms) // MINUTE_MS, pack_audiences(row.audiences), row.segments),
                *(row.bytes, row.frames, row.word, row.faults),
                *(row.from_ms - page.at_ms, row.to_ms - page.at_ms),
            )
            for row in page.minutes
        ],
        "schemas": write_hashes(page.schemas),
        "models": write_hashes(page.models),
    }


def _read_page(doc: object, day_ms: int) -> PageDigest:
    if not isinstance(doc, dict):
        raise ValueError("day: invalid ten minutes")
    at_ms = _whole(doc.get("at_ms"))
    if at_ms % PAGE_MS or not day_ms <= at_ms < day_ms + DAY_MS:
        raise ValueError("day: these ten minutes belong to another day")

    def read_rows(name: str, width: int, read: Callable[[list[Any]], T]) -> tuple[T, ...]:
        rows = _list(doc.get(name), ROWS_MAX)
        if not all(isinstance(row, list) and len(row) == width for row in rows):
            raise ValueError(f"day: invalid {name}")
        return tuple(read(row) for row in rows)

    def read_span(row: Sequence[Any]) -> tuple[int, int]:
        from_ms, to_ms = _whole(row[0], PAGE_MS), _whole(row[1], LONGEST_MS)
        if from_ms > to_ms:
            raise ValueError("day: it ends before it begins")
        return at_ms + from_ms, at_ms + to_ms

    def read_hash(row: list[Any]) -> HashSpan:
        return HashSpan(_text(row[0], SHA256), _letters(row[1]), *read_span(row[2:]))

    def read_minute(row: list[Any]) -> MinuteRow:
        if row[5] not in WORDS:
            raise ValueError("day: invalid status")
        count, size, frames, faults = (_whole(row[n]) for n in (2, 3, 4, 6))
        minute_ms, audiences = at_ms + MINUTE_MS * _whole(row[0], 9), _letters(row[1])
        return MinuteRow(minute_ms, audiences, count, size, frames, row[5], faults, *read_span(row[7:]))

    def read_take(row: list[Any]) -> TakeSpan:
        return TakeSpan(int(_text(row[0], U64), 16), _whole(row[1], U32_MAX), _whole(row[2], U32_MAX))

    return PageDigest(
        at_ms,
        _whole(doc.get("count")),
        _whole(doc.get("bytes")),
        read_rows("takes", 3, read_take),
        read_rows("minutes", 9, read_minute),
        read_rows("schemas", 4, read_hash),
        read_rows("models", 4, read_hash),
    )


def _whole(found: object, most: int = WHOLE_MAX) -> int:
    if type(found) is not int or not 0 <= found <= most:
        raise ValueError("day: invalid number")
    return found


def _text(found: object, form: re.Pattern[str]) -> str:
    if not isinstance(found, str) or not form.fullmatch(found):
        raise ValueError("day: invalid text")
    return found


def _letters(found: object) -> frozenset[Audience]:
    return unpack_audiences(found if isinstance(found, str) else "")


def _list(found: object, most: int) -> list[Any]:
    if not isinstance(found, list) or len(found) > most:
        raise ValueError("day: invalid list")
    return found


REACH_BYTES, SPAN_BYTES = 600, 250  # overhead of Python objects


class SeenSpan(NamedTuple):
    """A time span, unix ms, in which some audiences could see something."""

    audiences: frozenset[Audience]
    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True)
class ShownDay:
    """The summary of a day. `takes`: the first and last index of each take; `schemas`, `models`: SHA-256."""

    day_ms: int
    spans: tuple[SeenSpan, ...]
    takes: dict[int, TakeSpan]
    schemas: frozenset[str]
    models: frozenset[str] = frozenset()

    @property
    def cost_bytes(self) -> int:
        """Roughly how many bytes of memory it takes."""
        rows = len(self.spans) + len(self.takes) + len(self.schemas) + len(self.models)
        return REACH_BYTES + SPAN_BYTES * rows


def list_shown(day: DayIndex) -> ShownDay:
    """Summarise a day's index."""
    spans: dict[str, SeenSpan] = {}
    takes: dict[int, TakeSpan] = {}
    for row in day.list_minutes():
        letters = pack_audiences(row.audiences)
        span = spans.get(letters, SeenSpan(row.audiences, row.from_ms, row.to_ms))
        spans[letters] = SeenSpan(row.audiences, min(span.from_ms, row.from_ms), max(span.to_ms, row.to_ms))
    for page in day.list_pages():
        for take in page.takes:
            known = takes.get(take.take, take)
            first, last = min(known.first_index, take.first_index), max(known.last_index, take.last_index)
            takes[take.take] = TakeSpan(take.take, first, last)
    return ShownDay(
        day_ms=day.day_ms,
        spans=tuple(spans.values()),
        takes=takes,
        schemas=frozenset(day.find_schemas()),
        models=frozenset(day.find_models()),
    )
