"""A relay that records and gateways beside it, in this process, with a real Redis between them."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any
from unittest.mock import patch

import redis
from posecast_relay.past.segment import KeptSegment
from posecast_relay.redis import client
from posecast_relay.redis.past_reader import RedisPast
from posecast_relay.redis.past_scripts import LEDGER
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_testing import until_async

from .past_doors import PastDoors, Rules
from .redis_cluster import Cluster
from .redis_server import Redis

WINDOW_S = 1800.0
BYTES_MAX = 1 << 26


class PastFleet:
    """`ingest` keeps in memory and hands on to Redis; `gateways` read there, anew whenever they are asked."""

    def __init__(self, server: Redis | Cluster, rules: Rules | None, bytes_max: int = BYTES_MAX) -> None:
        url = server.url.removeprefix("redis+cluster")
        is_cluster = url != server.url
        self.client: Any = (
            redis.RedisCluster.from_url(f"redis{url}") if is_cluster else redis.Redis.from_url(url)
        )
        self.ingest = PastDoors(rules)
        self.writer = RedisPastWriter(server.url, bytes_max)
        self.writer.set_window(WINDOW_S)
        self.ingest.past.on_added(self.writer.keep)
        ticks = itertools.count()
        self.readers = [RedisPast(server.url, BYTES_MAX, lambda: float(next(ticks))) for _ in range(2)]
        self.gateways = [PastDoors(rules, reader) for reader in self.readers]

    @property
    def doors(self) -> list[PastDoors]:
        """All of them, the ingest's first."""
        return [self.ingest, *self.gateways]

    async def keep(self, index: int, from_ms: int | None = None, **more: Any) -> KeptSegment:
        """Keep a segment as the ingest does, and wait until it is in Redis."""
        segment = self.ingest.keep(index, from_ms, **more)
        await self.written()
        return segment

    async def written(self) -> None:
        """Wait until nothing waits for Redis."""
        count = self.ingest.past.added
        await until_async("all is written", lambda: self.writer.written + self.writer.dropped >= count)

    async def ask(self, path: str, token: str | None = None, **headers: str) -> list[Any]:
        """The same request to all, and the answers."""
        for door in self.doors:
            door.now += 2
            door.unix_ms = self.ingest.unix_ms
        return list(await asyncio.gather(*(door.ask(path, token, **headers) for door in self.doors)))

    async def ask_gateway(self, path: str) -> Any:
        """A request to the first gateway, whose caches are old."""
        gateway = self.gateways[0]
        gateway.now += 2
        gateway.unix_ms = self.ingest.unix_ms
        return await gateway.ask(path)

    @property
    def ways(self) -> tuple[RedisPastWriter | RedisPast, ...]:
        """To Redis, and from there."""
        return (self.writer, *self.readers)

    def list_keys(self) -> set[str]:
        """What the past has in Redis, without its ledger."""
        names = {name.decode() for name in self.client.keys("posecast:*past*")}
        return {name for name in names if not name.startswith(LEDGER)}


@asynccontextmanager
async def running(
    server: Redis | Cluster, rules: Rules | None, bytes_max: int = BYTES_MAX, patience_s: float = 20.0
) -> AsyncIterator[PastFleet]:
    """All of it, until the end of the block. `patience_s`: with Redis; on a busy machine, all of this process
    may stand still for longer than a relay waits.
    """
    with patch.object(client, "TIMEOUT_S", patience_s):
        fleet = PastFleet(server, rules, bytes_max)
        for way in fleet.ways:
            way.start()
        await asyncio.gather(*(door.start() for door in fleet.doors))
        await until_async("all are connected", lambda: not any(r.find_trouble() for r in fleet.ways))
        yield fleet
        await asyncio.gather(*(door.stop() for door in fleet.doors))
        for way in fleet.ways:
            await way.stop()
        fleet.client.close()
