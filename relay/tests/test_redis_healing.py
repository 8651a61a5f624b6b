"""A real Redis forgets, refuses and comes back: every robot that sends is LIVE again, without a restart.

How soon is asserted where the clock is simulated, in `test_histories`.
"""

from __future__ import annotations

import asyncio
import logging
import shutil
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest
import redis
from posecast_testing import until_async

from .fleet import Fleet, FleetEdge, Gateway, Ingest
from .page import Page
from .redis_server import Redis

HEALED_S = 30.0  # on a loaded machine; a robot that is muted stays so for longer
KEYS = ("generation", "writer", "status", "public:state")
BOARD = ("robots", "viewers", "ingests")
ALL = [*(f"posecast:{{r}}:{key}" for key in KEYS), *(f"posecast:{{-}}:{key}" for key in BOARD)]


class Park:
    """An ingest, a gateway with a page, a robot on air, and its Redis."""

    def __init__(self, server: Redis, url: str = "") -> None:
        self.server = server
        self.client: Any = redis.Redis(port=server.port, socket_timeout=5)
        self.fleet = Fleet(asyncio.get_running_loop(), url or server.url)
        self.ingest: Ingest
        self.gateway: Gateway
        self.edge: FleetEdge
        self.page: Page

    async def open(self) -> None:
        """Until the robot is LIVE."""
        self.ingest = await self.fleet.ingest()
        self.gateway = await self.fleet.gateway()
        self.edge = self.fleet.edge("r", self.ingest)
        self.page = self.gateway.watch("r")
        await self.is_live()

    async def is_live(self) -> None:
        """Until the page shows what the newest edge sends from now on."""
        run_id, seq = self.edge.life.run_id, self.edge.life.seq

        def shows() -> bool:
            self.fleet.look()
            newest = self.page.poses[-1] if self.page.poses else (0, 0)
            return self.page.look().word == "LIVE" and newest[0] == run_id and newest[1] > seq + 3

        await self.until("LIVE", shows)

    async def until(self, what: str, probe: Callable[[], object]) -> None:
        """Poll."""
        try:
            await until_async(what, probe, HEALED_S)
        except AssertionError as e:
            raise AssertionError(f"{e}: {self.page.look()} {self.page.told[-1:]}") from None

    async def says(self, word: str) -> None:
        """Until the page says so."""
        await self.until(word, lambda: word in self.page.look().word)

    async def restart_edge(self) -> None:
        """A new run in place of the one before."""
        self.fleet.stop(self.edge)
        self.edge = self.fleet.edge("r", self.ingest)

    async def restart_ingest(self) -> None:
        """Another process in its place; the edge finds it."""
        await self.fleet.kill(self.ingest)
        self.ingest = await self.fleet.ingest()
        self.edge.connect(self.ingest)


@pytest.fixture
async def park(redis_server: Redis) -> AsyncIterator[Park]:
    """With its robot LIVE."""
    park = Park(redis_server)
    await park.open()
    yield park
    await park.fleet.end()


def spoil(client: Any, key: str) -> None:
    """Something of another type stands there."""
    was = client.type(key)
    client.delete(key)
    if was == b"hash":
        client.set(key, "odd")
    else:
        client.hset(key, "odd", "odd")


@pytest.mark.parametrize(
    "key", ["all", *(pytest.param(key, marks=pytest.mark.full) for key in ALL)]
)  # each alone also in `test_histories`, on a simulated clock
@pytest.mark.parametrize("harm", ["lost", "spoilt"])
@pytest.mark.parametrize("restarted", ["nobody", "edge", "ingest"])
async def test_a_key_that_redis_forgot_or_holds_wrongly_mutes_nobody(
    park: Park, key: str, harm: str, restarted: str
) -> None:
    if restarted != "nobody":  # so that what is stored is not the first of its kind
        await park.restart_edge()
        await park.is_live()
    if restarted == "ingest":
        await park.fleet.kill(park.ingest)
    for each in ALL if key == "all" else [key]:
        park.client.delete(each) if harm == "lost" else spoil(park.client, each)
    if restarted == "edge":
        await park.restart_edge()
    elif restarted == "ingest":
        park.ingest = await park.fleet.ingest()
        park.edge.connect(park.ingest)
    await park.is_live()
    hashes = {key for key in ALL if "{-}" in key or key.endswith("state")}

    def is_whole() -> bool:
        kinds = {key: park.client.type(key) for key in ALL}
        return all(kind == (b"hash" if key in hashes else b"string") for key, kind in kinds.items())

    await park.until("all is there again, as it was", is_whole)


