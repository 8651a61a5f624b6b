"""`segments.json` and the segments of version 1 that every later version reads."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_wire import Decoder, Schema
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    InfoRecord,
    ModelRecord,
    Record,
    Segment,
    SegmentError,
    decode_segment,
    encode_segment,
)

from wire.python.tools.make_segment_vectors import shown

FOLDER = Path(__file__).resolve().parents[2] / "vectors"
KEPT = FOLDER / "segments"
VECTORS = json.loads((FOLDER / "segments.json").read_text(encoding="utf-8"))
DIGESTS = json.loads((KEPT / "digests.json").read_text(encoding="utf-8"))


def bytes_of(parts: list[Any]) -> bytes:
    pairs = [(part, 1) if isinstance(part, str) else part for part in parts]
    return b"".join(bytes.fromhex(digits) * times for digits, times in pairs)


def make_digest(segment: Segment, decoder: Decoder) -> str:
    """SHA-256 over a line for the header and one a record, frames as the codes that `decoder`, which knows
    the schema, makes of them."""
    start = segment.start
    header = [
        *(start.robot, start.view, f"{start.take:016x}", start.index, f"{start.run_id:016x}", start.from_ms),
        *(
            segment.to_ms,
            start.schema,
            start.model,
            start.word,
            start.missing,
            start.numbering,
            start.event_n,
        ),
        [[name, text] for name, text in start.info.items()],
        list(start.open_faults),
    ]
    lines = [header, *([record.at_us, *_said(record, decoder)] for record in segment.records)]
    text = "".join(json.dumps(line, separators=(",", ":"), ensure_ascii=False) + "\n" for line in lines)
    return hashlib.sha256(text.encode()).hexdigest()


def _said(record: Record, decoder: Decoder) -> Iterator[object]:
    if isinstance(record, FrameRecord):
        frame = decoder.decode(record.frame)
        yield from (
            "frame",
            record.late_us,
            record.seq,
            frame.seq,
            math.floor(frame.t_s * 1000 + 0.5),
            list(frame.codes),
        )
    elif isinstance(record, CopyRecord):
        yield from ("copy", decoder.decode(record.frame).seq)
    elif isinstance(record, EventRecord):
        yield from ("event", record.text)
    elif isinstance(record, InfoRecord):
        yield from ("info", [[name, text] for name, text in record.info.items()])
    elif isinstance(record, ModelRecord):
        yield from ("model", record.model)
    else:
        yield from ("word", record.word)


@pytest.mark.parametrize("case", VECTORS["good"], ids=lambda case: str(case["name"]))
def test_a_segment_is_read(case: dict[str, Any]) -> None:
    data = bytes_of(case["bytes"])
    found = decode_segment(data)
    assert json.loads(json.dumps(shown(found))) == case["segment"]
    if "encode" in case:
        assert encode_segment(found) == data


@pytest.mark.parametrize("case", VECTORS["bad"], ids=lambda case: str(case["says"]))
def test_a_bad_segment_is_refused_in_these_words(case: dict[str, Any]) -> None:
    with pytest.raises(SegmentError) as caught:
        decode_segment(bytes_of(case["bytes"]))
    assert str(caught.value) == case["says"]


def test_the_kept_segments_are_those_that_were_kept() -> None:
    assert sorted(p.name for p in KEPT.iterdir()) == sorted([*DIGESTS, "digests.json", "schema.json"])
    assert len(DIGESTS) == 5
    for name, kept in DIGESTS.items():
        assert hashlib.sha256((KEPT / name).read_bytes()).hexdigest() == kept["bytes"], f"never change {name}"


@pytest.mark.parametrize("name", DIGESTS)
def test_a_kept_segment_says_what_it_said(name: str) -> None:
    segment = decode_segment((KEPT / name).read_bytes())
    text = (KEPT / "schema.json").read_text(encoding="utf-8")
    if segment.start.schema is not None:
        assert hashlib.sha256(text.encode()).hexdigest() == segment.start.schema
    decoder = Decoder()
    assert decoder.add_schema(text) == Schema.parse(text)
    assert make_digest(segment, decoder) == DIGESTS[name]["holds"]
