"""Reads WebSocket frames from viewers: masked, mostly short, seldom fragmented."""

from __future__ import annotations

SHORT = 125  # longest message whose size fits the frame's second byte


def read_short_text(data: bytes) -> bytes | None:
    """Return the text if `data` is one complete, short text message from a viewer; else None.

    This takes a fifth of the library's time. The library handles all other frames.
    """
    size = len(data) - 6
    if not 0 < size <= SHORT or data[0] != 0x81 or data[1] != 0x80 | size:
        return None
    mask = (data[2:6] * ((size + 3) // 4))[:size]
    return (int.from_bytes(data[6:], "big") ^ int.from_bytes(mask, "big")).to_bytes(size, "big")


def count_frame_bytes(size: int) -> int:
    """Return the bytes of a viewer's frame with a payload of `size` bytes, head and mask included."""
    return size + (6 if size <= SHORT else 8 if size < 1 << 16 else 14)


class Fragments:
    """The fragments of an incomplete message. The library limits their total size."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []

    def __bool__(self) -> bool:
        """Whether a message has begun."""
        return bool(self._parts)

    def join(self, data: bytes | bytearray | memoryview, is_last: bool) -> bytes | None:
        """Add a fragment and return the whole message if it is the last one; else None."""
        if is_last and not self._parts:
            return bytes(data)
        self._parts.append(bytes(data))
        if not is_last:
            return None
        whole, self._parts = b"".join(self._parts), []
        return whole
