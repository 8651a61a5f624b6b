"""Reads the records of an MCAP file that are needed to play it: schemas, channels and messages.

A record is read only if it is complete and needed, so a false size in the file allocates nothing. Needs the
extra `mcap`, whose own reader by time does without no index, and holds all chunks that overlap.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import IO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema

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

MAGIC = b"\x89MCAP0\r\n"
HEAD = struct.Struct("<BQ")  # opcode, length
CHUNK = struct.Struct("<QQQ")  # times of its first and last message, unpacked size
INDEX = struct.Struct("<HI")  # channel, size of the index
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log and publish time
TIMED = struct.Struct("<HIQ")  # the beginning of that
CUT_OFF = -1  # in place of an opcode
RECORD_MAX = 256 << 20  # bytes; a longer one is left out
TOO_LONG = (MemoryError, OverflowError)  # raised when a record claims too large a size
UNREADABLE = (McapError, zstandard.ZstdError, struct.error, RuntimeError, ValueError, EOFError, *TOO_LONG)


class McapFile(BlockFile):
    """An MCAP file (see BlockFile)."""

    def __init__(self, path: Path, complain: Complain) -> None:
        self._types: dict[int, str] = {}  # of schemas
        super().__init__(path, complain)

    def _scan(self, file: IO[bytes]) -> None:
        chunk: Block | None = None  # the last one, whose index follows
        for begins, opcode, length in _list_heads(file, len(MAGIC), file.seek(0, 2)):
            start = file.read(min(length, CHUNK.size))
            if opcode == Opcode.MESSAGE_INDEX:
                if chunk is not None and len(start) >= INDEX.size and INDEX.unpack_from(start)[1]:
                    chunk.topics = (chunk.topics or frozenset()) | {INDEX.unpack_from(start)[0]}
                continue
            if chunk is not None:
                append_block(self._blocks, chunk)
                chunk = None
            if opcode == CUT_OFF:
                self._complain(f"is cut off in the record at byte {begins}")
            elif opcode == Opcode.CHUNK:
                chunk = _describe(begins, opcode, length, start)
            elif opcode == Opcode.MESSAGE:
                append_block(self._blocks, _describe(begins, opcode, length, start))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                for record in self._read_record(file, begins, opcode, length, (), self._complain):
                    if isinstance(record, RecordedTopic):
                        self.topics.setdefault(record.id, record)
        if chunk is not None:
            append_block(self._blocks, chunk)

    def _read_block(self, file: IO[bytes], block: Block, wanted: Collection[int]) -> Iterator[Record]:
        complain = ignore if block.was_read else self._complain
        for begins, opcode, length in _list_heads(file, block.begins, block.ends):
            if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                yield from self._read_record(file, begins, opcode, length, wanted, complain)

    def _read_record(
        self,
        file: IO[bytes],
        begins: int,
        opcode: int,
        length: int,
        wanted: Collection[int],
        complain: Complain,
    ) -> Iterator[Record]:
        """What is in the record, or in the records of a chunk."""
        try:
            if length > RECORD_MAX:
                raise ValueError(f"{length} bytes, at most {RECORD_MAX}")
            file.seek(begins + HEAD.size)
            data = file.read(length)
            if opcode == Opcode.CHUNK:
                data = unpack_chunk(Chunk.read(ReadDataStream(BytesIO(data))))
                for inner, at, size in _list_inner_heads(data):
                    yield from self._interpret(inner, data, at, size, wanted)
            else:
                yield from self._interpret(opcode, data, 0, length, wanted)
        except UNREADABLE as e:
            what = "chunk that begins" if opcode == Opcode.CHUNK else "record"
            complain(f"the {what} at byte {begins}: {describe_error(e)}; left out")

    def _interpret(
        self, opcode: int, data: bytes, at: int, length: int, wanted: Collection[int]
    ) -> Iterator[Record]:
        """The topic or message in `data[at : at + length]`. Messages have data if they are wanted."""
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE.size:
                raise ValueError("it is incomplete")
            number, _, t_ns, _ = MESSAGE.unpack_from(data, at)
            yield RecordedMessage(
                number, t_ns, data[at + MESSAGE.size : at + length] if number in wanted else b""
            )
        elif opcode == Opcode.SCHEMA:
            schema = Schema.read(ReadDataStream(BytesIO(data[at : at + length])))
            self._types[schema.id] = shorten_type(schema.name[:TOPIC_MAX])
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(ReadDataStream(BytesIO(data[at : at + length])))
            type_name = self._types.get(channel.schema_id, "")
            yield RecordedTopic(channel.id, channel.topic, type_name, channel.message_encoding)


def _describe(begins: int, opcode: int, length: int, start: bytes) -> Block:
    """The block of a chunk or message whose content begins with `start`."""
    block = Block(begins, begins + HEAD.size + length)
    if opcode == Opcode.CHUNK and len(start) == CHUNK.size:
        start_ns, end_ns, block.unpacked = CHUNK.unpack(start)
        if end_ns:
            block.start_ns, block.end_ns = start_ns, end_ns
    elif opcode == Opcode.MESSAGE and length >= MESSAGE.size:
        topic, _, block.start_ns = TIMED.unpack_from(start)
        block.end_ns, block.topics = block.start_ns, frozenset((topic,))
    return block


def _list_heads(file: IO[bytes], begins: int, ends: int) -> Iterator[tuple[int, int, int]]:
    """Position, opcode and length of each record up to the footer. After each, the file stands behind its
    head. The opcode is CUT_OFF where a record or the footer is incomplete."""
    while True:
        file.seek(begins)
        head = file.read(HEAD.size) if begins < ends else b""
        opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (CUT_OFF, 0)
        if opcode == Opcode.FOOTER:
            return
        if opcode == CUT_OFF or length > ends - begins - HEAD.size:
            yield begins, CUT_OFF, 0
            return
        yield begins, opcode, length
        begins += HEAD.size + length


def _list_inner_heads(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, position and length of the content of each record in a chunk. Raises ValueError when they are
    cut off."""
    begins = 0
    while begins < len(content):
        opcode, length = HEAD.unpack_from(content, begins)
        begins += HEAD.size
        if not opcode or length > len(content) - begins:
            raise ValueError("a record in it is incomplete")
        yield opcode, begins, length
        begins += length


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
