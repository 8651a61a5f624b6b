"""What a further worker is asked and is no stream: passed to the first worker, and its answer passed back.

So there is one answer to each question, whichever worker was asked. Requests under way are counted where they
come in, here and at the private door, as a relay of one worker counts them (`pending_requests.py`): a crowd
that asks at one moment waits, and beyond the bound the heaviest address loses a connection. An answer is read
as fast as its reader takes it: READ_BYTES of each are here, and what the kernel holds of a socket.
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

PEER = b"x-posecast-peer"  # who asks; believed behind the private door alone
ANSWER_S = 30.0  # without a byte of it; a request for the next segment is held for 8 s
AGAIN_S = 0.005  # until it is tried again, where as many wait at the door as the kernel lets
READ_BYTES = 1 << 16
BY_HOP = frozenset((b"connection", b"keep-alive", b"upgrade", b"transfer-encoding", b"te", b"expect"))
AWAY = b'{"error":"the first process of this relay does not answer: try again"}'
CROWDED = b'{"error":"this relay can open no more files now: try again"}'

Scope = MutableMapping[str, Any]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]


class Forwarder:
    """The ASGI application of a further worker. `path`: the private door of the first one."""

    def __init__(self, path: Path) -> None:
        self._path = str(path)
        self._turn = asyncio.Lock()  # so that those who wait at the door don't all look again at once

    async def __call__(self, scope: Scope, _receive: object, send: Send) -> None:
        """Answer a request as the first worker does; 503 where that can't be asked.

        Raises AnswerAborted where the first one cut it.
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
        """Knock until there is room at the door. Raises OSError."""
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


async def _pass_on(answer: _Answer, scope: Scope, asked: socket.socket, send: Send) -> None:
    """Ask, and pass the answer on; 503 when none comes. Raises AnswerAborted where it breaks off."""
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
