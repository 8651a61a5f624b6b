"""WebSocket frames as viewers send them: masked, mostly short, seldom in parts."""

from __future__ import annotations

SHORT = 125  # bytes of a message whose size stands in the frame's second byte


def read_short_text(data: bytes) -> bytes | None:
    """Return the text when `data` is one whole, short text message of a viewer; else None.

    A fifth of what the library takes for it. Whatever is not plainly that is the library's to judge.
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
    """The fragments of a message that is incomplete. The library bounds their sum."""

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
