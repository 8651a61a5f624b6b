"""FNV-1a hash of 32 bits: identifies a schema by its text and a base frame by its bytes."""

from __future__ import annotations

from collections.abc import Callable

PRIME, OFFSET = 0x01000193, 0x811C9DC5


def fnv1a32_in_python(data: bytes) -> int:
    """The hash of `fnv1a32`, 150 times as slow; for Python 3.10, for which the C version has no wheels."""
    value = OFFSET
    for byte in data:
        value = (value ^ byte) * PRIME & 0xFFFFFFFF
    return value


def _fastest() -> Callable[[bytes], int]:
    try:
        from fnv_hash_fast import fnv1a_32  # noqa: PLC0415 - not there for every Python
    except ImportError:
        return fnv1a32_in_python
    return fnv1a_32


_fnv1a_32 = _fastest()


def fnv1a32(data: bytes) -> int:
    """Hash of `data`, 0 … 2^32-1. Serves as an identifier and detects accidental damage, not forgery.

    Uses C code where available, since a relay hashes what untrusted senders send. Source: Fowler, Noll, Vo,
    `FNV-1a` (RFC 9923).
    """
    return _fnv1a_32(data)
