"""Reads the records of a ROS 1 bag (format 2.0) that are needed to play it, in file order and without its
index: so a bag that was never closed can be played, and a long one needs no more memory.

Only the unpacked chunk and one record are in memory at a time. A false size in the file allocates nothing.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from typing import IO

import lz4.frame

from posecast_edge.sources.files.records import (
    UNPACKED_MAX,
    Complain,
    Record,
    RecordedMessage,
    RecordedTopic,
    describe_error,
)
from posecast_edge.sources.ros.messages import shorten_type
from posecast_edge.sources.ros.topics import TOPIC_MAX

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, FILE, CHUNK, CONNECTION = 2, 3, 5, 7  # kinds of records; the others are the index
HEAD_MAX = 1 << 20  # bytes of a header; a connection's has the text of its message type in it
LENGTH = struct.Struct("<I")
TIME = struct.Struct("<II")  # seconds, nanoseconds
UNREADABLE = (ValueError, KeyError, OSError, EOFError, RuntimeError, struct.error, MemoryError)
UNPACKERS = {b"bz2": bz2.BZ2Decompressor, b"lz4": lz4.frame.LZ4FrameDecompressor}

Fields = dict[bytes, bytes]


def read_rosbag1(file: IO[bytes], complain: Complain) -> Iterator[Record]:
    """Read topics and messages in file order, up to the end or to the point where the file is cut off.
    `complain` gets a line for each record or chunk that is left out. Raises OSError when reading fails."""
    size = file.seek(0, 2)
    begins = file.seek(len(MAGIC))
    while begins < size:
        head = _read_part(file, size, HEAD_MAX)
        data_at = file.tell()
        (length,) = LENGTH.unpack(file.read(4)) if head is not None and data_at + 4 <= size else (size,)
        if head is None or length > size - data_at - 4:
            complain(f"is cut off in the record at byte {begins}")
            return
        what = "record"
        try:
            fields = split_fields(head)
            kind = fields[b"op"][0] if fields.get(b"op") else 0
            if kind == FILE and fields.get(b"encryptor"):
                complain("is encrypted: decrypt it first, for example with `rosbag decrypt`")
                return
            if kind in (MESSAGE, CHUNK, CONNECTION):
                what = "chunk that begins" if kind == CHUNK else "record"
                if length > UNPACKED_MAX:
                    raise ValueError(f"{length} bytes, at most {UNPACKED_MAX}")
                data = file.read(length)
                yield from _of_chunk(fields, data) if kind == CHUNK else [_record(kind, fields, data)]
        except UNREADABLE as e:
            reason = f"no field {e}" if isinstance(e, KeyError) else describe_error(e)
            complain(f"the {what} at byte {begins}: {reason}; left out")
        begins = file.seek(data_at + 4 + length)


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


def _of_chunk(fields: Fields, data: bytes) -> Iterator[Record]:
    content = unpack_rosbag1_chunk(fields, data)
    at = 0
    while at < len(content):
        parts: list[bytes] = []
        for _ in range(2):  # header and data
            if at + 4 > len(content):
                raise ValueError("a record in it is incomplete")
            (length,) = LENGTH.unpack_from(content, at)
            at += 4 + length
            if at > len(content):
                raise ValueError("a record in it is incomplete")
            parts.append(content[at - length : at])
        inner = split_fields(parts[0])
        kind = inner[b"op"][0] if inner.get(b"op") else 0
        if kind in (MESSAGE, CONNECTION):
            yield _record(kind, inner, parts[1])


def _record(kind: int, fields: Fields, data: bytes) -> Record:
    (number,) = LENGTH.unpack(fields[b"conn"])
    if kind == CONNECTION:
        type_name = shorten_type(_text(split_fields(data)[b"type"][:TOPIC_MAX]))
        return RecordedTopic(number, _text(fields[b"topic"]), type_name, "ros1")
    seconds, nanoseconds = TIME.unpack(fields[b"time"])
    return RecordedMessage(number, seconds * 10**9 + nanoseconds, data)


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
