"""Small pictures for tests: real heads, and as many bytes besides as a picture has."""

from __future__ import annotations

import struct
import zlib


def _segment(marker: int, body: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, 2 + len(body)) + body


# 5 × 3 px, the JPEG without the tables of its codes, the others as Pillow begins them
JPEG = (
    b"\xff\xd8"
    + _segment(0xE0, b"JFIF\0" + bytes((1, 1, 0, 0, 1, 0, 1, 0, 0)))
    + _segment(0xDB, bytes(65))
    + _segment(0xC0, struct.pack(">BHHB", 8, 3, 5, 1) + bytes((1, 0x11, 0)))
    + _segment(0xDA, bytes((1, 1, 0, 0, 63, 0)))
    + b"\xff\xd9"
)
WEBP_LOSSY = bytes.fromhex(
    "524946463800000057454250565038202c0000009001009d012a0500030001402625a00274ba00039800fef0"
)
WEBP_LOSSLESS = bytes.fromhex("524946461e000000574542505650384c110000002f0480000000750f2297a7ff8188e87f0000")
WEBP_EXTENDED = bytes.fromhex("524946467200000057454250565038580a00000018000000040000020000414c50480a0000")


def make_png(width_px: int, height_px: int) -> bytes:
    """Make a PNG of one colour; one that is large is so in its head only."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    rows = (b"\0" + bytes(3 * width_px)) * height_px if width_px * height_px < 10_000 else b""
    head = struct.pack(">IIBBBBB", width_px, height_px, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body
