"""FNV-1a, 32 bits: names a schema by its text and a base by its bytes."""

from __future__ import annotations

OFFSET_BASIS = 0x811C9DC5
PRIME = 0x01000193


def fnv1a32(data: bytes) -> int:
    """Hash of `data`, 0 … 2^32-1. A name and a checksum against accidents, not against forgers.

    Source: Fowler, Noll, Vo, `FNV-1a` (RFC 9923).
    """
    h = OFFSET_BASIS
    for byte in data:
        h = (h ^ byte) * PRIME & 0xFFFFFFFF
    return h
