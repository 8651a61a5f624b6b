"""Two ingests hear one robot: one of them writes it, the other goes on where that one stops."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Callable
from typing import Any

import pytest
import redis
from posecast_relay.adapters.redis_link import generation_key, state_key

from .redis_server import Redis
from .stage import Relay, Watcher, ZenohEdge, until
from .test_gateway import clean, live_after

TAKEN_OVER_S = 10.0  # 3.5 s of silence and a beat, on a loaded machine


class Pair:
    """Two ingests beside a Redis, a gateway, and a robot that both hear."""

    def __init__(self, relays: Any, edges: Any, server: Redis) -> None:
        self.flags = ("--role", "ingest", "--store", server.url)
        self.store: Any = redis.Redis(port=server.port, socket_timeout=5)
        self.first: Relay = relays(*self.flags)
        self.second: Relay = relays(*self.flags)
        self.gateway: Relay = relays("--role", "gateway", "--store", server.url)
        self.edge: ZenohEdge = edges(self.first.zenoh, also=[self.second.zenoh])

    def generation(self) -> int:
        """Who writes: each that takes over counts on."""
        return int(self.store.hget(state_key("r", "public"), "generation") or 0)

    async def taken_over(self, before: int) -> None:
        """Until another one writes."""
        await asyncio.to_thread(until, "taken over", lambda: self.generation() > before, TAKEN_OVER_S)


@pytest.fixture
def pair(relays: Any, edges: Any, redis_server: Redis) -> Pair:
    """With the robot on air."""
    return Pair(relays, edges, redis_server)


def texts(viewer: Watcher) -> list[tuple[int, str]]:
    """Its events."""
    return [(event["n"], event["text"]) for event in viewer.told("event")]


def has(events: int) -> Callable[[Watcher], bool]:
    """Whether a viewer has so many."""
    return lambda viewer: len(viewer.told("event")) >= events


async def test_the_second_takes_over_and_the_first_again_and_nothing_is_told_twice(pair: Pair) -> None:
    async with Watcher(pair.gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(until, "both heard it", lambda: pair.generation() == 2)
        pair.edge.event("one")
        await viewer.until("an event", has(1))
        writer = await asyncio.to_thread(_writer, pair)
        other = pair.second if writer is pair.first else pair.first
        writer.stop(signal.SIGKILL)
        await pair.taken_over(2)
        pair.edge.event("two")
        await viewer.until("the next event", has(2), TAKEN_OVER_S)
        await viewer.until("frames", live_after(viewer.frames[-1][1].seq), TAKEN_OVER_S)
        assert texts(viewer) == [(1, "one"), (2, "two")]
        clean(viewer)
        async with Watcher(pair.gateway.url()) as late:
            await late.until("what there is", has(2))
            assert texts(late) == texts(viewer)
        assert other.process.poll() is None


async def test_one_that_was_frozen_meanwhile_replaces_nothing(pair: Pair) -> None:
    async with Watcher(pair.gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(until, "both heard it", lambda: pair.generation() == 2)
        writer = await asyncio.to_thread(_writer, pair)
        writer.process.send_signal(signal.SIGSTOP)
        try:
            await pair.taken_over(2)
            await viewer.until("frames", live_after(viewer.frames[-1][1].seq), TAKEN_OVER_S)
        finally:
            writer.process.send_signal(signal.SIGCONT)
        thawed, seq = time.monotonic(), viewer.frames[-1][1].seq
        pair.edge.event("after")
        await viewer.until("three seconds", lambda v: v.frames[-1][1].seq > seq + 90, 20.0)
        await viewer.until("the event", has(1))
        assert pair.generation() == 3
        assert int(pair.store.get(generation_key("r"))) == 3
        assert texts(viewer) == [(1, "after")]
        assert all(said["robot"] == "online" for said in viewer.told("status")[-2:])
        assert viewer.longest_gap_s(thawed) < 2.0
        clean(viewer)
        assert writer.process.poll() is None


def _writer(pair: Pair) -> Relay:
    """The ingest whose words stand in Redis, found by stopping each for a moment."""
    for relay in (pair.first, pair.second):
        relay.process.send_signal(signal.SIGSTOP)
        try:
            before, seq = pair.edge.seq, _stored(pair)
            until("frames", lambda b=before: pair.edge.seq > b + 15)  # type: ignore[misc]
            if _stored(pair) <= seq + 3:
                return relay
        finally:
            relay.process.send_signal(signal.SIGCONT)
    raise AssertionError("nobody writes")


def _stored(pair: Pair) -> int:
    return int(pair.store.hget(state_key("r", "public"), "seq"))
