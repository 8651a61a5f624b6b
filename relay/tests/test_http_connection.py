"""What a request may bring: refused before it is kept, answered, and the connection closed."""

from __future__ import annotations

import asyncio
import re
import socket
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
import uvicorn
from posecast_relay.auth.access import Access
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.http1 import (
    BODY_BYTES,
    HEAD_BYTES,
    HEADS_BYTES,
    LINES,
    PIPELINED,
    TARGET_BYTES,
    HttpConnection,
    RequestTimeouts,
)
from posecast_relay.net.sse import make_http_protocol
from posecast_relay.net.websocket import make_live_protocol
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut

from .stage import Relay, Watcher

MB = 1_000_000
READ = 256_000  # bytes that an event loop reads at once
GET = b"GET /api/v1/robots HTTP/1.1\r\nHost: x\r\n"
POST = b"POST /api/v1/robots HTTP/1.1\r\nHost: x\r\n"
UPGRADE = b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
CHUNKED = POST + b"Transfer-Encoding: chunked\r\n\r\n"
FLOODS = {
    "lines": (431, GET, b"a:b\r\n"),
    "lines of an upgrade": (431, GET.replace(b"robots", b"robots/r/live") + UPGRADE, b"a:b\r\n"),
    "lines of a request for events": (431, GET.replace(b"robots", b"robots/r/live.sse"), b"a:b\r\n"),
    "one line": (431, GET + b"a:", b"b"),
    "a name without end": (431, GET, b"a"),
    "folded lines": (400, GET + b"a: b\r\n", b" b\r\n"),
    "target": (414, b"GET /", b"a"),
    "method": (400, b"", b"A"),
    "empty lines": (431, b"", b"\r\n"),
    "body": (413, POST + b"Content-Length: 10000000\r\n\r\n", b"a"),
    "chunks": (413, CHUNKED, b"1\r\na\r\n"),
    "one chunk": (413, CHUNKED + b"FFFFFF\r\n", b"a"),
    "extension": (413, CHUNKED + b"1;", b"a=b;"),
    "trailer": (431, CHUNKED + b"0\r\n", b"a:b\r\n"),
    "one line of a trailer": (413, CHUNKED + b"0\r\na:", b"b"),
    "requests": (429, b"", GET + b"\r\n"),
    "chunked beside a length": (400, POST + b"Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n", b"a"),
    "two lengths": (400, POST + b"Content-Length: 3\r\nContent-Length: 4\r\n\r\n", b"a"),
    "zeros": (400, b"", b"\0"),
    "a name for all": (400, b"OPTIONS * HTTP/1.1\r\n\r\n", b""),
    "another protocol's": (400, b"CONNECT x:80 HTTP/1.1\r\n\r\n", b""),
}


class Wire:
    """A transport that takes everything."""

    def __init__(self, peer: str = "192.0.2.1") -> None:
        self.taken = b""
        self.closed = False
        self.peer = peer

    def write(self, data: bytes) -> None:
        self.taken += data

    def write_eof(self) -> None:
        self.closed = True

    def close(self) -> None:
        self.closed = True

    abort = close

    def is_closing(self) -> bool:
        return self.closed

    def can_write_eof(self) -> bool:
        return True

    def get_extra_info(self, name: str) -> Any:
        return (self.peer, 1) if name == "peername" else None

    def set_write_buffer_limits(self, high: int) -> None: ...

    def pause_reading(self) -> None: ...

    def resume_reading(self) -> None: ...

    def get_write_buffer_size(self) -> int:
        return 0


async def no_app(_scope: Any, _receive: Any, _send: Any) -> None:
    """Is never begun: nothing here gives the loop a turn."""


class Desk:
    """What connections need of a relay."""

    def __init__(self) -> None:
        self.dispatcher = Dispatcher(Hub(Limits()), MemoryStore(), FanOut(None))
        access, decoded = Access(self.dispatcher), DecodeCache()
        self.cut: list[int] = []
        unasked = RequestTimeouts(self.dispatcher.now, self.cut.append)
        self._class = make_http_protocol(access, decoded, unasked)
        self._config = uvicorn.Config(
            no_app, ws=make_live_protocol(access, decoded), lifespan="off", log_config=None
        )
        self._config.load()
        self._state: Any = SimpleNamespace(connections=set(), tasks=set(), default_headers=[])

    def connect(self, peer: str = "192.0.2.1") -> tuple[HttpConnection, Wire]:
        """A connection."""
        connection, wire = self._class(self._config, self._state, {}), Wire(peer)
        connection.connection_made(wire)  # type: ignore[arg-type]
        return connection, wire


