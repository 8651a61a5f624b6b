"""uvicorn's HTTP with limits on the size of requests, on waiting requests, and on the effect of errors.

The limits are the same as the proxy's (infra/Caddyfile), for clients that reach the relay's port directly.
A request over a limit is refused before it is stored, and its connection is closed.

A client that never reads occupies an answer's memory. A thousand simultaneous requests would delay
everybody else. So addresses take turns, with a few requests per turn of the event loop. Above a limit in
bytes, the address that uses most memory loses its oldest answer.

uvicorn waits forever for a request's head. A client that sends one byte a minute would keep a socket
forever. So connections are closed that do not complete a request in time, or hold too many bytes together.
"""

from __future__ import annotations

import asyncio
import json
from collections import Counter, OrderedDict, deque
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from http import HTTPStatus
from typing import Any, ClassVar, Protocol, cast

import httptools
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_real_address
from posecast_relay.runtime.socket_options import leave_unsent, peer_of
from posecast_relay.runtime.tasks import isolated

HELD_MOST = 48 << 20  # bytes over all addresses
REQUEST_BYTES = 16 << 10  # memory of a running request without its answer: connection, head, task
STARTED_PER_TURN = 8  # one takes half a millisecond
GONE_PER_TURN = 1000


class Requester(Protocol):
    """A connection with a running request."""

    def cut(self) -> None:
        """Abort the connection. Raises nothing."""


class PendingRequests:
    """A process's queue of HTTP requests, and the bytes of unread answers."""

    def __init__(self, most: int = HELD_MOST) -> None:
        self._most = most
        self._addresses: dict[Requester, str] = {}
        self._held: dict[str, OrderedDict[Requester, int]] = {}  # bytes; longest without progress first
        self._sums: Counter[str] = Counter()  # bytes
        self.held_bytes = 0
        self._line: OrderedDict[str, deque[tuple[Requester, Callable[[], None]]]] = OrderedDict()
        self._working = False

    def __len__(self) -> int:
        """Return the number of running requests."""
        return len(self._addresses)

    def wait(self, asker: Requester, address: str, line: str, start: Callable[[], None]) -> None:
        """Call `start` when it is this `line`'s turn, unless the client has left."""
        if asker not in self._addresses:
            self._addresses[asker] = address
            self._held.setdefault(address, OrderedDict())[asker] = 0
        self._line.setdefault(line, deque()).append((asker, start))
        self.record_held(asker, 0)
        if not self._working:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)

    def record_held(self, asker: Requester, answer_bytes: int) -> None:
        """Record how many bytes of an answer are unread.

        Above the limit, the address that uses most memory loses a connection.
        """
        address = self._addresses.get(asker)
        if address is None:
            return
        held, size = self._held[address], REQUEST_BYTES + answer_bytes
        self._sums[address] += size - held[asker]
        self.held_bytes += size - held[asker]
        held[asker] = size
        held.move_to_end(asker)
        while self.held_bytes > self._most:
            heaviest = max(self._sums, key=self._sums.__getitem__)
            longest = next(iter(self._held[heaviest]))
            self.leave(longest)
            longest.cut()

    def leave(self, asker: Requester) -> None:
        """Forget a request that is answered or gone. Does nothing if it is unknown."""
        address = self._addresses.pop(asker, None)
        if address is None:
            return
        held = self._held[address]
        size = held.pop(asker)
        self._sums[address] -= size
        self.held_bytes -= size
        if not held:
            del self._held[address], self._sums[address]

    def _work(self) -> None:
        self._working = False
        started = gone = 0
        while self._line and started < STARTED_PER_TURN and gone < GONE_PER_TURN:
            line, waiting = self._line.popitem(last=False)
            asker, start = waiting.popleft()
            if waiting:
                self._line[line] = waiting  # behind all others
            if asker in self._addresses:
                started += 1
                start()
            else:
                gone += 1
        if self._line:
            self._working = True
            asyncio.get_running_loop().call_soon(self._work)


HEAD_BYTES = 16 << 10  # request line and header lines; more: 431
LINES = 100  # of a head or a trailer; more: 431
TARGET_BYTES = 4 << 10  # a longer one: 414
BODY_BYTES = 64 << 10  # including chunk headers and trailers; more: 413. No body is ever stored
PIPELINED = 8  # requests that wait for the answer to an earlier one; more: 429
SLICE_BYTES = 4096  # received data is parsed and checked in slices of this size
LINGER_S = 1.0  # for a refusal to be read: closing with unread data would reset the connection
LINGER_BYTES = 1 << 18  # bytes read meanwhile; the rest stays unread
HEALTH = (b"/livez", b"/readyz")  # have a separate queue, so that health checks don't wait

TOO_LARGE = HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE
MALFORMED = "not a valid HTTP/1 request"


class RequestRefused(Exception):
    """Refuses a request: the answer is `status` and the message, then the connection is closed."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class AnswerAborted(Exception):
    """The rest of an answer can't be sent, so the connection is aborted."""


