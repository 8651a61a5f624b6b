"""Reads a channel of the robot's shared memory through the TCP server `achd`. Reads all accumulated frames at
once.

The client sends header lines and a line `.`; the server answers in the same way. Then it sends frames, each
after 16 bytes: `achpipe\\0` and the frame's length (u64, little endian). There are no timestamps, sequence
numbers or heartbeats.

`direction` sets what the *server* does. With `push` it sends its frames. With `pull` it would write our data
into the robot's channel, so this agent never uses that word.
"""

from __future__ import annotations

import math
import select
import socket
import struct
import threading
import time
from collections import deque

from posecast_edge.model.finding import make_printable
from posecast_edge.sources.hubo.reconnecting import FRAME_MAX, KEPT_MAX, WAIT_S, PersistentReader, ReaderError

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
                raise AchdProtocolError(
                    f"header line {make_printable(text[:120])} has no key and value: this is not achd"
                )
            self._head[text[:at].strip().lower()] = text[at + 1 :].strip()

    def _check(self) -> None:
        status = self._head.get("status", "")
        if not status.isdecimal() or len(status) > STATUS_DIGITS:
            raise AchdProtocolError("a header without a status: this is not achd")
        number = int(status)
        if number:
            name = f"ACH_{STATUS[number]}" if number < len(STATUS) else f"status {number}"
            message = self._head.get("message", "")
            raise AchdProtocolError(f"{make_printable(message[:120])} ({name})" if message else name)


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


# --- the connection

ANSWER_S = 3.0  # to connect, and again until the server has answered
SILENT_S = 5.0  # a restarted daemon makes a new channel; the old connection then stays silent for ever
CHUNK = 1 << 16
DRAIN_MAX = 1 << 20  # bytes read at once; then use the newest frame, even if more data is arriving
BATCH_BYTES = 1 << 16  # the kernel buffers this much while we wait
BATCH_LATE_S = 0.03  # how long to wait for a late batch; then use the frames that have arrived
# achd combines small writes (Nagle): data smaller than a segment is sent once the previous data is
# acknowledged. While nobody reads, the kernel acknowledges only at the second full segment. Over loopback a
# frame is smaller than a segment, so that takes 40 ms; limiting the segments' size avoids it.
SEGMENT_BYTES = 1400


class BatchTimer:
    """Computes how many frames to wait for, so that the last of them is the wanted one. A wake-up costs ten
    times as much as reading a frame, and waiting makes the last frame of a batch no older. Does no I/O; times
    are monotonic seconds."""

    def __init__(self) -> None:
        self._seen_s: float | None = None  # when the newest came
        self._period_s = 0.0  # from frame to frame, smoothed; 0: not known

    def record_batch(self, frames: int, now_s: float) -> None:
        """Record that `frames` frames arrived together."""
        if self._seen_s is not None:
            period_s = (now_s - self._seen_s) / frames
            self._period_s += (period_s - self._period_s) / 4 if self._period_s else period_s
        self._seen_s = now_s

    def reset(self) -> None:
        """Forget the period, because a batch did not arrive in time: the source has slowed down or paused."""
        self._period_s, self._seen_s = 0.0, None

    def compute_batch(self, wanted_s: float) -> int:
        """The number of frames, counted from now, up to the first one expected at `wanted_s` or later."""
        if not self._period_s or self._seen_s is None:
            return 1
        return max(1, math.ceil(min((wanted_s - self._seen_s) / self._period_s, BATCH_BYTES)))

    def predict_due_s(self, frames: int) -> float:
        """When the last of `frames` frames is expected."""
        return (self._seen_s or 0.0) + frames * self._period_s


class AchdReader(PersistentReader):
    """Reads one channel of one server."""

    def __init__(self, host: str, port: int, channel: str) -> None:
        super().__init__(f"{host}:{port}")
        self._address = (host, port)
        self._channel = channel
        self._socket: socket.socket | None = None
        self._poll = select.poll()
        self._conversation = AchdParser()
        self._heard_s = 0.0  # last bytes
        self._rhythm = BatchTimer()
        self._size = 0  # of a frame and its head
        self._low = 1  # bytes that wake us up

    def close(self) -> None:
        """Close the connection."""
        super().close()
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _open(self) -> None:
        self._socket = connection = _connected(*self._address)
        # an unplugged robot does not close the connection
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        connection.sendall(make_request(self._channel))
        connection.setblocking(False)
        self._poll = select.poll()
        self._poll.register(connection, select.POLLIN)
        self._conversation = AchdParser()
        self._heard_s = time.monotonic()
        self._rhythm, self._size, self._low = BatchTimer(), 0, 1  # as a new socket has it

    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        del stop
        connection = self._socket
        assert connection is not None
        batch = min(self._rhythm.compute_batch(wanted_s), BATCH_BYTES // self._size) if self._size else 1
        self._wake_for(connection, batch)
        wait_s = WAIT_S if batch <= 1 else self._rhythm.predict_due_s(batch) + BATCH_LATE_S - time.monotonic()
        if not self._poll.poll(max(0.0, wait_s) * 1e3):
            if batch > 1:
                self._rhythm.reset()
            else:
                self._nothing_came()
                return []
        frames = self._drain(connection)
        if frames:
            self._size = HEAD.size + len(frames[-1])
            self._rhythm.record_batch(len(frames), time.monotonic())
        return frames

    def _drain(self, connection: socket.socket) -> list[bytes]:
        frames = deque[bytes](maxlen=KEPT_MAX)
        taken = 0
        while taken < DRAIN_MAX:
            try:
                data = connection.recv(CHUNK)
            except BlockingIOError:
                break
            if not data:
                raise AchdProtocolError("the server closed the connection")
            self._heard_s = time.monotonic()
            taken += len(data)
            frames.extend(self._conversation.feed(data))
            if len(data) < CHUNK:
                break  # that was all
        return list(frames)

    def _nothing_came(self) -> None:
        silent_s = time.monotonic() - self._heard_s
        if not self._conversation.accepted and silent_s > ANSWER_S:
            raise AchdProtocolError(f"no answer within {ANSWER_S:g} s")
        if silent_s > SILENT_S:
            raise AchdProtocolError(f"no frame for {SILENT_S:g} s")

    def _wake_for(self, connection: socket.socket, batch: int) -> None:
        """Make poll return once `batch` frames have arrived; for one frame, at its first byte."""
        low = batch * self._size - self._conversation.pending if batch > 1 else 1
        if low != self._low:
            self._low = low
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, low)

    def _reason(self, e: Exception) -> str:
        return f"no connection within {ANSWER_S:g} s" if isinstance(e, TimeoutError) else super()._reason(e)


def _connected(host: str, port: int) -> socket.socket:
    """Connect to the first of the host's addresses that answers, with segments of at most SEGMENT_BYTES."""
    failure = OSError(f"{host} has no address")
    for family, kind, protocol, _, address in socket.getaddrinfo(host, port, type=socket.SOCK_STREAM):
        connection = socket.socket(family, kind, protocol)
        try:
            connection.settimeout(ANSWER_S)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_MAXSEG, SEGMENT_BYTES)
            connection.connect(address)
        except OSError as e:
            connection.close()
            failure = e
        else:
            return connection
    raise failure
