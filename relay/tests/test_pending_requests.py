"""Answers that wait: turns by address, one bound in bytes, and a relay on which thousands are never read."""

from __future__ import annotations

import asyncio
import socket
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import httpx
from posecast_relay.net.http1 import REQUEST_BYTES, STARTED_PER_TURN, PendingRequests

from .stage import Relay, SharedRelay, Watcher
from .test_http_connection import peak_mb

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
