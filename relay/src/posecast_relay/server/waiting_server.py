"""Answers HTTP while a relay waits for a valid configuration: alive, but not ready."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import socket

log = logging.getLogger("posecast_relay")

WHY = "the robots file or a certificate is invalid or can't be read; the log says which"
HEAD_BYTES_MAX = 1 << 14
HEAD_S = 5.0
CONNECTIONS_MAX = 100  # further ones are closed at once


class WaitingServer:
    """An async context manager that serves on a listening socket. The socket stays open afterwards.

    `/livez` answers 200, so that no platform restarts the process. `/readyz` and everything else answer 503.
    """

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._server: asyncio.Server | None = None
        self._open: set[asyncio.StreamWriter] = set()

    async def __aenter__(self) -> WaitingServer:
        """Start to serve."""
        self._server = await asyncio.start_server(
            self._answer, sock=self._listener.dup(), limit=HEAD_BYTES_MAX
        )
        return self

    async def __aexit__(self, *_error: object) -> None:
        """Close all connections."""
        assert self._server is not None
        self._server.close()
        for writer in tuple(self._open):
            writer.close()

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._open) < CONNECTIONS_MAX:
            self._open.add(writer)
            # a client that sends no request, or has left, gets no answer
            with contextlib.suppress(TimeoutError, OSError, asyncio.IncompleteReadError, ValueError):
                async with asyncio.timeout(HEAD_S):
                    await self._exchange(reader, writer)
            self._open.discard(writer)
        writer.close()

    async def _exchange(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            head = await reader.readuntil(b"\r\n\r\n")
        except asyncio.LimitOverrunError:
            return
        target = head.partition(b"\r\n")[0].split(b" ")[1:2]
        if target == [b"/livez"]:
            status, kind, body = "200 OK", "text/plain", b"ok\n"
        elif target == [b"/readyz"]:
            status, kind, body = (
                "503 Service Unavailable",
                "application/json",
                _pack(status="waiting", why=WHY),
            )
        else:
            status, kind, body = "503 Service Unavailable", "application/json", _pack(error="not ready yet")
        writer.write(
            f"HTTP/1.1 {status}\r\ncontent-type: {kind}\r\ncontent-length: {len(body)}\r\n"
            "retry-after: 5\r\ncache-control: no-store\r\nconnection: close\r\n\r\n".encode()
            + body
        )
        await writer.drain()


def _pack(**doc: str) -> bytes:
    return json.dumps(doc).encode()
