"""Robots, and segments of what they reported, as exports read them."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.table import TableReader
from posecast_wire import Encoder, Quantiser, Schema, parse_header
from posecast_wire.segment import SegmentStart, SegmentWriter, decode_segment

FROM_MS = 1_795_357_260_112  # 2026-11-22T14:21:00.112Z
EVENT = {"type": "event", "n": 41, "t": 1.5, "at": 1795357260, "source": "LSR", "level": "fault"}

Named = tuple[str, bytes]
Values = Sequence[float | None]


def hash_of(text: str | bytes) -> str:
    return hashlib.sha256(text if isinstance(text, bytes) else text.encode()).hexdigest()


@dataclass
class Take:
    """A recorder of one run: a frame every `step_us`, a segment every `segment_frames` (or whatever `cut`
    says)."""

    schema_text: str
    take: int = 7
    run_id: int = 9
    from_ms: int = FROM_MS
    step_us: int = 33_333
    model: str | None = None
    segment_frames: int = 30
    schema: Schema = field(init=False)

    def __post_init__(self) -> None:
        self.schema = Schema.parse(self.schema_text)

    def encode(self, rows: Sequence[Values], first_seq: int = 100) -> list[bytes]:
        """The frames of values in the schema's order and units."""
        encoder = Encoder(self.schema, 1.0)
        codes = (codes_of(self.schema, row) for row in rows)
        step_s = self.step_us / 1e6
        return [
            encoder.encode(row, (first_seq + i) % (1 << 32), 5 + i * step_s, i * step_s)
            for i, row in enumerate(codes)
        ]

    def record(
        self,
        frames: Sequence[bytes],
        late_us: int = 0,
        heard: Callable[[int], bool] = lambda _: True,
        events: Mapping[int, Mapping[str, Any] | str] | None = None,
    ) -> list[Named]:
        """The segments of those frames that it heard, `late_us` after the first recorder; events stand before
        the frame of that index."""
        found: list[Named] = []
        writer: SegmentWriter | None = None
        key: bytes | None = None
        begun_us = at_us = index = 0
        for i, frame in enumerate(frames):
            at_us = 1000 * self.from_ms + i * self.step_us + late_us
            if not heard(i):
                continue
            if writer is None or index >= self.segment_frames:
                if writer is not None:
                    found.append(self._close(writer, len(found), at_us))
                begun_us, index = at_us // 1000 * 1000, 0
                start = SegmentStart(
                    *("demo", "public", self.take, len(found), self.run_id, begun_us // 1000),
                    *(hash_of(self.schema_text), self.model),
                    numbering="one",
                )
                writer = SegmentWriter(start, key)
            for event in [events[i]] if events and i in events else []:
                writer.append_event(event if isinstance(event, str) else json.dumps(event), at_us - begun_us)
            writer.append_frame(frame, at_us - begun_us, 1500)
            index += 1
            if parse_header(frame).is_key:
                key = frame
        if writer is not None:
            found.append(self._close(writer, len(found), at_us + 1000))
        return found

    def _close(self, writer: SegmentWriter, index: int, at_us: int) -> Named:
        return f"{self.take:016x}/{index}", writer.close(at_us // 1000)


class Nowhere(io.RawIOBase):
    """A file that remembers its size alone."""

    size = 0

    def writable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """How many bytes there are."""
        return self.size

    def write(self, data: object) -> int:
        """Count them."""
        count = len(data)  # type: ignore[arg-type]
        self.size += count
        return count


def codes_of(schema: Schema, row: Values) -> list[int]:
    return Quantiser(schema, 0).quantise(row)


def in_order(*takes: list[Named]) -> list[Named]:
    """All segments by their beginning."""
    return sorted((s for take in takes for s in take), key=lambda s: decode_segment(s[1]).start.from_ms)


def schemas_of(*texts: str) -> dict[str, str]:
    return {hash_of(text): text for text in texts}


def csv_of(segments: Sequence[Named], *schemas: str, **span: int) -> tuple[str, TableReader]:
    """The file without its byte order mark."""
    file = io.BytesIO()
    table = TableReader(segments, schemas_of(*schemas), **span)
    write_csv(file, table)
    text = file.getvalue().decode()
    assert text[0] == "\ufeff"
    return text[1:], table


def mcap_of(
    segments: Sequence[Named], *schemas: str, models: Mapping[str, bytes] | None = None, **span: int
) -> tuple[bytes, TableReader]:
    file = io.BytesIO()
    table = TableReader(segments, schemas_of(*schemas), **span)
    write_mcap(file, table, (models or {}).get)
    return file.getvalue(), table


def messages_of(data: bytes) -> Iterator[tuple[str, str, int, bytes]]:
    """Topic, type, log time in ns and CDR of each message, by the library's own reader."""
    from mcap.reader import make_reader

    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages(log_time_order=False):
        assert schema is not None
        assert message.log_time == message.publish_time
        yield channel.topic, schema.name, message.log_time, message.data
