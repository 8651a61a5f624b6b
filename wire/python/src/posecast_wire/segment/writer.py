"""Writes segments: record by record as the relay accepts what they hold, or a whole one at once."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

from posecast_wire.frame import TAG_KEY
from posecast_wire.keys import check_name
from posecast_wire.messages import COUNT_MAX, RobotStatus
from posecast_wire.segment import records as of
from posecast_wire.segment.byte_reader import (
    pack_hash,
    pack_info,
    pack_text,
    pack_utf8,
    pack_varint,
)
from posecast_wire.segment.envelope import U64, pack_envelope
from posecast_wire.segment.frame_chain import SEQS, FrameChain
from posecast_wire.segment.records import Segment, SegmentError, SegmentStart, refuse

KEY_START = bytes((TAG_KEY,))
RECORD_HEADER_BYTES_MAX = 1 + 8 + 3  # kind, wait, length


class SegmentWriter:
    """Collects one segment. Each `append_…` costs microseconds and raises SegmentError, with nothing changed,
    for what the segment can't hold. `at_us`: µs since `start.from_ms`, never less than before.

    `key`: the current KEY, if there is one: copied into the segment if its first frame is no KEY.
    """

    def __init__(self, start: SegmentStart, key: bytes | None = None) -> None:
        """Raises SegmentError when `start` can't be written."""
        self.start = start
        self.at_us = 0  # of the newest record
        self.count = 0  # records
        self._head = _pack_start_before(start)
        self._tail = _pack_start_behind(start)
        self._chain = FrameChain()
        self._key = key
        self._records = bytearray()
        self._crc = 0

    @property
    def frames(self) -> int:
        """How many frames it holds, without copies."""
        return self._chain.count

    @property
    def last_seq(self) -> int | None:
        """The newest frame's number; None before any."""
        return self._chain.last_seq if self._chain.count else None

    @property
    def size(self) -> int:
        """How many bytes it has, give or take 30 of the header's numbers."""
        return len(self._head) + len(self._tail) + len(self._records) + 60

    def set_missing(self, missing: int) -> None:
        """Set how many frames are missing before the first one, which is known when that comes. Raises
        SegmentError when it is none."""
        start = replace(self.start, missing=missing)
        self._tail = _pack_start_behind(start)
        self.start = start

    def has_room(self, payload_bytes: int) -> bool:
        """Whether a record with so many bytes of content fits, with the copy that it may need."""
        copied = 0 if self._chain.count or self._key is None else len(self._key) + RECORD_HEADER_BYTES_MAX
        added = payload_bytes + copied + RECORD_HEADER_BYTES_MAX + 8  # a frame's lateness
        return len(self._records) + added <= of.RECORDS_BYTES_MAX

    def append_frame(self, frame: bytes, at_us: int, late_us: int) -> int:
        """Append a frame and return its number. `late_us`: its lateness, µs."""
        chain, parts = self._chain, [(of.FRAME, pack_varint(late_us, "lateness") + frame)]
        if self._key is not None and not chain.count and not chain.copies and frame[:1] != KEY_START:
            chain = FrameChain()
            chain.add_copy(self._key)
            parts = [(of.COPY, self._key), *parts]
        packed = self._pack(at_us, parts)
        seq = chain.add_frame(frame)
        self._chain = chain
        self._append(at_us, packed, len(parts))
        return seq

    def append_copy(self, frame: bytes, at_us: int) -> None:
        """Append a copy of the KEY itself: for writing a segment again that has been read."""
        packed = self._pack(at_us, [(of.COPY, frame)])
        self._chain.add_copy(frame)
        self._append(at_us, packed, 1)

    def append_event(self, text: str, at_us: int) -> None:
        """Append an event, as every viewer got it."""
        self._append_one(of.EVENT, at_us, pack_utf8(text, "event", of.EVENT_BYTES_MAX))

    def append_info(self, info: Mapping[str, str], at_us: int) -> None:
        """Append what the info has changed to."""
        self._append_one(of.INFO, at_us, pack_info(info, "info", of.INFO_BYTES_MAX))

    def append_model(self, model: str | None, at_us: int) -> None:
        """Append what the model has changed to."""
        self._append_one(of.MODEL, at_us, pack_hash(model, "model")[1:])

    def append_word(self, word: RobotStatus, at_us: int) -> None:
        """Append what the robot's status has changed to."""
        self._append_one(of.WORD, at_us, _pack_word(word))

    def close(self, to_ms: int) -> bytes:
        """The segment's bytes. `to_ms`: its end, Unix time, rounded down. Raises SegmentError when that is
        before its newest record, or when there are copies and no frame."""
        start, chain = self.start, self._chain
        duration_ms = to_ms - start.from_ms
        if duration_ms * 1000 + 999 < self.at_us or not 0 <= duration_ms <= of.DURATION_MS_MAX:
            refuse("duration", f"{duration_ms} ms, its newest record at {self.at_us // 1000} ms")
        if chain.count and (start.schema is None or start.run_id == 0):
            refuse("header", "frames without a schema or run")
        if chain.copies and not chain.count:
            refuse("records", "copies without frames")
        numbers = (duration_ms, chain.count, chain.first_seq, chain.last_seq)
        header = b"".join((self._head, *map(pack_varint, numbers), self._tail))
        return pack_envelope(of.MAGIC, of.SEGMENT_VERSION, header, self._records, self.count, self._crc)

    def _append_one(self, kind: int, at_us: int, payload: bytes) -> None:
        self._append(at_us, self._pack(at_us, [(kind, payload)]), 1)

    def _pack(self, at_us: int, parts: Sequence[tuple[int, bytes]]) -> bytes:
        """Records of the same time. Raises SegmentError when that is past or there is no room for them."""
        if not self.at_us <= at_us < (of.DURATION_MS_MAX + 1) * 1000:
            refuse("record", f"at {at_us} µs, the one before at {self.at_us} µs")
        wait_us = at_us - self.at_us
        packed = bytearray()
        for kind, payload in parts:
            packed.append(kind)
            packed += pack_varint(wait_us)
            packed += pack_varint(len(payload))
            packed += payload
            wait_us = 0
        size = len(self._records) + len(packed)
        if size > of.RECORDS_BYTES_MAX:
            refuse("records", f"{size} bytes, {of.RECORDS_BYTES_MAX} allowed")
        return bytes(packed)

    def _append(self, at_us: int, packed: bytes, count: int) -> None:
        self._records += packed
        self._crc = zlib.crc32(packed, self._crc)
        self.at_us = at_us
        self.count += count


