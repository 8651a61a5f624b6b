"""The stream's own way in: a WebSocket upgrade is taken over from uvicorn before ASGI.

The handshake, and everything a viewer sends, goes through the sans-I/O protocol of the `websockets` library.
A viewer is sent messages that the core has made ready, straight to the transport: no task, no queue, no copy.
"""

from __future__ import annotations

import asyncio
import random
import socket
from typing import TYPE_CHECKING, Any, ClassVar, cast

from posecast_wire import Close
from websockets.frames import Frame as WebSocketFrame
from websockets.frames import Opcode
from websockets.http11 import Request
from websockets.protocol import OPEN
from websockets.server import ServerProtocol

from posecast_relay.adapters.asked import BadRequest, NoSuchStream, read_target
from posecast_relay.adapters.decoded import Decoded
from posecast_relay.adapters.forms import Form, JsonForm
from posecast_relay.adapters.pump import Pump
from posecast_relay.core import messages
from posecast_relay.core.hub import DRAIN_RETRY_S, GOING
from posecast_relay.core.viewer import Viewer

if TYPE_CHECKING:
    from uvicorn.config import Config
    from uvicorn.server import ServerState

# What an unread socket swallows before it pushes back. Small, so that a slow viewer shows soon (the kernel
# takes twice the figure); large enough for a join in one go.
SEND_BUFFER_BYTES = 16384
CLOSING_S = 2.0  # a viewer that does not answer a close in this time is cut off


def use_small_buffers(transport: asyncio.Transport) -> None:
    """So that the core hears of a slow viewer soon."""
    sock = transport.get_extra_info("socket")
    if sock is not None:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    # at 0 the transport tells at once when a socket has not taken everything
    transport.set_write_buffer_limits(high=0)


