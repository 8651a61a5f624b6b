"""Forwards a further worker's HTTP requests, except streams, to the first worker, and returns its answers.

So all workers give the same answers. Running requests are counted both here and in the first worker, as in a
relay with one worker (`pending_requests.py`): simultaneous requests have to wait, and above the limit the
address that uses most memory loses a connection. Answers are read as fast as the client takes them. Each
needs READ_BYTES here, plus the kernel's socket buffer.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

import httptools

from posecast_relay.streaming.http_connection import AnswerAborted

PEER = b"x-posecast-peer"  # the client's address; trusted only on the private socket
ANSWER_S = 30.0  # without any data; a request for the next segment is held for 8 s
AGAIN_S = 0.005  # between attempts while the kernel's queue of connections is full
READ_BYTES = 1 << 16
BY_HOP = frozenset((b"connection", b"keep-alive", b"upgrade", b"transfer-encoding", b"te", b"expect"))
AWAY = b'{"error":"the first process of this relay does not answer: try again"}'
CROWDED = b'{"error":"this relay can open no more files now: try again"}'

Scope = MutableMapping[str, Any]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]


class Forwarder:
    """The ASGI application of a further worker. `path`: the first worker's private socket."""

    def __init__(self, path: Path) -> None:
        self._path = str(path)
        self._turn = asyncio.Lock()  # so that waiting requests don't all retry at once

    async def __call__(self, scope: Scope, _receive: object, send: Send) -> None:
        """Answer a request as the first worker does; 503 if it can't be reached.

        Raises AnswerAborted if the first worker aborted the answer.
        """
        with contextlib.ExitStack() as opened:
            try:
                asked = opened.enter_context(socket.socket(socket.AF_UNIX))
                asked.setblocking(False)
                async with asyncio.timeout(ANSWER_S):
                    await self._connect(asked)
            except OSError as e:  # TimeoutError, too
                await _refuse(send, CROWDED if e.errno in (errno.EMFILE, errno.ENFILE) else AWAY)
            else:
                await _pass_on(_Answer(), scope, asked, send)

    async def _connect(self, asked: socket.socket) -> None:
        """Try to connect until the first worker's queue has room. Raises OSError."""
        async with self._turn:
            while True:
                try:
                    asked.connect(self._path)
                    return
                except (BlockingIOError, ConnectionRefusedError):  # of a full line: Linux, macOS
                    await asyncio.sleep(AGAIN_S)


def _make_request(scope: Scope) -> bytes:
    target = scope["raw_path"] + (b"?" + scope["query_string"] if scope["query_string"] else b"")
    peer = (scope.get("client") or ("",))[0].encode()
    # no body: no route of the relay needs one
    dropped = BY_HOP | {PEER, b"content-length"}
    headers = [(name, value) for name, value in scope["headers"] if name not in dropped]
    headers += [(PEER, peer), (b"connection", b"close")]
    lines = [b"%s %s HTTP/1.1" % (scope["method"].encode(), target), *(b"%s: %s" % each for each in headers)]
    return b"\r\n".join([*lines, b"", b""])


class _Answer:
    """The received part of an answer. httptools calls its methods."""

    def __init__(self) -> None:
        self.headers: list[tuple[bytes, bytes]] = []
        self.body: list[bytes] = []
        self.is_headed = False
        self.is_whole = False

    def on_header(self, name: bytes, value: bytes) -> None:
        """Take a header line."""
        if not self.is_headed and name.lower() not in BY_HOP:
            self.headers.append((name.lower(), value))

    def on_headers_complete(self) -> None:
        """Note that the head is complete."""
        self.is_headed = True

    def on_body(self, body: bytes) -> None:
        """Take a part of the body."""
        self.body.append(body)

    def on_message_complete(self) -> None:
        """Note that the answer is complete."""
        self.is_whole = True


async def _pass_on(answer: _Answer, scope: Scope, asked: socket.socket, send: Send) -> None:
    """Forward the request and return the answer; 503 if none arrives. Raises AnswerAborted if it is cut."""
    parser, is_begun, loop = httptools.HttpResponseParser(answer), False, asyncio.get_running_loop()
    has_head_only, left = scope["method"] == "HEAD", _make_request(scope)
    while not answer.is_whole:
        try:
            async with asyncio.timeout(ANSWER_S):
                await loop.sock_sendall(asked, left)
                data = await loop.sock_recv(asked, READ_BYTES)
            if not data:
                raise EOFError
            parser.feed_data(data)
        except (OSError, EOFError, httptools.HttpParserError) as e:
            if is_begun or not isinstance(e, TimeoutError):
                raise AnswerAborted from None
            await _refuse(send, AWAY)
            return
        left = b""
        if not answer.is_headed:
            continue
        if not is_begun:
            is_begun = True
            status = parser.get_status_code()
            await send({"type": "http.response.start", "status": status, "headers": answer.headers})
        body = b"".join(answer.body)
        answer.body.clear()
        more = not (answer.is_whole or has_head_only)
        await send({"type": "http.response.body", "body": body, "more_body": more})
        if has_head_only:
            return


async def _refuse(send: Send, body: bytes) -> None:
    headers = [
        (b"content-type", b"application/json"),
        (b"content-length", b"%d" % len(body)),
        (b"cache-control", b"no-store"),
        (b"retry-after", b"1"),
        (b"access-control-allow-origin", b"*"),
    ]
    await send({"type": "http.response.start", "status": 503, "headers": headers})
    await send({"type": "http.response.body", "body": body})
