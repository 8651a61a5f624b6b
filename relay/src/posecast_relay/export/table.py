"""Segments of one robot and view as a table: every frame once, decoded, and every event, in order.

Memory is bounded whatever the length: a segment is let go when its last frame has been read. Where takes
overlap (two recorders heard one robot) a frame counts once, as the segment that begins first has it, and
what the one lost comes from the other. Segments wait for that as long as clocks of recorders differ at most.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import NamedTuple

from posecast_wire import Decoder, FrameError, Schema, SchemaError
from posecast_wire.checked import make_visible
from posecast_wire.frame import TAG_KEY
from posecast_wire.segment import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    ModelRecord,
    Segment,
    SegmentError,
    decode_segment,
)
from posecast_wire.segment.frame_chain import SEQS

from posecast_relay.kit import write_count

GAP_MS = 2000  # a robot that stands still sends two frames a second: a longer pause is a lack


@dataclass
class HeldTime:
    """What was added so far, unix ms. `from_ms`, `to_ms`: the first moment and the last, 0 without any;
    `gaps`: how many, `gaps_ms`: how long all together, `gap_from_ms`: where the first one begins."""

    from_ms: int = 0
    to_ms: int = 0
    gaps: int = 0
    gaps_ms: int = 0
    gap_from_ms: int = 0

    def add(self, from_ms: int, to_ms: int) -> None:
        """Add a stretch of it, which begins no earlier than the one before, or a moment."""
        if not self.to_ms:
            self.from_ms = from_ms
        elif from_ms - self.to_ms > GAP_MS:
            self.gap_from_ms = self.gap_from_ms or self.to_ms
            self.gaps += 1
            self.gaps_ms += from_ms - self.to_ms
        self.to_ms = max(self.to_ms, to_ms)


CLOCKS_US = 2_000_000  # by so much the clocks of two recorders may differ; what comes later still is left out
WAITING_BYTES_MAX = 64 << 20  # of segments that wait; beyond, the oldest frames don't wait any longer
EVENTS_MAX = 4096  # the newest, by which an event that two takes have is known
YEARS_MS = 253_402_300_799_999  # the end of the year 9999, beyond which there are no dates
RECORD_BYTES = 300  # of Python's own for one record
RUNS_MAX = 16  # of which no frame waits, whose numbers are remembered
DECODERS_MAX = 8  # that wait for the next segment of their schema


class TableRow(NamedTuple):
    """A frame. `unix_us`: when the relay accepted it; `robot_s`: robot clock; `schema`: SHA-256 of the
    schema's text, `model` of the manifest, or None; `codes`: all channels in the schema's order."""

    unix_us: int
    run_id: int
    seq: int
    robot_s: float
    schema: str
    parsed: Schema
    model: str | None
    codes: tuple[int, ...]


class TableEvent(NamedTuple):
    """An event. `unix_us`: when the relay accepted it; `text`: JSON as every viewer got it."""

    unix_us: int
    text: str


@dataclass
class TableLosses:
    """What was passed over while a table was read. `first`: where and why, of the first one."""

    segments: int = 0
    frames: int = 0
    first: str = ""
    others: list[str] = field(default_factory=list)  # lines about what else is not in the file

    def add_segment(self, name: str, reason: str) -> None:
        """Count a segment."""
        self.segments += 1
        self._note(name, reason)

    def add_frame(self, name: str, reason: str) -> None:
        """Count a frame."""
        self.frames += 1
        self._note(name, reason)

    def add_line(self, line: str) -> None:
        """Take a line about something else, once."""
        if line not in self.others and len(self.others) < 8:
            self.others.append(line)

    def describe(self) -> list[str]:
        """One line for what was passed over, and one for each other thing; none when all is there."""
        parts = [
            write_count(count, noun)
            for count, noun in ((self.segments, "segment"), (self.frames, "frame"))
            if count
        ]
        lines = [f"passed over {' and '.join(parts)}; the first: {self.first}"] if parts else []
        return lines + self.others

    def _note(self, name: str, reason: str) -> None:
        self.first = self.first or f"{make_visible(name)}: {make_visible(reason)}"


class TableReader:
    """Reads the table of segments.

    `segments`: a name to tell of each, and its bytes or why it can't be read, by the moment at which they
    begin; `schemas`: their texts by SHA-256 (64 hexadecimal digits); `from_ms`, `to_ms`: unix, only what came
    in between counts, the ends included. What can't be read is passed over and counted in `losses`; `held`
    knows the time that rows cover.
    """

    def __init__(
        self,
        segments: Iterable[tuple[str, bytes | SegmentError]],
        schemas: Mapping[str, str],
        from_ms: int = 0,
        to_ms: int = YEARS_MS,
    ) -> None:
        self.losses = TableLosses()
        self.held = HeldTime()
        self._segments = segments
        self._schemas = _Schemas(schemas)
        self._span_us = (1000 * from_ms, 1000 * to_ms + 999)
        self._runs: dict[int, _Run] = {}
        self._events: list[TableEvent] = []  # a heap
        self._event_keys: dict[tuple[str, str], None] = {}
        self._waiting_bytes = 0

    @property
    def schemas(self) -> Mapping[str, Schema]:
        """The parsed schemas by SHA-256, in the order in which they were given, without those that can't be
        read."""
        return self._schemas.parsed

    def read(self) -> Iterator[TableRow | TableEvent]:
        """Yield what the segments hold; call it once. Raises what the iterator of segments raises."""
        low_us, high_us = self._span_us
        for found in self._read_all():
            if low_us <= found.unix_us <= high_us:
                if isinstance(found, TableRow):
                    self.held.add(found.unix_us // 1000, found.unix_us // 1000)
                yield found

    def _read_all(self) -> Iterator[TableRow | TableEvent]:
        for name, data in self._segments:
            try:
                if isinstance(data, SegmentError):
                    raise data
                segment = decode_segment(data)
                if segment.to_ms > YEARS_MS:
                    raise SegmentError("from: beyond the year 9999")
            except SegmentError as e:
                self.losses.add_segment(name, str(e))
                continue
            yield from self._flush(1000 * segment.start.from_ms - CLOCKS_US)
            refusal = self._schemas.find_refusal(segment.start.schema)
            if refusal:
                self.losses.add_segment(name, refusal)
                continue
            self._take(_OpenSegment(name, len(data), segment, self._schemas))
            if self._waiting_bytes > WAITING_BYTES_MAX:
                yield from self._flush(None, WAITING_BYTES_MAX)
        yield from self._flush(None)

    def _take(self, opened: _OpenSegment) -> None:
        start = opened.start
        for record in opened.events:
            event = TableEvent(1000 * start.from_ms + record.at_us, record.text)
            if self._is_new(start.numbering, event):
                heappush(self._events, event)
                self._waiting_bytes += RECORD_BYTES + len(event.text)
        if not opened.frames:
            return
        run = self._runs.pop(start.run_id, None) or _Run()
        self._runs[start.run_id] = run  # the newest last
        for run_id in [run_id for run_id, each in self._runs.items() if not each.waits][:-RUNS_MAX]:
            del self._runs[run_id]
        if run.add(opened):
            self._waiting_bytes += opened.cost_bytes
        else:
            opened.close(self._schemas)

    def _is_new(self, numbering: str, event: TableEvent) -> bool:
        """Whether no other take had it. The relay's number stands in the text as every viewer got it."""
        key = (numbering, event.text)
        if key in self._event_keys:
            return False
        self._event_keys[key] = None
        if len(self._event_keys) > EVENTS_MAX:
            del self._event_keys[next(iter(self._event_keys))]
        return True

    def _flush(self, limit_us: int | None, waiting_bytes: int = -1) -> Iterator[TableRow | TableEvent]:
        """Yield what came before `limit_us` (None: all), until no more than `waiting_bytes` wait."""
        while self._waiting_bytes > waiting_bytes:
            heads = (run for run in self._runs.values() if run.waits)
            run = min(heads, key=lambda each: each.head_us, default=None)
            head_us = None if run is None else run.head_us
            if self._events and (head_us is None or self._events[0].unix_us <= head_us):
                if limit_us is not None and self._events[0].unix_us >= limit_us:
                    return
                event = heappop(self._events)
                self._waiting_bytes -= RECORD_BYTES + len(event.text)
                yield event
                continue
            if run is None or head_us is None or (limit_us is not None and head_us >= limit_us):
                return
            row, freed_bytes = run.pop(self.losses, self._schemas)
            self._waiting_bytes -= freed_bytes
            if row is not None:
                yield row


