"""The stream through real sockets: frames, endings, and what a viewer may not do."""

from __future__ import annotations

import asyncio
import json
import socket
import time
from contextlib import suppress
from itertools import pairwise
from statistics import median
from typing import Any

import pytest
import websockets
from posecast_wire import Close

from .sim import schema
from .stage import Relay, Watcher, until


def stride(seqs: list[int]) -> float:
    """The usual step between frames; that each one is exact is tested on a clock of the test's own."""
    assert seqs == sorted(set(seqs))
    return median(b - a for a, b in pairwise(seqs))


async def test_frames_arrive_as_they_came_at_the_rate_asked_for(relays: Any, edges: Any) -> None:
    relay = relays()
    edge = edges(relay.zenoh)
    async with Watcher(relay.url(query="?hz=30")) as all_frames, Watcher(relay.url(query="?hz=10")) as third:
        await third.until("two seconds of frames", lambda v: len(v.frames) > 25)
        await all_frames.until("the same", lambda v: len(v.frames) > 70)
    assert stride([frame.seq for _, frame in all_frames.frames][-60:]) == 1
    assert stride([frame.seq for _, frame in third.frames][-20:]) == 3
    assert all(frame.codes == (frame.seq,) * 2 for _, frame in all_frames.frames + third.frames)
    types = [doc["type"] for doc in third.texts]
    assert types[:2] == ["hello", "status"]
    # the robot may come on air just after the viewer, which is one more status before the schema
    assert [kind for kind in types if kind != "status"][:2] == ["hello", "schema"]
    assert third.texts[0]["hz"] == 10
    assert edge.seq > 60


async def test_no_compression_is_negotiated(relays: Any) -> None:
    relay = relays()
    async with websockets.connect(relay.url(), compression="deflate") as connection:
        assert connection.protocol.extensions == []


async def test_an_event_reaches_a_viewer_of_no_frames(relays: Any, edges: Any) -> None:
    relay = relays()
    edge = edges(relay.zenoh)
    async with Watcher(relay.url(query="?hz=0")) as viewer:
        await viewer.until("the robot shows", lambda v: v.told("schema"))
        edge.event("jam", "on")
        edge.event("jam", "off")
        await viewer.until("both events", lambda v: len(v.told("event")) == 2)
        assert [(e["n"], e["text"], e["state"]) for e in viewer.told("event")] == [
            (1, "jam", "on"),
            (2, "jam", "off"),
        ]
        assert viewer.frames == []


async def ending(
    relay: Relay, *messages: str | bytes, robot: str = "r", query: str = ""
) -> tuple[int, dict[str, Any]]:
    """Say this, then read to the end: close code and `bye`."""
    said: dict[str, Any] = {}
    async with websockets.connect(relay.url(robot, query)) as connection:
        for message in messages:
            await connection.send(message)
        try:
            while True:
                doc = json.loads(await asyncio.wait_for(connection.recv(), 10))
                said = doc if doc["type"] == "bye" else said
        except websockets.ConnectionClosed:
            return connection.close_code or 0, said


@pytest.mark.parametrize(
    ("messages", "close"),
    [
        ((b"\x00\x01",), Close.BINARY),
        (("hello",), Close.NOT_ALLOWED),
        (('{"type":"command","joint":"RKN","to":1}',), Close.NOT_ALLOWED),
        (('{"type":"ping","t":1}',) * 21, Close.TOO_MANY),
    ],
)
async def test_what_a_viewer_may_not_send_ends_with_its_name(
    relays: Any, messages: tuple[str | bytes, ...], close: Close
) -> None:
    relay = relays()
    code, bye = await ending(relay, *messages)
    assert code == close
    assert bye["code"] == close
    assert bye["reason"]


async def test_a_message_over_4_kib_ends_with_1009(relays: Any) -> None:
    relay = relays()
    code, _ = await ending(relay, '{"type":"auth","token":"' + "x" * 4096 + '"}')
    assert code == Close.TOO_LONG
    async with websockets.connect(relay.url()) as connection:  # also in small pieces

        async def pieces() -> Any:
            for _ in range(100):
                yield " " * 100

        with suppress(websockets.ConnectionClosed):
            await connection.send(pieces())
        await asyncio.wait_for(connection.wait_closed(), 10)
        assert connection.close_code == Close.TOO_LONG


async def test_text_that_is_not_utf_8_ends_with_1007(relays: Any) -> None:
    relay = relays()
    async with websockets.connect(relay.url()) as connection:
        await connection.send(b"\xff\xfe", text=True)
        await asyncio.wait_for(connection.wait_closed(), 10)
        assert connection.close_code == Close.NOT_UTF8


@pytest.mark.parametrize(("robot", "query"), [("R*", ""), ("a%2Fb", ""), ("-x", ""), ("r", "?view=lab")])
async def test_a_robot_or_view_that_cannot_be_here_is_told_so(relays: Any, robot: str, query: str) -> None:
    code, bye = await ending(relays(), robot=robot, query=query)
    assert code == Close.ABSENT
    assert bye["code"] == Close.ABSENT


