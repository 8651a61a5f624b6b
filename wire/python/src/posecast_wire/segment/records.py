"""What a segment holds, and its bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, NoReturn

from posecast_wire.checked import make_visible
from posecast_wire.messages import RobotStatus

MAGIC = b"\x89PCS"
SEGMENT_VERSION = 1
HEADER_BYTES_MAX = 1 << 20
RECORDS_BYTES_MAX = 1 << 20
DURATION_MS_MAX = 600_000
INFO_BYTES_MAX = 1 << 17
EVENT_BYTES_MAX = 4096
NUMBERING_BYTES_MAX = 256
OPEN_FAULTS_MAX = 100
WORDS: tuple[RobotStatus, ...] = ("online", "silent", "offline")

END, FRAME, COPY, EVENT, INFO, MODEL, WORD = range(7)  # kinds of records
KINDS = ("end", "frame", "copy", "event", "info", "model", "word")


class SegmentError(ValueError):
    """A segment that can't be read or written: one line, `where: reason`."""


def refuse(where: str, reason: str) -> NoReturn:
    """Raise SegmentError with the text `where: reason`."""
    raise SegmentError(f"{where}: {make_visible(reason)}")


@dataclass(frozen=True)
class SegmentStart:
    """What is known of a segment when it begins; word, model, info and open faults are as they were then.

    `take`, `run_id`: u64, a run of 0 if none was known; `index`: in its take, from 0; `from_ms`: Unix time,
    rounded down; `schema`, `model`: SHA-256 of schema text and manifest, hexadecimal, or None; `missing`:
    frames of the run lost between the segments before in this take and this one; `numbering` names the count
    of the events' numbers, of which `event_n` is the newest before this segment (0: none); `open_faults`:
    events, as every viewer got them, that had begun and not ended, oldest first.
    """

    robot: str
    view: str
    take: int
    index: int
    run_id: int
    from_ms: int
    schema: str | None
    model: str | None = None
    word: RobotStatus = "online"
    missing: int = 0
    numbering: str = ""
    event_n: int = 0
    info: Mapping[str, str] = field(default_factory=dict)
    open_faults: Sequence[str] = ()


class FrameRecord(NamedTuple):
    """A frame that was accepted. `at_us`: when, µs since the segment's `from_ms`; `late_us`: its lateness
    then, µs; `frame`: its bytes."""

    at_us: int
    late_us: int
    seq: int
    frame: bytes


class CopyRecord(NamedTuple):
    """A KEY of before the segment, which frames here name as their base. `at_us`: µs since the
    segment's `from_ms`; says nothing of when it was accepted."""

    at_us: int
    frame: bytes


class EventRecord(NamedTuple):
    """An event. `at_us`: µs since the segment's `from_ms`; `text`: JSON as every viewer got it."""

    at_us: int
    text: str


class InfoRecord(NamedTuple):
    """The info has changed to `info`. `at_us`: µs since the segment's `from_ms`."""

    at_us: int
    info: Mapping[str, str]


class ModelRecord(NamedTuple):
    """The model has changed to `model`, SHA-256 of its manifest, hexadecimal, or None. `at_us`: µs since the
    segment's `from_ms`."""

    at_us: int
    model: str | None


class WordRecord(NamedTuple):
    """The robot's status has changed to `word`. `at_us`: µs since the segment's `from_ms`."""

    at_us: int
    word: RobotStatus


Record = FrameRecord | CopyRecord | EventRecord | InfoRecord | ModelRecord | WordRecord


@dataclass(frozen=True)
class Segment:
    """A whole segment: `records` in the order in which the relay accepted what they hold. `to_ms`: its end,
    Unix time, rounded down."""

    start: SegmentStart
    to_ms: int
    records: tuple[Record, ...]

    @property
    def frames(self) -> tuple[FrameRecord, ...]:
        """Its frames, without copies, in order."""
        return tuple(record for record in self.records if isinstance(record, FrameRecord))
