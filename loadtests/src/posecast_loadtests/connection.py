"""One viewer's blocking socket: upgrade, messages, and acknowledgements like those of the page."""

from __future__ import annotations

import json
import os
import socket
import time
from collections.abc import Callable, Iterator
from urllib.parse import urlsplit

from posecast_loadtests.rfc6455 import (
    Opcode,
    ProtocolError,
    WebSocketReader,
    check_upgrade,
    client_frame,
    upgrade_request,
)

ACK_INTERVAL_S = 1.0
SILENCE_S = 5.0  # a status comes every second
RECEIVE_BYTES = 65536
_SLOW_BUFFER_BYTES = 4096


class Connection:
    """A connection, open until `close`. Raises OSError or ProtocolError if it can't connect or breaks."""

    def __init__(self, address: str, slow: bool = False) -> None:
        url = urlsplit(address)
        self.socket = socket.socket()
        self.socket.settimeout(SILENCE_S)
        if slow:  # before connecting, otherwise the kernel reads ahead
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SLOW_BUFFER_BYTES)
        try:
            self.socket.connect((url.hostname or "127.0.0.1", url.port or 80))
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._rest = self._upgrade(url.netloc, f"{url.path}?{url.query}")
        except BaseException:
            self.close()
            raise
        self._reader = WebSocketReader()
        self._binaries = 0
        self._acknowledged = 0
        self._acknowledged_s = time.monotonic()

    def _upgrade(self, host: str, path: str) -> bytes:
        key = os.urandom(16)
        self.socket.sendall(upgrade_request(host, path, key))
        answer = b""
        while (rest := check_upgrade(answer, key)) is None:
            more = self.socket.recv(4096)
            if not more:
                raise ProtocolError("the connection was closed before the response")
            answer += more
        return rest

    def messages(self, receive: Callable[[], bytes] | None = None) -> Iterator[tuple[Opcode, bytes, float]]:
        """Yield the kind (TEXT, BINARY or CLOSE), payload, and arrival in monotonic s, until the relay
        closes.

        `receive`: reads from the socket; None: read everything available.
        """
        receive = receive or (lambda: self.socket.recv(RECEIVE_BYTES))
        data = self._rest
        while True:
            arrival_s = time.monotonic()
            for opcode, payload in self._reader.feed(data):
                if opcode is Opcode.PING:
                    self.socket.sendall(client_frame(Opcode.PONG, payload))
                    continue
                self._binaries += opcode is Opcode.BINARY
                yield opcode, payload, arrival_s
                if opcode is Opcode.CLOSE:
                    return
            self._acknowledge(arrival_s)
            data = receive()
            if not data:
                return

    def _acknowledge(self, now_s: float) -> None:
        # after any message, not only a frame: a relay that waits for an ack still sends status
        if now_s - self._acknowledged_s >= ACK_INTERVAL_S and self._binaries > self._acknowledged:
            self._acknowledged_s, self._acknowledged = now_s, self._binaries
            text = json.dumps({"type": "ack", "n": self._binaries})
            self.socket.sendall(client_frame(Opcode.TEXT, text.encode()))

    def close(self) -> None:
        """Close the connection. Calling it twice is fine."""
        self.socket.close()