class LiveSocket(asyncio.Protocol):
    """One viewer's connection, from its HTTP request to its end."""

    pump: ClassVar[Pump]
    json_form: ClassVar[Form]

    def __init__(
        self,
        config: Config,  # noqa: ARG002 — the arguments are uvicorn's
        server_state: ServerState,
        app_state: Any,  # noqa: ARG002
    ) -> None:
        self._connections: set[Any] = server_state.connections
        self._ws = ServerProtocol(max_size=self.pump.hub.limits.message_bytes)
        self._transport: asyncio.Transport
        self._viewer: Viewer | None = None
        self._fragments: list[bytes] | None = None
        self._closing: asyncio.TimerHandle | None = None

    # ---- asyncio ----------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """uvicorn hands its transport over."""
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self)
        use_small_buffers(self._transport)

    def connection_lost(self, _exc: Exception | None) -> None:
        """The connection is gone, by whichever side."""
        self._connections.discard(self)
        if self._closing is not None:
            self._closing.cancel()
        if self._viewer is not None:
            self.pump.hub.leave(self._viewer)

    def pause_writing(self) -> None:
        """The socket did not take everything."""
        if self._viewer is not None:
            self._viewer.paused(self.pump.now())

    def resume_writing(self) -> None:
        """The socket has taken everything."""
        if self._viewer is not None:
            self.pump.carry_out(self.pump.hub.drained(self._viewer))

    def data_received(self, data: bytes) -> None:
        """Bytes from the viewer (first of all its HTTP request, as uvicorn read it)."""
        ws = self._ws
        ws.receive_data(data)
        if self._viewer is not None:
            self._viewer.heard_at = self.pump.now()
        for event in ws.events_received():
            if isinstance(event, Request):
                self._handshake(event)
            elif isinstance(event, WebSocketFrame):
                self._frame(event)
        self._send_own()

    def eof_received(self) -> None:
        """The viewer will send no more: there is no half-open stream here."""
        self._ws.receive_eof()
        self._send_own()

    def shutdown(self) -> None:
        """uvicorn stops. Viewers were moved away before, unless somebody was in a hurry."""
        if self._viewer is None:
            self._transport.close()
        else:
            self.end(Close.DRAIN, GOING, DRAIN_RETRY_S)

    # ---- what a viewer sends ------------------------------------------------

    def _handshake(self, request: Request) -> None:
        try:
            asked = read_target(request.path)
        except BadRequest as e:
            self.pump.handshakes["refused"] += 1
            self._ws.send_response(self._ws.reject(e.status, f"{e}\n"))
            return
        response = self._ws.accept(request)
        self._ws.send_response(response)
        self._send_own()
        pump = self.pump
        if self._ws.state is not OPEN:
            pump.handshakes["refused"] += 1
            return
        try:
            asked.check()
        except NoSuchStream as e:
            pump.hub.endings[Close.ABSENT] += 1
            pump.handshakes["told to go"] += 1
            self.end(Close.ABSENT, str(e), None)
            return
        lives_s = pump.hub.limits.max_age_s * random.uniform(0.9, 1.1)
        outlet = _JsonOutlet(self, self.json_form) if asked.decoded else self
        self._viewer = Viewer(
            outlet, asked.robot, asked.view, asked.hz, pump.hub.limits, pump.now(), lives_s, asked.decoded
        )
        pump.join(self._viewer)
        if self._transport.get_write_buffer_size() > 0:
            # uvicorn makes us the transport's protocol only after this call: it was told to pause, not we
            self._viewer.paused(pump.now())

    def _frame(self, frame: WebSocketFrame) -> None:
        if frame.opcode is Opcode.CLOSE or self._ws.state is not OPEN:
            return
        if frame.opcode is Opcode.BINARY:
            self._refuse(Close.BINARY, "viewers send text only")
        elif frame.opcode in (Opcode.TEXT, Opcode.CONT):
            if not frame.fin or self._fragments is not None:  # the library bounds their sum
                self._fragments = [*(self._fragments or []), bytes(frame.data)]
                if not frame.fin:
                    return
                whole, self._fragments = b"".join(self._fragments), None
            else:
                whole = bytes(frame.data)
            if self._viewer is not None:
                pump = self.pump
                pump.carry_out(pump.hub.message(self._viewer, whole, pump.now()))

    def _refuse(self, close: Close, reason: str) -> None:
        if self._viewer is not None:
            self.pump.carry_out(self.pump.hub.refuse(self._viewer, close, reason))

    # ---- what it is sent (Outlet) -------------------------------------------

    def write(self, data: bytes) -> None:
        """Ready-made messages, to the socket."""
        self._transport.write(data)

    def end(self, close: Close, reason: str, retry_s: float | None) -> None:
        """Say why, close, and do not wait for long."""
        if self._ws.state is not OPEN:
            return
        self._transport.write(messages.bye(close, reason, retry_s))
        self._ws.send_close(close, reason[:100])
        self._send_own()
        self._hurry()

    def cut(self, _close: Close) -> None:
        """Abort: nothing gets through to a viewer that does not read."""
        self._transport.abort()

    def _hurry(self) -> None:
        if self._closing is None:
            loop = asyncio.get_running_loop()
            self._closing = loop.call_later(CLOSING_S, self._transport.abort)

    def _send_own(self) -> None:
        """What the library itself wants to send: the handshake, pongs, closes, the end."""
        for data in self._ws.data_to_send():
            if data:
                self._transport.write(data)
            else:
                # half-close, and read on for a while: closing with unread data would reset the connection,
                # and the viewer would never see why
                self._let_go()
                if self._transport.can_write_eof():
                    self._transport.write_eof()
                else:
                    self._transport.close()
                self._hurry()

    def _let_go(self) -> None:
        """Nothing more may be written. An ending for a broken rule (1002, 1009) is counted by its code."""
        viewer, hub, sent = self._viewer, self.pump.hub, self._ws.close_sent
        if viewer is None or viewer not in hub.viewers:
            return
        hub.leave(viewer)
        if self._ws.parser_exc is not None and sent is not None:
            hub.endings[sent.code] += 1

    def write_as(self, form: Form, data: bytes) -> None:
        """The same in another form."""
        room = self.pump.hub.viewers.get(self._viewer) if self._viewer else None
        if room is not None:
            self._transport.write(form.of(data, room.stream))


class _JsonOutlet:
    """The outlet of a viewer of `format=json`."""

    def __init__(self, socket: LiveSocket, form: Form) -> None:
        self._form = form
        self._socket = socket
        self.end = socket.end
        self.cut = socket.cut

    def write(self, data: bytes) -> None:
        """Outlet."""
        self._socket.write_as(self._form, data)


def live_protocol(of: Pump, decoded: Decoded) -> type[LiveSocket]:
    """The class that uvicorn takes as its `ws` option."""

    class Bound(LiveSocket):
        pump = of
        json_form = JsonForm(decoded)

    return Bound