async def test_redis_emptied_while_no_ingest_runs_and_the_edge_is_another(park: Park) -> None:
    """The gateway remembers what Redis has forgotten."""
    for _ in range(3):
        await park.restart_ingest()
        await park.is_live()
    await park.fleet.kill(park.ingest)
    park.client.flushall()
    await park.says("STALE")
    park.fleet.stop(park.edge)
    park.ingest = await park.fleet.ingest()
    park.edge = park.fleet.edge("r", park.ingest)
    await park.is_live()


async def test_redis_that_evicts_all_the_time_mutes_nobody(redis_server: Redis) -> None:
    park = Park(redis_server)
    park.client.config_set("maxmemory", "3mb")
    park.client.config_set("maxmemory-policy", "allkeys-random")
    await park.open()
    try:
        for n in range(60):
            park.client.mset({f"junk:{n}:{i}": bytes(20_000) for i in range(5)})
            await asyncio.sleep(0.01)
        assert park.client.info("stats")["evicted_keys"] > 50
        await park.is_live()
    finally:
        await park.fleet.end()


async def refuse_password(park: Park) -> None:
    park.client.config_set("requirepass", "another")
    park.client.execute_command("AUTH", "another")
    park.client.execute_command("CLIENT", "KILL", "TYPE", "normal", "SKIPME", "yes")
    park.client.execute_command("CLIENT", "KILL", "TYPE", "pubsub")


async def take_password(park: Park) -> None:
    client: Any = redis.Redis(port=park.server.port, password="another", socket_timeout=5)
    client.config_set("requirepass", "")


async def follow(park: Park) -> None:
    park.client.execute_command("REPLICAOF", "127.0.0.1", "1")


async def lead(park: Park) -> None:
    park.client.execute_command("REPLICAOF", "NO", "ONE")


async def fill(park: Park) -> None:
    park.client.config_set("maxmemory-policy", "noeviction")
    park.client.config_set("maxmemory", "1")


async def empty(park: Park) -> None:
    park.client.config_set("maxmemory", "0")


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    """The lines of the log so far."""
    return [record.getMessage() for record in caplog.records]


@pytest.mark.parametrize(
    ("harm", "mend", "why"),
    [
        (refuse_password, take_password, "Authentication"),
        (follow, lead, "read only replica"),
        (fill, empty, "command not allowed when used memory"),
    ],
)
async def test_redis_that_refuses_is_told_once_and_survived(
    park: Park, caplog: pytest.LogCaptureFixture, harm: Any, mend: Any, why: str
) -> None:
    caplog.set_level(logging.WARNING)
    await harm(park)
    await park.says("STALE relay degraded")
    refused = park.gateway.store.failures
    await park.until("several attempts", lambda: park.gateway.store.failures > refused + 5)
    await mend(park)
    await park.is_live()
    lines = said(caplog)
    assert len([line for line in lines if line.startswith("redis: ") and why.lower() in line.lower()]) <= 2, (
        lines
    )
    assert "redis is back" not in lines, "it may fail again at once, and that would be the same trouble"
    await park.until("it is said to be back", lambda: said(caplog).count("redis is back") == 2)


async def test_redis_that_is_loading_is_told_once_and_survived(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here: apt-get install redis-server")
    slow = ("--key-load-delay", "3000", "--loading-process-events-interval-bytes", "1024")
    server = Redis(tmp_path, *slow)
    server.start()
    park = Park(server)
    await park.open()
    try:
        caplog.set_level(logging.WARNING)
        park.client.mset({f"junk:{i}": bytes(1000) for i in range(500)})
        park.client.save()
        await asyncio.to_thread(server.kill)
        await park.says("STALE relay degraded")
        server.launch()
        await park.until("it loads", lambda: park.gateway.store.find_trouble() == "redis: BusyLoadingError")
        await park.is_live()
        lines = [record.getMessage() for record in caplog.records]
        assert len([line for line in lines if "loading the dataset" in line]) <= 2, lines
    finally:
        await park.fleet.end()
        server.kill()


async def test_scripts_that_redis_forgot_are_given_to_it_again(park: Park) -> None:
    told = len(park.page.told)
    park.client.script_flush()
    await park.is_live()
    assert not any(doc.get("degraded") for doc in park.page.told[told:])
    assert park.gateway.store.failures == park.ingest.store.failures == 0


async def test_subscriptions_that_redis_cut_come_back(park: Park) -> None:
    for _ in range(3):
        assert park.client.execute_command("CLIENT", "KILL", "TYPE", "pubsub") == 1
        await park.is_live()