@pytest.mark.parametrize("flood", FLOODS)
async def test_a_flood_is_refused_and_nothing_of_it_is_kept(flood: str) -> None:
    status, begin, more = FLOODS[flood]
    desk = Desk()
    connection, wire = desk.connect()
    connection.data_received(GET + b"\r\n")  # it is prepared
    connection, wire = desk.connect()
    piece = more * (READ // max(1, len(more)))
    tracemalloc.start()
    try:
        connection.data_received(begin)
        for _ in range(40):  # 10 MB
            connection.data_received(piece)
        kept, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert wire.taken.startswith(f"HTTP/1.1 {status} ".encode()), wire.taken
    assert b"connection: close" in wire.taken
    assert wire.closed
    assert peak < 300_000, f"{peak} bytes at most"
    assert kept < 150_000, f"{kept} bytes"
    connection.connection_lost(None)
    desk.dispatcher.stop()


@pytest.mark.parametrize(
    ("head", "status"),
    [
        (GET + b"a:b\r\n" * (LINES - 1), 200),
        (GET + b"a:b\r\n" * LINES, 431),
        (GET + b"a: " + b"b" * (HEAD_BYTES - 500) + b"\r\n", 200),
        (GET + (b"a: " + b"b" * 500 + b"\r\n") * (HEAD_BYTES // 500 + 1), 431),
        (b"GET /livez?" + b"a" * (TARGET_BYTES - 7) + b" HTTP/1.1\r\nHost: x\r\n", 200),
        (b"GET /livez?" + b"a" * (TARGET_BYTES - 6) + b" HTTP/1.1\r\nHost: x\r\n", 414),
        (POST + b"Content-Length: %d\r\n" % (BODY_BYTES - 10), 405),
        (GET + b"Upgrade: h2c\r\nConnection: Upgrade, HTTP2-Settings\r\n", 200),
    ],
)
def test_what_is_within_the_limits_is_answered(head: bytes, status: int, relay: Relay) -> None:
    with socket.create_connection(("127.0.0.1", relay.http), 10) as sock:
        sock.sendall(head + b"\r\n")
        if b"Content-Length" in head:
            sock.sendall(b"a" * (BODY_BYTES - 10))
        assert int(sock.recv(4096).split(b" ", 2)[1]) == status


def test_requests_sent_at_once_are_answered_in_their_order(relay: Relay) -> None:
    with socket.create_connection(("127.0.0.1", relay.http), 10) as sock:
        sock.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n" * PIPELINED)
        sock.sendall(b"GET /nothing HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
        said = b""
        while got := sock.recv(65536):
            said += got
    assert re.findall(rb"HTTP/1\.1 (\d+)", said) == [b"200"] * PIPELINED + [b"404"]


async def test_unfinished_heads_have_one_bound_and_the_oldest_go() -> None:
    desk = Desk()
    wires = []
    for _ in range(2 * HEADS_BYTES // HEAD_BYTES):
        connection, wire = desk.connect()
        connection.data_received(GET + b"a:" + b"b" * (HEAD_BYTES - 2000))
        wires.append(wire)
    held = [wire for wire in wires if not wire.closed]
    assert HEADS_BYTES // HEAD_BYTES <= len(held) < 1.3 * HEADS_BYTES // HEAD_BYTES
    assert held == wires[-len(held) :]
    assert sum(desk.cut) == len(wires) - len(held)
    desk.dispatcher.stop()


def peak_mb(relay: Relay) -> float:
    """The most memory that its process ever had."""
    status = Path(f"/proc/{relay.process.pid}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+)", status)[1]) / 1024  # type: ignore[index]


def send_all(port: int, data: bytes) -> None:
    """As much of it as is taken."""
    with socket.create_connection(("127.0.0.1", port), 20) as sock, suppress(OSError):
        sock.sendall(data)
        while sock.recv(65536):
            pass


async def test_floods_of_headers_cost_neither_memory_nor_frames(relays: Any, edges: Any) -> None:
    relay: Relay = relays()
    edges(relay.zenoh).hz = 10.0
    floods = [begin + more * (10 * MB // max(1, len(more))) for _, begin, more in FLOODS.values()]
    async with Watcher(relay.url(query="?hz=60")) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        before_mb, first = peak_mb(relay), viewer.frames[-1][1].seq
        with ThreadPoolExecutor(4) as pool:
            turns = [
                asyncio.get_running_loop().run_in_executor(pool, send_all, relay.http, flood)
                for flood in floods
            ]
            await asyncio.gather(*turns)
        await viewer.until("frames", lambda v: v.frames[-1][1].seq > first + 10)
        seqs = [frame.seq for _, frame in viewer.frames if frame.seq >= first]
        assert len(seqs) >= 0.5 * (seqs[-1] - first)  # the share that it keeps `make attack` measures
        assert viewer.closed is None
    assert peak_mb(relay) - before_mb < 60
    assert httpx.get(f"http://{relay.address}/livez").status_code == 200
    assert relay.errors() == ""
