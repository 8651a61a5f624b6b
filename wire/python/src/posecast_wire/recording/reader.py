"""Reads `recording.json` and unpacks the files of segments.

What breaks a rule of SPEC §12 is refused with one line: what and where.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeVar

from posecast_wire.checked import loads
from posecast_wire.keys import ROBOT_ID
from posecast_wire.messages import COUNT_MAX
from posecast_wire.recording import contents as of
from posecast_wire.recording.contents import (
    PastRecording,
    RecordedEvent,
    RecordedSegment,
    RecordedWord,
    RecordingNote,
    refuse,
)
from posecast_wire.schema import TEXT_BYTES_MAX as SCHEMA_BYTES_MAX
from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX
from posecast_wire.segment.frame_chain import SEQS
from posecast_wire.segment.records import DURATION_MS_MAX, WORDS
from posecast_wire.segment.records import refuse as refuse_segment

T = TypeVar("T")

SEGMENT_VALUES = 11  # per row
STATE_VALUES = 3

CONTROLS = re.compile("[\x00-\x1f\x7f-\x9f]")
NOTE_CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")  # except line ends and tabs
U64_DIGITS = re.compile(r"[0-9a-f]{16}")
SHA256_DIGITS = re.compile(r"[0-9a-f]{64}")
GZIP = b"\x1f\x8b"
GZIP_WINDOW = 31  # 2^15 bytes, in gzip's envelope

# take, run, index, from, to (Unix ms), frames, first and last seq, bytes, schema, model, missing
_Part = tuple[int, int, int, int, int, int, int, int, int, "str | None", "str | None", int]


def decode_recording(data: bytes) -> PastRecording:
    """Read `recording.json`. Unknown members are ignored. Raises RecordingError when it is invalid."""
    if len(data) > of.RECORDING_BYTES_MAX:
        refuse("recording", f"{len(data)} bytes, {of.RECORDING_BYTES_MAX} allowed")
    try:
        doc = loads(data)
    except ValueError:
        refuse("recording", "not JSON")
    members = _object(doc, "recording")
    if members.get("format") != of.FORMAT:
        refuse("format", f"must be {of.FORMAT}")
    if _whole(members.get("version"), "version", 1) > of.RECORDING_VERSION:
        refuse("version", "made by a newer Posecast")
    return _Reader(members).read()


def unpack_segment(data: bytes) -> bytes:
    """Return the segment's bytes, unchecked. Raises SegmentError.

    Unpacking stops as soon as the result exceeds the largest segment.
    """
    if data[:2] != GZIP:
        return data
    unpacker = zlib.decompressobj(GZIP_WINDOW)
    try:
        segment = unpacker.decompress(data, ENVELOPE_BYTES_MAX + 1)
    except zlib.error:
        refuse_segment("gzip", "damaged")
    if len(segment) > ENVELOPE_BYTES_MAX:
        refuse_segment("gzip", f"over {ENVELOPE_BYTES_MAX} bytes")
    if not unpacker.eof or unpacker.unused_data:
        refuse_segment("gzip", "damaged")
    return segment


class _Reader:
    """Reads the members in the same order in both languages."""

    def __init__(self, members: Mapping[str, object]) -> None:
        self._members = members
        self._from_ms = self._to_ms = 0
        self._schemas: dict[str, str] = {}
        self._models: dict[str, None] = {}
        self._takes: dict[int, int] = {}

    def read(self) -> PastRecording:
        get = self._members.get
        robot, view = _name(get("robot"), "robot"), _name(get("view"), "view")
        title, author, licence = (_title(get(name), name) for name in ("title", "author", "licence"))
        self._from_ms = _whole(get("from_ms"), "from_ms", of.TIME_MS_MIN, of.TIME_MS_MAX)
        self._to_ms = _whole(get("to_ms"), "to_ms", self._from_ms, of.TIME_MS_MAX)
        notes = self._read_notes()
        self._read_schemas()
        self._read_models()
        self._read_takes()
        parts = self._read_segments()
        words, events = self._read_words(parts), self._read_events(parts)
        segments = (
            RecordedSegment(*part, tuple(words.get(row, ())), tuple(events.get(row, ())))
            for row, part in enumerate(parts)
        )
        return PastRecording(
            robot=robot,
            view=view,
            from_ms=self._from_ms,
            to_ms=self._to_ms,
            segments=tuple(segments),
            schemas=self._schemas,
            models=tuple(self._models),
            notes=notes,
            title=title,
            author=author,
            licence=licence,
        )

    def _read_notes(self) -> tuple[RecordingNote, ...]:
        notes: list[RecordingNote] = []
        least_ms = self._from_ms
        for i, value in enumerate(_items(self._members.get("notes"), "notes", of.NOTES_MAX)):
            where = f"notes[{i}]"
            note = _object(value, where)
            at_ms = _whole(note.get("at_ms"), f"{where}.at_ms", self._from_ms, self._to_ms)
            if at_ms < least_ms:
                refuse(where, "out of order")
            least_ms = at_ms
            notes.append(RecordingNote(at_ms, _note_text(note.get("text"), f"{where}.text")))
        return tuple(notes)

    def _read_schemas(self) -> None:
        for i, value in enumerate(_items(self._members.get("schemas"), "schemas", of.HASHES_MAX)):
            where = f"schemas[{i}]"
            schema = _object(value, where)
            sha256 = _digits(schema.get("sha256"), f"{where}.sha256", SHA256_DIGITS, 64)
            if sha256 in self._schemas:
                refuse(f"{where}.sha256", "appears twice")
            text = schema.get("text")
            if not isinstance(text, str) or not 0 < len(text.encode()) <= SCHEMA_BYTES_MAX:
                refuse(f"{where}.text", f"must be a text of 1 to {SCHEMA_BYTES_MAX} bytes")
            self._schemas[sha256] = text

    def _read_models(self) -> None:
        for i, value in enumerate(_items(self._members.get("models"), "models", of.HASHES_MAX)):
            where = f"models[{i}]"
            sha256 = _digits(value, where, SHA256_DIGITS, 64)
            if sha256 in self._models:
                refuse(where, "appears twice")
            self._models[sha256] = None

    def _read_takes(self) -> None:
        for i, value in enumerate(_items(self._members.get("takes"), "takes", of.SEGMENTS_MAX)):
            where = f"takes[{i}]"
            row = _object(value, where)
            take = int(_digits(row.get("take"), f"{where}.take", U64_DIGITS, 16), 16)
            if take in self._takes:
                refuse(f"{where}.take", "appears twice")
            self._takes[take] = int(_digits(row.get("run"), f"{where}.run", U64_DIGITS, 16), 16)

    def _read_segments(self) -> list[_Part]:
        takes, schemas, models = [*self._takes.items()], [*self._schemas], [*self._models]
        parts: list[_Part] = []
        names: set[tuple[int, int]] = set()
        newest = (-1, -1, -1)
        for i, value in enumerate(_items(self._members.get("segments"), "segments", of.SEGMENTS_MAX)):
            where = f"segments[{i}]"
            row = _values(value, where, SEGMENT_VALUES)
            take, run_id = _of_rows(takes, row[0], f"{where}: take")
            index = _whole(row[1], f"{where}: index", 0, SEQS - 1)
            offset_ms = _whole(row[2], f"{where}: from", 0, self._to_ms - self._from_ms)
            from_ms = self._from_ms + offset_ms
            left_ms = min(DURATION_MS_MAX, self._to_ms - from_ms)
            to_ms = from_ms + _whole(row[3], f"{where}: duration", 0, left_ms)
            frames = _whole(row[4], f"{where}: frames", 0, SEQS - 1)
            first_seq = _whole(row[5], f"{where}: first seq", 0, SEQS - 1)
            last_seq = _whole(row[6], f"{where}: last seq", 0, SEQS - 1)
            size = _whole(row[7], f"{where}: bytes", 1, ENVELOPE_BYTES_MAX)
            schema = None if row[8] is None else _of_rows(schemas, row[8], f"{where}: schema")
            model = None if row[9] is None else _of_rows(models, row[9], f"{where}: model")
            missing = _whole(row[10], f"{where}: missing", 0, SEQS - 1)
            if frames and (schema is None or run_id == 0):
                refuse(where, "frames without a schema or run")
            if (from_ms, take, index) <= newest:
                refuse(where, "out of order")
            if (take, index) in names:
                refuse(where, "a segment twice")
            newest = (from_ms, take, index)
            names.add((take, index))
            numbers = (frames, first_seq, last_seq, size)
            parts.append((take, run_id, index, from_ms, to_ms, *numbers, schema, model, missing))
        if not parts:
            refuse("segments", "there are none")
        return parts

    def _read_words(self, parts: Sequence[_Part]) -> dict[int, list[RecordedWord]]:
        words: dict[int, list[RecordedWord]] = {}
        for where, row, at_ms, value in self._read_states("words", parts):
            word = next((one for one in WORDS if one == value), None)
            if word is None:
                refuse(where, f"must be one of {', '.join(WORDS)}")
            words.setdefault(row, []).append(RecordedWord(at_ms, word))
        return words

    def _read_events(self, parts: Sequence[_Part]) -> dict[int, list[RecordedEvent]]:
        events: dict[int, list[RecordedEvent]] = {}
        for where, row, at_ms, value in self._read_states("events", parts):
            events.setdefault(row, []).append(RecordedEvent(at_ms, _object(value, where)))
        return events

    def _read_states(self, name: str, parts: Sequence[_Part]) -> Iterator[tuple[str, int, int, object]]:
        """Yield the place, the segment's row, the time in Unix ms, and the content."""
        newest = (-1, -1)
        for i, value in enumerate(_items(self._members.get(name), name, of.STATES_MAX)):
            where = f"{name}[{i}]"
            values = _values(value, where, STATE_VALUES)
            row = _row_of(len(parts), values[0], f"{where}: segment")
            from_ms, to_ms = parts[row][3], parts[row][4]
            low_ms, high_ms = from_ms - self._from_ms, to_ms - self._from_ms
            offset_ms = _whole(values[1], f"{where}: at", low_ms, high_ms)
            if (row, offset_ms) < newest:
                refuse(where, "out of order")
            newest = (row, offset_ms)
            yield where, row, self._from_ms + offset_ms, values[2]