class _Schemas:
    """The schemas of a table, and decoders that know one each."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        self.parsed: dict[str, Schema] = {}
        self._texts = texts
        self._refusals: dict[str, str] = {}
        self._decoders: dict[str, list[Decoder]] = {}
        for sha256, text in texts.items():
            try:
                self.parsed[sha256] = Schema.parse(text)
            except SchemaError as e:
                self._refusals[sha256] = f"its schema: {e}"

    def find_refusal(self, sha256: str | None) -> str:
        """Why nothing of this schema can be decoded; "" if it can, or where there is none."""
        if sha256 is None or sha256 in self.parsed:
            return ""
        return self._refusals.get(sha256, "its schema is not here")

    def lend(self, sha256: str) -> Decoder:
        """A decoder that knows the schema. What it decoded before does no harm: KEYs go by their hash."""
        free = self._decoders.get(sha256)
        if free:
            return free.pop()
        decoder = Decoder(1)
        decoder.add_schema(self._texts[sha256])
        return decoder

    def take_back(self, sha256: str, decoder: Decoder) -> None:
        """Keep a decoder for the next segment."""
        free = self._decoders.setdefault(sha256, [])
        if len(free) < DECODERS_MAX:
            free.append(decoder)


class _OpenSegment:
    """A segment whose frames are decoded one after the other."""

    def __init__(self, name: str, size: int, segment: Segment, schemas: _Schemas) -> None:
        self.name = name
        self.cost_bytes = size + RECORD_BYTES * len(segment.records)
        self.start = segment.start
        self.frames = segment.frames
        self.events = [record for record in segment.records if isinstance(record, EventRecord)]
        self.left = 0  # frames that have not been popped
        self._models: list[tuple[int, str | None]] = []  # from which frame on
        self._copies: list[bytes] = []
        self._at = 0
        count = 0
        for record in segment.records:
            if isinstance(record, FrameRecord):
                count += 1
            elif isinstance(record, CopyRecord):
                self._copies.append(record.frame)
            elif isinstance(record, ModelRecord):
                self._models.append((count, record.model))
        self._decoder = schemas.lend(self.start.schema) if self.start.schema is not None else None

    def decode(self, index: int, losses: TableLosses) -> TableRow | None:
        """The row of a frame; frames are asked for in their order, and KEYs among those in between are
        learned."""
        decoder = self._decoder
        if decoder is None or self.start.schema is None:
            return None
        record = self.frames[index]
        for key in self._keys_before(index):
            with suppress(FrameError):  # those that name it will tell
                decoder.decode(key)
        try:
            frame = decoder.decode(record.frame)
        except FrameError as e:
            losses.add_frame(f"{self.name}, frame {record.seq}", str(e))
            return None
        return TableRow(
            1000 * self.start.from_ms + record.at_us,
            self.start.run_id,
            record.seq,
            frame.t_s,
            self.start.schema,
            frame.schema,
            self._model_at(index),
            frame.codes,
        )

    def _keys_before(self, index: int) -> list[bytes]:
        """What frames from `index` on may name and has not been decoded: another take had it."""
        keys, self._copies = self._copies, []
        keys += [each.frame for each in self.frames[self._at : index] if each.frame[0] == TAG_KEY]
        self._at = index + 1
        return keys

    def close(self, schemas: _Schemas) -> None:
        """Nothing more of it is read."""
        if self._decoder is not None and self.start.schema is not None:
            schemas.take_back(self.start.schema, self._decoder)
            self._decoder = None

    def _model_at(self, index: int) -> str | None:
        model = self.start.model
        for count, changed in self._models:
            if count > index:
                break
            model = changed
        return model


class _Run:
    """The frames of one run that wait, by their numbers."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, _OpenSegment, int]] = deque()  # number that does not go round
        self._last: int | None = None  # that was popped

    @property
    def waits(self) -> bool:
        """Whether there is any."""
        return bool(self._waiting)

    @property
    def head_us(self) -> int:
        """When the first one was accepted, unix µs."""
        _, opened, index = self._waiting[0]
        return 1000 * opened.start.from_ms + opened.frames[index].at_us

    def add(self, opened: _OpenSegment) -> bool:
        """Take the frames that no earlier segment has. Returns whether there was any."""
        known = self._waiting[-1][0] if self._waiting else self._last
        numbers = self._straighten(opened, opened.frames[0].seq if known is None else known)
        if known is not None and numbers[0] <= known:
            had = {number for number, _, _ in self._waiting}
            floor = -1 << 62 if self._last is None else self._last
            new = [(n, opened, i) for i, n in enumerate(numbers) if n > floor and n not in had]
            merged = sorted([*self._waiting, *new], key=lambda each: each[0])
            self._waiting = deque(merged)
        else:
            new = [(n, opened, i) for i, n in enumerate(numbers)]
            self._waiting.extend(new)
        opened.left = len(new)
        return bool(new)

    def pop(self, losses: TableLosses, schemas: _Schemas) -> tuple[TableRow | None, int]:
        """The first row, or None where its frame can't be decoded; and how many bytes wait no longer."""
        number, opened, index = self._waiting.popleft()
        self._last = number
        row = opened.decode(index, losses)
        opened.left -= 1
        if opened.left:
            return row, 0
        opened.close(schemas)
        return row, opened.cost_bytes

    @staticmethod
    def _straighten(opened: _OpenSegment, near: int) -> list[int]:
        """Numbers that go on where those of the wire go round: each less than half a round from `near`."""
        middle = near - SEQS // 2
        return [middle + (record.seq - middle) % SEQS for record in opened.frames]
