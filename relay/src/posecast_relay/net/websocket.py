"""Serves the stream over WebSockets. A connection is taken over from uvicorn before ASGI.

The sans-I/O protocol of the `websockets` library handles the handshake and everything that a viewer sends,
except short messages, which are most. The core's messages to a viewer go directly to the transport: no
task, no queue, no copy.
"""

from __future__ import annotations

import asyncio
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, ClassVar, cast

from posecast_wire import Auth, Close, MessageError, parse_viewer_message
from websockets.frames import Frame as WebSocketFrame
from websockets.frames import Opcode
from websockets.http11 import Request
from websockets.protocol import CONNECTING, OPEN
from websockets.server import ServerProtocol

from posecast_relay.auth.access import Access
from posecast_relay.core import messages
from posecast_relay.core.policy import ANYONE, DRAIN_RETRY_S, GOING, REFUSALS, Applicant, Refusal
from posecast_relay.core.viewer import Viewer
from posecast_relay.net.encodings import DecodeCache, Encoding, JsonEncoding, JsonOutlet
from posecast_relay.net.request import (
    BadRequest,
    StreamRequest,
    join_all,
    make_viewer,
    read_bearer,
    read_target,
)
from posecast_relay.runtime.socket_options import descriptor_of, fit_buffer, peer_of, use_small_buffers
from posecast_relay.runtime.tasks import FAULT, isolated, isolated_task

if TYPE_CHECKING:
    from uvicorn.config import Config
    from uvicorn.server import ServerState


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


TOKEN_S = 5.0  # for the token to arrive; then closed with 4401
SLICE_BYTES = 512  # received data is parsed and checked in slices of this size
AFTER_END_BYTES = 1024  # read from a viewer after the close was sent: its answer, and data already under way
CLOSING_S = 2.0  # a viewer that does not answer a close within this time is cut off
HEADERS = ("Origin", "Host", "Authorization", "X-Forwarded-For")
FAILED = b"HTTP/1.1 500 Internal Server Error\r\ncontent-length: 0\r\nconnection: close\r\n\r\n"


