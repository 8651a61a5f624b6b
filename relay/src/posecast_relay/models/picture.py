"""Reads a picture's size from its first bytes. It comes from a robot, so it may be invalid, or so large that
it would fill the viewer's memory.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

SIDE_PX_MAX = 2048  # 16 MiB when decoded; pictures made by `posecast-edge` are 256 px wide and high

_PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR"
_JPEG_PLAIN = frozenset((0x01, *range(0xD0, 0xD8)))  # markers without a segment
_JPEG_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # segments with the size
_JPEG_END = frozenset((0xD9, 0xDA))  # end of the picture, or of its header


class PictureError(ValueError):
    """A picture can't be shown. The message is one line that quotes nothing from it."""


class PictureSize(NamedTuple):
    """A picture's size in pixels."""

    width_px: int
    height_px: int


def read_picture_size(data: bytes | bytearray, type_: str) -> PictureSize:
    """Read the size of a picture of this media type, in time proportional to its bytes.

    Raises PictureError if it is not of this type, or if a side is longer than SIDE_PX_MAX.
    """
    read = _READERS.get(type_)
    if read is None:
        raise PictureError(f"want one of {', '.join(_READERS)}")
    size = read(data)
    if size is None:
        raise PictureError(f"not a valid {type_}")
    if not (1 <= size.width_px <= SIDE_PX_MAX and 1 <= size.height_px <= SIDE_PX_MAX):
        raise PictureError(f"{size.width_px} × {size.height_px} px; want 1 to {SIDE_PX_MAX} for each side")
    return size


def _read_png(data: bytes | bytearray) -> PictureSize | None:
    if len(data) < 33 or not data.startswith(_PNG):
        return None
    return PictureSize(int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big"))


def _read_jpeg(data: bytes | bytearray) -> PictureSize | None:
    """Walk through the segments to the one with the size."""
    if data[:2] != b"\xff\xd8":
        return None
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # padding before a marker
            at += 1
        elif marker in _JPEG_PLAIN:
            at += 2
        elif marker in _JPEG_END:
            return None
        elif marker in _JPEG_FRAMES:
            if at + 9 > len(data):
                return None
            height, width = data[at + 5 : at + 7], data[at + 7 : at + 9]
            return PictureSize(int.from_bytes(width, "big"), int.from_bytes(height, "big"))
        else:
            size = int.from_bytes(data[at + 2 : at + 4], "big")
            if size < 2:
                return None
            at += 2 + size
    return None


def _read_webp(data: bytes | bytearray) -> PictureSize | None:
    if len(data) < 30 or data[:4] != b"RIFF" or data[8:12] != b"WEBP":
        return None
    kind, body = bytes(data[12:16]), data[20:30]
    if kind == b"VP8X":  # 24 bits each, less one
        return PictureSize(1 + int.from_bytes(body[4:7], "little"), 1 + int.from_bytes(body[7:10], "little"))
    if kind == b"VP8L" and body[0] == 0x2F:  # 14 bits each, less one
        bits = int.from_bytes(body[1:5], "little")
        return PictureSize(1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF))
    if kind == b"VP8 " and body[3:6] == b"\x9d\x01\x2a":  # 14 bits each, then 2 bits of scaling
        width, height = (int.from_bytes(body[off : off + 2], "little") & 0x3FFF for off in (6, 8))
        return PictureSize(width, height)
    return None


_READERS: dict[str, Callable[[bytes | bytearray], PictureSize | None]] = {
    "image/jpeg": _read_jpeg,
    "image/png": _read_png,
    "image/webp": _read_webp,
}
PICTURE_TYPES = tuple(_READERS)
