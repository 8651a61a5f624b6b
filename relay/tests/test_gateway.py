"""Gateways fed by an ingest through a real Redis: the same bytes, no gap, truth when Redis is ill."""

from __future__ import annotations

import asyncio
import shutil
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from itertools import count, pairwise
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis
from posecast_relay.redis.client import bundle_key
from posecast_testing import until

from .redis_server import Redis
from .stage import Model, Relay, Watcher, ZenohEdge


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
    """An ingest and two gateways around a Redis."""

    edge: ZenohEdge
    _names = count()

    def __init__(self, folder: Path) -> None:
        self.redis = Redis(folder)
        self.redis.start()
        self._start = partial(Relay, folder)
        self._flags = ("--store", self.redis.url)
        self.ingest = self._start("--role", "ingest", *self._flags)
        self.gateways = [self._start("--role", "gateway", *self._flags) for _ in range(2)]
        self._ended = [self.ingest, *self.gateways]

    async def another_ingest(self, port: int) -> Relay:
        """In its place. Beside the loop: a viewer of this process that answers nothing for 11 s is cut."""
        start = partial(self._start, "--role", "ingest", *self._flags, zenoh_port=port)
        self.ingest = await asyncio.to_thread(start)
        self._ended.append(self.ingest)
        return self.ingest

    def lend(self) -> None:
        """To the next test, when all is well."""
        robot = f"r{next(self._names)}"
        until("all is well", lambda: all(is_ready(each) for each in (self.ingest, *self.gateways)))
        for relay in (self.ingest, *self.gateways):
            relay.robot = robot

    def end(self) -> None:
        """All of it; nobody may have left a traceback."""
        for relay in self._ended:
            relay.stop()
        self.redis.kill()
        for relay in self._ended:
            assert "Traceback" not in relay.errors(), relay.errors()


def is_ready(relay: Relay) -> bool:
    """Whether it says so."""
    return str(get(relay, "/readyz").json()["status"]) == "ready"


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Trio]:
    """One for all tests, which leave it as it was."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here: apt-get install redis-server")
    parts = Trio(tmp_path_factory.mktemp("trio"))
    yield parts
    parts.end()


@pytest.fixture
def trio(parts: Trio, edges: Any) -> Trio:
    """With a robot of the test's own on air."""
    parts.lend()
    parts.edge = edges(parts.ingest)
    return parts


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
            await viewer.until("200 frames", lambda v: v.frames[-1][1].seq >= first + 200, 60.0)
        for viewer in viewers:
            assert [seq for seq in clean(viewer) if first <= seq < first + 200] == [
                *range(first, first + 200)
            ]
            assert {word(viewer)} == {"online"}
        same = viewers[0].payloads
        for viewer in viewers[1:]:
            assert all(viewer.payloads[seq] == same[seq] for seq in range(first, first + 200))


@pytest.mark.full  # on a machine with time to spare; that each has all frames, the test above says
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


async def test_redis_killed_is_told_and_survived(trio: Trio) -> None:
    async with watching(*trio.gateways) as viewers:
        for viewer in viewers:
            await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(trio.redis.kill)
        for viewer in viewers:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 3.0)
        assert get(trio.gateways[0], "/readyz").json()["status"] == "degraded"
        await asyncio.to_thread(trio.redis.start)
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


async def test_redis_frozen_is_told_and_survived(trio: Trio) -> None:
    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        trio.redis.freeze()
        try:
            await viewer.until("degraded", lambda v: word(v) == "degraded", 3.0)
            assert get(trio.gateways[0], "/livez").status_code == 200
            async with watching(trio.gateways[1]) as (late,):
                await late.until("degraded at once or soon", lambda v: v.texts and word(v) == "degraded", 3.0)
        finally:
            trio.redis.thaw()
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


async def test_events_go_on_after_redis_and_the_ingest_lost_count(trio: Trio) -> None:
    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        for n in range(1, 6):
            trio.edge.event(f"fault {n}")
        await viewer.until("the events", lambda v: len(v.told("event")) == 5)
        port = trio.ingest.zenoh_port
        await asyncio.to_thread(trio.ingest.stop)
        await asyncio.to_thread(trio.redis.kill)
        await asyncio.to_thread(trio.redis.start)
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
        second = edges(trio.ingest, run_id=0xF)
        await viewer.until("the new run", lambda v: v.frames[-1][1].seq <= second.seq + 1)
        second.close()
        trio.edge.close()
        await viewer.until("offline", lambda v: word(v) == "offline")


def list_own(relay: Relay) -> list[tuple[str, int]]:
    """What the list says of its robot: status and viewers."""
    robots = get(relay, "/api/v1/robots").json()["robots"]
    return [(each["status"], each["viewers"]) for each in robots if each["robot"] == relay.robot]


async def test_viewers_are_counted_over_all_and_lists_are_the_same(trio: Trio) -> None:
    async with watching(*trio.gateways, trio.gateways[0]) as viewers:
        await viewers[0].until("frames", lambda v: len(v.frames) > 5)
        for relay in (trio.ingest, *trio.gateways):
            for what, probe in (
                ("three", lambda r=relay: get(r, r.path).json().get("viewers") == 3),
                ("likewise in the list", lambda r=relay: list_own(r) == [("online", 3)]),
            ):
                await asyncio.to_thread(until, what, probe)
    gateway = trio.gateways[1]
    assert get(gateway, "/api/v1/robots/nobody").status_code == 404
    state = get(gateway, f"{gateway.path}/state").json()
    assert state["status"] == "online"
    assert trio.edge.seq - 30 <= state["seq"] <= trio.edge.seq


async def test_a_gateway_listens_only_for_robots_with_viewers(trio: Trio, edges: Any) -> None:
    edges(trio.ingest.zenoh, robot=f"{trio.ingest.robot}-other")
    client: Any = redis.Redis(port=trio.redis.port)
    own = f"posecast:{{{trio.ingest.robot}}}:live".encode()

    def listened() -> set[bytes]:
        return set(client.execute_command("PUBSUB", "SHARDCHANNELS"))

    await asyncio.to_thread(until, "nobody looks any more", lambda: listened() == set())

    async with watching(trio.gateways[0]) as (viewer,):
        await viewer.until("frames", lambda v: len(v.frames) > 5)
        assert listened() == {own}
    await asyncio.to_thread(until, "let go after a while", lambda: listened() == set(), 20.0)
    async with watching(trio.gateways[0]) as (again,):
        await again.until("frames", lambda v: len(v.frames) > 5)


async def test_models_reach_gateways_through_redis(trio: Trio, edges: Any) -> None:
    trio.edge.close()
    gateway, robot = trio.gateways[0], trio.ingest.robot
    model = Model(
        {"robot.urdf": (b"<robot/>", "application/xml"), "meshes/a.stl": (bytes(600_001), "model/stl")}
    )
    redis.Redis(port=trio.redis.port).set(bundle_key(robot, model.digest), "something of another type")
    edges(trio.ingest, model=model)
    base = f"{gateway.path}/model/{model.digest}"
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
        assert get(gateway, f"{gateway.path}/model/{'0' * 64}/manifest.json").status_code == 404


def test_an_ingest_has_no_viewers(trio: Trio) -> None:
    relay = trio.ingest
    headers = {"connection": "upgrade", "upgrade": "websocket", "sec-websocket-version": "13"}
    answer = httpx.get(
        f"{relay.api}/live",
        headers=headers | {"sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA=="},
    )
    assert answer.status_code == 404
    assert get(relay, "/livez").status_code == 200
    assert get(relay, "/api/v1/robots").status_code == 200
