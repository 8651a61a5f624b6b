"""Many TCP connections of one attacker, in one thread: opened at once, written to, and read or not."""

from __future__ import annotations

import resource
import selectors
import socket
import struct
import time
from collections.abc import Callable, Iterable
from contextlib import suppress

from tests.attack.target import Target

KEY = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ=="
READ_BYTES = 1 << 16
MASK = bytes(4)
RESET = struct.pack("ii", 1, 0)


def allow_sockets() -> None:
    """As many as this process may have."""
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def get(path: str, *headers: str) -> bytes:
    """A request over a connection that stays open."""
    more = "".join(f"{header}\r\n" for header in headers)
    return f"GET {path} HTTP/1.1\r\nHost: relay\r\n{more}\r\n".encode()


def stream(robot: str = "innocent", query: str = "hz=0") -> bytes:
    """The request for a WebSocket."""
    path = f"/api/v1/robots/{robot}/live?{query}"
    return get(path, "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", KEY)


def text(said: str) -> bytes:
    """A viewer's message, masked by zeros."""
    data = said.encode()
    if len(data) < 126:
        return bytes((0x81, 0x80 | len(data))) + MASK + data
    return bytes((0x81, 0xFE)) + len(data).to_bytes(2, "big") + MASK + data


class Crowd:
    """`write` and `read` never wait; what a socket refuses is lost. `first`: written on opening."""

    def __init__(self, at: Target, first: Callable[[int], bytes], small: bool = False) -> None:
        allow_sockets()
        self._at = at
        self._first = first
        self._small = small  # little room for what it does not read
        self._selector = selectors.DefaultSelector()
        self.sockets: dict[int, socket.socket] = {}
        self.heard: set[int] = set()
        self.opened = 0
        self.ended = 0
        self.bytes_read = 0

    def open(self, numbers: Iterable[int]) -> None:
        """One connection for each."""
        for number in numbers:
            made = socket.socket()
            if self._small:
                made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            made.settimeout(5.0)
            try:
                made.connect(self._at.address)
            except OSError:
                made.close()
                continue
            made.setblocking(False)
            self.sockets[number] = made
            self.opened += 1
            self._selector.register(made, selectors.EVENT_READ, number)
            self.write(number, self._first(number))

    def write(self, number: int, data: bytes) -> None:
        """As much of it as goes now."""
        found = self.sockets.get(number)
        if found is not None:
            with suppress(OSError):
                found.send(data)

    def read(self, wait_s: float = 0.0) -> list[int]:
        """Reads and discards everything available. Returns the clients whose connections have ended."""
        gone = []
        for key, _ in self._selector.select(wait_s):
            number = int(key.data)
            try:
                data = self.sockets[number].recv(READ_BYTES)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            self.heard.add(number)
            self.bytes_read += len(data)
            if not data:
                gone.append(number)
        for number in gone:
            self.ended += 1
            self.drop(number)
        return gone

    def drop(self, number: int, reset: bool = False) -> None:
        """Leave."""
        found = self.sockets.pop(number, None)
        self.heard.discard(number)
        if found is not None:
            self._selector.unregister(found)
            if reset:
                found.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
            found.close()

    def until_heard(self, wait_s: float = 5.0) -> None:
        """Whether all open ones have received an answer."""
        end_s = time.monotonic() + wait_s
        while len(self.heard) < len(self.sockets) and time.monotonic() < end_s:
            self.read(0.05)

    def reopen(self) -> None:
        """Replaces disconnected clients at once."""
        self.open(self.read())
