"""The page of KEYs (SPEC §11): the first pose of each segment in ten minutes, for browsing.

`posecast_wire` does not import it, because an edge does not need it.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from posecast_wire.frame import FRAME_BYTES_MAX
from posecast_wire.messages import COUNT_MAX
from posecast_wire.segment.byte_reader import HASH_BYTES, ByteReader, pack_hash, pack_varint
from posecast_wire.segment.envelope import U64, open_envelope, pack_envelope
from posecast_wire.segment.frame_chain import SEQS, FrameChain
from posecast_wire.segment.reader import read_name, read_until_frame
from posecast_wire.segment.records import (
    CopyRecord,
    FrameRecord,
    ModelRecord,
    Record,
    Segment,
    SegmentError,
    SegmentStart,
    refuse,
)
from posecast_wire.segment.writer import pack_names

MAGIC = b"\x89PCK"
KEY_PAGE_VERSION = 1
PAGE_BYTES_MAX = 1 << 20
POSES_MAX = 4096
MOMENT_MS_MAX = 1_199_999  # a segment begins within ten minutes, and lasts no longer than ten more
FROM_MS_MAX = COUNT_MAX - MOMENT_MS_MAX
POSE = 1  # the kind of an entry


@dataclass(frozen=True)
class KeyPose:
    """The first pose of a segment: its first frame, accepted at `at_ms` (Unix ms, rounded down), then
    `late_us` late.

    `frame` is a KEY, or `copies` has the KEY that it names; that is decoded first and is not a pose of this
    moment. `take`, `run_id`: u64; `index`: of the segment in its take; `schema`, `model`: SHA-256 in
    hexadecimal.
    """

    at_ms: int
    take: int
    run_id: int
    index: int
    schema: str
    model: str | None
    late_us: int
    seq: int
    copies: tuple[bytes, ...]
    frame: bytes


@dataclass(frozen=True)
class KeyPage:
    """Poses of segments that begin in the ten minutes from `from_ms` (Unix time), ordered by moment."""

    robot: str
    view: str
    from_ms: int
    poses: tuple[KeyPose, ...]


def pick_pose(segment: Segment | bytes) -> KeyPose | None:
    """Return the first pose of a segment; None if it has no frames. Of bytes it decodes only up to the first
    frame.

    Raises SegmentError if they are not a segment.
    """
    return _pick(*_begin(segment))


def encode_key_page(
    robot: str, view: str, from_ms: int, segments: Iterable[Segment | bytes | KeyPose], every: int = 1
) -> bytes:
    """Encode the page of segments in any order, or of poses picked earlier.

    `from_ms`: the start of the ten minutes, Unix ms. `every`: takes each n-th pose, starting with the first;
    if that is too many, each 2n-th, and so on. Raises SegmentError for segments of another robot or view,
    outside the ten minutes, or given twice.
    """
    if every < 1:
        refuse("every", f"{every}, at least 1 allowed")
    poses: list[KeyPose] = []
    for segment in segments:
        if isinstance(segment, KeyPose):
            poses.append(segment)
            continue
        start, records = _begin(segment)
        if (start.robot, start.view) != (robot, view):
            refuse("segment", f"of {start.robot}/{start.view}, not {robot}/{view}")
        pose = _pick(start, records)
        if pose is not None:
            poses.append(pose)
    poses.sort(key=lambda pose: (pose.at_ms, pose.take, pose.index))
    front = pack_names(robot, view) + pack_varint(from_ms, "from", FROM_MS_MAX)
    while True:
        picked = poses[::every]
        if len(picked) <= POSES_MAX:
            data = _pack(front, from_ms, picked)
            if len(data) <= PAGE_BYTES_MAX:
                return data
        every *= 2


def decode_key_page(data: bytes) -> KeyPage:
    """Decode a page, skipping entries of unknown kinds. Raises SegmentError if it is invalid."""
    if len(data) > PAGE_BYTES_MAX:
        refuse(f"byte {PAGE_BYTES_MAX}", f"page of {len(data)} bytes, {PAGE_BYTES_MAX} allowed")
    envelope = open_envelope(data, MAGIC, KEY_PAGE_VERSION, "page of KEYs")
    r = envelope.header
    robot, view = read_name(r, "robot"), read_name(r, "view")
    from_ms = r.take_varint("from", FROM_MS_MAX)
    takes = [_read_take(r) for _ in range(r.take_varint("takes", POSES_MAX))]
    hashes = [r.take_bytes("hash", HASH_BYTES).hex() for _ in range(r.take_varint("hashes", POSES_MAX))]
    poses = _read_poses(envelope.records, envelope.count, from_ms, takes, hashes)
    return KeyPage(robot, view, from_ms, poses)


def _begin(segment: Segment | bytes) -> tuple[SegmentStart, Sequence[Record]]:
    if isinstance(segment, Segment):
        return segment.start, segment.records
    return read_until_frame(segment)


def _pick(start: SegmentStart, records: Sequence[Record]) -> KeyPose | None:
    model, copies = start.model, []
    for record in records:
        if isinstance(record, CopyRecord):
            copies.append(record.frame)
        elif isinstance(record, ModelRecord):
            model = record.model
        elif isinstance(record, FrameRecord):
            if start.schema is None:
                refuse("header", "frames without a schema or run")
            at_ms = start.from_ms + record.at_us // 1000
            named = (at_ms, start.take, start.run_id, start.index, start.schema, model)
            return KeyPose(*named, record.late_us, record.seq, tuple(copies), record.frame)
    return None


def _pack(front: bytes, from_ms: int, poses: Sequence[KeyPose]) -> bytes:
    takes: dict[tuple[int, int], int] = {}
    hashes: dict[str | None, int] = {None: 0}
    names: set[tuple[int, int]] = set()
    entries = bytearray()
    for pose in poses:
        name = (pose.take, pose.index)
        if name in names:
            refuse("segment", f"take {pose.take:016x}, index {pose.index}: given twice")
        names.add(name)
        if _check_frames(pose.copies, pose.frame) != pose.seq:
            refuse("frame", f"its number is not {pose.seq}")
        numbers = (
            pack_varint(pose.at_ms - from_ms, "moment", MOMENT_MS_MAX),
            pack_varint(takes.setdefault((pose.take, pose.run_id), len(takes))),
            pack_varint(pose.index, "index", SEQS - 1),
            pack_varint(hashes.setdefault(pose.schema, len(hashes))),
            pack_varint(hashes.setdefault(pose.model, len(hashes))),
            pack_varint(pose.late_us, "lateness"),
            pack_varint(len(pose.copies)),
        )
        frames = (part for frame in (*pose.copies, pose.frame) for part in (pack_varint(len(frame)), frame))
        content = b"".join((*numbers, *frames))
        entries.append(POSE)
        entries += pack_varint(len(content))
        entries += content
    rows = [pack_varint(len(takes)), *(_pack_take(*row) for row in takes)]
    rows += [pack_varint(len(hashes) - 1), *(pack_hash(row, "hash")[1:] for row in hashes)]
    header = front + b"".join(rows)
    return pack_envelope(MAGIC, KEY_PAGE_VERSION, header, entries, len(poses), zlib.crc32(entries))


def _pack_take(take: int, run_id: int) -> bytes:
    if not (0 <= take < 1 << 64 and 0 < run_id < 1 << 64):
        refuse("take", "take and run are u64, and the run is not 0")
    return U64.pack(take) + U64.pack(run_id)


def _read_take(r: ByteReader) -> tuple[int, int]:
    take, run_id = r.take_u64("take"), r.take_u64("run")
    if run_id == 0:
        r.fail("run", "0 is none")
    return take, run_id


def _read_poses(
    r: ByteReader, count: int, from_ms: int, takes: list[tuple[int, int]], hashes: list[str]
) -> tuple[KeyPose, ...]:
    poses: list[KeyPose] = []
    names: set[tuple[int, int]] = set()
    before: tuple[int, int, int] | None = None
    found, end = 0, r.end
    if count > POSES_MAX:
        refuse(f"byte {end}", f"{count} entries, {POSES_MAX} allowed")
    while r.at < end:
        start = r.at
        kind = r.take_byte("kind")
        size = r.take_varint("length", end - r.at)
        if size > end - r.at:
            r.fail("length", f"{size} bytes said, {end - r.at} left")
        if kind == 0:
            refuse(f"byte {start}", "an end before the end")
        found += 1
        r.end = r.at + size
        if kind == POSE:
            pose = _read_pose(r, from_ms, takes, hashes)
            place = (pose.at_ms, pose.take, pose.index)
            if before is not None and place <= before:
                refuse(f"byte {start}", "a pose out of order")
            if place[1:] in names:
                refuse(f"byte {start}", f"take {pose.take:016x}, index {pose.index}: a segment twice")
            names.add(place[1:])
            before = place
            poses.append(pose)
        r.at, r.end = r.end, end
    if found != count:
        refuse(f"byte {end}", f"{found} entries, {count} said")
    return tuple(poses)


def _read_pose(r: ByteReader, from_ms: int, takes: list[tuple[int, int]], hashes: list[str]) -> KeyPose:
    at_ms = from_ms + r.take_varint("moment", MOMENT_MS_MAX)
    take_row = r.take_varint("take", COUNT_MAX)
    if take_row >= len(takes):
        r.fail("take", f"row {take_row} of {len(takes)}")
    index = r.take_varint("index", SEQS - 1)
    schema = _read_row(r, "schema", hashes)
    if schema is None:
        r.fail("schema", "none")
    model = _read_row(r, "model", hashes)
    late_us = r.take_varint("lateness")
    copies = r.take_varint("copies", 1)
    at = r.at
    frames = tuple(
        r.take_bytes("frame", r.take_varint("frame length", FRAME_BYTES_MAX)) for _ in range(copies + 1)
    )
    try:
        seq = _check_frames(frames[:-1], frames[-1])
    except SegmentError as e:
        raise SegmentError(f"byte {at}: {e}") from None
    take, run_id = takes[take_row]
    return KeyPose(at_ms, take, run_id, index, schema, model, late_us, seq, frames[:-1], frames[-1])


def _read_row(r: ByteReader, what: str, hashes: list[str]) -> str | None:
    row = r.take_varint(what)
    if row > len(hashes):
        r.fail(what, f"row {row} of {len(hashes)}")
    return hashes[row - 1] if row else None


def _check_frames(copies: Sequence[bytes], frame: bytes) -> int:
    """Return the number of the frame, which must be a KEY or name the copied one."""
    chain = FrameChain()
    for copy in copies:
        chain.add_copy(copy)
    return chain.add_frame(frame)
