"""Reads the records of an MCAP file that are needed to play it: schemas, channels and messages.

A record is read only if it is complete and needed, so a false size in the file allocates nothing. Only the
unpacked chunk and one record are in memory at a time. Needs the extra `mcap`.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import IO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

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

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode, length
RECORD_MAX = 256 << 20  # bytes; a longer one is left out
TOO_LONG = (MemoryError, OverflowError)  # raised when a record claims too large a size
UNREADABLE = (McapError, zstandard.ZstdError, struct.error, RuntimeError, ValueError, EOFError, *TOO_LONG)


def read_mcap(file: IO[bytes], complain: Complain) -> Iterator[Record]:
    """Read topics and messages in file order, up to the end or to the point where the file is cut off.
    `complain` gets a line for each record or chunk that is left out. Raises OSError when reading fails."""
    types: dict[int, str] = {}  # of schemas
    for record in _records(file, complain):
        if isinstance(record, Message):
            yield RecordedMessage(record.channel_id, record.log_time, record.data)
        elif isinstance(record, Schema):
            types[record.id] = shorten_type(record.name[:TOPIC_MAX])
        else:
            type_name = types.get(record.schema_id, "")
            yield RecordedTopic(record.id, record.topic, type_name, record.message_encoding)


def _records(file: IO[bytes], complain: Complain) -> Iterator[Schema | Channel | Message]:
    size = file.seek(0, 2)
    begins = file.seek(len(MAGIC))
    while True:
        head = file.read(HEAD.size)
        opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, size)
        if opcode == Opcode.FOOTER:
            return
        if length > size - begins - HEAD.size:
            complain(f"is cut off in the record at byte {begins}")
            return
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK):
            what = "chunk that begins" if opcode == Opcode.CHUNK else "record"
            try:
                if length > RECORD_MAX:
                    raise ValueError(f"{length} bytes, at most {RECORD_MAX}")
                data = file.read(length)
                yield from _of_chunk(data) if opcode == Opcode.CHUNK else [_record(opcode, data)]
            except UNREADABLE as e:
                complain(f"the {what} at byte {begins}: {describe_error(e)}; left out")
        begins = file.seek(begins + HEAD.size + length)


def _of_chunk(data: bytes) -> Iterator[Schema | Channel | Message]:
    """The records of one chunk. Raises what `unpack_chunk` raises, and ValueError when they are cut off."""
    content = unpack_chunk(Chunk.read(ReadDataStream(BytesIO(data))))
    begins = 0
    while begins < len(content):
        opcode, length = HEAD.unpack_from(content, begins)
        begins += HEAD.size
        if not opcode or length > len(content) - begins:
            raise ValueError("a record in it is incomplete")
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            yield _record(opcode, content[begins : begins + length])
        begins += length


def _record(opcode: int, data: bytes) -> Schema | Channel | Message:
    stream = ReadDataStream(BytesIO(data))
    if opcode == Opcode.MESSAGE:
        record: Schema | Channel | Message = Message.read(stream, len(data))
    else:
        record = Schema.read(stream) if opcode == Opcode.SCHEMA else Channel.read(stream)
    return record


def unpack_chunk(chunk: Chunk) -> bytes:
    """Decompress the records of a chunk. Raises ValueError or the compression library's error when the chunk
    is damaged or too large."""
    size = chunk.uncompressed_size
    if size > UNPACKED_MAX:
        raise ValueError(f"{size} bytes unpacked, at most {UNPACKED_MAX}")
    if chunk.compression == "zstd":
        # the size in the compressed frame's header overrides the limit given here
        if zstandard.frame_content_size(chunk.data) > size:
            raise ValueError(f"more than {size} bytes unpacked")
        data = zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=size)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size)
    elif chunk.compression == "":
        data = chunk.data
    else:
        raise ValueError(f"compressed as {chunk.compression[:20]!r}, which is not supported")
    if len(data) != size:
        raise ValueError(f"{len(data)} bytes unpacked instead of {size}")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError("its checksum is wrong")
    return bytes(data)
