"""A viewer that sends far too much is let go after its first few, whatever it sends, and read no further."""

from __future__ import annotations

import asyncio
import socket
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from posecast_relay.auth.access import Access
from posecast_relay.auth.tokens import Tokens
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.net.encodings import DecodeCache
from posecast_relay.net.websocket import AFTER_END_BYTES, SLICE_BYTES, LiveSocket, make_live_protocol
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut
from posecast_wire import Close

from .stage import Relay, Watcher, Wire, request_stream

MASK = bytes(4)
PING = b"\x89\x80" + MASK
PONG = b"\x8a\x80" + MASK
PIECE = b"\x00\x80" + MASK  # of a message that never ends, and never gets longer
BEGUN = b"\x01\x80" + MASK
ACK = b'\x81\x94{}{"type":"ack","n":0}'.replace(b"{}", MASK, 1)
MANY = 50_000
FLOODS = {"pings": PING * MANY, "pongs": PONG * MANY, "pieces": BEGUN + PIECE * MANY, "messages": ACK * MANY}


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many WebSocket frames were taken apart and looked at."""
    counts, look = [0], LiveSocket._frame

    def counted(self: LiveSocket, frame: Any) -> None:
        counts[0] += 1
        look(self, frame)

    monkeypatch.setattr(LiveSocket, "_frame", counted)
    return counts


@pytest.mark.parametrize("query", ["", "?auth=1"])
@pytest.mark.parametrize("what", FLOODS)
async def test_whatever_it_sends_a_few_are_looked_at(what: str, query: str, seen: list[int]) -> None:
    limits = Limits()
    dispatcher, wire = Dispatcher(Hub(limits), MemoryStore(), FanOut(None)), Wire()
    config, server = SimpleNamespace(), SimpleNamespace(connections=set())
    made = make_live_protocol(Access(dispatcher, tokens=Tokens()), DecodeCache())
    viewer: Any = made(config, server, None)  # type: ignore[arg-type]
    viewer.connection_made(wire)
    viewer.data_received(request_stream(query))
    viewer.data_received(FLOODS[what])
    assert f'"code":{int(Close.TOO_MANY)}'.encode() in wire.taken
    assert not wire.reading
    assert seen[0] <= SLICE_BYTES // len(PING) + 2, "of many thousands"
    assert not dispatcher.hub.viewers
    viewer.connection_lost(None)
    dispatcher.stop()


@pytest.mark.parametrize("what", FLOODS)
async def test_a_flood_behind_the_end_is_not_read(what: str, seen: list[int]) -> None:
    dispatcher, wire = Dispatcher(Hub(Limits()), MemoryStore(), FanOut(None)), Wire()
    made = make_live_protocol(Access(dispatcher), DecodeCache())
    viewer: Any = made(SimpleNamespace(), SimpleNamespace(connections=set()), None)  # type: ignore[arg-type]
    viewer.connection_made(wire)
    viewer.data_received(request_stream())
    viewer.data_received(b"\x81\x82" + MASK + b"{}")
    assert f'"code":{int(Close.NOT_ALLOWED)}'.encode() in wire.taken
    for _ in range(10):
        viewer.data_received(FLOODS[what])
    assert not wire.reading
    assert seen[0] <= 2 * AFTER_END_BYTES // len(PING), "of many thousands"
    viewer.connection_lost(None)
    dispatcher.stop()


async def test_one_that_floods_keeps_nobody_waiting(relay: Relay, edges: Any) -> None:
    edges(relay)

    def flood(data: bytes) -> bytes:
        with socket.create_connection(("127.0.0.1", relay.http), 20) as sock:
            sock.sendall(request_stream("?hz=0"))
            said = b""
            try:
                sock.sendall(data)
                while part := sock.recv(65536):
                    said += part
            except ConnectionError:
                pass
            return said

    async with Watcher(relay.url(query="?hz=30")) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 10)
        for data in FLOODS.values():
            await asyncio.to_thread(flood, data)
        seq = viewer.frames[-1][1].seq
        await viewer.until("further frames", lambda v: v.frames[-1][1].seq > seq + 30)
        assert viewer.closed is None
        seqs = [frame.seq for _, frame in viewer.frames]
    assert seqs == sorted(set(seqs))
    assert httpx.get(relay.api).json()["viewers"] <= 1
