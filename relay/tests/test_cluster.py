"""The roles on a Redis Cluster of three nodes, each robot's keys and channel on one of them."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.redis.client import state_key
from posecast_testing import until

from .redis_cluster import Cluster
from .stage import Watcher
from .test_gateway import clean, live_after, word


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Not running yet."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here: apt-get install redis-server")
    nodes = Cluster(tmp_path)
    yield nodes
    nodes.stop()


async def test_robots_of_every_node_reach_a_gateway(relays: Any, edges: Any, cluster: Cluster) -> None:
    await asyncio.to_thread(cluster.start)
    ingest = relays("--role", "ingest", "--store", cluster.url)
    gateway = relays("--role", "gateway", "--store", cluster.url)
    names = cluster.robots()
    for name in names:
        edges(ingest.zenoh, robot=name)
    for name in names:
        async with Watcher(gateway.url(name)) as viewer:
            await viewer.until("frames", lambda v: len(v.frames) > 20, 15.0)
            clean(viewer)
            assert word(viewer) == "online"
    listed = httpx.get(f"http://{gateway.address}/api/v1/robots").json()["robots"]
    assert {robot["robot"] for robot in listed} == set(names)
    ready = f"http://{gateway.address}/readyz"
    until("the past is read, too", lambda: httpx.get(ready).json() == {"status": "ready"})
    for node in cluster.masters:
        assert any(b":public:state" in key for key in await asyncio.to_thread(node.ask, "KEYS", "*"))


@pytest.mark.full
@pytest.mark.parametrize("how", ["killed", "told to"])
async def test_a_replica_is_promoted_and_all_robots_go_on(
    relays: Any, edges: Any, cluster: Cluster, how: str
) -> None:
    await asyncio.to_thread(cluster.start, True)
    ingest = relays("--role", "ingest", "--store", cluster.url)
    gateway = relays("--role", "gateway", "--store", cluster.url)
    started = {name: edges(ingest.zenoh, robot=name) for name in cluster.robots()}
    names = list(started)
    async with AsyncExitStack() as stack:
        viewers = [await stack.enter_async_context(Watcher(gateway.url(name))) for name in names]
        for name, viewer in zip(names, viewers, strict=True):
            await viewer.until("frames", lambda v: len(v.frames) > 20, 15.0)
            started[name].event("before")
            await viewer.until("an event", lambda v: v.told("event"))
        replica = cluster.replicas[0]
        if how == "killed":
            await asyncio.to_thread(cluster.masters[0].kill)
            for viewer in viewers:
                await viewer.until("degraded", lambda v: word(v) == "degraded", 5.0)
        else:
            await asyncio.to_thread(replica.ask, "CLUSTER", "FAILOVER")
        await asyncio.to_thread(until, "promoted", lambda: replica.ask("ROLE")[0] == b"master", 30.0)
        for name, viewer in zip(names, viewers, strict=True):
            await viewer.until("frames again", live_after(viewer.frames[-1][1].seq + 20), 20.0)
            started[name].event("after")
            await viewer.until("the next event", lambda v: len(v.told("event")) == 2)
            assert [(e["n"], e["text"]) for e in viewer.told("event")] == [(1, "before"), (2, "after")]
            clean(viewer)
        assert await asyncio.to_thread(replica.ask, "HGET", state_key(names[0], "public"), "seq")
