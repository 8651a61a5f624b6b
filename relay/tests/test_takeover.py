"""Two ingests hear one robot: one of them writes it, the other goes on where that one stops."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable
from typing import Any

import httpx
import pytest
import redis
from posecast_relay.redis.client import generation_key, state_key
from posecast_testing import until

from .redis_server import Redis
from .stage import Relay, Watcher, ZenohEdge
from .test_gateway import clean, live_after

TAKEN_OVER_S = 10.0  # a lease of 1.5 s and a look, on a loaded machine


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

    def stored(self) -> int:
        """The newest frame in Redis."""
        return int(self.store.hget(state_key("r", "public"), "seq") or -1)

    def second_writes(self) -> None:
        """See to it that the second ingest is the one that writes, and the first has learned so."""
        until("both hear it", lambda: all(_hears(relay) for relay in (self.first, self.second)))
        self.first.process.send_signal(signal.SIGSTOP)
        try:
            before = self.edge.seq
            until("the second writes", lambda: self.stored() > before + 15)
        finally:
            self.first.process.send_signal(signal.SIGCONT)
        before = self.generation()
        seq = self.stored()
        until("the first has learned it", lambda: self.stored() > seq + 30)
        assert self.generation() == before

    async def taken_over(self, before: int) -> None:
        """Until another one writes."""
        await asyncio.to_thread(until, "taken over", lambda: self.generation() > before, TAKEN_OVER_S)


def _hears(relay: Relay) -> bool:
    answer = httpx.get(f"http://{relay.address}/api/v1/robots/r")
    return answer.status_code == 200 and answer.json()["status"] == "online"


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


async def test_the_first_takes_over_again_and_nothing_is_told_twice(pair: Pair) -> None:
    async with Watcher(pair.gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(pair.second_writes)
        pair.edge.event("one")
        await viewer.until("an event", has(1))
        before = pair.generation()
        pair.second.stop(signal.SIGKILL)
        await pair.taken_over(before)
        pair.edge.event("two")
        await viewer.until("the next event", has(2), TAKEN_OVER_S)
        await viewer.until("frames", live_after(viewer.frames[-1][1].seq), TAKEN_OVER_S)
        assert texts(viewer) == [(1, "one"), (2, "two")]
        clean(viewer)
        async with Watcher(pair.gateway.url()) as late:
            await late.until("what there is", has(2))
            assert texts(late) == texts(viewer)
        assert pair.first.process.poll() is None


async def test_one_that_was_frozen_meanwhile_replaces_nothing(pair: Pair) -> None:
    async with Watcher(pair.gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(pair.second_writes)
        before = pair.generation()
        pair.second.process.send_signal(signal.SIGSTOP)
        try:
            await pair.taken_over(before)
            await viewer.until("frames", live_after(viewer.frames[-1][1].seq), TAKEN_OVER_S)
        finally:
            pair.second.process.send_signal(signal.SIGCONT)
        generation, seq = pair.generation(), viewer.frames[-1][1].seq
        pair.edge.event("after")
        await viewer.until("three seconds", lambda v: v.frames[-1][1].seq > seq + 90, 20.0)
        await viewer.until("the event", has(1))
        assert pair.generation() == generation
        assert int(pair.store.get(generation_key("r"))) == generation
        assert texts(viewer) == [(1, "after")]
        assert all(said["robot"] == "online" for said in viewer.told("status")[-2:])
        clean(viewer)
        assert pair.second.process.poll() is None
