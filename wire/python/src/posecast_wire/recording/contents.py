"""The contents of a recording, its limits, and the paths of its files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import NoReturn

from posecast_wire.checked import make_visible
from posecast_wire.messages import RobotStatus
from posecast_wire.segment.records import SegmentStart

RECORDING_FILE = "recording.json"
FORMAT = "posecast-recording"
RECORDING_VERSION = 1
RECORDING_BYTES_MAX = 32 << 20  # of recording.json
SEGMENTS_MAX = 200_000
HASHES_MAX = 1024  # schemas, and models
STATES_MAX = 400_000  # words, and events
NOTES_MAX = 1000
NOTE_CHARACTERS_MAX = 2000
TITLE_CHARACTERS_MAX = 500
TIME_MS_MIN = 946_684_800_000  # 2000-01-01T00:00Z
TIME_MS_MAX = 4_102_444_799_999  # the last of 2099
TEN_MINUTES_MS = 600_000


class RecordingError(ValueError):
    """A recording that can't be read or written: one line, `where: reason`."""


@dataclass(frozen=True, slots=True)
class RecordingNote:
    """A note at a moment. `at_ms`: Unix ms."""

    at_ms: int
    text: str


@dataclass(frozen=True, slots=True)
class RecordedWord:
    """The robot's status from `at_ms` on, Unix time."""

    at_ms: int
    word: RobotStatus


@dataclass(frozen=True, slots=True)
class RecordedEvent:
    """An event as every viewer got it (SPEC §6). `at_ms`: when it was accepted, Unix time."""

    at_ms: int
    event: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class RecordedSegment:
    """A segment's entry in the recording.

    `take`, `run_id`: u64, with a run of 0 if none was known; `from_ms`, `to_ms`: Unix ms; `size`: in bytes;
    `schema`, `model`: SHA-256 in hexadecimal, at its start; `missing`: frames lost before it.
    """

    take: int
    run_id: int
    index: int
    from_ms: int
    to_ms: int
    frames: int
    first_seq: int
    last_seq: int
    size: int
    schema: str | None
    model: str | None
    missing: int
    words: tuple[RecordedWord, ...] = ()
    events: tuple[RecordedEvent, ...] = ()


@dataclass(frozen=True)
class PastRecording:
    """The content of `recording.json`.

    `from_ms`, `to_ms`: Unix ms; `notes`: ascending; `schemas`: text by SHA-256; `models`: SHA-256 of each
    manifest; `segments`: ordered by start, then take, then index.
    """

    robot: str
    view: str
    from_ms: int
    to_ms: int
    segments: tuple[RecordedSegment, ...]
    schemas: Mapping[str, str]
    models: tuple[str, ...] = ()
    notes: tuple[RecordingNote, ...] = ()
    title: str | None = None
    author: str | None = None
    licence: str | None = None


def segment_path(take: int, index: int) -> str:
    """Return the path of a segment's file in a recording. `take`: u64."""
    return f"segments/{take:016x}/{index}.segment"


def key_page_path(from_ms: int) -> str:
    """Return the path of the page of KEYs of ten minutes. `from_ms`: any time within them, Unix ms."""
    at_s = from_ms // TEN_MINUTES_MS * (TEN_MINUTES_MS // 1000)
    return f"keys/{datetime.fromtimestamp(at_s, timezone.utc):%Y-%m-%dT%H-%MZ}.keys"


def model_path(model: str, name: str) -> str:
    """Return the path of a model's file. `name`: `manifest.json`, or a name from the manifest."""
    return f"models/{model}/{name}"


def check_segment(recording: PastRecording, expected: RecordedSegment, found: SegmentStart) -> None:
    """Raise RecordingError if a segment's file does not match its name and path."""
    if (found.robot, found.view, found.take, found.index) != (
        recording.robot,
        recording.view,
        expected.take,
        expected.index,
    ):
        refuse(
            segment_path(expected.take, expected.index),
            f"is of {found.robot}/{found.view}, take {found.take:016x}, index {found.index}",
        )


def refuse(where: str, reason: str) -> NoReturn:
    """Raise RecordingError with the text `where: reason`."""
    raise RecordingError(f"{where}: {make_visible(reason)}")
