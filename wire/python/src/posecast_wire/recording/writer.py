"""Writes `recording.json`, and packs the files of segments."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

from posecast_wire.recording.contents import FORMAT, RECORDING_VERSION, PastRecording, refuse
from posecast_wire.recording.reader import GZIP_WINDOW, decode_recording


def encode_recording(recording: PastRecording) -> bytes:
    """Encode `recording.json`. Raises RecordingError if it could not be read again."""
    of = recording
    takes: dict[tuple[int, int], int] = {}
    schemas = {sha256: row for row, sha256 in enumerate(of.schemas)}
    models = {sha256: row for row, sha256 in enumerate(of.models)}
    rows: list[list[int | None]] = []
    words: list[list[object]] = []
    events: list[list[object]] = []
    for at, each in enumerate(of.segments):
        where = f"segments[{at}]"
        rows.append(
            [
                takes.setdefault((each.take, each.run_id), len(takes)),
                each.index,
                each.from_ms - of.from_ms,
                each.to_ms - each.from_ms,
                each.frames,
                each.first_seq,
                each.last_seq,
                each.size,
                _row(schemas, each.schema, f"{where}: schema"),
                _row(models, each.model, f"{where}: model"),
                each.missing,
            ]
        )
        words += [[at, word.at_ms - of.from_ms, word.word] for word in each.words]
        events += [[at, event.at_ms - of.from_ms, event.event] for event in each.events]
    texts = {"title": of.title, "author": of.author, "licence": of.licence}
    doc = {
        "format": FORMAT,
        "version": RECORDING_VERSION,
        "robot": of.robot,
        "view": of.view,
        **{name: text for name, text in texts.items() if text is not None},
        "from_ms": of.from_ms,
        "to_ms": of.to_ms,
        "notes": [{"at_ms": note.at_ms, "text": note.text} for note in of.notes],
        "schemas": [{"sha256": sha256, "text": text} for sha256, text in of.schemas.items()],
        "models": of.models,
        "takes": [{"take": f"{take:016x}", "run": f"{run:016x}"} for take, run in takes],
        "segments": rows,
        "words": words,
        "events": events,
    }
    try:
        data = json.dumps(doc, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    except ValueError:
        refuse("recording", "not JSON")
    decode_recording(data)
    return data


def pack_segment(data: bytes) -> bytes:
    """Return the gzip of a segment, or its plain bytes if gzip is not smaller."""
    packer = zlib.compressobj(9, zlib.DEFLATED, GZIP_WINDOW)  # without a time stamp: deterministic
    packed = packer.compress(data) + packer.flush()
    return packed if len(packed) < len(data) else data


def _row(rows: Mapping[str, int], sha256: str | None, where: str) -> int | None:
    if sha256 is None:
        return None
    if sha256 not in rows:
        refuse(where, f"{sha256} is not in the list")
    return rows[sha256]
