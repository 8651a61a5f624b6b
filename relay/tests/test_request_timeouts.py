"""Who connects and does not ask holds a socket for seconds, not for ever."""

from __future__ import annotations

import asyncio
import socket
from contextlib import ExitStack
from typing import Any, cast

import httpx
from posecast_relay.net.http1 import ASK_S, CROWD, HURRIED_S, SWEEP_S, RequestTimeouts
from posecast_testing import free_port

from .stage import SharedRelay, Watcher
from .test_observability import figures


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
