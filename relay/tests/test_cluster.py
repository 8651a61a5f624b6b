"""The roles on a Redis Cluster of three nodes, each robot's keys and channel on one of them."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis
from posecast_relay.adapters.redis_link import state_key

from .stage import Watcher, free_port, until
from .test_gateway import clean, live_after, word

SLOTS = 16384


class Node:
    """One server of a cluster."""

    def __init__(self, folder: Path) -> None:
        self.port, bus = free_port(), free_port()
        folder.mkdir()
        command = ["redis-server", "--port", str(self.port), "--bind", "127.0.0.1", "--save", ""]
        command += ["--dir", str(folder), "--cluster-enabled", "yes", "--cluster-port", str(bus)]
        command += ["--cluster-node-timeout", "2000"]
        self._address = ("127.0.0.1", self.port, bus)
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        until("a node answers", self._answers)

    def ask(self, *words: object) -> Any:
        """Its answer."""
        client: Any = redis.Redis(port=self.port, socket_timeout=5)
        with client:
            return client.execute_command(*words)

    def meet(self, other: Node) -> None:
        """Get to know each other."""
        self.ask("CLUSTER", "MEET", *other._address)

    def _answers(self) -> bool:
        try:
            return bool(self.ask("PING"))
        except redis.ConnectionError:
            return False

    def kill(self) -> None:
        """At once."""
        self.process.kill()
        self.process.wait()


class Cluster:
    """Three masters, and a replica of each if asked for; no data on disk."""

    def __init__(self, folder: Path) -> None:
        self.masters: list[Node] = []
        self.replicas: list[Node] = []
        self._folder = folder

    @property
    def nodes(self) -> list[Node]:
        """All."""
        return self.masters + self.replicas

    @property
    def url(self) -> str:
        """By one of them."""
        return f"redis+cluster://127.0.0.1:{self.masters[-1].port}"

    def start(self, replicas: bool = False) -> None:
        """Until every node knows all."""
        for i in range(3):
            node = Node(self._folder / f"master{i}")
            self.masters.append(node)
            share = range(i * SLOTS // 3, (i + 1) * SLOTS // 3)
            node.ask("CLUSTER", "ADDSLOTSRANGE", share.start, share.stop - 1)
            node.ask("CLUSTER", "SET-CONFIG-EPOCH", i + 1)
        if replicas:
            self.replicas = [Node(self._folder / f"replica{i}") for i in range(3)]
        for node in self.nodes[1:]:
            node.meet(self.masters[0])
        for node in self.nodes:
            until("the cluster is whole", lambda n=node: self._is_whole(n), 30.0)  # type: ignore[misc]
        for master, replica in zip(self.masters, self.replicas, strict=False):
            replica.ask("CLUSTER", "REPLICATE", master.ask("CLUSTER", "MYID").decode())
        for replica in self.replicas:
            until("it follows", lambda n=replica: _follows(n))  # type: ignore[misc]

    def _is_whole(self, node: Node) -> bool:
        state, known = node.ask("CLUSTER", "INFO"), node.ask("CLUSTER", "NODES")
        return b"cluster_state:ok" in state and known.count(b" connected") == len(self.nodes)

    def robots(self) -> list[str]:
        """A robot for every master, in their order."""
        names: dict[int, str] = {}
        for i in range(100):
            slot = self.masters[0].ask("CLUSTER", "KEYSLOT", f"posecast:{{r{i}}}:live")
            names.setdefault(int(slot) * 3 // SLOTS, f"r{i}")
        return [names[i] for i in range(3)]

    def stop(self) -> None:
        """All nodes, by their processes."""
        for node in self.nodes:
            node.kill()


def _follows(replica: Node) -> bool:
    return b"connected" in replica.ask("ROLE")


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
    assert httpx.get(f"http://{gateway.address}/readyz").json() == {"status": "ready"}
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
