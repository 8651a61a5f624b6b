"""Sends the stream as server-sent events, for networks that break WebSockets.

The connection is taken over from uvicorn, like a WebSocket upgrade, so that the send rule sees the real
socket. A response through ASGI would fill buffers that the relay can't see.
"""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, cast

from posecast_wire import Close, Retry, retry_of

from posecast_relay.auth.access import Access
from posecast_relay.core import messages
from posecast_relay.core.policy import ANYONE, DRAIN_RETRY_S, GOING, Applicant, Grant, Refusal
from posecast_relay.net.encodings import DecodeCache, Encoding, EventStreamEncoding, JsonEncoding
from posecast_relay.net.http1 import HttpConnection, PendingRequests, RequestTimeouts, make_timeouts
from posecast_relay.net.request import (
    STREAM_PATH,
    BadRequest,
    StreamRequest,
    join_all,
    make_viewer,
    read_bearer,
    read_target,
)
from posecast_relay.net.websocket import CLOSING_S
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.socket_options import cut_unread, fit_buffer, peer_of, use_small_buffers
from posecast_relay.runtime.tasks import FAULT, isolated, isolated_task

log = logging.getLogger("posecast_relay")

TURN_S = 0.01


class HandshakeQueue:
    """A first-in, first-out queue of handshakes, at most one per open connection."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._working = False

    def admit(self, enter: Callable[[], None]) -> None:
        """Call `enter` later, when there is time for it."""
        self._waiting.append(enter)
        if not self._working:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)

    def _work(self) -> None:
        until = time.monotonic() + TURN_S
        while self._waiting and time.monotonic() < until:
            enter = self._waiting.popleft()
            try:
                enter()
            except Exception as e:  # go on with the others
                log.error("handshake failed", exc_info=e)
        self._working = bool(self._waiting)
        if self._working:
            asyncio.get_running_loop().call_soon(self._work)


HEAD = (
    b"HTTP/1.1 200 OK\r\ncontent-type: text/event-stream\r\ncache-control: no-store\r\n%s"
    b"x-accel-buffering: no\r\nconnection: close\r\n\r\n"
    b"retry: 2000\n\n"  # ms, after a connection that ended without a word
)


class EventStream(asyncio.Protocol):
    """One viewer's event stream: an HTTP response, from its head to its end."""

    descriptor = -1  # what is written is made into events first

    def __init__(
        self,
        transport: asyncio.Transport,
        connections: set[Any],
        dispatcher: Dispatcher,
        form: Encoding,
        asked: StreamRequest,
        grant: Grant,
        left: Callable[[], None],
    ) -> None:
        """`left` is called when the connection is gone."""
        self._left = left
        self._transport = transport
        self._connections = connections
        self._dispatcher = dispatcher
        self._form = form
        self._closing: asyncio.TimerHandle | None = None
        self._failed = False
        self._viewer = make_viewer(self, asked, grant, dispatcher, speaks=False)

    @isolated
    def start(self, pages: str | None) -> None:
        """Send the response's head and join the hub. `pages`: the origin whose pages may read the stream."""
        self._transport.set_protocol(self)
        self._connections.add(self)
        use_small_buffers(self._transport)
        sock = self._transport.get_extra_info("socket")
        if sock is not None:
            # These viewers send nothing, but get a status every second. A peer that is gone or reads nothing
            # does not accept it, and ends as late as a silent WebSocket. `undrained_s` is shorter, so whoever
            # fills the relay's buffer is cut by the core, and counted.
            cut_unread(sock, round(1000 * self._dispatcher.hub.limits.half_open_s))
        self._transport.write(_make_head(pages))
        self._dispatcher.join(self._viewer)
        self._fit_buffer()

    def _fit_buffer(self) -> None:
        """Fit the socket's buffer to the stream's frames: when it joins, and when one did not fit."""
        room = self._dispatcher.hub.viewers.get(self._viewer)
        if room is not None:
            fit_buffer(self._transport, room.stream.frame_bytes)

    # ---- asyncio ----------------------------------------------------------

    @isolated
    def connection_lost(self, _exc: Exception | None) -> None:
        """Remove the viewer: either side has closed the connection."""
        with ExitStack() as each:  # all of it, whatever one of them raises
            each.callback(self._left)
            each.callback(self._dispatcher.hub.remove_viewer, self._viewer)
            each.callback(self._connections.discard, self)
            if self._closing is not None:
                each.callback(self._closing.cancel)

    def data_received(self, _data: bytes) -> None:
        """Ignore received data: viewers send nothing on this connection."""

    @isolated
    def pause_writing(self) -> None:
        """Pause the viewer: the socket did not take everything."""
        self._viewer.pause(self._dispatcher.now())
        self._fit_buffer()

    @isolated
    def resume_writing(self) -> None:
        """Resume the viewer: the socket has taken everything."""
        self._dispatcher.carry_out(self._dispatcher.hub.resume_viewer(self._viewer))

    @isolated
    def shutdown(self) -> None:
        """End the stream, because uvicorn stops."""
        self.end(Close.DRAIN, GOING, DRAIN_RETRY_S)

    # ---- what it is sent (Outlet) -------------------------------------------

    def write(self, data: bytes) -> None:
        """Send messages as events."""
        try:
            room = self._dispatcher.hub.viewers.get(self._viewer)
            events = self._form.encode(data, room.stream) if room is not None else b""
            if events:
                # The send time, so that a reader sees how late it is: it can't acknowledge.
                self._transport.write(b"id: %d\n" % messages.to_clock_ms(self._dispatcher.now()) + events)
        except Exception as e:
            self.end_after_fault(e)

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Tell the viewer the reason and when to reconnect, then close. `retry_s` is in seconds."""
        if self._closing is not None:
            return
        self._transport.write(_make_bye(close, reason, retry_s, lane))
        self._transport.close()
        self._closing = asyncio.get_running_loop().call_later(CLOSING_S, self._transport.abort)

    def cut(self, _close: Close) -> None:
        """Abort the connection."""
        self._transport.abort()

    def end_after_fault(self, error: Exception) -> None:
        """Report an internal error, tell this viewer, and end its stream. Raises nothing."""
        viewer, dispatcher = self._viewer, self._dispatcher
        dispatcher.report_fault("a viewer's connection", error)
        first, self._failed = not self._failed, True
        try:
            if not first:
                self._transport.abort()
            elif viewer in dispatcher.hub.viewers:
                dispatcher.carry_out(dispatcher.hub.refuse(viewer, Close.INTERNAL_ERROR, FAULT))
            else:
                dispatcher.hub.count_ending(Close.INTERNAL_ERROR)
                self.end(Close.INTERNAL_ERROR, FAULT, None)
        except Exception:
            self._transport.abort()


def _make_head(pages: str | None) -> bytes:
    """Make the response's head. Pages of the origin `pages` may read the events; None: only the relay's."""
    return HEAD % (f"access-control-allow-origin: {pages}\r\n".encode() if pages else b"")


def _make_bye(close: Close, reason: str, retry_s: float | None, lane: str | None) -> bytes:
    ((_, bye),) = messages.split_messages(messages.make_bye(close, reason, retry_s, lane))
    return b"event: bye\ndata: " + bye + b"\nretry: %d\n\n" % _choose_wait_ms(close, retry_s)


def _choose_wait_ms(close: Close, retry_s: float | None) -> int:
    """Choose when the browser reconnects. Browsers wait exactly that long, so this adds a random part."""
    if retry_of(close) is Retry.LATER:
        return round(1000 * random.uniform(30.0, 60.0))
    if retry_of(close) is Retry.WAIT:
        return round(1000 * (retry_s or 30.0) * random.uniform(1.0, 1.5))
    return round(1000 * random.uniform(0.1, retry_s or 10.0))


class _Http(HttpConnection):
    """HTTP, but requests for event streams become an EventStream."""

    forms: ClassVar[dict[bool, Encoding]]
    doorway: ClassVar[HandshakeQueue]

    _wanted = False
    _taken = False
    _entering: asyncio.Task[None] | None = None

    def on_headers_complete(self) -> None:
        """Check whether this is a request for an event stream; queue any other request."""
        if self._taken:
            return
        found = STREAM_PATH.fullmatch(self.url.partition(b"?")[0].decode("latin-1"))
        idle = self.cycle is None or self.cycle.response_complete
        plain = self.parser.get_method() == b"GET" and not self.parser.should_upgrade()
        self._wanted = bool(found and found[2]) and idle and plain
        if self._wanted:
            self._ends_head()
        else:
            super().on_headers_complete()

    def on_message_complete(self) -> None:
        """Take the connection over for an event stream, and ignore further data."""
        self.unasked.stop(self.transport)
        if not self._wanted:
            super().on_message_complete()
        elif not self._taken:
            self._taken = self._deaf = True
            self._take_over()

    def handle_websocket_upgrade(self) -> None:
        """Upgrade when it is its turn. Until then, read nothing more from this connection."""
        self.transport.pause_reading()
        self.doorway.admit(self._upgrade)

    @isolated
    def _upgrade(self) -> None:
        if not self.transport.is_closing():
            self.transport.resume_reading()
            super().handle_websocket_upgrade()
            self.parser = cast(Any, None)  # the two hold each other, until a rare collection

    def _take_over(self) -> None:
        try:
            asked = read_target(self.url.decode("latin-1"), ".sse")
        except BadRequest as e:
            self.refuse(e.status, str(e))
            return
        token = read_bearer(self._header(b"authorization")) if self.access.tokens is not None else None
        may_show = self.access.may_show(self._header(b"origin"), self._header(b"host"))
        applicant = asked.make_applicant(token is not None, not may_show)
        refusal = self.access.find_refusal(applicant)
        if refusal is not None:
            self.refuse(refusal.status, refusal.reason)
        elif token is None:
            self._enter(asked, replace(applicant, who=ANYONE))
        else:
            self._entering = asyncio.create_task(self._enter_by(asked, applicant, token), name="token")

    def _header(self, name: bytes) -> str | None:
        return join_all(value.decode("latin-1") for each, value in self.headers if each == name)

    @isolated_task
    async def _enter_by(self, asked: StreamRequest, applicant: Applicant, token: str) -> None:
        who = await self.access.identify(token)
        if not self.transport.is_closing():
            self._enter(asked, replace(applicant, who=who))

    def _enter(self, asked: StreamRequest, applicant: Applicant) -> None:
        grant = self.access.admit(applicant)
        if isinstance(grant, Refusal):
            self.refuse(grant.status, grant.reason)
            return
        pages = "*" if grant.open else self._header(b"origin")  # that one was let in
        peer = peer_of(self.transport)
        address = self.access.enter_address(applicant, peer, self._header(b"x-forwarded-for"))
        if isinstance(address, Refusal):
            self._turn_away(address, pages)
            return
        self.connections.discard(self)
        form, dispatcher = self.forms[asked.decoded], self.access.find_dispatcher(grant)
        left = partial(self.access.addresses.leave, address)
        try:
            stream = EventStream(self.transport, self.connections, dispatcher, form, asked, grant, left)
        except Exception:
            left()
            raise
        stream.start(pages)

    def _turn_away(self, refusal: Refusal, pages: str | None) -> None:
        """Refuse a stream. If the viewer is sent to a lane, open a stream that says only that."""
        if refusal.at_door:
            self.refuse(refusal.status, refusal.reason)
            return
        dispatcher = self.access.live
        refused = dispatcher.hub.count_refusal(refusal, dispatcher.now())
        dispatcher.handshakes["told to go"] += 1
        bye = _make_bye(refused.close, refused.reason, refused.retry_s, refused.lane)
        self.transport.write(_make_head(pages) + bye)
        self.transport.close()


def make_http_protocol(
    of: Access, decoded: DecodeCache, timeouts: RequestTimeouts | None = None
) -> type[_Http]:
    """Make the class for uvicorn's `http` option."""

    class Bound(_Http):
        access = of
        under_way = PendingRequests()
        unasked = timeouts or make_timeouts(of)
        doorway = HandshakeQueue()
        forms: ClassVar[dict[bool, Encoding]] = {
            False: EventStreamEncoding(),
            True: EventStreamEncoding(JsonEncoding(decoded)),
        }

    return Bound
