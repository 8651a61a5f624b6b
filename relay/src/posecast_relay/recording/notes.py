"""Reads notes.toml: what somebody wrote about moments of a recording."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from posecast_wire.checked import make_visible
from posecast_wire.recording import RecordingNote
from posecast_wire.recording.contents import NOTE_CHARACTERS_MAX, NOTES_MAX
from posecast_wire.recording.reader import NOTE_CONTROLS

BYTES_MAX = 16 << 20
HEAD = re.compile(r"[ \t]*\[\[[ \t]*(?:note|\"note\"|'note')[ \t]*\]\]")
OFFSET = re.compile(r"(?:([0-9]{1,3}):)?([0-5]?[0-9]):([0-5][0-9](?:\.[0-9]{1,6})?)", re.ASCII)
AT_FORM = 'use at = 2026-11-12T14:02:07Z, or at = "00:12:30" since the beginning'


class NotesError(ValueError):
    """A file of notes is wrong. The message is one line that names file, line and reason."""


class Note(NamedTuple):
    """`at`: a moment, or how long after the beginning; `where`: file and line, for refusals."""

    where: str
    at: datetime | timedelta
    text: str


def read_notes(file: Path) -> list[Note]:
    """Read the file. Raises NotesError."""
    try:
        if file.stat().st_size > BYTES_MAX:
            raise NotesError(f"{file}: over {BYTES_MAX} bytes")
        raw = file.read_text("utf-8-sig")
        doc = tomllib.loads(raw)
    except OSError as e:
        raise NotesError(f"{file}: {(e.strerror or str(e)).lower()}") from None
    except UnicodeDecodeError:
        raise NotesError(f"{file}: not UTF-8") from None
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as e:
        if isinstance(e, NotesError):
            raise
        raise NotesError(f"{file}: {make_visible(str(e))}") from None
    for name in doc:
        if name != "note":
            raise NotesError(f"{file}: {make_visible(name)}: only [[note]] may stand here")
    entries = doc.get("note", [])
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise NotesError(f"{file}: note: begin each with [[note]]")
    if len(entries) > NOTES_MAX:
        raise NotesError(f"{file}: {len(entries)} notes, {NOTES_MAX} allowed")
    lines = [number for number, line in enumerate(raw.splitlines(), 1) if HEAD.match(line)]
    places = lines if len(lines) == len(entries) else [0] * len(entries)  # written in another way
    return [
        _read_note(entry, f"{file}, line {line}" if line else f"{file}, note {n}")
        for n, (entry, line) in enumerate(zip(entries, places, strict=True), 1)
    ]


def place_notes(notes: Sequence[Note], from_ms: int, to_ms: int) -> list[RecordingNote]:
    """Return the notes by moment, for a recording from and to these moments (unix ms). Raises NotesError."""
    placed: list[RecordingNote] = []
    for note in notes:
        if isinstance(note.at, timedelta):
            at_ms = from_ms + note.at // timedelta(milliseconds=1)
        else:
            at_ms = round(note.at.timestamp() * 1000)
        if not from_ms <= at_ms <= to_ms:
            first, last = (
                datetime.fromtimestamp(ms / 1000).astimezone().isoformat(timespec="seconds")
                for ms in (from_ms, to_ms)
            )
            raise NotesError(f"{note.where}: at: not within the recording, which is from {first} to {last}")
        placed.append(RecordingNote(at_ms, note.text))
    return sorted(placed, key=lambda each: each.at_ms)


def _read_note(entry: Mapping[str, object], where: str) -> Note:
    for name in entry:
        if name not in ("at", "text"):
            raise NotesError(f"{where}: {make_visible(name)}: a note has only at and text")
    return Note(where, _read_at(entry.get("at"), where), _read_text(entry.get("text"), where))


def _read_at(value: object, where: str) -> datetime | timedelta:
    if isinstance(value, datetime):
        try:
            return value if value.tzinfo is not None else value.astimezone()
        except (ValueError, OverflowError, OSError):  # in this machine's zone, of another year than 1 to 9999
            raise NotesError(f"{where}: at: there is no such time") from None
    found = OFFSET.fullmatch(value) if isinstance(value, str) else None
    if found is not None:
        return timedelta(hours=int(found[1] or 0), minutes=int(found[2]), seconds=float(found[3]))
    told = f" '{make_visible(value[:40])}':" if isinstance(value, str) else ""
    raise NotesError(f"{where}: at:{told} {AT_FORM}")


def _read_text(value: object, where: str) -> str:
    text = value.replace("\r\n", "\n").strip() if isinstance(value, str) else ""
    if not 0 < len(text) <= NOTE_CHARACTERS_MAX or NOTE_CONTROLS.search(text):
        raise NotesError(f"{where}: text: write 1 to {NOTE_CHARACTERS_MAX} characters")
    return text