def _object(value: object, where: str) -> dict[str, object]:
    if not isinstance(value, dict):
        refuse(where, "must be an object")
    return value


def _items(value: object, where: str, most: int) -> list[object]:
    """Return a list; an empty one if it is missing."""
    if value is None:
        return []
    if not isinstance(value, list):
        refuse(where, "must be a list")
    if len(value) > most:
        refuse(where, f"{len(value)}, {most} allowed")
    return value


def _values(value: object, where: str, count: int) -> list[object]:
    """Return a row. A later writer may append values."""
    if not isinstance(value, list) or len(value) < count:
        refuse(where, f"must be a list of {count}")
    return value


def _whole(value: object, where: str, low: int, high: int = COUNT_MAX) -> int:
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or not low <= value <= high
        or value % 1
    ):
        refuse(where, f"must be a whole number from {low} to {high}")
    return int(value)


def _row_of(count: int, value: object, where: str) -> int:
    row = _whole(value, where, 0)
    if row >= count:
        refuse(where, f"row {row} of {count}")
    return row


def _of_rows(rows: Sequence[T], value: object, where: str) -> T:
    return rows[_row_of(len(rows), value, where)]


def _digits(value: object, where: str, form: re.Pattern[str], count: int) -> str:
    if not isinstance(value, str) or not form.fullmatch(value):
        refuse(where, f"must be {count} lower-case hexadecimal digits")
    return value


def _name(value: object, where: str) -> str:
    if not isinstance(value, str) or not ROBOT_ID.fullmatch(value):
        refuse(where, "use 1 to 63 of a-z, 0-9 and -, not starting with -")
    return value


def _title(value: object, where: str) -> str | None:
    if value is None:
        return None
    if not isinstance(value, str) or not 0 < len(value) <= of.TITLE_CHARACTERS_MAX or CONTROLS.search(value):
        refuse(
            where, f"must be a text of 1 to {of.TITLE_CHARACTERS_MAX} characters without control characters"
        )
    return value


def _note_text(value: object, where: str) -> str:
    if (
        not isinstance(value, str)
        or not 0 < len(value) <= of.NOTE_CHARACTERS_MAX
        or NOTE_CONTROLS.search(value)
    ):
        reason = "characters without control characters, except line ends and tabs"
        refuse(where, f"must be a text of 1 to {of.NOTE_CHARACTERS_MAX} {reason}")
    return value