def encode_segment(segment: Segment) -> bytes:
    """The bytes of a segment. Raises SegmentError when they could not be read again."""
    writer = SegmentWriter(segment.start)
    for record in segment.records:
        if isinstance(record, of.FrameRecord):
            seq = writer.append_frame(record.frame, record.at_us, record.late_us)
            if seq != record.seq:
                refuse("frame", f"its number is {seq}, not {record.seq}")
        elif isinstance(record, of.CopyRecord):
            writer.append_copy(record.frame, record.at_us)
        elif isinstance(record, of.EventRecord):
            writer.append_event(record.text, record.at_us)
        elif isinstance(record, of.InfoRecord):
            writer.append_info(record.info, record.at_us)
        elif isinstance(record, of.ModelRecord):
            writer.append_model(record.model, record.at_us)
        else:
            writer.append_word(record.word, record.at_us)
    return writer.close(segment.to_ms)


def pack_names(robot: str, view: str) -> bytes:
    """The names of a robot and a view. Raises SegmentError when they are none."""
    try:
        check_name("robot", robot)
        check_name("view", view)
    except ValueError as e:
        raise SegmentError(f"header: {e}") from None
    return pack_text(robot, "robot", 63) + pack_text(view, "view", 63)


def _pack_start_before(start: SegmentStart) -> bytes:
    """The header's members before its duration."""
    names = pack_names(start.robot, start.view)
    if not (0 <= start.take < 1 << 64 and 0 <= start.run_id < 1 << 64):
        refuse("header", "take and run are u64")
    return b"".join(
        (
            names,
            U64.pack(start.take),
            pack_varint(start.index, "index", SEQS - 1),
            U64.pack(start.run_id),
            pack_varint(start.from_ms, "from", COUNT_MAX - of.DURATION_MS_MAX),
        )
    )


def _pack_start_behind(start: SegmentStart) -> bytes:
    """The header's members behind its numbers of frames."""
    if len(start.open_faults) > of.OPEN_FAULTS_MAX:
        refuse("open faults", f"{len(start.open_faults)}, {of.OPEN_FAULTS_MAX} allowed")
    return b"".join(
        (
            pack_hash(start.schema, "schema"),
            pack_hash(start.model, "model"),
            _pack_word(start.word),
            pack_varint(start.missing, "missing", SEQS - 1),
            pack_text(start.numbering, "numbering", of.NUMBERING_BYTES_MAX),
            pack_varint(start.event_n, "event n"),
            pack_info(start.info, "info", of.INFO_BYTES_MAX),
            pack_varint(len(start.open_faults)),
            *(pack_text(text, "open fault", of.EVENT_BYTES_MAX) for text in start.open_faults),
        )
    )


def _pack_word(word: RobotStatus) -> bytes:
    if word not in of.WORDS:
        refuse("word", f"'{word}' is none")
    return bytes((of.WORDS.index(word),))
