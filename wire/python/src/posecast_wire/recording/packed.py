"""The file of a segment: its plain bytes, or their gzip."""

from __future__ import annotations

import zlib

from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX
from posecast_wire.segment.records import refuse

GZIP = b"\x1f\x8b"
WINDOW = 31  # 2^15 bytes, in gzip's envelope


def pack_segment(data: bytes) -> bytes:
    """Return the gzip of a segment, or its plain bytes if gzip is not smaller."""
    packer = zlib.compressobj(9, zlib.DEFLATED, WINDOW)  # without a time stamp: deterministic
    packed = packer.compress(data) + packer.flush()
    return packed if len(packed) < len(data) else data


def unpack_segment(data: bytes) -> bytes:
    """Return the segment's bytes, unchecked. Raises SegmentError.

    Unpacking stops as soon as the result exceeds the largest segment.
    """
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
