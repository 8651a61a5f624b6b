"""Reads from certificate files when they expire. Python's `ssl` can do so only for a peer's certificate."""

from __future__ import annotations

import base64
import binascii
import re
from datetime import UTC, datetime
from pathlib import Path

FILE_BYTES_MAX = 1 << 20  # an authority's file may hold hundreds of certificates
SEQUENCE, UTC_TIME, GENERALIZED_TIME, VERSION = 0x30, 0x17, 0x18, 0xA0
_PEM = re.compile(rb"-----BEGIN CERTIFICATE-----(.*?)-----END CERTIFICATE-----", re.DOTALL)


def read_expiry(path: Path) -> float:
    """Return when the first of a PEM file's certificates expires, in unix seconds.

    Raises OSError if the file can't be read, ValueError if it contains no certificate.
    """
    with path.open("rb") as file:
        text = file.read(FILE_BYTES_MAX)
    try:
        found = [_find_expiry(base64.b64decode(block)) for block in _PEM.findall(text)]
    except (binascii.Error, IndexError, UnicodeDecodeError):
        raise ValueError(f"{path}: contains a certificate that can't be read") from None
    if not found:
        raise ValueError(f"{path}: contains no certificate")
    return min(found)


def _find_expiry(der: bytes) -> float:
    """Return `notAfter` of one certificate (RFC 5280 §4.1) in unix seconds.

    Raises ValueError or IndexError if it is not a certificate.
    """
    at = _enter(der, _enter(der, 0))  # Certificate, then tbsCertificate
    if der[at] == VERSION:
        at = _skip(der, at)
    for _ in ("serialNumber", "signature", "issuer"):
        at = _skip(der, at)
    not_after = _skip(der, _enter(der, at))  # validity: notBefore, notAfter
    begin, end = _measure(der, not_after)
    form = {UTC_TIME: "%y%m%d%H%M%SZ", GENERALIZED_TIME: "%Y%m%d%H%M%SZ"}.get(der[not_after])
    if form is None:
        raise ValueError("no time where a certificate has one")
    found = datetime.strptime(der[begin:end].decode("ascii"), form).replace(tzinfo=UTC)
    if form.startswith("%y") and found.year >= 2050:  # in RFC 5280 "50" is 1950; in strptime, 2050
        found = found.replace(year=found.year - 100)
    return found.timestamp()


def _measure(der: bytes, at: int) -> tuple[int, int]:
    """Return where the content of the element at `at` begins and ends. Raises ValueError or IndexError."""
    size, begin = der[at + 1], at + 2
    if size & 0x80:
        count = size & 0x7F
        size, begin = int.from_bytes(der[begin : begin + count], "big"), begin + count
    if begin + size > len(der):
        raise ValueError("an element that is longer than the certificate")
    return begin, begin + size


def _enter(der: bytes, at: int) -> int:
    if der[at] != SEQUENCE:
        raise ValueError("no certificate")
    return _measure(der, at)[0]


def _skip(der: bytes, at: int) -> int:
    return _measure(der, at)[1]
