"""Reads a segment's numbers and texts from bytes, and writes them. A refusal names the place."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NoReturn

from posecast_wire.checked import is_unicode
from posecast_wire.messages import COUNT_MAX
from posecast_wire.segment.records import refuse

HASH_BYTES = 32
SHA256 = re.compile("[0-9a-f]{64}")


class ByteReader:
    """Reads `data` from `at` up to `end`. Whatever is refused raises SegmentError with the byte's offset."""

    def __init__(self, data: bytes, at: int, end: int) -> None:
        self.data = data
        self.at = at
        self.end = end

    def fail(self, what: str, reason: str) -> NoReturn:
        """Raise SegmentError for the place reached."""
        refuse(f"byte {self.at}", f"{what}: {reason}")

    def take_bytes(self, what: str, count: int) -> bytes:
        """The next `count` bytes."""
        start = self.at
        if count > self.end - start:
            self.fail(what, f"{count} bytes said, {self.end - start} left")
        self.at = start + count
        return self.data[start : self.at]

    def take_u64(self, what: str) -> int:
        """A number of eight bytes."""
        return int.from_bytes(self.take_bytes(what, 8), "little")

    def take_byte(self, what: str) -> int:
        """A number of one byte."""
        return self.take_bytes(what, 1)[0]

    def take_varint(self, what: str, most: int = COUNT_MAX) -> int:
        """A varint of at most `most`."""
        data, start = self.data, self.at
        value = 0
        for i in range(start, min(start + 8, self.end)):
            byte = data[i]
            value |= (byte & 0x7F) << 7 * (i - start)
            if byte < 0x80:
                if byte == 0 and i > start:
                    self.fail(what, "a number longer than it needs")
                if value > most:
                    self.fail(what, f"{value}, {most} allowed")
                self.at = i + 1
                return value
        return self.fail(what, "cut short" if self.end - start < 8 else "a number without an end")

    def take_text(self, what: str, bytes_max: int) -> str:
        """A text of at most `bytes_max` bytes of UTF-8, after its length."""
        return self.take_utf8(what, self.take_varint(f"{what} length", bytes_max))

    def take_utf8(self, what: str, count: int) -> str:
        """A text of `count` bytes of UTF-8."""
        start = self.at
        raw = self.take_bytes(what, count)
        try:
            return raw.decode()
        except UnicodeDecodeError:
            return refuse(f"byte {start}", f"{what}: not UTF-8")

    def take_hash(self, what: str) -> str | None:
        """A SHA-256 in hexadecimal digits, or None."""
        size = self.take_varint(f"{what} length")
        if size not in (0, HASH_BYTES):
            self.fail(what, f"a hash of {size} bytes")
        return self.take_bytes(what, size).hex() or None

    def take_info(self, what: str, bytes_max: int) -> dict[str, str]:
        """Names and texts, of at most `bytes_max` bytes in all."""
        start = self.at
        info: dict[str, str] = {}
        for _ in range(self.take_varint(f"{what} count", bytes_max)):
            name = self.take_text(f"{what} name", bytes_max)
            if name in info:
                self.fail(what, "a name appears twice")
            info[name] = self.take_text(f"{what} text", bytes_max)
            if self.at - start > bytes_max:
                break
        if self.at - start > bytes_max:
            self.fail(what, f"over {bytes_max} bytes")
        return info


def pack_varint(value: int, what: str = "number", most: int = COUNT_MAX) -> bytes:
    """A varint. Raises SegmentError for what is not from 0 to `most`."""
    if 0 <= value < 0x80:
        return bytes((value,))
    if not 0 <= value <= most:
        refuse(what, f"{value}, 0 to {most} allowed")
    packed = bytearray()
    while value >= 0x80:
        packed.append(value & 0x7F | 0x80)
        value >>= 7
    packed.append(value)
    return bytes(packed)


def pack_text(text: str, what: str, bytes_max: int) -> bytes:
    """A text after its length. Raises SegmentError when it is too long or not Unicode."""
    raw = pack_utf8(text, what, bytes_max)
    return pack_varint(len(raw)) + raw


def pack_utf8(text: str, what: str, bytes_max: int) -> bytes:
    """A text alone. Raises SegmentError when it is too long or not Unicode."""
    if not is_unicode(text):
        refuse(what, "not Unicode")
    raw = text.encode()
    if len(raw) > bytes_max:
        refuse(what, f"{len(raw)} bytes, {bytes_max} allowed")
    return raw


def pack_hash(digest: str | None, what: str) -> bytes:
    """A hash after its length. Raises SegmentError when it is no SHA-256 in hexadecimal digits."""
    if digest is None:
        return b"\0"
    if not SHA256.fullmatch(digest):
        refuse(what, "no SHA-256")
    return pack_varint(HASH_BYTES) + bytes.fromhex(digest)


def pack_info(info: Mapping[str, str], what: str, bytes_max: int) -> bytes:
    """Names and texts. Raises SegmentError when they are too long."""
    parts = [pack_varint(len(info))]
    for name, text in info.items():
        parts += (pack_text(name, what, bytes_max), pack_text(text, what, bytes_max))
    packed = b"".join(parts)
    if len(packed) > bytes_max:
        refuse(what, f"{len(packed)} bytes, {bytes_max} allowed")
    return packed
