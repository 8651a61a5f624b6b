"""A lecture hall opens the link: a thousand viewers from one address, within ten seconds."""

from __future__ import annotations

import asyncio
import json
import time
from functools import partial
from typing import Any

import pytest
from posecast_testing import free_port
from posecast_wire import Close, parse_header

from .open_files import allow_files
from .sim import schema
from .stage import Relay, Watcher, request_stream
from .test_websocket import endings, raw_viewer

VIEWERS = 1000
ARRIVE_S = 10.0
FRAMES = 3


@pytest.fixture
def many_files() -> Any:
    """Two processes with a socket per viewer each: the relay sees to itself."""
    with allow_files(VIEWERS + 200):
        yield


async def one_of_many(relay: Relay) -> tuple[list[str], list[int], float]:
    """Reads three frames: types of the texts, numbers of the frames, seconds from connecting to `hello`."""
    began = time.monotonic()
    reader, writer = await asyncio.open_connection("127.0.0.1", relay.http)
    writer.write(request_stream("?hz=2"))
    assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 101")
    texts: list[str] = []
    frames: list[bytes] = []
    hello_s = 0.0
    while len(frames) < FRAMES:
        head = await reader.readexactly(2)
        size = head[1]
        if size == 126:
            size = int.from_bytes(await reader.readexactly(2), "big")
        payload = await reader.readexactly(size)
        if head[0] & 0x0F == 2:
            frames.append(payload)
        else:
            texts.append(json.loads(payload)["type"])
            hello_s = hello_s or time.monotonic() - began
    writer.close()
    return texts, [len(frame) for frame in frames if parse_header(frame)], hello_s


async def test_a_thousand_from_one_address_all_see_frames(relays: Any, edges: Any, many_files: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edges(relay.zenoh)
    async with Watcher(relay.url()) as watcher:
        await watcher.until("frames", lambda v: len(v.frames) > 10)
        began = watcher.frames[-1][1].seq

        async def come(n: int) -> tuple[list[str], list[int], float]:
            await asyncio.sleep(n * ARRIVE_S / VIEWERS)
            return await one_of_many(relay)

        seen = await asyncio.wait_for(asyncio.gather(*(come(n) for n in range(VIEWERS))), 60)
        assert len(seen) == VIEWERS
        assert {texts[0] for texts, _, _ in seen} == {"hello"}
        assert all("schema" in texts and "bye" not in texts for texts, _, _ in seen)
        assert all(len(frames) == FRAMES for _, frames, _ in seen)
        assert watcher.closed is None
        assert watcher.most_missed(began) < 60
    assert endings(relay, port) == ""


def has_events(n: int, viewer: Watcher) -> bool:
    return len(viewer.told("event")) == n


async def test_a_full_event_queue_ends_a_viewer_that_does_not_read(relays: Any, edges: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edge = edges(relay.zenoh)
    async with Watcher(relay.url(query="?hz=0")) as other:
        await other.until("the robot", lambda v: v.told("schema"))
        sock = raw_viewer(relay)
        assert sock.recv(12).startswith(b"HTTP/1.1 101")
        n = 0
        while "code" not in (told := await asyncio.to_thread(endings, relay, port)):
            for _ in range(50):  # faster than an edge may, but no faster than whoever reads can read
                n += 1
                edge.event(f"{n} " + "x" * 1500)
            await other.until("all events", partial(has_events, n))
        assert f'code="{int(Close.EVENTS_FULL)}"}} 1.0' in told
        assert 257 < n < 500
        assert other.closed is None
        sock.close()


async def test_a_30_ms_fault_reaches_a_viewer_of_one_frame_in_ten_seconds(relay: Relay, edges: Any) -> None:
    edge = edges(relay, of=schema())
    async with Watcher(relay.url(query="?hz=0.1")) as viewer:
        await viewer.until("a second of frames", lambda v: v.frames and edge.seq > 30)
        before = len(viewer.frames)
        edge.event("jam", "on")
        await asyncio.sleep(0.03)
        edge.event("jam", "off")
        await viewer.until("both", lambda v: len(v.told("event")) == 2)
        assert len(viewer.frames) <= before + 1  # they did not wait for the next
        assert [e["state"] for e in viewer.told("event")] == ["on", "off"]
