"""Gateways fed by an ingest through a real Redis: the same bytes, no gap, truth when Redis is ill."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from itertools import pairwise
from typing import Any

import httpx
import pytest
import redis
from posecast_relay.redis.client import bundle_key

from .redis_server import Redis
from .stage import Model, Relay, Watcher, ZenohEdge, until

STATE = "posecast:{r}:public:state"


def get(relay: Relay, path: str) -> Any:
    """What HTTP says."""
    return httpx.get(f"http://{relay.address}{path}", timeout=10)


def clean(viewer: Watcher) -> list[int]:
    """Its seqs, which neither repeat nor go back."""
    seqs = [frame.seq for _, frame in viewer.frames]
    assert all(a < b for a, b in pairwise(seqs)), seqs
    return seqs


def word(viewer: Watcher) -> str:
    """What it was told last."""
    said = viewer.told("status")[-1]
    return "degraded" if said.get("degraded") else str(said["robot"])


def live_after(seq: int) -> Callable[[Watcher], bool]:
    """Whether a viewer has the state some frames after that, and is told that the robot is online."""
    return lambda viewer: viewer.frames[-1][1].seq > seq + 5 and word(viewer) == "online"


@asynccontextmanager
async def watching(*relays: Relay, query: str = "") -> AsyncIterator[list[Watcher]]:
    """A viewer at each."""
    async with AsyncExitStack() as stack:
        yield [await stack.enter_async_context(Watcher(relay.url(query=query))) for relay in relays]


class Trio:
    """An ingest and two gateways."""

    def __init__(self, relays: Any, edges: Any, server: Redis) -> None:
        self.flags = ("--store", server.url)
        self.relays = relays
        self.ingest: Relay = relays("--role", "ingest", *self.flags)
        self.gateways: list[Relay] = [relays("--role", "gateway", *self.flags) for _ in range(2)]
        self.edge: ZenohEdge = edges(self.ingest.zenoh)

    async def another_ingest(self, port: int) -> Relay:
        """In its place. Beside the loop: a viewer of this process that answers nothing for 11 s is cut."""
        flags = ("--role", "ingest", *self.flags)
        return await asyncio.to_thread(partial(self.relays, *flags, zenoh_port=port))


@pytest.fixture
def trio(relays: Any, edges: Any, redis_server: Redis) -> Trio:
    """With a robot on air."""
    return Trio(relays, edges, redis_server)


async def test_two_gateways_hand_out_every_frame_with_the_same_bytes(trio: Trio) -> None:
    """Two viewers at each. The edge makes a frame when all have the one before: a loaded machine costs time
    and never a frame, so what is missing was lost by us.
    """
    async with watching(*trio.gateways, *trio.gateways, query="?hz=60") as viewers:
        for viewer in viewers:
            await viewer.until("frames", lambda v: len(v.frames) > 5)
        trio.edge.hz = 50.0
        trio.edge.waits = lambda: any(v.frames[-1][1].seq < trio.edge.seq for v in viewers)
        first = max(v.frames[-1][1].seq for v in viewers) + 5
        for viewer in viewers:
            await viewer.until("600 frames", lambda v: v.frames[-1][1].seq >= first + 600, 60.0)
        for viewer in viewers:
            assert [seq for seq in clean(viewer) if first <= seq < first + 600] == [
                *range(first, first + 600)
            ]
            assert {word(viewer)} == {"online"}
        same = viewers[0].payloads
        for viewer in viewers[1:]:
            assert all(viewer.payloads[seq] == same[seq] for seq in range(first, first + 600))


async def test_two_gateways_are_never_far_apart(trio: Trio) -> None:
    """The edge waits for nobody here. 200 ms are six frames."""
    async with watching(*trio.gateways) as viewers:
        for viewer in viewers:
            await viewer.until("frames", lambda v: len(v.frames) > 5)
        began = time.monotonic()
        for viewer in viewers:
            await viewer.until("four seconds", lambda v: len(v.frames) > 120)
        arrivals = sorted((at, n, f.seq) for n, v in enumerate(viewers) for at, f in v.frames if at > began)
        newest = [arrivals[0][2]] * 2
        apart = []
        for _, n, seq in arrivals:
            newest[n] = seq
            apart.append(abs(newest[0] - newest[1]))
        assert sorted(apart)[len(apart) * 95 // 100] <= 6, apart
        for viewer in viewers:
            clean(viewer)


async def test_the_state_its_events_and_info_reach_whoever_joins_late(trio: Trio) -> None:
    trio.edge.edge.info = {"mode": "walking"}
    await asyncio.to_thread(until, "frames", lambda: trio.edge.seq > 10)
    trio.edge.event("jam")
    async with watching(trio.gateways[0]) as (early,):
        await early.until("the event", lambda v: len(v.told("event")) == 1)
        trio.edge.event("jam", "off")
        await early.until("the fall", lambda v: len(v.told("event")) == 2)
        trio.edge.edge.info = {"mode": "standing"}
        await early.until(
            "info", lambda v: v.told("info")[-1:] == [{"type": "info", "kv": {"mode": "standing"}}], 20
        )
        async with watching(trio.gateways[1]) as (late,):
            await late.until("frames", lambda v: len(v.frames) > 5)
            assert [(e["n"], e["state"]) for e in late.told("event")] == [(1, "on"), (2, "off")]
            assert late.told("event") == early.told("event")
            assert late.told("info")[-1]["kv"] == {"mode": "standing"}


async def test_joining_under_load_leaves_no_gap(trio: Trio) -> None:
    trio.edge.hz = 60
    async with watching(trio.gateways[0], query="?hz=60") as (first,):
        await first.until("frames", lambda v: len(v.frames) > 30)
        for _ in range(5):
            async with watching(trio.gateways[1], query="?hz=60") as (late,):
                joined = time.monotonic()
                await late.until("frames", lambda v: len(v.frames) > 40)
                assert late.frames[0][0] - joined < 1.0
                seqs = clean(late)
                missed = {s for s in first.payloads if seqs[1] < s < seqs[-1]} - set(seqs)
                assert len(missed) <= 4, missed
        clean(first)


async def test_redis_killed_is_told_and_survived(trio: Trio, redis_server: Redis) -> None:
    async with watching(*trio.gateways) as viewers:
        for viewer in viewers:
            await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(redis_server.kill)
        for viewer in viewers:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 3.0)
        assert get(trio.gateways[0], "/readyz").json()["status"] == "degraded"
        await asyncio.to_thread(redis_server.start)
        back = time.monotonic()
        for viewer in viewers:
            before = viewer.frames[-1][1].seq
            await viewer.until("frames again", live_after(before), 20.0)
        print(f"frames again {time.monotonic() - back:.1f} s after Redis")
        for viewer in viewers:
            clean(viewer)
        await asyncio.to_thread(
            until,
            "the past is back, too",
            lambda: get(trio.gateways[0], "/readyz").json()["status"] == "ready",
        )


async def test_redis_frozen_is_told_and_survived(trio: Trio, redis_server: Redis) -> None:
    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        redis_server.freeze()
        try:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 3.0)
            assert get(trio.gateways[0], "/livez").status_code == 200
            async with watching(trio.gateways[1]) as (late,):
                await late.until("degraded at once or soon", lambda v: v.texts and word(v) == "degraded", 3.0)
        finally:
            redis_server.thaw()
        back, before = time.monotonic(), viewer.frames[-1][1].seq
        await viewer.until("frames again", live_after(before), 20.0)
        print(f"frames again {time.monotonic() - back:.1f} s after Redis")
        clean(viewer)


async def test_an_ingest_that_starts_again_goes_on(trio: Trio, edges: Any) -> None:
    async with watching(*trio.gateways) as viewers:
        trio.edge.event("jam")
        for viewer in viewers:
            await viewer.until("frames and the event", lambda v: len(v.frames) > 20 and v.told("event"))
        port = trio.ingest.zenoh_port
        await asyncio.to_thread(trio.ingest.stop)
        for viewer in viewers:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 8.0)
        ingest = await trio.another_ingest(port)
        for viewer in viewers:
            before = viewer.frames[-1][1].seq
            await viewer.until("frames again", live_after(before), 20.0)
        trio.edge.event("jam", "off")
        for viewer in viewers:
            await viewer.until("the next event", lambda v: len(v.told("event")) == 2)
            assert [event["n"] for event in viewer.told("event")] == [1, 2]
            clean(viewer)
        assert get(ingest, "/readyz").status_code == 200


async def test_events_go_on_after_redis_and_the_ingest_lost_count(trio: Trio, redis_server: Redis) -> None:
    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        for n in range(1, 6):
            trio.edge.event(f"fault {n}")
        await viewer.until("the events", lambda v: len(v.told("event")) == 5)
        port = trio.ingest.zenoh_port
        await asyncio.to_thread(trio.ingest.stop)
        await asyncio.to_thread(redis_server.kill)
        await asyncio.to_thread(redis_server.start)
        await trio.another_ingest(port)
        await viewer.until("frames again", live_after(viewer.frames[-1][1].seq), 20.0)
        trio.edge.event("after it all")
        await viewer.until("the next event", lambda v: len(v.told("event")) == 6)
        assert [e["n"] for e in viewer.told("event")] == [1, 2, 3, 4, 5, 1]
        async with watching(*trio.gateways) as lates:
            for late in lates:
                await late.until("the state", lambda v: v.frames)
                assert [(e["n"], e["text"]) for e in late.told("event")] == [(1, "after it all")]


async def test_silent_offline_and_another_run_reach_gateways(trio: Trio, edges: Any) -> None:
    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        trio.edge.silent = True
        await viewer.until("silent", lambda v: word(v) == "silent")
        async with watching(trio.gateways[1]) as (late,):  # an old pose is never shown as live to who joins
            await late.until("the pose", lambda v: v.frames)
            assert word(late) == "silent"
            await late.until("its age", lambda v: (v.told("status")[-1]["age_ms"] or 0) > 1500)
        trio.edge.silent = False
        await viewer.until("online", lambda v: word(v) == "online")
        second = edges(trio.ingest.zenoh, run_id=0xF)
        await viewer.until("the new run", lambda v: v.frames[-1][1].seq <= second.seq + 1)
        second.close()
        trio.edge.close()
        await viewer.until("offline", lambda v: word(v) == "offline")


def in_list(relay: Relay) -> tuple[str, str, int]:
    """The only robot there."""
    (robot,) = get(relay, "/api/v1/robots").json()["robots"]
    return robot["robot"], robot["status"], robot["viewers"]


async def test_viewers_are_counted_over_all_and_lists_are_the_same(trio: Trio) -> None:
    async with watching(*trio.gateways, trio.gateways[0]) as viewers:
        await viewers[0].until("frames", lambda v: len(v.frames) > 5)
        path, told = "/api/v1/robots/r", ("r", "online", 3)
        for relay in (trio.ingest, *trio.gateways):
            await asyncio.to_thread(until, "three", lambda r=relay: get(r, path).json().get("viewers") == 3)
            await asyncio.to_thread(until, "likewise in the list", lambda r=relay: in_list(r) == told)
    gateway = trio.gateways[1]
    assert get(gateway, "/api/v1/robots/nobody").status_code == 404
    state = get(gateway, "/api/v1/robots/r/state").json()
    assert state["status"] == "online"
    assert trio.edge.seq - 30 <= state["seq"] <= trio.edge.seq


async def test_a_gateway_listens_only_for_robots_with_viewers(
    trio: Trio, edges: Any, redis_server: Redis
) -> None:
    edges(trio.ingest.zenoh, robot="other")
    client: Any = redis.Redis(port=redis_server.port)

    def listened() -> set[bytes]:
        return set(client.execute_command("PUBSUB", "SHARDCHANNELS"))

    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 5)
        assert listened() == {b"posecast:{r}:live"}
    await asyncio.to_thread(until, "let go after a while", lambda: listened() == set(), 20.0)
    async with watching(trio.gateways[0]) as (again,):
        await again.until("frames", lambda v: len(v.frames) > 5)


async def test_models_reach_gateways_through_redis(relays: Any, edges: Any, redis_server: Redis) -> None:
    flags = ("--store", redis_server.url)
    ingest = relays("--role", "ingest", *flags)
    gateway = relays("--role", "gateway", *flags)
    model = Model(
        {"robot.urdf": (b"<robot/>", "application/xml"), "meshes/a.stl": (bytes(600_001), "model/stl")}
    )
    redis.Redis(port=redis_server.port).set(bundle_key("r", model.digest), "something of another type")
    edges(ingest.zenoh, model=model)
    base = f"/api/v1/robots/r/model/{model.digest}"
    async with watching(gateway) as (viewer,):
        await viewer.until(
            "the model is told", lambda v: v.told("model") or any(h["model"] for h in v.told("hello"))
        )
        await asyncio.to_thread(
            until, "manifest", lambda: get(gateway, f"{base}/manifest.json").status_code == 200
        )
        assert get(gateway, f"{base}/manifest.json").content == model.manifest
        assert get(gateway, f"{base}/meshes/a.stl").content == bytes(600_001)
        assert get(gateway, f"{base}/none").status_code == 404
        assert get(gateway, f"/api/v1/robots/r/model/{'0' * 64}/manifest.json").status_code == 404


def test_an_ingest_has_no_viewers(relays: Any, redis_server: Redis) -> None:
    relay = relays("--role", "ingest", "--store", redis_server.url)
    headers = {"connection": "upgrade", "upgrade": "websocket", "sec-websocket-version": "13"}
    answer = httpx.get(
        f"http://{relay.address}/api/v1/robots/r/live",
        headers=headers | {"sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA=="},
    )
    assert answer.status_code == 404
    assert get(relay, "/livez").status_code == 200
    assert get(relay, "/api/v1/robots").json() == {"robots": []}
