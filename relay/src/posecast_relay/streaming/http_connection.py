"""uvicorn's HTTP with bounds: on what a request may bring, what waits for an answer, and what a fault hurts.

The same limits as the proxy's (infra/Caddyfile), for whoever reaches the relay's own port. What goes beyond
is refused before it is kept, and the connection closed.
"""

from __future__ import annotations

import asyncio
import json
from collections import Counter
from contextlib import ExitStack
from functools import partial
from http import HTTPStatus
from typing import Any, ClassVar, cast

import httptools
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_real_address
from posecast_relay.runtime.boundary import isolated
from posecast_relay.runtime.socket_options import leave_unsent
from posecast_relay.streaming.pending_requests import PendingRequests

HEAD_BYTES = 16 << 10  # request line and header lines; more: 431
LINES = 100  # of a head or a trailer; more: 431
TARGET_BYTES = 4 << 10  # a longer one: 414
BODY_BYTES = 64 << 10  # chunks' sizes, extensions and trailers included; more: 413. None of it is ever kept
PIPELINED = 8  # requests that wait for the answer to an earlier one; more: 429
SLICE_BYTES = 4096  # of what comes at once: judged before more of it is taken apart
LINGER_S = 1.0  # for a refusal to be read: closing with unread data would reset the connection
LINGER_BYTES = 1 << 18  # of what still comes meanwhile; the rest stays where it is
HEALTH = (b"/livez", b"/readyz")  # in a line of their own: who watches over the relay does not queue

TOO_LARGE = HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE
MALFORMED = "not a request in HTTP/1"


class RequestRefused(Exception):
    """What came is not taken: answered with `status`, then closed."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class AnswerAborted(Exception):
    """The rest of an answer can't be given: it ends in the middle."""