class LiveSocket(asyncio.Protocol):
    """One viewer's WebSocket connection, from its HTTP request to its end."""

    access: ClassVar[Access]
    json_form: ClassVar[Encoding]

    def __init__(
        self,
        config: Config,  # noqa: ARG002 — the arguments are uvicorn's
        server_state: ServerState,
        app_state: Any,  # noqa: ARG002
    ) -> None:
        self.dispatcher = self.access.live  # its hub has the viewer, once it has joined
        self._connections: set[Any] = server_state.connections
        self._ws = ServerProtocol(max_size=self.dispatcher.hub.limits.message_bytes)
        self._transport: asyncio.Transport
        self._viewer: Viewer | None = None
        self._own_descriptor = -1
        self.descriptor = -1  # for direct writes; −1 while data waits in the transport
        self._over = False  # nothing more may be written
        self._failed = False
        self._fragments = Fragments()
        self._flooded = False  # the viewer sent too much: nothing more is read
        self._after_end = 0  # bytes received since the close was sent
        self._early = 0  # frames received before it joined
        self._unread = 0  # bytes in the library that may be an incomplete message
        self._closing: asyncio.TimerHandle | None = None
        self._address: str | None = None  # the address under which it is counted
        self._asked: StreamRequest | None = None  # the request, while it waits for a token
        self._applicant = Applicant()  # who sent it
        self._no_token: asyncio.TimerHandle | None = None
        self._entering: asyncio.Task[None] | None = None

    # ---- asyncio ----------------------------------------------------------

    @isolated
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport over from uvicorn."""
        self._transport = cast(asyncio.Transport, transport)
        self._connections.add(self)
        use_small_buffers(self._transport)

    @isolated
    def connection_lost(self, _exc: Exception | None) -> None:
        """Remove the viewer: either side has closed the connection."""
        viewer, address = self._viewer, self._address
        with ExitStack() as each:  # all of it, whatever one of them raises
            # break reference cycles: garbage collection runs only after 50,000 objects
            each.callback(self._ws.parser.close)
            self._viewer = self._address = self._ws.parser_exc = None
            each.callback(self._connections.discard, self)
            if address is not None:
                each.callback(self.access.addresses.leave, address)
            if viewer is not None:
                each.callback(self.dispatcher.hub.remove_viewer, viewer)
            if self._closing is not None:
                each.callback(self._closing.cancel)
            each.callback(self._cancel_token_wait)
            each.callback(self._write_no_more)

    @isolated
    def pause_writing(self) -> None:
        """Pause the viewer: the socket did not take everything."""
        self.descriptor = -1
        if self._viewer is not None:
            self._viewer.pause(self.dispatcher.now())
            self._fit_buffer()

    @isolated
    def resume_writing(self) -> None:
        """Resume the viewer: the socket has taken everything."""
        if not self._over:
            self.descriptor = self._own_descriptor
        if self._viewer is not None:
            self.dispatcher.carry_out(self.dispatcher.hub.resume_viewer(self._viewer))

    @isolated
    def data_received(self, data: bytes) -> None:
        """Process bytes from the viewer. The first ones are its HTTP request, as read by uvicorn."""
        if self._viewer is not None:
            self._viewer.record_heard(self.dispatcher.now())
        if self._unread == 0 and not self._fragments and self._ws.state is OPEN:
            text = read_short_text(data)
            if text is not None:
                self._text(text)
                return
        for at in range(0, len(data), SLICE_BYTES):
            if self._ws.state not in (CONNECTING, OPEN):
                self._after_end += min(SLICE_BYTES, len(data) - at)
                if self._after_end > AFTER_END_BYTES:
                    self._read_no_more()
            if not self._flooded:
                self._read(data[at : at + SLICE_BYTES])

    def _read(self, data: bytes) -> None:
        ws = self._ws
        ws.receive_data(data)
        self._unread += len(data)
        self._send_own()  # answers a ping between two parts of a message before the message
        for event in ws.events_received():
            if isinstance(event, Request):
                self._handshake(event)
                if data.endswith(b"\r\n\r\n"):  # else what it read of a message is not known, nor will be
                    self._unread = 0
            elif isinstance(event, WebSocketFrame):
                self._unread -= count_frame_bytes(len(event.data))
                self._frame(event)
        self._send_own()

    @isolated
    def eof_received(self) -> None:
        """Close, because the viewer has closed its side: streams are never half open."""
        self._ws.receive_eof()
        self._send_own()

    @isolated
    def shutdown(self) -> None:
        """End the stream, because uvicorn stops. Usually all viewers were moved away before."""
        if self._viewer is None:
            self._transport.close()
        else:
            self.end(Close.DRAIN, GOING, DRAIN_RETRY_S)

    # ---- what a viewer sends ------------------------------------------------

    def _handshake(self, request: Request) -> None:
        try:
            asked = read_target(request.path)
        except BadRequest as e:
            self._reject(e.status, str(e), None)
            return
        origin, host, authorization, forwarded = (join_all(request.headers.get_all(name)) for name in HEADERS)
        token = read_bearer(authorization)
        # check a page's origin even if this process can't verify tokens
        is_foreign = not self.access.may_show(origin, host)
        applicant = self._applicant = asked.make_applicant(asked.auth or token is not None, is_foreign)
        address = self.access.enter_address(applicant, peer_of(self._transport), forwarded)
        if isinstance(address, Refusal) and address.at_door:
            self._reject(address.status, address.reason, address.retry_s)
            return
        crowded, self._address = (address, None) if isinstance(address, Refusal) else (None, address)
        self._ws.send_response(self._ws.accept(request))
        self._send_own()
        if self._ws.state is not OPEN:
            self.dispatcher.handshakes["refused"] += 1
        elif (refusal := crowded or self.access.find_refusal(applicant)) is not None:
            self._refuse_entry(refusal)
        elif self.access.tokens is not None and applicant.shows_token:
            self._wait_for_token(asked, token)
        else:
            self._enter(asked, replace(applicant, who=ANYONE))

    def _reject(self, status: HTTPStatus, reason: str, retry_s: float | None) -> None:
        """Answer the upgrade with an HTTP error: there is no stream."""
        self.dispatcher.handshakes["refused"] += 1
        response = self._ws.reject(status, f"{reason}\n")
        if retry_s is not None:
            response.headers["Retry-After"] = f"{retry_s:.0f}"
        self._ws.send_response(response)

    def _wait_for_token(self, asked: StreamRequest, token: str | None) -> None:
        """Wait for the token. It is in the request, or in the first message within TOKEN_S seconds."""
        self._asked = asked
        loop, late = asyncio.get_running_loop(), REFUSALS[Close.TOKEN]
        self._no_token = loop.call_later(TOKEN_S, self._refuse_entry, late)
        if token:
            self._verify_token(token)

    def _verify_token(self, token: str) -> None:
        if self._entering is None:
            self._entering = asyncio.create_task(self._enter_by(token), name="token")

    @isolated_task
    async def _enter_by(self, token: str) -> None:
        asked, who = self._asked, await self.access.identify(token)
        if asked is not None and not self._over:
            self._enter(asked, replace(self._applicant, who=who))

    def _cancel_token_wait(self) -> None:
        self._asked = None
        if self._no_token is not None:
            self._no_token.cancel()

    @isolated
    def _refuse_entry(self, refusal: Refusal) -> None:
        self._cancel_token_wait()
        refused = self.dispatcher.hub.count_refusal(refusal, self.dispatcher.now())
        self.dispatcher.handshakes["told to go"] += 1
        self.end(refused.close, refused.reason, refused.retry_s, refused.lane)

    def _enter(self, asked: StreamRequest, applicant: Applicant) -> None:
        self._cancel_token_wait()
        grant = self.access.admit(applicant)
        if isinstance(grant, Refusal):
            self._refuse_entry(grant)
            return
        dispatcher = self.dispatcher = self.access.find_dispatcher(grant)
        outlet = JsonOutlet(self, partial(self.write_as, self.json_form)) if asked.decoded else self
        self._viewer = make_viewer(outlet, asked, grant, dispatcher)
        self._own_descriptor = descriptor_of(self._transport)
        dispatcher.join(self._viewer)
        self._fit_buffer()
        if self._transport.get_write_buffer_size() == 0:
            self.descriptor = self._own_descriptor
        else:
            # uvicorn makes this the transport's protocol only after this call, so it got the pause itself
            self._viewer.pause(dispatcher.now())

    def _fit_buffer(self) -> None:
        """Fit the socket's buffer to the stream's frames: when it joins, and when one did not fit."""
        room = self.dispatcher.hub.viewers.get(self._viewer) if self._viewer else None
        if room is not None:
            fit_buffer(self._transport, room.stream.frame_bytes)

    def _frame(self, frame: WebSocketFrame) -> None:
        if frame.opcode is Opcode.CLOSE or self._ws.state is not OPEN:
            return
        counted = self._viewer is not None and frame.fin and frame.opcode is Opcode.TEXT  # by the hub
        if not counted and not self._may_send():
            self._refuse(Close.TOO_MANY, "too many messages")
        elif frame.opcode is Opcode.BINARY:
            self._refuse(Close.BINARY, "viewers send text only")
        elif frame.opcode in (Opcode.TEXT, Opcode.CONT):
            whole = self._fragments.join(frame.data, frame.fin)
            if whole is not None:
                self._text(whole)

    def _may_send(self) -> bool:
        """Count a ping, a fragment or data before the token as a message. Return whether it is allowed."""
        if self._viewer is not None:
            return self._viewer.allow_message(self.dispatcher.now())
        self._early += 1
        return self._early <= self.dispatcher.hub.limits.messages_burst

    def _text(self, text: bytes) -> None:
        if self._viewer is not None:
            dispatcher = self.dispatcher
            dispatcher.carry_out(dispatcher.hub.take_message(self._viewer, text, dispatcher.now()))
        elif self._asked is not None:
            try:
                message = parse_viewer_message(text)
            except MessageError as e:
                self._cancel_token_wait()
                self.dispatcher.hub.count_ending(e.close)
                self.end(e.close, str(e), None)
                return
            if isinstance(message, Auth):
                self._verify_token(message.token)

    def _refuse(self, close: Close, reason: str) -> None:
        if self._viewer is not None:
            self.dispatcher.carry_out(self.dispatcher.hub.refuse(self._viewer, close, reason))
        elif self._asked is not None:
            self._cancel_token_wait()
            self.end(close, reason, None)

    # ---- what it is sent (Outlet) -------------------------------------------

    def write(self, data: bytes) -> None:
        """Send ready-made messages to the socket."""
        if not self._over:
            self._transport.write(data)

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Tell the viewer the reason, and close. After CLOSING_S seconds without an answer, cut it off."""
        if self._ws.state is not OPEN:
            return
        if close is Close.TOO_MANY:
            self._read_no_more()
        self._transport.write(messages.make_bye(close, reason, retry_s, lane))
        self._write_no_more()
        self._ws.send_close(close, reason[:100])
        self._send_own()
        self._arm_close_timeout()

    def _read_no_more(self) -> None:
        self._flooded = True
        self._transport.pause_reading()

    def cut(self, _close: Close) -> None:
        """Abort the connection: a viewer that does not read can't be told why."""
        self._transport.abort()
        self._write_no_more()

    def end_after_fault(self, error: Exception) -> None:
        """Report an internal error, tell this viewer, and end its stream. Raises nothing."""
        viewer = self._viewer
        self.dispatcher.report_fault("a viewer's connection", error)
        first, self._failed = not self._failed, True
        try:
            if not first:
                self._transport.abort()
            elif self._ws.state is CONNECTING:
                self._transport.write(FAILED)
                self._transport.close()
            elif viewer is not None and viewer in self.dispatcher.hub.viewers:
                self._arm_close_timeout()
                self.dispatcher.carry_out(self.dispatcher.hub.refuse(viewer, Close.INTERNAL_ERROR, FAULT))
            else:
                self._arm_close_timeout()
                self.dispatcher.hub.count_ending(Close.INTERNAL_ERROR)
                self.end(Close.INTERNAL_ERROR, FAULT, None)
        except Exception:
            self._transport.abort()

    def _arm_close_timeout(self) -> None:
        if self._closing is None:
            self._closing = asyncio.get_running_loop().call_later(CLOSING_S, self._transport.abort)

    def _send_own(self) -> None:
        """Send the library's own data: the handshake, pongs, closes, the end."""
        for data in self._ws.data_to_send():
            if data:
                self._transport.write(data)
            else:
                # half-close, and read on for a while: closing with unread data would reset the connection,
                # and the viewer would never see why
                self._detach()
                if self._transport.can_write_eof():
                    self._transport.write_eof()
                else:
                    self._transport.close()
                self._arm_close_timeout()

    def _detach(self) -> None:
        """Remove the viewer, write no more, and count protocol errors by their code (1002, 1009)."""
        self._write_no_more()
        viewer, hub, sent = self._viewer, self.dispatcher.hub, self._ws.close_sent
        if viewer is None or viewer not in hub.viewers:
            return
        hub.remove_viewer(viewer)
        if self._ws.parser_exc is not None and sent is not None:
            hub.count_ending(sent.code)

    @isolated
    def write_as(self, form: Encoding, data: bytes) -> None:
        """Send ready-made messages in another encoding."""
        room = self.dispatcher.hub.viewers.get(self._viewer) if self._viewer else None
        if room is not None:
            self.write(form.encode(data, room.stream))

    def _write_no_more(self) -> None:
        self._over, self.descriptor = True, -1


def make_live_protocol(of: Access, decoded: DecodeCache) -> type[LiveSocket]:
    """Make the class for uvicorn's `ws` option."""

    class Bound(LiveSocket):
        access = of
        json_form = JsonEncoding(decoded)

    return Bound
