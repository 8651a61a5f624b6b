"""One viewer's blocking socket: upgrade, messages, and acknowledgements like those of the page."""

from __future__ import annotations

import json
import socket
import time
from collections.abc import Callable, Iterator

from websockets.client import ClientProtocol
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

ACK_INTERVAL_S = 1.0
SILENCE_S = 5.0  # a status comes every second
RECEIVE_BYTES = 65536
_SLOW_BUFFER_BYTES = 4096
_KINDS = (Opcode.TEXT, Opcode.BINARY, Opcode.CLOSE)


class ProtocolError(ValueError):
    """The server violated RFC 6455, or refused the upgrade. The message is one line."""


class Connection:
    """A connection, open until `close`. Raises OSError or ProtocolError if it can't connect or breaks.

    Framing is by websockets' own state machine, whose whole clients cost several times as much under gevent:
    a load test must not measure itself.
    """

    def __init__(self, address: str, slow: bool = False) -> None:
        url = parse_uri(address)
        self._protocol = ClientProtocol(url)
        self._binaries = 0
        self._acknowledged = 0
        self._acknowledged_s = time.monotonic()
        self._first: list[tuple[Opcode, bytes]] = []  # messages that came with the response
        self.socket = socket.socket()
        self.socket.settimeout(SILENCE_S)
        if slow:  # before connecting, otherwise the kernel reads ahead
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _SLOW_BUFFER_BYTES)
        try:
            self.socket.connect((url.host, url.port))
            self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._protocol.send_request(self._protocol.connect())
            self._flush()
            while self._protocol.state is State.CONNECTING:
                data = self.socket.recv(RECEIVE_BYTES)
                if not data:
                    raise ProtocolError("the connection was closed before the response")
                self._first += self.take(data)
        except BaseException:
            self.close()
            raise

    def take(self, data: bytes) -> list[tuple[Opcode, bytes]]:
        """Return the messages that these bytes complete, kind (TEXT, BINARY or CLOSE) and payload. Answers
        pings. A ProtocolError is final."""
        self._protocol.receive_data(data)
        frames = [event for event in self._protocol.events_received() if isinstance(event, Frame)]
        if not (frames and frames[-1].opcode is Opcode.CLOSE):  # a relay that has closed needs no answer
            self._flush()
        error = self._protocol.handshake_exc or self._protocol.parser_exc
        if error is not None:
            raise ProtocolError(str(error)) from error
        if not all(frame.fin and frame.opcode is not Opcode.CONT for frame in frames):
            raise ProtocolError("a message in fragments, which a relay does not send")
        found = [(frame.opcode, bytes(frame.data)) for frame in frames if frame.opcode in _KINDS]
        self._binaries += sum(opcode is Opcode.BINARY for opcode, _ in found)
        return found

    def messages(self, receive: Callable[[], bytes] | None = None) -> Iterator[tuple[Opcode, bytes, float]]:
        """Yield the kind (TEXT, BINARY or CLOSE), payload, and arrival in monotonic s, until the relay
        closes.

        `receive`: reads from the socket; None: read everything available.
        """
        receive = receive or (lambda: self.socket.recv(RECEIVE_BYTES))
        found, arrival_s = self._first, time.monotonic()
        while True:
            for opcode, payload in found:
                yield opcode, payload, arrival_s
                if opcode is Opcode.CLOSE:
                    return
            self.acknowledge(arrival_s)
            data = receive()
            if not data:
                return
            arrival_s = time.monotonic()
            found = self.take(data)

    def acknowledge(self, now_s: float) -> None:
        """Say how many frames have come, once a second at most."""
        # after any message, not only a frame: a relay that waits for an ack still sends status
        if now_s - self._acknowledged_s >= ACK_INTERVAL_S and self._binaries > self._acknowledged:
            self._acknowledged_s, self._acknowledged = now_s, self._binaries
            self._protocol.send_text(json.dumps({"type": "ack", "n": self._binaries}).encode())
            self._flush()

    def _flush(self) -> None:
        for data in self._protocol.data_to_send():
            if data:
                self.socket.sendall(data)

    def close(self) -> None:
        """Close the connection. Calling it twice is fine."""
        self.socket.close()
