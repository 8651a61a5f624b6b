"""Frames and segments written by hand as in SPEC.md: also such as no encoder or writer of ours would make."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence

from posecast_wire import Schema

FROM_MS = 1_764_000_000_000
Part = tuple[bytes, int]  # bytes, and how often
Coded = Sequence[tuple[int, Sequence[int]]]  # per field: nibble, residuals


def code_bits(residual: int, k: int) -> str:
    bits = f"{(2 * residual if residual >= 0 else -2 * residual - 1) + (1 << k):b}"
    return "0" * (len(bits) - 1 - k) + bits


def packed(header: bytes, bits: str) -> bytes:
    bits += "0" * (-len(bits) % 8)
    return header + int(bits, 2).to_bytes(len(bits) // 8, "big")


def body(fields: Coded, orders: Sequence[int]) -> str:
    bits, i = "", 0
    for n, residuals in fields:
        bits += f"{n:04b}"
        for r in residuals:
            bits += "" if n == 15 else code_bits(r, max(0, min(15, orders[i] + n - 4)))
            i += 1
    return bits


def key_frame(schema: str, seq: int, t: float, fields: Coded, orders: Sequence[int]) -> bytes:
    """A KEY. `schema`: its text."""
    header = struct.pack("<BIId", 0x13, Schema.parse(schema).id, seq, t)
    return packed(header, body(fields, [4] * len(orders)) + "".join(f"{k:04b}" for k in orders))


def plain_frame(base: int, distance: int, ms: int, fields: Coded, orders: Sequence[int]) -> bytes:
    return packed(struct.pack("<BIHH", 0x10, base, distance, ms), body(fields, orders))


def reserved_frame(plain: bytes) -> bytes:
    """A plain frame as the REF that it would be."""
    return b"\x12" + plain[1:]


def varint(value: int) -> bytes:
    low, rest = value & 0x7F, value >> 7
    return bytes((low | 0x80,)) + varint(rest) if rest else bytes((low,))


def text(value: str) -> bytes:
    return varint(len(value.encode())) + value.encode()


def digest(value: str | None) -> bytes:
    return b"\0" if value is None else b"\x20" + bytes.fromhex(value)


def header(
    count: int, first_seq: int, last_seq: int, duration_ms: int = 100, members: dict[str, bytes] | None = None
) -> bytes:
    """A header of robot `hubo`, view `public`. `members`: other bytes for some."""
    found = {
        "robot": text("hubo"),
        "view": text("public"),
        "take": struct.pack("<Q", 7),
        "index": varint(0),
        "run": struct.pack("<Q", 9 if count else 0),
        "from": varint(FROM_MS),
        "duration": varint(duration_ms),
        "frames": varint(count),
        "first": varint(first_seq),
        "last": varint(last_seq),
        "schema": digest("5c" * 32 if count else None),
        "model": digest(None),
        "word": b"\0",
        "missing": varint(0),
        "numbering": text(""),
        "event_n": varint(0),
        "info": varint(0),
        "faults": varint(0),
    }
    changed = members or {}
    assert not set(changed) - set(found) - {"more"}
    return b"".join((found | changed).values())


def record(kind: int, wait_us: int, content: bytes, length: int | None = None) -> bytes:
    """One record. `length`: another one than it has."""
    return bytes((kind,)) + varint(wait_us) + varint(len(content) if length is None else length) + content


def frame_record(frame: bytes, wait_us: int = 0, late_us: int = 0) -> bytes:
    return record(1, wait_us, varint(late_us) + frame)


def segment(
    head: bytes, records: Sequence[bytes | Part] = (), count: int | None = None, magic: bytes = b"\x89PCS"
) -> list[Part]:
    """A segment whose checksums are right. `count`: another number of records than there are. `magic`: of
    something else that is built as segments are."""
    front = magic + b"\1" + struct.pack("<I", len(head)) + head
    parts = [one if isinstance(one, tuple) else (one, 1) for one in records]
    found = len(parts) if count is None else count
    tail = struct.pack("<BII", 0, found, zlib.crc32(joined(parts)))
    return [(front + struct.pack("<I", zlib.crc32(front)), 1), *parts, (tail, 1)]


def joined(parts: Sequence[Part]) -> bytes:
    return b"".join(data * times for data, times in parts)