async def test_a_robot_that_is_not_there_yet_is_waited_for(relays: Any, edges: Any) -> None:
    relay = relays()
    async with Watcher(relay.url("later")) as viewer:
        await viewer.until("status", lambda v: v.told("status"))
        assert viewer.told("status")[0]["robot"] == "offline"
        edges(relay.zenoh, robot="later")
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        assert viewer.told("status")[-1]["robot"] == "online"


async def test_the_relay_is_full(relays: Any) -> None:
    relay = relays("--max-viewers", "1")
    async with Watcher(relay.url()) as first:
        code, bye = await ending(relay)
        assert (code, bye["code"], bye["retry_s"]) == (Close.FULL, Close.FULL, 30.0)
        assert first.closed is None


async def test_messages_in_pieces_and_pings_are_understood(relays: Any) -> None:
    async with websockets.connect(relays().url()) as connection:
        await connection.send(iter(['{"type":', '"ping",', '"t":42}']))
        docs: list[dict[str, Any]] = []
        while not docs or docs[-1]["type"] != "pong":
            docs.append(json.loads(await asyncio.wait_for(connection.recv(), 10)))
        assert docs[-1]["t"] == 42
        await asyncio.wait_for(await connection.ping(), 10)


async def test_rate_changes_while_watching(relays: Any, edges: Any) -> None:
    relay = relays()
    edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 40)
        assert viewer.connection is not None
        await viewer.connection.send('{"type":"rate","hz":10}')
        await viewer.until("the answer", lambda v: v.told("rate"))
        n = len(viewer.frames)
        await viewer.until("frames at the new rate", lambda v: len(v.frames) > n + 10)
        assert stride([frame.seq for _, frame in viewer.frames[n + 1 :]]) == 3


@pytest.mark.parametrize(
    ("target", "headers", "status"),
    [
        ("/api/v1/robots/r/live?hz=fast", {}, 400),
        ("/api/v1/robots/r/live?hz=nan", {}, 400),
        ("/api/v1/robots/r/live?hz=-1", {}, 400),
        ("/api/v1/robots/r/live?format=xml", {}, 400),
        ("/api/v1/robots/r/live?" + "&".join("a=1" for _ in range(99)), {}, 400),
        ("/elsewhere", {}, 404),
        ("/api/v1/robots/r/live", {"Sec-WebSocket-Version": "12"}, 400),
        ("/api/v1/robots/r/live", {"Sec-WebSocket-Key": "short"}, 400),
    ],
)
def test_a_malformed_request_gets_a_status(
    relays: Any, target: str, headers: dict[str, str], status: int
) -> None:
    relay = relays()
    usual = {
        "Host": relay.address,
        "Connection": "Upgrade",
        "Upgrade": "websocket",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    lines = [f"GET {target} HTTP/1.1", *(f"{k}: {v}" for k, v in (usual | headers).items()), "", ""]
    with socket.create_connection(("127.0.0.1", relay.http), 5) as sock:
        sock.sendall("\r\n".join(lines).encode())
        answer = b""
        while part := sock.recv(4096):
            answer += part
    assert answer.startswith(f"HTTP/1.1 {status} ".encode())


def raw_viewer(relay: Relay, receive_bytes: int = 4096) -> socket.socket:
    """A viewer that has upgraded and then does nothing, not even answer pings."""
    sock = socket.socket()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
    sock.settimeout(30)
    sock.connect(("127.0.0.1", relay.http))
    lines = [
        "GET /api/v1/robots/r/live?hz=60 HTTP/1.1",
        f"Host: {relay.address}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "",
        "",
    ]
    sock.sendall("\r\n".join(lines).encode())
    return sock


def endings(relay: Relay, port: int) -> str:
    """The relay's count of endings."""
    import httpx

    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    return "\n".join(line for line in text.splitlines() if line.startswith("posecast_endings_total"))


@pytest.mark.parametrize("from_the_start", [True, False])
async def test_a_viewer_that_does_not_read_is_cut_and_hurts_nobody(
    relays: Any, edges: Any, from_the_start: bool
) -> None:
    from .stage import free_port

    port = free_port()
    relay = relays("--metrics-port", str(port))
    before = raw_viewer(relay)
    if from_the_start:  # the join alone is more than its socket takes, else it is the frames
        before.close()
    edges(relay.zenoh, of=schema([f"J{n}" for n in range(3000)]))
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: v.frames)
        sock = raw_viewer(relay) if from_the_start else before
        began = time.monotonic()
        await asyncio.to_thread(until, "it is cut", lambda: 'code="4409"} 1.0' in endings(relay, port), 12.0)
        assert time.monotonic() - began < 10
        assert viewer.longest_gap_s(began) < 2.0  # the stuck one stood for five
        assert viewer.closed is None
    sock.close()


async def test_a_viewer_that_went_without_a_word_is_found_within_twelve_seconds(relays: Any) -> None:
    from .stage import free_port

    port = free_port()
    relay = relays("--metrics-port", str(port))
    sock = raw_viewer(relay)
    began = time.monotonic()

    def gone() -> bool:
        try:
            while sock.recv(65536):
                assert time.monotonic() - began < 13
        except ConnectionResetError:
            pass
        return True

    assert await asyncio.to_thread(gone)
    assert 10.5 <= time.monotonic() - began <= 12.5
    assert 'code="4408"} 1.0' in endings(relay, port)
    sock.close()
