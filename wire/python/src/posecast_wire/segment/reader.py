"""Reads segments, and merges those of several takes.

A segment that breaks a rule of SPEC §10 is refused whole, with one line that says what and where.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from posecast_wire.frame import FRAME_BYTES_MAX
from posecast_wire.keys import ROBOT_ID
from posecast_wire.messages import COUNT_MAX, RobotStatus
from posecast_wire.segment import records as of
from posecast_wire.segment.byte_reader import HASH_BYTES, ByteReader
from posecast_wire.segment.envelope import open_envelope
from posecast_wire.segment.frame_chain import SEQS, FrameChain
from posecast_wire.segment.records import Record, Segment, SegmentError, SegmentStart, refuse


class MergedFrame(NamedTuple):
    """A frame of a run. `unix_us`: when it was accepted, µs since 1970; `late_us`: its lateness then, µs."""

    unix_us: int
    late_us: int
    seq: int
    frame: bytes


@dataclass(frozen=True)
class MergedRun:
    """The frames of one run, each once, in the order of their numbers."""

    run_id: int
    frames: tuple[MergedFrame, ...]

    @property
    def missing(self) -> int:
        """How many frames are missing between the first and the last one."""
        if not self.frames:
            return 0
        return (self.frames[-1].seq - self.frames[0].seq) % SEQS + 1 - len(self.frames)


class _Header(NamedTuple):
    start: SegmentStart
    duration_ms: int
    frames: int
    first_seq: int
    last_seq: int


def decode_segment(data: bytes) -> Segment:
    """Decode a segment. Records of unknown kinds are skipped. Raises SegmentError when it is invalid."""
    envelope = open_envelope(data, of.MAGIC, of.SEGMENT_VERSION, "segment")
    header = _read_header(envelope.header)
    chain = FrameChain()
    records = tuple(_read_records(envelope.records, envelope.count, header.duration_ms, chain))
    _check_frames(header, chain)
    return Segment(header.start, header.start.from_ms + header.duration_ms, records)


def read_until_frame(data: bytes) -> tuple[SegmentStart, list[Record]]:
    """Return the start of a segment, and its records up to and including the first frame; all of them if
    there is no frame. Of the rest only the checksum is checked. Raises SegmentError."""
    envelope = open_envelope(data, of.MAGIC, of.SEGMENT_VERSION, "segment")
    header = _read_header(envelope.header)
    records: list[Record] = []
    for record in _read_records(envelope.records, envelope.count, header.duration_ms, FrameChain()):
        records.append(record)
        if isinstance(record, of.FrameRecord):
            break
    return header.start, records


def merge_segments(segments: Iterable[Segment]) -> tuple[MergedRun, ...]:
    """Merge the frames of segments of one robot and view by run and number; runs in the order of their
    beginning. What several segments have is taken from the one that begins first."""
    runs: dict[int, dict[int, MergedFrame]] = {}
    for segment in sorted(segments, key=lambda each: each.start.from_ms):
        if not segment.frames:
            continue
        found = runs.setdefault(segment.start.run_id, {})
        for record in segment.frames:
            unix_us = 1000 * segment.start.from_ms + record.at_us
            found.setdefault(record.seq, MergedFrame(unix_us, record.late_us, record.seq, record.frame))
    return tuple(MergedRun(run_id, _sort_frames(list(found.values()))) for run_id, found in runs.items())


def _read_header(r: ByteReader) -> _Header:
    robot, view = read_name(r, "robot"), read_name(r, "view")
    take = r.take_u64("take")
    index = r.take_varint("index", SEQS - 1)
    run_id = r.take_u64("run")
    from_ms = r.take_varint("from", COUNT_MAX - of.DURATION_MS_MAX)
    duration_ms = r.take_varint("duration", of.DURATION_MS_MAX)
    frames = r.take_varint("frames")
    first_seq = r.take_varint("first seq", SEQS - 1)
    last_seq = r.take_varint("last seq", SEQS - 1)
    schema = r.take_hash("schema")
    start = SegmentStart(
        robot=robot,
        view=view,
        take=take,
        index=index,
        run_id=run_id,
        from_ms=from_ms,
        schema=schema,
        model=r.take_hash("model"),
        word=_word(r),
        missing=r.take_varint("missing", SEQS - 1),
        numbering=r.take_text("numbering", of.NUMBERING_BYTES_MAX),
        event_n=r.take_varint("event n"),
        info=r.take_info("info", of.INFO_BYTES_MAX),
        open_faults=tuple(
            r.take_text("open fault", of.EVENT_BYTES_MAX)
            for _ in range(r.take_varint("open faults", of.OPEN_FAULTS_MAX))
        ),
    )
    if frames and (schema is None or run_id == 0):
        r.fail("header", "frames without a schema or run")
    return _Header(start, duration_ms, frames, first_seq, last_seq)


def read_name(r: ByteReader, what: str) -> str:
    """The name of a robot or view."""
    at = r.at
    name = r.take_text(what, 63)
    if not ROBOT_ID.fullmatch(name):
        refuse(f"byte {at}", f"{what}: no name")
    return name


def _word(r: ByteReader) -> RobotStatus:
    at = r.at
    word = r.take_byte("word")
    if word >= len(of.WORDS):
        refuse(f"byte {at}", f"word: {word} is none")
    return of.WORDS[word]


def _read_records(r: ByteReader, count: int, duration_ms: int, chain: FrameChain) -> Iterator[Record]:
    found = at_us = 0
    end = r.end
    while r.at < end:
        start = r.at
        kind = r.take_byte("kind")
        at_us += r.take_varint("wait", (of.DURATION_MS_MAX + 1) * 1000)
        size = r.take_varint("length", end - r.at)
        if size > end - r.at:
            r.fail("length", f"{size} bytes said, {end - r.at} left")
        if kind == of.END:
            refuse(f"byte {start}", "an end before the end")
        if at_us > duration_ms * 1000 + 999:
            refuse(f"byte {start}", f"a record at {at_us} µs of {duration_ms} ms")
        found += 1
        r.end = r.at + size
        record = _read_record(r, kind, at_us, chain)
        if record is not None:
            yield record
        r.at, r.end = r.end, end
    if found != count:
        refuse(f"byte {end}", f"{found} records, {count} said")


def _read_record(r: ByteReader, kind: int, at_us: int, chain: FrameChain) -> Record | None:
    """The record with its content from `r.at` to `r.end`; None if its kind is unknown."""
    start, size = r.at, r.end - r.at
    record: Record | None = None
    try:
        if kind == of.FRAME:
            late_us = r.take_varint("lateness")
            frame = r.take_bytes("frame", _checked(r, "frame", r.end - r.at, FRAME_BYTES_MAX))
            return of.FrameRecord(at_us, late_us, chain.add_frame(frame), frame)
        if kind == of.COPY:
            frame = r.take_bytes("copy", _checked(r, "copy", size, FRAME_BYTES_MAX))
            chain.add_copy(frame)
            return of.CopyRecord(at_us, frame)
    except SegmentError as e:
        reason = str(e)
        raise SegmentError(reason if reason.startswith("byte ") else f"byte {start}: {reason}") from None
    if kind == of.EVENT:
        record = of.EventRecord(at_us, r.take_utf8("event", _checked(r, "event", size, of.EVENT_BYTES_MAX)))
    elif kind == of.INFO:
        record = of.InfoRecord(at_us, r.take_info("info", of.INFO_BYTES_MAX))
    elif kind == of.MODEL:
        if size not in (0, HASH_BYTES):
            r.fail("model", f"a hash of {size} bytes")
        record = of.ModelRecord(at_us, r.take_bytes("model", size).hex() or None)
    elif kind == of.WORD:
        record = of.WordRecord(at_us, _word(r))
    if record is not None and r.at != r.end:
        r.fail(of.KINDS[kind], f"{r.end - r.at} bytes too many")
    return record


def _checked(r: ByteReader, what: str, size: int, most: int) -> int:
    if size > most:
        r.fail(what, f"{size} bytes, {most} allowed")
    return size


def _check_frames(header: _Header, chain: FrameChain) -> None:
    if chain.copies and not chain.count:
        refuse("records", "copies without frames")
    if header.frames != chain.count:
        refuse("header", f"{header.frames} frames said, {chain.count} there")
    if (header.first_seq, header.last_seq) != (chain.first_seq, chain.last_seq):
        named = f"frames {header.first_seq} to {header.last_seq} said"
        refuse("header", f"{named}, {chain.first_seq} to {chain.last_seq} there")


def _sort_frames(frames: list[MergedFrame]) -> tuple[MergedFrame, ...]:
    """Sort by number. Numbers wrap around, but a run is shorter than half of their range."""
    middle = frames[0].seq - SEQS // 2
    return tuple(sorted(frames, key=lambda frame: (frame.seq - middle) % SEQS))
