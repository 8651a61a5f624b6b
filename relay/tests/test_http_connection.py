"""What a request may bring: refused before it is kept, answered, and the connection closed."""

from __future__ import annotations

import asyncio
import re
import socket
import tracemalloc
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import httpx
import pytest
import uvicorn
from posecast_relay.auth.access import Access
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.http1 import (
    ASK_S,
    BODY_BYTES,
    CROWD,
    HEAD_BYTES,
    HEADS_BYTES,
    HURRIED_S,
    LINES,
    PIPELINED,
    REQUEST_BYTES,
    STARTED_PER_TURN,
    SWEEP_S,
    TARGET_BYTES,
    HttpConnection,
    PendingRequests,
    RequestTimeouts,
)
from posecast_relay.net.sse import TURN_S, HandshakeQueue, make_http_protocol
from posecast_relay.net.websocket import make_live_protocol
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_testing import free_port

from .stage import Relay, SharedRelay, Watcher, Wire
from .test_observability import figures

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


# ---- handshakes spread over turns of the loop ----------------------------------------


async def test_many_at_once_leave_room_for_others_and_keep_their_order(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    now, entered, between = 100.0, list[int](), list[int]()
    monkeypatch.setattr("posecast_relay.net.sse.time", SimpleNamespace(monotonic=lambda: now))
    doorway = HandshakeQueue()

    def enter(number: int) -> None:
        nonlocal now
        now += TURN_S / 4
        entered.append(number)
        if number == 5:
            raise ValueError("this one only")

    for number in range(20):
        doorway.admit(lambda number=number: enter(number))  # type: ignore[misc]
    assert entered == []
    while len(entered) < 20:
        await asyncio.sleep(0)
        between.append(len(entered))
    assert entered == list(range(20))
    assert max(b - a for a, b in pairwise([0, *between])) <= 5
    assert [record.getMessage() for record in caplog.records] == ["handshake failed"]
    doorway.admit(lambda: entered.append(20))
    while len(entered) < 21:
        await asyncio.sleep(0)


# ---- answers that wait: one bound in bytes, and thousands that are never read -----------


UNREAD = 2500


class Asker:
    """A connection that only notes its end."""

    def __init__(self) -> None:
        self.was_cut = False

    def cut(self) -> None:
        """As a connection's."""
        self.was_cut = True


async def test_addresses_take_turns_and_health_does_not_queue() -> None:
    under_way, order = PendingRequests(), list[str]()
    for number in range(3000):
        under_way.wait(Asker(), "crowd", "crowd", partial(order.append, f"crowd {number}"))
    under_way.wait(Asker(), "crowd", "crowd health", partial(order.append, "health"))
    under_way.wait(Asker(), "other", "other", partial(order.append, "other"))
    under_way.wait(Asker(), "other", "other", partial(order.append, "other's second"))
    assert order == []
    await asyncio.sleep(0)
    assert len(order) == STARTED_PER_TURN
    assert order[:5] == ["crowd 0", "health", "other", "crowd 1", "other's second"]
    turns = 1
    while len(order) < 3003:
        before = len(order)
        await asyncio.sleep(0)
        turns += 1
        assert len(order) - before <= STARTED_PER_TURN
    assert [name for name in order if name.startswith("crowd")] == [f"crowd {n}" for n in range(3000)]


async def test_who_has_left_is_not_answered_and_takes_no_turn() -> None:
    under_way, order = PendingRequests(), list[int]()
    askers = [Asker() for _ in range(500)]
    for number, asker in enumerate(askers):
        under_way.wait(asker, "a", "a", partial(order.append, number))
    for asker in askers[:-1]:
        under_way.leave(asker)
    await asyncio.sleep(0)
    assert order == [499]
    under_way.leave(askers[-1])
    under_way.leave(askers[-1])
    assert (len(under_way), under_way.held_bytes) == (0, 0)


async def test_beyond_the_bound_the_heaviest_address_loses_what_was_not_read_for_longest() -> None:
    room = 10 * REQUEST_BYTES
    under_way = PendingRequests(room)
    few, many = [Asker() for _ in range(3)], [Asker() for _ in range(4)]
    for asker in few:
        under_way.wait(asker, "few", "few", lambda: None)
    for asker in many:
        under_way.wait(asker, "many", "many", lambda: None)
    under_way.record_held(many[0], REQUEST_BYTES)
    under_way.record_held(many[1], REQUEST_BYTES)
    under_way.record_held(many[0], REQUEST_BYTES // 2)  # it has taken some
    assert under_way.held_bytes == 8.5 * REQUEST_BYTES
    under_way.record_held(few[0], 2 * REQUEST_BYTES)
    assert [asker.was_cut for asker in many] == [False, False, True, False]
    assert not any(asker.was_cut for asker in few)
    assert under_way.held_bytes == 9.5 * REQUEST_BYTES
    under_way.record_held(
        many[3], 1 + REQUEST_BYTES // 2
    )  # now `many` is the heavier again, and 3 has just read
    assert [asker.was_cut for asker in many] == [False, True, True, False]
    assert under_way.held_bytes <= room
    under_way.record_held(few[0], 20 * REQUEST_BYTES)  # more than there is room for
    assert few[0].was_cut


def asking(relay: Relay, path: str) -> socket.socket:
    """Somebody who asks and reads nothing."""
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    sock.connect(("127.0.0.1", relay.http))
    sock.sendall(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    return sock


async def test_thousands_of_answers_that_nobody_reads(relays: Any, edges: Any, tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("page")
    (tmp_path / "long.js").write_bytes(bytes(2_000_000))
    relay: Relay = relays("--static", str(tmp_path))
    edges(relay.zenoh).hz = 10.0
    with ExitStack() as stack:
        async with (
            Watcher(relay.url(query="?hz=60")) as viewer,
            httpx.AsyncClient(base_url=f"http://{relay.address}") as client,
        ):
            await viewer.until("frames", lambda v: len(v.frames) > 10)
            before_mb, first, live = peak_mb(relay), viewer.frames[-1][1].seq, 0
            for number in range(UNREAD):
                stack.enter_context(asking(relay, "/long.js"))
                if number % 50 == 49:
                    assert (await client.get("/livez")).status_code == 200
                    live += 1
            assert (await client.get("/long.js")).content == bytes(2_000_000)
            await viewer.until("further frames", lambda v: v.frames[-1][1].seq > first + 10)
            seqs = [frame.seq for _, frame in viewer.frames if frame.seq >= first]
            assert len(seqs) >= 0.5 * (seqs[-1] - first)  # the share that it keeps `make attack` measures
            assert viewer.closed is None
            assert live == UNREAD // 50
    assert peak_mb(relay) - before_mb < 60


async def test_a_reader_that_is_slow_gets_all_of_it(relay: SharedRelay) -> None:
    (relay.page / "long.js").write_bytes(b"abcdefghij" * 30_000)

    def read() -> bytes:
        with asking(relay, "/long.js") as sock:
            said = b""
            while len(said.partition(b"\r\n\r\n")[2]) < 300_000:
                said += sock.recv(1000)
            return said.partition(b"\r\n\r\n")[2]

    assert await asyncio.to_thread(read) == b"abcdefghij" * 30_000


# ---- who connects and does not ask holds a socket for seconds, not for ever ----------


class Line:
    """A transport that only notes its end."""

    def __init__(self) -> None:
        self.aborted = False

    def abort(self) -> None:
        """As asyncio's."""
        self.aborted = True


async def test_the_slow_go_and_in_a_crowd_the_oldest_go_sooner() -> None:
    now = [100.0]
    cut: list[int] = []
    unasked = RequestTimeouts(lambda: now[0], cut.append)
    lines = [Line() for _ in range(CROWD + 7)]
    for line in lines:
        unasked.start(cast(Any, line))
    unasked.stop(cast(Any, lines[0]))  # it asked
    now[0] += HURRIED_S + 0.1
    await asyncio.sleep(2 * SWEEP_S)
    assert [n for n, line in enumerate(lines) if line.aborted] == [1, 2, 3, 4, 5, 6]
    for line in lines[7:57]:
        unasked.stop(cast(Any, line))
    now[0] += ASK_S
    await asyncio.sleep(2 * SWEEP_S)
    assert [line.aborted for line in lines] == [False] + [True] * 6 + [False] * 50 + [True] * (CROWD - 50)
    assert sum(cut) == CROWD - 50 + 6


def is_open(sock: socket.socket) -> bool:
    """Whether the relay still holds this connection."""
    try:
        return sock.recv(100) != b""
    except BlockingIOError:
        return True
    except OSError:
        return False


async def test_six_hundred_half_requests_hurt_nobody(relays: Any, edges: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edges(relay.zenoh)
    with ExitStack() as stack:
        async with (
            Watcher(relay.url()) as viewer,
            httpx.AsyncClient(base_url=f"http://{relay.address}") as client,
        ):
            await viewer.until("frames", lambda v: len(v.frames) > 10)
            slow = []
            for n in range(600):
                sock = stack.enter_context(socket.create_connection(("127.0.0.1", relay.http)))
                sock.sendall(b"GET / HTTP/1.1\r\nHost:" if n % 2 else b"")
                sock.setblocking(False)
                slow.append(sock)
            async with asyncio.timeout(ASK_S + 60.0), Watcher(relay.url()) as late:
                await late.until("frames", lambda v: len(v.frames) > 10)
                while any(is_open(sock) for sock in slow):
                    assert (await client.get("/livez")).status_code == 200
                    for sock in slow[1::2]:
                        if is_open(sock):
                            sock.send(b"x")  # a byte now and then is no request either
                    await asyncio.sleep(0.2)
                assert late.closed is None
                seq = late.frames[-1][1].seq
                await late.until("further frames", lambda v: v.frames[-1][1].seq > seq + 5)
            assert viewer.closed is None
            found = await asyncio.to_thread(figures, port)
    assert found["posecast_handshakes_total|never asked"] == 600
    assert found["posecast_handshakes_total|accepted"] == 2


async def test_who_leaves_while_several_of_its_requests_are_answered_is_no_mistake_of_ours(
    relay: SharedRelay,
) -> None:
    (relay.page / "long.js").write_bytes(bytes(1_000_000))
    for _ in range(40):  # each left behind a traceback one time in three
        with socket.create_connection(("127.0.0.1", relay.http)) as sock:
            sock.sendall(5 * b"GET /long.js HTTP/1.1\r\nHost: x\r\n\r\n")
            assert await asyncio.to_thread(sock.recv, 1000)
    async with httpx.AsyncClient(base_url=relay.base) as client:
        assert (await client.get("/livez")).status_code == 200
