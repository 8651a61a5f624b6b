"""Headers that are there twice, which no browser sends and proxies do: one list, and always an answer."""

from __future__ import annotations

import asyncio
import socket
from contextlib import ExitStack
from typing import Any

import pytest
import uvicorn
from posecast_relay.auth.access import Access
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import LiveSocket, make_live_protocol
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut

from .stage import UPGRADE, Relay

STREAMS = {"live?hz=0": UPGRADE, "live.sse?hz=0": ()}


def asked(port: int, stream: str, *headers: str) -> socket.socket:
    """A connection that has asked for a stream of `r`."""
    sock = socket.create_connection(("127.0.0.1", port), 10)
    lines = [f"GET /api/v1/robots/r/{stream} HTTP/1.1", "Host: x", *STREAMS[stream], *headers, "", ""]
    sock.sendall("\r\n".join(lines).encode())
    return sock


def status(sock: socket.socket) -> int:
    """Of the answer."""
    return int(sock.recv(4096).split(b" ", 2)[1])


async def no_app(_scope: Any, _receive: Any, _send: Any) -> None:
    """Nothing is asked of it."""


def left_alone(sock: socket.socket) -> bool:
    """Whether it was cut and nothing said."""
    try:
        return sock.recv(100) == b""
    except ConnectionError:
        return True


def test_no_header_twice_leaves_anybody_without_an_answer(relay: Relay) -> None:
    for stream in STREAMS:
        for header in ("Origin: https://a.example", "Host: y", "Authorization: Bearer L1.x", "Cookie: a"):
            with asked(relay.http, stream, header, header) as sock:
                assert status(sock) in (101, 200, 400, 401, 403), (stream, header)


def test_the_line_that_the_proxy_added_is_the_one_that_counts(relays: Any) -> None:
    relay: Relay = relays("--max-per-address", "1", "--trusted-proxies", "127.0.0.1", "--past", "0")
    for stream, taken in (("live?hz=0", 101), ("live.sse?hz=0", 200)):
        with ExitStack() as stack:

            def of(own_word: str, address: str, stream: str = stream, stack: ExitStack = stack) -> int:
                lines = (f"X-Forwarded-For: {own_word}", f"x-forwarded-for: {address}")
                return status(stack.enter_context(asked(relay.http, stream, *lines)))

            mine = f"1.1.1.{taken}"
            found = [of("6.6.6.6", mine), of("7.7.7.7", mine), of("6.6.6.6", "2.2.2.2")]
            assert found == [taken, 503, taken]


async def test_a_mistake_of_ours_leaves_no_connection_behind(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def mistaken(_self: LiveSocket, _request: Any) -> None:
        raise LookupError("a mistake")

    monkeypatch.setattr(LiveSocket, "_handshake", mistaken)
    access, decoded = Access(Dispatcher(Hub(Limits()), MemoryStore(), FanOut(None))), DecodeCache()
    config = uvicorn.Config(
        no_app,
        port=0,
        ws=make_live_protocol(access, decoded),
        http=make_http_protocol(access, decoded),
        lifespan="off",
        log_config=None,
    )
    server = uvicorn.Server(config)
    serving = asyncio.create_task(server.serve())
    while not server.started:
        await asyncio.sleep(0.01)
    port = server.servers[0].sockets[0].getsockname()[1]
    with await asyncio.to_thread(asked, port, "live?hz=0") as sock:
        assert await asyncio.to_thread(status, sock) == 500
        assert await asyncio.to_thread(left_alone, sock)
    async with asyncio.timeout(10):
        while server.server_state.connections:  # told of the end at the next turn
            await asyncio.sleep(0.01)
    assert access.live.faults == {"LookupError": 1}
    assert len(caplog.records) == 1
    server.should_exit = True
    await serving
