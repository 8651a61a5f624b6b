"""Messages of ROS 2 as CDR, little endian: laid out once, then only their times and numbers change."""

from __future__ import annotations

import struct
from collections.abc import Sequence

ENCAPSULATION = b"\0\1\0\0"  # plain CDR, little endian; alignment counts from behind it
SECONDS_MAX = (1 << 31) - 1  # of a builtin_interfaces/Time: up to 2038
STAMP = struct.Struct("<iI")


class CdrMessage:
    """A message in the making. What is added stands in the order of the message's definition; a place that is
    returned says where numbers can be written later."""

    def __init__(self) -> None:
        self._data = bytearray(ENCAPSULATION)
        self._stamps: list[int] = []

    def __bytes__(self) -> bytes:
        return bytes(self._data)

    def add_stamp(self) -> None:
        """Add a builtin_interfaces/Time, for `set_stamps`."""
        self._align(4)
        self._stamps.append(len(self._data))
        self._data += bytes(STAMP.size)

    def add_header(self, frame_id: str) -> None:
        """Add a std_msgs/Header."""
        self.add_stamp()
        self.add_text(frame_id)

    def add_byte(self, value: int) -> None:
        """Add a uint8."""
        self._data.append(value)

    def add_count(self, value: int) -> None:
        """Add a uint32, as it also stands before a sequence."""
        self._align(4)
        self._data += struct.pack("<I", value)

    def add_text(self, text: str) -> None:
        """Add a string; a zero byte in it, which would end it, is left out."""
        raw = text.replace("\0", "").encode()
        self.add_count(len(raw) + 1)
        self._data += raw + b"\0"

    def add_texts(self, texts: Sequence[str]) -> None:
        """Add a string[]."""
        self.add_count(len(texts))
        for text in texts:
            self.add_text(text)

    def add_numbers(self, count: int) -> int:
        """Add so many float64 that are members or a fixed array, all 0; return their place."""
        if count:
            self._align(8)
        at = len(self._data)
        self._data += bytes(8 * count)
        return at

    def add_sequence(self, count: int) -> int:
        """Add a float64[] of so many zeros; return their place."""
        self.add_count(count)
        return self.add_numbers(count)

    def set_stamps(self, unix_ns: int) -> None:
        """Set all times of the message. What a Time can't hold becomes the last that it can."""
        seconds, nanoseconds = divmod(unix_ns, 10**9)
        if seconds > SECONDS_MAX:
            seconds, nanoseconds = SECONDS_MAX, 10**9 - 1
        for at in self._stamps:
            STAMP.pack_into(self._data, at, seconds, nanoseconds)

    def set_numbers(self, at: int, numbers: Sequence[float]) -> None:
        """Write float64 from a place on."""
        struct.pack_into(f"<{len(numbers)}d", self._data, at, *numbers)

    def _align(self, size: int) -> None:
        self._data += bytes(-(len(self._data) - len(ENCAPSULATION)) % size)
