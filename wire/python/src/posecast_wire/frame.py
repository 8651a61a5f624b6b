"""Parses a frame's header, the only part of a frame that a relay reads."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from posecast_wire.fnv import fnv1a32

VERSION = 1
FRAME_BYTES_MAX = 1 << 16  # 4096 channels of the widest codes fit

KEY_HEADER = struct.Struct("<BIId")
HEADER = struct.Struct("<BIHH")
TAG_KEY = VERSION << 4 | 3
TAG_RESERVED = VERSION << 4 | 2  # REF, a second kind of base, which no agent ever sent
TAG_PLAIN = VERSION << 4


class FrameError(ValueError):
    """A frame that can't be decoded; the decoder is unchanged."""


class BadFrame(FrameError):
    """Not a frame of wire format 1, or damaged."""


class BaseUnknown(FrameError):
    """A frame that seems valid, but its schema or base has not been received: request the snapshot."""


class Header(NamedTuple):
    """A frame's header. `seq`, `t`: absolute in a KEY (u32; seconds, robot clock), else relative to the base
    (u16; ms)."""

    is_key: bool  # later frames may name this one as their base
    schema_id: int | None
    base_id: int | None
    seq: int
    t: float


def parse_header(frame: bytes) -> Header:
    """Parse a frame's header without looking at its body. Raises BadFrame when it is invalid."""
    if not frame:
        raise BadFrame("empty frame")
    if len(frame) > FRAME_BYTES_MAX:
        raise BadFrame(f"frame of {len(frame)} bytes, {FRAME_BYTES_MAX} allowed")
    tag = frame[0]
    if tag >> 4 != VERSION:
        raise BadFrame(f"version {tag >> 4}, this reader knows {VERSION}")
    if tag == TAG_KEY:
        if len(frame) <= KEY_HEADER.size:
            raise BadFrame(f"KEY of {len(frame)} bytes")
        _, schema_id, seq, t = KEY_HEADER.unpack_from(frame)
        if not math.isfinite(t):
            raise BadFrame("KEY without a time")
        return Header(True, schema_id, None, seq, t)
    if tag == TAG_RESERVED:
        raise BadFrame("REF frames are reserved")
    if tag != TAG_PLAIN:
        raise BadFrame(f"tag 0x{tag:02x}")
    if len(frame) <= HEADER.size:
        raise BadFrame(f"frame of {len(frame)} bytes")
    _, base_id, distance, t_ms = HEADER.unpack_from(frame)
    if distance == 0:
        raise BadFrame("no distance from its base")
    return Header(False, None, base_id, distance, t_ms)


def frame_id(frame: bytes) -> int:
    """The id by which later frames refer to this KEY: FNV-1a-32 of all its bytes."""
    return fnv1a32(frame)
