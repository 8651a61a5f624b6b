"""Reads the records of a ROS 1 bag (format 2.0) that are needed to play it. A record is read only if it is
complete and needed, so a false size in the file allocates nothing.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Collection, Iterator
from typing import IO, NamedTuple

import lz4.frame
import numpy as np

from posecast_edge.sources.files.records import (
    UNPACKED_MAX,
    Block,
    BlockFile,
    Complain,
    Record,
    RecordedMessage,
    RecordedTopic,
    append_block,
    describe_error,
    ignore,
)
from posecast_edge.sources.ros.messages import shorten_type
from posecast_edge.sources.ros.topics import TOPIC_MAX

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, FILE, INDEX, CHUNK, CONNECTION = 2, 3, 4, 5, 7  # kinds of records that are needed
CUT_OFF, SPOILED = -1, -2  # in place of a kind
HEAD_MAX = 1 << 20  # bytes of a header; a connection's has the text of its message type in it
LENGTH = struct.Struct("<I")
TIME = struct.Struct("<II")  # seconds, nanoseconds
UNREADABLE = (ValueError, KeyError, OSError, EOFError, RuntimeError, struct.error, MemoryError)
UNPACKERS = {b"bz2": bz2.BZ2Decompressor, b"lz4": lz4.frame.LZ4FrameDecompressor}

Fields = dict[bytes, bytes]


class Rosbag1File(BlockFile):
    """A bag of ROS 1 (see BlockFile)."""

    def _scan(self, file: IO[bytes]) -> None:
        chunk: Block | None = None  # the last one, whose index follows
        for one in _list_records(file, len(MAGIC), file.seek(0, 2)):
            if one.kind == INDEX:
                if chunk is not None:
                    self._take_index(file, one, chunk)
                continue
            if chunk is not None:
                append_block(self._blocks, chunk)
                chunk = None
            if one.kind == CUT_OFF:
                self._complain(f"is cut off in the record at byte {one.begins}")
            elif one.kind == FILE and one.fields.get(b"encryptor"):
                self._complain("is encrypted: decrypt it first, for example with `rosbag decrypt`")
                return
            elif one.kind == CHUNK:
                chunk = Block(one.begins, one.ends, one.unpacked)
            elif one.kind == MESSAGE:
                append_block(self._blocks, Block(one.begins, one.ends))
            elif one.kind in (CONNECTION, SPOILED):
                for record in _read_record(file, one, (), self._complain):
                    if isinstance(record, RecordedTopic):
                        self.topics.setdefault(record.id, record)
        if chunk is not None:
            append_block(self._blocks, chunk)

    def _take_index(self, file: IO[bytes], one: _Head, chunk: Block) -> None:
        """Take the times of one topic's messages in a chunk. An index that can't be read says nothing."""
        try:
            if one.length > UNPACKED_MAX // 4:
                return
            (number,) = LENGTH.unpack(one.fields[b"conn"])
            file.seek(one.data_at)
            times = np.frombuffer(file.read(one.length), "<u4").reshape(-1, 3)[:, :2] @ (10**9, 1)
        except UNREADABLE:
            return
        if len(times):
            start_ns, end_ns = int(times.min()), int(times.max())
            chunk.start_ns = start_ns if chunk.start_ns is None else min(chunk.start_ns, start_ns)
            chunk.end_ns = end_ns if chunk.end_ns is None else max(chunk.end_ns, end_ns)
            chunk.topics = (chunk.topics or frozenset()) | {number}

    def _read_block(self, file: IO[bytes], block: Block, wanted: Collection[int]) -> Iterator[Record]:
        complain = ignore if block.was_read else self._complain
        for one in _list_records(file, block.begins, block.ends):
            if one.kind in (CHUNK, MESSAGE):
                yield from _read_record(file, one, wanted, complain)


class _Head(NamedTuple):
    """A record of a file, up to its data. `kind`: also CUT_OFF, and SPOILED for the reason in `problem`."""

    kind: int
    begins: int
    data_at: int
    length: int
    fields: Fields
    problem: str = ""

    @property
    def ends(self) -> int:
        return self.data_at + self.length

    @property
    def unpacked(self) -> int:
        size = self.fields.get(b"size", b"")
        return LENGTH.unpack(size)[0] if len(size) == LENGTH.size else 0


def _list_records(file: IO[bytes], begins: int, ends: int) -> Iterator[_Head]:
    while begins < ends:
        file.seek(begins)
        head = _read_part(file, ends, HEAD_MAX)
        data_at = file.tell() + 4
        (length,) = LENGTH.unpack(file.read(4)) if head is not None and data_at <= ends else (ends,)
        if head is None or length > ends - data_at:
            yield _Head(CUT_OFF, begins, ends, 0, {})
            return
        try:
            fields = split_fields(head)
            kind = fields[b"op"][0] if fields.get(b"op") else 0
            yield _Head(kind, begins, data_at, length, fields)
        except ValueError as e:
            yield _Head(SPOILED, begins, data_at, length, {}, describe_error(e))
        begins = data_at + length


def _read_record(
    file: IO[bytes], one: _Head, wanted: Collection[int], complain: Complain
) -> Iterator[Record]:
    """What is in the record, or in the records of a chunk."""
    try:
        if one.problem:
            raise ValueError(one.problem)
        if one.length > UNPACKED_MAX:
            raise ValueError(f"{one.length} bytes, at most {UNPACKED_MAX}")
        file.seek(one.data_at)
        data = file.read(one.length)
        if one.kind == CHUNK:
            yield from _of_chunk(one.fields, data, wanted)
        else:
            yield _interpret(one.kind, one.fields, data, 0, len(data), wanted)
    except UNREADABLE as e:
        reason = f"no field {e}" if isinstance(e, KeyError) else describe_error(e)
        what = "chunk that begins" if one.kind == CHUNK else "record"
        complain(f"the {what} at byte {one.begins}: {reason}; left out")


def split_fields(head: bytes) -> Fields:
    """Split a header into its fields. Raises ValueError when it is incomplete."""
    fields: Fields = {}
    at = 0
    while at < len(head):
        if at + 4 > len(head):
            raise ValueError("its header is incomplete")
        (length,) = LENGTH.unpack_from(head, at)
        at += 4 + length
        name, equals, value = head[at - length : at].partition(b"=")
        if at > len(head) or not equals:
            raise ValueError("its header is invalid")
        fields[name] = value
    return fields


def unpack_rosbag1_chunk(fields: Fields, data: bytes) -> bytes:
    """Decompress the records of a chunk. Raises ValueError, or what the library raises, when it is damaged or
    too large; KeyError when its header lacks a field."""
    (size,) = LENGTH.unpack(fields[b"size"])
    compression = fields[b"compression"]
    if size > UNPACKED_MAX:
        raise ValueError(f"{size} bytes unpacked, at most {UNPACKED_MAX}")
    if compression in UNPACKERS:
        unpacker = UNPACKERS[compression]()
        data = unpacker.decompress(data, max_length=size)
        if len(data) == size and not unpacker.eof:
            raise ValueError(f"more than {size} bytes unpacked")
    elif compression != b"none":
        raise ValueError(f"compressed as {_text(compression[:20])!r}, which is not supported")
    if len(data) != size:
        raise ValueError(f"{len(data)} bytes unpacked instead of {size}")
    return data


def _read_part(file: IO[bytes], size: int, most: int) -> bytes | None:
    """Read a length and as many bytes; None when there are fewer, or the length exceeds `most`."""
    raw = file.read(4)
    (length,) = LENGTH.unpack(raw) if len(raw) == 4 else (size,)
    return None if length > most or length > size - file.tell() else file.read(length)


def _of_chunk(fields: Fields, data: bytes, wanted: Collection[int]) -> Iterator[Record]:
    content = unpack_rosbag1_chunk(fields, data)
    at = 0
    while at < len(content):
        parts: list[tuple[int, int]] = []  # begin and end of header and data
        for _ in range(2):
            if at + 4 > len(content):
                raise ValueError("a record in it is incomplete")
            (length,) = LENGTH.unpack_from(content, at)
            at += 4 + length
            if at > len(content):
                raise ValueError("a record in it is incomplete")
            parts.append((at - length, at))
        inner = split_fields(content[slice(*parts[0])])
        kind = inner[b"op"][0] if inner.get(b"op") else 0
        if kind in (MESSAGE, CONNECTION):
            yield _interpret(kind, inner, content, *parts[1], wanted)


def _interpret(
    kind: int, fields: Fields, content: bytes, begins: int, ends: int, wanted: Collection[int]
) -> Record:
    """The topic or message whose data is `content[begins:ends]`. Messages have data if they are wanted."""
    (number,) = LENGTH.unpack(fields[b"conn"])
    if kind == CONNECTION:
        type_name = shorten_type(_text(split_fields(content[begins:ends])[b"type"][:TOPIC_MAX]))
        return RecordedTopic(number, _text(fields[b"topic"]), type_name, "ros1")
    seconds, nanoseconds = TIME.unpack(fields[b"time"])
    data = content[begins:ends] if number in wanted else b""
    return RecordedMessage(number, seconds * 10**9 + nanoseconds, data)


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