class HttpConnection(HttpToolsProtocol):
    """One HTTP connection, within the limits above. Its errors end only this connection."""

    access: ClassVar[Access]
    under_way: ClassVar[PendingRequests]
    unasked: ClassVar[RequestTimeouts]

    answering: RequestResponseCycle | None = None
    _task: asyncio.Task[None] | None = None
    _deaf = False  # nothing more is read: refused, or taken over
    _in_head = False
    _in_message = False
    _fed = 0  # bytes since the head's, the body's or the pause's beginning
    _slice = _lines = _head_bytes = _ignored = 0
    _lingers: asyncio.TimerHandle | None = None

    @property
    def counts(self) -> Counter[str]:
        """The number of requests by result."""
        return self.access.live.handshakes

    @property
    def request_bytes(self) -> int:
        """The approximate number of stored bytes of an incomplete request."""
        return min(self._fed, HEAD_BYTES) + self._head_bytes

    # ---- asyncio ----------------------------------------------------------

    @isolated
    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start, and let the transport report each write that the socket does not accept at once."""
        self.transport = transport
        super().connection_made(transport)
        leave_unsent(transport)
        self.unasked.start(transport)

    @isolated
    def connection_lost(self, exc: Exception | None) -> None:
        """Cancel the running answer: the client has left."""
        with ExitStack() as each:  # all of it, whatever one of them raises
            each.callback(super().connection_lost, exc)
            each.callback(self._abandon)
            each.callback(self.under_way.leave, self)
            each.callback(self.unasked.stop, self.transport)
            if self._lingers is not None:
                each.callback(self._lingers.cancel)

    @isolated
    def data_received(self, data: bytes) -> None:
        """Parse the received data in slices: the parser always processes all that it gets."""
        for at in range(0, len(data), SLICE_BYTES):
            if self._deaf:
                # behind a refusal: a little of it, so that the refusal can be read
                self._ignored += len(data) - at
                if self._lingers is not None and self._ignored > LINGER_BYTES:
                    self.transport.pause_reading()
                break
            self._feed(data[at : at + SLICE_BYTES])
        if self._in_message:
            self.unasked.record_bytes(self.transport, self.request_bytes)

    @isolated
    def eof_received(self) -> None:
        """Let asyncio close the connection: the client sends no more."""
        super().eof_received()

    @isolated
    def pause_writing(self) -> None:
        """Note how much of the answer the client has not read yet."""
        super().pause_writing()
        self.under_way.record_held(self, self._unread_bytes())

    @isolated
    def resume_writing(self) -> None:
        """Note that the socket has taken all that was written."""
        super().resume_writing()
        if self._is_idle():
            self.under_way.leave(self)
        else:
            self.under_way.record_held(self, 0)

    @isolated
    def shutdown(self) -> None:
        """Close, because uvicorn stops; a running answer is finished first."""
        super().shutdown()

    @isolated
    def close_if_idle(self) -> None:
        """Close, unless a request is being answered or received."""
        if self._is_idle() and not self._in_message:
            self.transport.close()

    @isolated
    def timeout_keep_alive_handler(self) -> None:
        """Close, because no request has arrived for a while."""
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
        """Check the size of what the parser holds of an unfinished head or body. Raises RequestRefused."""
        if not self._in_message or self._in_head:
            if self._fed > HEAD_BYTES:
                raise RequestRefused(TOO_LARGE, f"header over {HEAD_BYTES} bytes")
        elif self._fed > BODY_BYTES:
            raise RequestRefused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"body over {BODY_BYTES} bytes")

    def on_message_begin(self) -> None:
        """Begin a request."""
        self.unasked.start(self.transport)
        self._unset_keepalive_if_required()
        self._in_message = self._in_head = True
        self._lines = self._head_bytes = 0
        self._fed = self._slice  # requests hardly ever begin within one
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        """Take a part of the request's target. Raises RequestRefused when it is too long."""
        if len(self.url) + len(url) > TARGET_BYTES:
            raise RequestRefused(HTTPStatus.REQUEST_URI_TOO_LONG, f"address over {TARGET_BYTES} bytes")
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header line; ignore one of a trailer. Raises RequestRefused if they are too many or long."""
        self._lines += 1
        self._head_bytes += len(name) + len(value) + 4
        if self._lines > LINES or self._head_bytes > HEAD_BYTES:
            raise RequestRefused(TOO_LARGE, f"header over {LINES} lines or {HEAD_BYTES} bytes")
        if self._in_head:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Queue the request, whose head is complete. Raises RequestRefused when too many wait."""
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
            raise RequestRefused(HTTPStatus.BAD_REQUEST, "invalid address")

    def on_body(self, _body: bytes) -> None:
        """Ignore a request's body: no route of the relay needs one."""

    def on_message_complete(self) -> None:
        """End the request, which is complete."""
        self.unasked.stop(self.transport)
        self._in_message = False
        self._fed = 0
        super().on_message_complete()

    # ---- answers --------------------------------------------------------------

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: Any) -> None:
        """Answer the request when it is its turn."""
        address = find_real_address(
            peer_of(self.transport),
            self._find_header(cycle, b"x-forwarded-for"),
            self.access.addresses.trusted,
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
        """Run the application until the client leaves. An error in it ends this connection."""

        async def send_now(message: Any) -> None:
            if message["type"] == "http.response.start":
                # uvicorn's Date is the request's time: caches would treat a held answer as old
                cycle.default_headers = self.server_state.default_headers
                if self.access.live.draining:  # the next request should go to another relay
                    cycle.keep_alive = False
            await send(message)

        try:
            await app(scope, receive, send_now)
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
        """Go on with the next request, if one waits."""
        self._task = None
        super().on_response_complete()
        if self._is_idle() and not self.flow.write_paused:
            self.under_way.leave(self)

    def _is_idle(self) -> bool:
        return self.answering is None or (self.answering.response_complete and not self.pipeline)

    def _unread_bytes(self) -> int:
        """Return the bytes stored for this client alone, without those of shared answers."""
        shared = self.answering is not None and "shared" in self.answering.scope
        return 0 if shared else self.transport.get_write_buffer_size()

    def _abandon(self) -> None:
        """Cancel the running answer and the waiting ones."""
        self.pipeline.clear()
        if self.answering is not None:
            self.answering.disconnected = True
            self.answering.message_event.set()
        task, self._task = self._task, None
        if task is not None and task is not asyncio.current_task(self.loop):
            task.cancel()

    # ---- ends -------------------------------------------------------------------

    def cut(self) -> None:
        """Abort and count the connection, because its client does not read."""
        self.counts["unread"] += 1
        self.transport.abort()

    def refuse(self, status: HTTPStatus, reason: str) -> None:
        """Answer with this error, unless another answer is running, and close."""
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
        """Report an internal error, answer 500 if that is still possible, and close."""
        self.access.live.report_fault("a request", error)
        try:
            answering = self.answering
            if answering is not None and answering.response_complete:  # the application already answered 500
                self._deaf = True
                self.transport.close()
            else:
                self.refuse(HTTPStatus.INTERNAL_SERVER_ERROR, "internal error of the relay")
        except Exception:
            self.transport.abort()

    @staticmethod
    def _find_header(cycle: RequestResponseCycle, name: bytes) -> str | None:
        """Return a header's value, None if there is none; repeated ones are joined by commas."""
        values = [value.decode("latin-1") for each, value in cycle.scope["headers"] if each == name]
        return ", ".join(values) or None


ASK_S = 5.0  # from connecting, or from a request's first byte, to its end
CROWD = 500  # above this number, those older than HURRIED_S are dropped; a quarter of http_server.SPARE_FILES
HURRIED_S = 1.0
SWEEP_S = 0.5
HEADS_BYTES = 8 << 20  # of incomplete requests on all connections; above this, the oldest are dropped


class RequestTimeouts:
    """Connections with an incomplete request, and its age. `cut` is called with the number of drops."""

    def __init__(self, now: Callable[[], float], cut: Callable[[int], None]) -> None:
        self._now = now
        self._cut = cut
        self._since: dict[asyncio.Transport, float] = {}  # the oldest first
        self._heard: dict[asyncio.Transport, int] = {}  # bytes of their requests so far
        self._heard_bytes = 0
        self._timer: asyncio.TimerHandle | None = None

    def start(self, transport: asyncio.Transport) -> None:
        """Start the timeout for a connection's next request, unless it is already running."""
        self._since.setdefault(transport, self._now())
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)

    def record_bytes(self, transport: asyncio.Transport, size: int) -> None:
        """Record how many bytes of an incomplete request have arrived."""
        if transport not in self._since:
            return
        self._heard_bytes += size - self._heard.get(transport, 0)
        self._heard[transport] = size
        while self._heard_bytes > HEADS_BYTES:
            oldest = next(iter(self._heard))
            self.stop(oldest)
            oldest.abort()
            self._cut(1)

    def stop(self, transport: asyncio.Transport) -> None:
        """Stop the timeout: the request is complete, or the connection is gone."""
        self._since.pop(transport, None)
        self._heard_bytes -= self._heard.pop(transport, 0)

    def _sweep(self) -> None:
        self._timer = None
        now, spare = self._now(), len(self._since) - CROWD
        late = []
        for n, (transport, since) in enumerate(self._since.items()):
            if now - since < (HURRIED_S if n < spare else ASK_S):
                break
            late.append(transport)
        for transport in late:
            self.stop(transport)
            transport.abort()
        if late:
            self._cut(len(late))
        if self._since:
            self._timer = asyncio.get_running_loop().call_later(SWEEP_S, self._sweep)


def make_timeouts(access: Access) -> RequestTimeouts:
    """Make the timeouts of a port's connections, which also counts those that it drops."""

    def count(dropped: int) -> None:
        access.live.handshakes["never asked"] += dropped

    return RequestTimeouts(access.live.now, count)


def make_plain_http_protocol(of: Access) -> type[HttpConnection]:
    """Make the class for uvicorn's `http` option, without streams."""

    class Bound(HttpConnection):
        access = of
        under_way = PendingRequests()
        unasked = make_timeouts(of)

    return Bound
