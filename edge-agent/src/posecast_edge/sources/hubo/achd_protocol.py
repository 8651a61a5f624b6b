"""The protocol of `achd`, which sends a channel of the robot's shared memory to a TCP client. Pure.

The client sends header lines and a line `.`; the server answers in the same way. Then it sends frames, each
after 16 bytes: `achpipe\\0` and the frame's length (u64, little endian). There are no timestamps, sequence
numbers or heartbeats.

`direction` sets what the *server* does. With `push` it sends its frames. With `pull` it would write our data
into the robot's channel, so this agent never uses that word.
"""

from __future__ import annotations

import struct
from collections import deque

from posecast_edge.sources.hubo.reconnecting import FRAME_MAX, KEPT_MAX, ReaderError

PORT = 8076
LINE_MAX = 1024
LINES_MAX = 64
HEAD = struct.Struct("<8sQ")
MAGIC = b"achpipe\0"
STATUS_DIGITS = 10  # of a 32-bit number

# fmt: off
STATUS = (
    "OK", "OVERFLOW", "INVALID_NAME", "BAD_SHM_FILE", "FAILED_SYSCALL", "STALE_FRAMES", "MISSED_FRAME",
    "TIMEOUT", "EEXIST", "ENOENT", "CLOSED", "BUG", "EINVAL", "CORRUPT", "BAD_HEADER", "EACCES", "CANCELED",
    "EFAULT", "EINTR", "ENOTSUP",
)
# fmt: on


class AchdProtocolError(ReaderError):
    """The server reported an error or does not speak this protocol. One line."""


def make_request(channel: str) -> bytes:
    """The client's header: asks for the frames of `channel`, and for only the newest after a pause."""
    return f"channel-name: {channel}\ntransport: tcp\nget-last: 1\ndirection: push\n.\n".encode()


class AchdParser:
    """Parses the server's bytes: first the header of its reply, then frames."""

    def __init__(self) -> None:
        self.accepted = False  # the server has said OK
        self._buffer = bytearray()
        self._lines = 0
        self._head: dict[str, str] = {}

    def feed(self, data: bytes) -> list[bytes]:
        """Parse received bytes and return the frames that are now complete, oldest first, at most the newest
        KEPT_MAX.

        Raises AchdProtocolError when the server refuses or sends nonsense; the connection is then useless.
        """
        if self.accepted and not self._buffer:  # the common case: the data starts with a frame
            frames, taken = _frames(data)
            self._buffer += data[taken:]
            return frames
        self._buffer += data
        if not self.accepted:
            self._read_head()
            if not self.accepted:
                return []
        frames, taken = _frames(self._buffer)
        del self._buffer[:taken]
        return frames

    @property
    def pending(self) -> int:
        """Bytes received of a frame that is not complete yet."""
        return len(self._buffer)

    def _read_head(self) -> None:
        while not self.accepted:
            end = self._buffer.find(b"\n", 0, LINE_MAX)
            if end < 0:
                if len(self._buffer) >= LINE_MAX:
                    raise AchdProtocolError(f"a header line of over {LINE_MAX} bytes: this is not achd")
                return
            line = bytes(self._buffer[:end])
            del self._buffer[: end + 1]
            self._lines += 1
            if self._lines > LINES_MAX:
                raise AchdProtocolError(f"a header of over {LINES_MAX} lines: this is not achd")
            self._take(line)

    def _take(self, line: bytes) -> None:
        try:
            text = line.decode().partition("#")[0].strip()
        except UnicodeDecodeError:
            raise AchdProtocolError("a header that is not text: this is not achd") from None
        if text == ".":
            self._check()
            self.accepted = True
        elif text:
            # key and value are separated by : or =, whichever comes first
            at = min((i for i in (text.find(":"), text.find("=")) if i > 0), default=0)
            if not at:
                raise AchdProtocolError(f"header line {_shown(text)} has no key and value: this is not achd")
            self._head[text[:at].strip().lower()] = text[at + 1 :].strip()

    def _check(self) -> None:
        status = self._head.get("status", "")
        if not status.isdecimal() or len(status) > STATUS_DIGITS:
            raise AchdProtocolError("a header without a status: this is not achd")
        number = int(status)
        if number:
            name = f"ACH_{STATUS[number]}" if number < len(STATUS) else f"status {number}"
            message = self._head.get("message", "")
            raise AchdProtocolError(f"{_shown(message)} ({name})" if message else name)


def _frames(data: bytes | bytearray) -> tuple[list[bytes], int]:
    """The newest KEPT_MAX whole frames, and how many bytes all of them are."""
    at, found = 0, deque[slice](maxlen=KEPT_MAX)
    while len(data) - at >= HEAD.size:
        magic, size = HEAD.unpack_from(data, at)
        if magic != MAGIC:
            raise AchdProtocolError("no frame where one should begin: the stream is out of sync")
        if not 0 < size <= FRAME_MAX:
            raise AchdProtocolError(f"a frame of {size} bytes; at most {FRAME_MAX}")
        end = at + HEAD.size + size
        if len(data) < end:
            break
        found.append(slice(at + HEAD.size, end))
        at = end
    return [bytes(data[place]) for place in found], at


def _shown(text: str) -> str:
    return "".join(c if c.isprintable() else "�" for c in text[:120])
