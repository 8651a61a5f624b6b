"""The file of a segment: its bytes as they are, or the gzip of them."""

from __future__ import annotations

import zlib

from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX
from posecast_wire.segment.records import refuse

GZIP = b"\x1f\x8b"
WINDOW = 31  # 2^15 bytes, in gzip's envelope


def pack_segment(data: bytes) -> bytes:
    """The gzip of a segment; where that is not smaller, its bytes as they are."""
    packer = zlib.compressobj(9, zlib.DEFLATED, WINDOW)  # without a time: the same every time
    packed = packer.compress(data) + packer.flush()
    return packed if len(packed) < len(data) else data


def unpack_segment(data: bytes) -> bytes:
    """The segment's bytes, which are not looked at. What unpacks to more than a segment may have is let go of
    at once. Raises SegmentError."""
    if data[:2] != GZIP:
        return data
    unpacker = zlib.decompressobj(WINDOW)
    try:
        segment = unpacker.decompress(data, ENVELOPE_BYTES_MAX + 1)
    except zlib.error:
        refuse("gzip", "damaged")
    if len(segment) > ENVELOPE_BYTES_MAX:
        refuse("gzip", f"over {ENVELOPE_BYTES_MAX} bytes")
    if not unpacker.eof or unpacker.unused_data:
        refuse("gzip", "damaged")
    return segment
