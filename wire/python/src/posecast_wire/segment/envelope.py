"""What is around a header and records: a magic number, a version, lengths, and checksums."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from posecast_wire.segment.byte_reader import ByteReader
from posecast_wire.segment.records import END, HEADER_BYTES_MAX, RECORDS_BYTES_MAX, refuse

U32, U64 = struct.Struct("<I"), struct.Struct("<Q")
PREFIX = struct.Struct("<4sBI")
TAIL = struct.Struct("<BII")
ENVELOPE_BYTES_MAX = PREFIX.size + HEADER_BYTES_MAX + U32.size + RECORDS_BYTES_MAX + TAIL.size


@dataclass(frozen=True)
class Envelope:
    """The two parts, with correct checksums. `count`: the number of records that the last bytes name."""

    header: ByteReader
    records: ByteReader
    count: int


def open_envelope(data: bytes, magic: bytes, version: int, what: str) -> Envelope:
    """Check lengths and checksums. `what`: the word for such a file in errors. Raises SegmentError when it is
    none or damaged."""
    header_end = _check_front(data, magic, version, what)
    records_at = header_end + U32.size
    records_end = len(data) - TAIL.size
    count = _check_records(data, records_at, records_end)
    header = ByteReader(data, PREFIX.size, header_end)
    return Envelope(header, ByteReader(data, records_at, records_end), count)


def pack_envelope(
    magic: bytes, version: int, header: bytes, records: bytes | bytearray, count: int, crc: int
) -> bytes:
    """The bytes of the file. `crc`: of the records."""
    front = PREFIX.pack(magic, version, len(header)) + header
    return b"".join((front, U32.pack(zlib.crc32(front)), records, TAIL.pack(END, count, crc)))


def _check_front(data: bytes, magic: bytes, version: int, what: str) -> int:
    """Check the header and return where it ends."""
    if data[:4] != magic[: len(data)]:
        refuse("byte 0", f"no {what}")
    if len(data) > 4 and data[4] != version:
        why = "made by a newer Posecast" if data[4] > version else f"this reader knows {version}"
        refuse("byte 4", f"version {data[4]}, {why}")
    if len(data) < PREFIX.size:
        refuse(f"byte {len(data)}", "cut short")
    size = PREFIX.unpack_from(data)[2]
    if size > HEADER_BYTES_MAX:
        refuse("byte 5", f"header of {size} bytes, {HEADER_BYTES_MAX} allowed")
    end: int = PREFIX.size + size
    if len(data) < end + U32.size + TAIL.size:
        refuse(f"byte {len(data)}", "cut short")
    if zlib.crc32(data[:end]) != U32.unpack_from(data, end)[0]:
        refuse(f"byte {end}", "header: damaged")
    return end


def _check_records(data: bytes, at: int, end: int) -> int:
    """Check the records' bytes and return the number of records that the last bytes name."""
    if end - at > RECORDS_BYTES_MAX:
        refuse(f"byte {at}", f"records of {end - at} bytes, {RECORDS_BYTES_MAX} allowed")
    kind, count, crc = TAIL.unpack_from(data, end)
    if kind != END:
        refuse(f"byte {end}", "no end: cut short or damaged")
    if zlib.crc32(data[at:end]) != crc:
        refuse(f"byte {end}", "records: damaged")
    return int(count)
