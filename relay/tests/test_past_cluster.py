"""The past through a Redis Cluster: each robot's on one node, the ledger on another."""

from __future__ import annotations

import asyncio

from .past_doors import PAGE_MS, address_of, make_kept
from .past_redis import running
from .redis_cluster import Cluster
from .test_cluster import cluster

__all__ = ["cluster"]


async def test_the_past_of_robots_of_every_node(cluster: Cluster) -> None:
    await asyncio.to_thread(cluster.start)
    async with running(cluster, None, 60_000) as fleet:
        fleet.ingest.unix_ms = PAGE_MS + 300_000
        names = cluster.robots()
        for n in range(40):  # more than there is room for
            for robot in names:
                segment = make_kept(n, PAGE_MS + 4000 * n, robot=robot)
                fleet.ingest.past.add(segment, 0.0)
            await fleet.written()
        assert fleet.writer.dropped == 0
        assert fleet.writer.losses == 0
        sums = fleet.client.hgetall("posecast:{-}:past")
        assert 50_000 < int(sums[b""]) <= 60_000
        for robot in names:
            answer = await fleet.ask_gateway(f"/{robot}/past/{address_of(segment)}")
            assert answer.status_code == 200
            assert answer.headers["content-type"] == "application/octet-stream"
            summary = (await fleet.ask_gateway(f"/{robot}/past")).json()
            assert summary["newest"]["index"] == 39
            assert summary["from_ms"] > PAGE_MS  # the oldest had to go
            assert 10_000 < int(sums[robot.encode()]) < 30_000
        assert fleet.readers[0].losses == 0
