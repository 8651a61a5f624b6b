"""Names all that a segment holds by one SHA-256, the same in every language."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator

from posecast_wire import Decoder
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    InfoRecord,
    ModelRecord,
    Record,
    Segment,
)


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