class HttpConnection(HttpToolsProtocol):
    """One connection of somebody who asks over HTTP."""

    access: ClassVar[Access]
    under_way: ClassVar[PendingRequests]

    answering: RequestResponseCycle | None = None
    _task: asyncio.Task[None] | None = None
    _deaf = False  # nothing more is read: refused, or somebody else's now
    _in_head = False
    _in_message = False
    _fed = 0  # bytes since the head's, the body's or the pause's beginning
    _slice = _lines = _head_bytes = _ignored = 0
    _lingers: asyncio.TimerHandle | None = None

    @property
    def counts(self) -> Counter[str]:
        """What became of requests."""
        return self.access.live.handshakes

    @property
    def request_bytes(self) -> int:
        """Of a request that is not whole yet, about: what is kept of it."""
        return min(self._fed, HEAD_BYTES) + self._head_bytes

    # ---- asyncio ----------------------------------------------------------

    @isolated
    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Nothing but the newest write may lie in the transport: then it is known how much that is."""
        self.transport = transport
        super().connection_made(transport)
        leave_unsent(transport)

    @isolated
    def connection_lost(self, exc: Exception | None) -> None:
        """The asker has left: so does what is done for it."""
        with ExitStack() as each:  # all of it, whatever one of them raises
            each.callback(super().connection_lost, exc)
            each.callback(self._abandon)
            each.callback(self.under_way.leave, self)
            if self._lingers is not None:
                each.callback(self._lingers.cancel)

    @isolated
    def data_received(self, data: bytes) -> None:
        """A slice at a time, since the parser takes apart all that it is given."""
        for at in range(0, len(data), SLICE_BYTES):
            if self._deaf:
                # behind a refusal: a little of it, so that the refusal can be read
                self._ignored += len(data) - at
                if self._lingers is not None and self._ignored > LINGER_BYTES:
                    self.transport.pause_reading()
                return
            self._feed(data[at : at + SLICE_BYTES])

    @isolated
    def eof_received(self) -> None:
        """Nothing more will come: asyncio closes."""
        super().eof_received()

    @isolated
    def pause_writing(self) -> None:
        """Some of the answer waits to be read."""
        super().pause_writing()
        self.under_way.record_held(self, self._unread_bytes())

    @isolated
    def resume_writing(self) -> None:
        """All that was written is taken."""
        super().resume_writing()
        if self._is_idle():
            self.under_way.leave(self)
        else:
            self.under_way.record_held(self, 0)

    @isolated
    def shutdown(self) -> None:
        """uvicorn stops."""
        super().shutdown()

    @isolated
    def timeout_keep_alive_handler(self) -> None:
        """Nothing was asked for a while."""
        super().timeout_keep_alive_handler()

    # ---- the parser ---------------------------------------------------------

    def _feed(self, data: bytes) -> None:
        self._slice = len(data)
        self._fed += self._slice
        try:
            self.parser.feed_data(data)
            self._measure()
        except httptools.HttpParserUpgrade:
            self._deaf = True
            if self._should_upgrade():
                self.handle_websocket_upgrade()
            elif self.cycle is not None:
                self.cycle.keep_alive = False  # answered as if it had not asked for another protocol
        except RequestRefused as e:
            self.refuse(e.status, str(e))
        except httptools.HttpParserCallbackError as e:
            if isinstance(e.__context__, RequestRefused):
                self.refuse(e.__context__.status, str(e.__context__))
            elif isinstance(e.__context__, Exception):
                self.end_after_fault(e.__context__)
            else:
                self.refuse(HTTPStatus.BAD_REQUEST, MALFORMED)
        except httptools.HttpParserError:
            self.refuse(HTTPStatus.BAD_REQUEST, MALFORMED)

    def _measure(self) -> None:
        """Of what the parser has not handed over yet, since its end has not come."""
        if not self._in_message or self._in_head:
            if self._fed > HEAD_BYTES:
                raise RequestRefused(TOO_LARGE, f"over {HEAD_BYTES} bytes of header")
        elif self._fed > BODY_BYTES:
            raise RequestRefused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"over {BODY_BYTES} bytes of body")

    def on_message_begin(self) -> None:
        """A request begins."""
        self._unset_keepalive_if_required()
        self._in_message = self._in_head = True
        self._lines = self._head_bytes = 0
        self._fed = self._slice  # requests hardly ever begin within one
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        """A part of its target."""
        if len(self.url) + len(url) > TARGET_BYTES:
            raise RequestRefused(HTTPStatus.REQUEST_URI_TOO_LONG, f"over {TARGET_BYTES} bytes of address")
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """One line of the head; or of a trailer, in which there is nothing for us."""
        self._lines += 1
        self._head_bytes += len(name) + len(value) + 4
        if self._lines > LINES or self._head_bytes > HEAD_BYTES:
            raise RequestRefused(TOO_LARGE, f"over {LINES} lines or {HEAD_BYTES} bytes of header")
        if self._in_head:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """The head is here: the request waits for its turn."""
        self._ends_head()
        if len(self.pipeline) >= PIPELINED:
            raise RequestRefused(HTTPStatus.TOO_MANY_REQUESTS, f"over {PIPELINED} requests at once")
        super().on_headers_complete()

    def _ends_head(self) -> None:
        self._in_head = False
        self._lines = self._head_bytes = 0
        self._fed = 0
        try:
            path = httptools.parse_url(self.url).path
        except httptools.HttpParserInvalidURLError:
            path = None
        if path is None or not path.startswith(b"/") or not path.isascii():
            raise RequestRefused(HTTPStatus.BAD_REQUEST, "no such address")

    def on_body(self, _body: bytes) -> None:
        """Nothing that the relay answers has a body."""

    def on_message_complete(self) -> None:
        """The request is whole."""
        self._in_message = False
        self._fed = 0
        super().on_message_complete()

    # ---- answers --------------------------------------------------------------

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        """In its turn."""
        peer = (self.transport.get_extra_info("peername") or ("",))[0]
        address = find_real_address(
            peer, self.find_header(cycle, b"x-forwarded-for"), self.access.addresses.trusted
        )
        line = f"{address} health" if cycle.scope["raw_path"] in HEALTH else address
        self.answering = cycle
        self.under_way.wait(self, address, line, partial(self._begin, cycle, app))

    @isolated
    def _begin(self, cycle: RequestResponseCycle, app: Any) -> None:
        if cycle.disconnected or self.transport.is_closing():
            return
        task = self.loop.create_task(cycle.run_asgi(cast(Any, partial(self._answer, cycle, app))))
        self._task = task
        task.add_done_callback(self.tasks.discard)
        self.tasks.add(task)

    async def _answer(
        self, cycle: RequestResponseCycle, app: Any, scope: Any, receive: Any, send: Any
    ) -> None:
        """By the application. It ends when its asker has left, and a fault in it ends this connection."""
        try:
            await app(scope, receive, send)
        except asyncio.CancelledError:
            if not cycle.disconnected:  # the relay stops
                cycle.disconnected = True
                self.transport.abort()
        except AnswerAborted:
            cycle.disconnected = True
            self.transport.abort()
        except Exception as e:
            self.end_after_fault(e)

    def on_response_complete(self) -> None:
        """The next one, if it has been asked already."""
        self._task = None
        super().on_response_complete()
        if self._is_idle() and not self.flow.write_paused:
            self.under_way.leave(self)

    def _is_idle(self) -> bool:
        return self.answering is None or (self.answering.response_complete and not self.pipeline)

    def _unread_bytes(self) -> int:
        """What is the same for all who ask, and kept anyway, is no burden."""
        shared = self.answering is not None and "shared" in self.answering.scope
        return 0 if shared else self.transport.get_write_buffer_size()

    def _abandon(self) -> None:
        """Nobody waits for this answer any more."""
        self.pipeline.clear()
        if self.answering is not None:
            self.answering.disconnected = True
            self.answering.message_event.set()
        task, self._task = self._task, None
        if task is not None and task is not asyncio.current_task(self.loop):
            task.cancel()

    # ---- ends -------------------------------------------------------------------

    def cut(self) -> None:
        """Too much lies here that nobody reads."""
        self.counts["unread"] += 1
        self.transport.abort()

    def refuse(self, status: HTTPStatus, reason: str) -> None:
        """Say so if nothing else is being said, and close."""
        self.counts["refused"] += 1
        self._deaf = True
        last = self.answering
        if last is not None and last.response_started and not last.response_complete:
            self.transport.abort()
            return
        in_body = self._in_message and not self._in_head
        is_answered = in_body and last is self.cycle and last is not None and last.response_complete
        self._abandon()
        if not is_answered:
            body = json.dumps({"error": reason}).encode()
            head = (
                f"HTTP/1.1 {status.value} {status.phrase}\r\ncontent-type: application/json\r\n"
                f"content-length: {len(body)}\r\naccess-control-allow-origin: *\r\nconnection: close\r\n\r\n"
            )
            self.transport.write(head.encode() + body)
        if self.transport.can_write_eof():
            self.transport.write_eof()
            self._lingers = self.loop.call_later(LINGER_S, self.transport.abort)
        else:
            self.transport.close()

    def end_after_fault(self, error: Exception) -> None:
        """A fault of ours: 500, and nothing more on this connection."""
        self.access.live.report_fault("a request", error)
        try:
            answering = self.answering
            if answering is not None and answering.response_complete:  # with a 500, by the application
                self._deaf = True
                self.transport.close()
            else:
                self.refuse(HTTPStatus.INTERNAL_SERVER_ERROR, "a fault of the relay's own")
        except Exception:
            self.transport.abort()

    @staticmethod
    def find_header(cycle: RequestResponseCycle, name: bytes) -> str | None:
        """One that is there more than once is one list."""
        values = [value.decode("latin-1") for each, value in cycle.scope["headers"] if each == name]
        return ", ".join(values) or None


def make_plain_http_protocol(of: Access) -> type[HttpConnection]:
    """The class that uvicorn takes as its `http` option where there are no streams."""

    class Bound(HttpConnection):
        access = of
        under_way = PendingRequests()

    return Bound
