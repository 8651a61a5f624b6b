"""Server-sent events: the stream for networks that break WebSockets.

The request is taken over from uvicorn like a WebSocket upgrade, so that the send rule sees the real socket: a
response that goes through ASGI would fill buffers that nobody can look into.
"""

from __future__ import annotations

import asyncio
import json
import random
import socket
from http import HTTPStatus
from typing import Any, ClassVar

from posecast_wire import Close, Retry, retry_of
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from posecast_relay.adapters.asked import STREAM_PATH, Asked, BadRequest, NoSuchStream, read_target
from posecast_relay.adapters.decoded import Decoded
from posecast_relay.adapters.forms import EventForm, Form, JsonForm
from posecast_relay.adapters.pump import Pump
from posecast_relay.adapters.websocket import CLOSING_S, use_small_buffers
from posecast_relay.core import messages
from posecast_relay.core.hub import DRAIN_RETRY_S, GOING
from posecast_relay.core.viewer import Viewer

HEAD = (
    b"HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ncache-control: no-store\r\n"
    b"access-control-allow-origin: *\r\nx-accel-buffering: no\r\nconnection: close\r\n\r\n"
    b"retry: 2000\n\n"  # ms, after a connection that ended without a word
)
# These viewers never speak. A status goes out every second, so a peer that is gone leaves it unacknowledged.
USER_TIMEOUT_MS = 11_000


class EventStream(asyncio.Protocol):
    """One viewer's response, from its head to its end."""

    def __init__(
        self, transport: asyncio.Transport, connections: set[Any], pump: Pump, form: Form, asked: Asked
    ) -> None:
        self._transport = transport
        self._connections = connections
        self._pump = pump
        self._form = form
        self._closing: asyncio.TimerHandle | None = None
        limits = pump.hub.limits
        lives_s = limits.max_age_s * random.uniform(0.9, 1.1)
        self._viewer = Viewer(
            self, asked.robot, asked.view, asked.hz, limits, pump.now(), lives_s, asked.decoded, speaks=False
        )

    def start(self) -> None:
        """Join; the first write brings everything."""
        self._connections.add(self)
        self._transport.set_protocol(self)
        use_small_buffers(self._transport)
        sock = self._transport.get_extra_info("socket")
        if sock is not None and hasattr(socket, "TCP_USER_TIMEOUT"):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, USER_TIMEOUT_MS)
        self._transport.write(HEAD)
        self._pump.join(self._viewer)

    # ---- asyncio ----------------------------------------------------------

    def connection_lost(self, _exc: Exception | None) -> None:
        """The connection is gone, by whichever side."""
        self._connections.discard(self)
        if self._closing is not None:
            self._closing.cancel()
        self._pump.hub.leave(self._viewer)

    def data_received(self, _data: bytes) -> None:
        """There is nothing to say on this connection."""

    def pause_writing(self) -> None:
        """The socket did not take everything."""
        self._viewer.paused(self._pump.now())

    def resume_writing(self) -> None:
        """The socket has taken everything."""
        self._pump.carry_out(self._pump.hub.drained(self._viewer))

    def shutdown(self) -> None:
        """uvicorn stops."""
        self.end(Close.DRAIN, GOING, DRAIN_RETRY_S)

    # ---- what it is sent (Outlet) -------------------------------------------

    def write(self, data: bytes) -> None:
        """Messages, as events."""
        room = self._pump.hub.viewers.get(self._viewer)
        if room is not None:
            self._transport.write(self._form.of(data, room.stream))

    def end(self, close: Close, reason: str, retry_s: float | None) -> None:
        """Say why and when to come again, then close."""
        if self._closing is not None:
            return
        ((_, bye),) = messages.split(messages.bye(close, reason, retry_s))
        wait_ms = _wait_ms(close, retry_s)
        self._transport.write(b"event: bye\ndata: " + bye + b"\nretry: %d\n\n" % wait_ms)
        self._transport.close()
        self._closing = asyncio.get_running_loop().call_later(CLOSING_S, self._transport.abort)

    def cut(self, _close: Close) -> None:
        """Abort."""
        self._transport.abort()


def _wait_ms(close: Close, retry_s: float | None) -> int:
    """A browser comes again by itself after exactly what it is told, so the dice are thrown here."""
    if retry_of(close) is Retry.WAIT:
        return round(1000 * (retry_s or 30.0) * random.uniform(1.0, 1.5))
    return round(1000 * random.uniform(0.1, retry_s or 10.0))


class _Http(HttpToolsProtocol):
    """uvicorn's HTTP, less the requests for event streams."""

    pump: ClassVar[Pump]
    forms: ClassVar[dict[bool, Form]]

    _wanted = False
    _taken = False

    def on_headers_complete(self) -> None:
        """Look whose request it is."""
        if self._taken:
            return
        found = STREAM_PATH.fullmatch(self.url.partition(b"?")[0].decode("latin-1"))
        idle = self.cycle is None or self.cycle.response_complete
        plain = self.parser.get_method() == b"GET" and not self.parser.should_upgrade()
        self._wanted = bool(found and found[2]) and idle and plain
        if not self._wanted:
            super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """A request for events has none."""
        if not self._wanted:
            super().on_body(body)

    def on_message_complete(self) -> None:
        """Take the connection over; whatever else it brings is of no interest."""
        if not self._wanted:
            super().on_message_complete()
        elif not self._taken:
            self._taken = True
            self._take_over()

    def _take_over(self) -> None:
        try:
            asked = read_target(self.url.decode("latin-1"), ".sse")
            asked.check()
        except BadRequest as e:
            self._refuse(e.status, str(e))
            return
        except NoSuchStream as e:
            self._refuse(HTTPStatus.NOT_FOUND, str(e))
            return
        self.connections.discard(self)
        form = self.forms[asked.decoded]
        EventStream(self.transport, self.connections, self.pump, form, asked).start()

    def _refuse(self, status: HTTPStatus, reason: str) -> None:
        self.pump.handshakes["refused"] += 1
        body = json.dumps({"error": reason}).encode()
        head = (
            f"HTTP/1.1 {status.value} {status.phrase}\r\ncontent-type: application/json\r\n"
            f"content-length: {len(body)}\r\naccess-control-allow-origin: *\r\nconnection: close\r\n\r\n"
        )
        self.transport.write(head.encode() + body)
        self.transport.close()


def http_protocol(of: Pump, decoded: Decoded) -> type[_Http]:
    """The class that uvicorn takes as its `http` option."""

    class Bound(_Http):
        pump = of
        forms: ClassVar[dict[bool, Form]] = {False: EventForm(), True: EventForm(JsonForm(decoded))}

    return Bound
