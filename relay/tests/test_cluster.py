"""The roles on a Redis Cluster of three nodes, each robot's keys and channel on one of them."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis

from .stage import Watcher, free_port, until

SLOTS = 16384


class Cluster:
    """Three nodes without replicas; configuration in the test's folder, no data on disk."""

    def __init__(self, folder: Path) -> None:
        self.nodes: list[tuple[int, subprocess.Popen[bytes]]] = []
        self._folder = folder

    def start(self) -> None:
        """Until every node knows all."""
        for i in range(3):
            port, bus = free_port(), free_port()
            own = self._folder / f"node{i}"
            own.mkdir()
            command = [
                "redis-server",
                "--port",
                str(port),
                "--bind",
                "127.0.0.1",
                "--save",
                "",
                "--dir",
                str(own),
            ]
            command += [
                "--cluster-enabled",
                "yes",
                "--cluster-port",
                str(bus),
                "--cluster-node-timeout",
                "5000",
            ]
            self.nodes.append((port, subprocess.Popen(command, stdout=subprocess.DEVNULL)))
            until("a node answers", lambda p=port: self._answers(p))  # type: ignore[misc]
            share = range(i * SLOTS // 3, (i + 1) * SLOTS // 3)
            self.ask(port, "CLUSTER", "ADDSLOTSRANGE", share.start, share.stop - 1)
            self.ask(port, "CLUSTER", "SET-CONFIG-EPOCH", i + 1)
            if i:
                self.ask(port, "CLUSTER", "MEET", "127.0.0.1", self.nodes[0][0], self._bus(self.nodes[0][0]))
        for port, _ in self.nodes:
            until("the cluster is whole", lambda p=port: self._is_whole(p), 30.0)  # type: ignore[misc]
        self.url = f"redis+cluster://127.0.0.1:{self.nodes[0][0]}"

    @staticmethod
    def ask(port: int, *words: object) -> Any:
        """One node's answer."""
        client: Any = redis.Redis(port=port, socket_timeout=5)
        with client:
            return client.execute_command(*words)

    def _bus(self, port: int) -> int:
        return int(self.ask(port, "CONFIG", "GET", "cluster-port")[b"cluster-port"])

    def _answers(self, port: int) -> bool:
        try:
            return bool(self.ask(port, "PING"))
        except redis.ConnectionError:
            return False

    def _is_whole(self, port: int) -> bool:
        state, known = self.ask(port, "CLUSTER", "INFO"), self.ask(port, "CLUSTER", "NODES")
        return b"cluster_state:ok" in state and known.count(b" connected") == 3

    def stop(self) -> None:
        """All nodes, by their processes."""
        for _, process in self.nodes:
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """Running."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here: apt-get install redis-server")
    nodes = Cluster(tmp_path)
    try:
        nodes.start()
        yield nodes
    finally:
        nodes.stop()


async def test_robots_of_every_node_reach_a_gateway(relays: Any, edges: Any, cluster: Cluster) -> None:
    ingest = relays("--role", "ingest", "--store", cluster.url)
    gateway = relays("--role", "gateway", "--store", cluster.url)
    names: dict[int, str] = {}  # node → a robot whose keys it holds
    for i in range(100):
        slot = cluster.ask(cluster.nodes[0][0], "CLUSTER", "KEYSLOT", f"posecast:{{r{i}}}:live")
        names.setdefault(int(slot) * 3 // SLOTS, f"r{i}")
    assert len(names) == 3
    for name in names.values():
        edges(ingest.zenoh, robot=name)
    for name in names.values():
        async with Watcher(gateway.url(name)) as viewer:
            await viewer.until("frames", lambda v: len(v.frames) > 20, 15.0)
            seqs = [frame.seq for _, frame in viewer.frames]
            assert seqs == sorted(set(seqs))
            assert "degraded" not in viewer.told("status")[-1]
    listed = httpx.get(f"http://{gateway.address}/api/v1/robots").json()["robots"]
    assert {robot["robot"] for robot in listed} == set(names.values())
    assert httpx.get(f"http://{gateway.address}/readyz").json() == {"status": "ready"}
    for port, _ in cluster.nodes:
        assert any(b":public:state" in key for key in await asyncio.to_thread(cluster.ask, port, "KEYS", "*"))
