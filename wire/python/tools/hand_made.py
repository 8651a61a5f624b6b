"""Frames written out by hand, bit by bit as in SPEC.md: also such as no encoder of ours would write."""

from __future__ import annotations

import struct
from collections.abc import Sequence

from posecast_wire import Schema

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
