"""The frame's header: what a relay reads, and all it ever reads."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from posecast_wire.fnv import fnv1a32

VERSION = 1
KEY = 1
REF = 2
FRAME_BYTES_MAX = 1 << 16  # 4096 channels of the widest codes fit

KEY_HEADER = struct.Struct("<BIId")
HEADER = struct.Struct("<BIHH")
TAG_KEY = VERSION << 4 | KEY | REF
TAG_REF = VERSION << 4 | REF
TAG_PLAIN = VERSION << 4


class FrameError(ValueError):
    """A frame that cannot be decoded; it changed nothing."""


class BadFrame(FrameError):
    """Not a frame of wire format 1, or a damaged one."""


class BaseUnknown(FrameError):
    """Sound as far as can be seen, but its schema or base is not here: ask for the snapshot."""


class Header(NamedTuple):
    """`seq`, `t`: of a KEY absolute (u32; s, robot clock), else distances from the base (u16; ms)."""

    is_key: bool
    is_ref: bool  # later frames may name this one as their base; true for every KEY
    schema_id: int | None
    base_id: int | None
    seq: int
    t: float


def parse_header(frame: bytes) -> Header:
    """Read a frame's header. BadFrame when it is none. The body is not looked at."""
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
        return Header(True, True, schema_id, None, seq, t)
    if tag not in (TAG_REF, TAG_PLAIN):
        raise BadFrame(f"tag 0x{tag:02x}")
    if len(frame) <= HEADER.size:
        raise BadFrame(f"frame of {len(frame)} bytes")
    _, base_id, distance, t_ms = HEADER.unpack_from(frame)
    if distance == 0:
        raise BadFrame("no distance from its base")
    return Header(False, tag == TAG_REF, None, base_id, distance, t_ms)


def frame_id(frame: bytes) -> int:
    """The id by which later frames name this KEY or REF: FNV-1a-32 of the whole message."""
    return fnv1a32(frame)
