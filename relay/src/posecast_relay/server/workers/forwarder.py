"""What a further worker is asked and is no stream: passed to the first worker, and its answer passed back.

So there is one answer to each question, whichever worker was asked. An answer is read as fast as its reader
takes it: of each there are some 128 KiB here at most, and of all AT_ONCE of them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from pathlib import Path
from typing import Any

import httptools

from posecast_relay.http.past.held_requests import HELD_MAX
from posecast_relay.streaming.http_connection import AnswerAborted

PEER = b"x-posecast-peer"  # who asks; believed behind the private door alone
AT_ONCE = HELD_MAX + 1000  # requests under way, so that those that are held leave places for others
CONNECT_S = 5.0
ANSWER_S = 30.0  # without a byte of it; a request for the next segment is held for 8 s
READ_BYTES = 1 << 16
BY_HOP = frozenset((b"connection", b"keep-alive", b"upgrade", b"transfer-encoding", b"te", b"expect"))
AWAY = b'{"error":"this relay is just starting: ask again"}'
CROWDED = b'{"error":"as many requests at once as this relay takes: ask again"}'

Scope = MutableMapping[str, Any]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]


class Forwarder:
    """The ASGI application of a further worker. `path`: the private door of the first one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._under_way = 0

    async def __call__(self, scope: Scope, _receive: object, send: Send) -> None:
        """Answer a request as the first worker does; 503 where that can't be asked."""
        if self._under_way >= AT_ONCE:
            await _refuse(send, CROWDED)
            return
        self._under_way += 1
        try:
            await self._forward(scope, send)
        finally:
            self._under_way -= 1

    async def _forward(self, scope: Scope, send: Send) -> None:
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_unix_connection(self._path, limit=READ_BYTES)
        except (OSError, TimeoutError):
            await _refuse(send, AWAY)
            return
        try:
            writer.write(_make_request(scope))
            await _pass_on(_Answer(), scope["method"] == "HEAD", reader, send)
        finally:
            writer.transport.abort()


def _make_request(scope: Scope) -> bytes:
    target = scope["raw_path"] + (b"?" + scope["query_string"] if scope["query_string"] else b"")
    peer = (scope.get("client") or ("",))[0].encode()
    # none has a body: the relay answers nothing that needs one
    dropped = BY_HOP | {PEER, b"content-length"}
    headers = [(name, value) for name, value in scope["headers"] if name not in dropped]
    headers += [(PEER, peer), (b"connection", b"close")]
    lines = [b"%s %s HTTP/1.1" % (scope["method"].encode(), target), *(b"%s: %s" % each for each in headers)]
    return b"\r\n".join([*lines, b"", b""])


class _Answer:
    """What has come of an answer, as httptools calls it."""

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
        """Note that the head has come."""
        self.is_headed = True

    def on_body(self, body: bytes) -> None:
        """Take some of the body."""
        self.body.append(body)

    def on_message_complete(self) -> None:
        """Note that all has come."""
        self.is_whole = True


async def _pass_on(answer: _Answer, has_head_only: bool, reader: asyncio.StreamReader, send: Send) -> None:
    """Pass the answer on. Raises AnswerAborted where it breaks off."""
    parser, is_begun = httptools.HttpResponseParser(answer), False
    while not answer.is_whole:
        try:
            async with asyncio.timeout(ANSWER_S):
                data = await reader.read(READ_BYTES)
            if not data:
                raise EOFError
            parser.feed_data(data)
        except (OSError, EOFError, TimeoutError, httptools.HttpParserError):
            if is_begun:
                raise AnswerAborted from None
            await _refuse(send, AWAY)
            return
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
