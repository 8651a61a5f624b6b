"""A robot that is removed takes its past in Redis with it, and another one of its name has nothing of it."""

from __future__ import annotations

import re
from pathlib import Path

from posecast_relay.core.policy import Audience, Rule
from posecast_relay.redis.past_scripts import (
    FORGOTTEN_MAX,
    LEDGER,
    schema_key,
    segment_key,
    stream_key,
)
from posecast_testing import until_async

from .past_doors import PAGE, PAGE_MS, SCHEMA_HASH, address_of
from .past_redis import running
from .redis_server import Redis

RULES = {"r": {Audience.ANYONE: Rule()}, "open": {Audience.ANYONE: Rule()}}


async def test_a_robot_that_is_removed_loses_its_past_at_gateways(redis_server: Redis) -> None:
    async with running(redis_server, RULES) as fleet:
        fleet.writer.set_robots(RULES)
        count = FORGOTTEN_MAX + 50  # more than one call lists
        segments = [fleet.ingest.keep(index, PAGE_MS + 100 * index) for index in range(count)]
        other = await fleet.keep(0, PAGE_MS, robot="open")
        fleet.ingest.unix_ms = PAGE_MS + 60_000
        assert (await fleet.ask_gateway(address_of(segments[0]))).status_code == 200
        fleet.writer.set_robots({"open"})
        fleet.writer.set_robots(RULES)  # another gets its name
        gone = {segment_key(segment.name) for segment in segments}
        await until_async("it is deleted", lambda: not gone & fleet.list_keys())
        assert fleet.list_keys() - {stream_key("r", "public")} == {
            segment_key(other.name),
            stream_key("open", "public"),
            schema_key("open", SCHEMA_HASH.hex()),
        }
        await until_async("the ledger knows", lambda: not fleet.client.exists(f"{LEDGER}:r"))
        assert fleet.client.hget(LEDGER, "r") == b"0"
        assert fleet.client.hget(LEDGER, "") == fleet.client.hget(LEDGER, "open")
        assert (await fleet.ask_gateway(address_of(segments[0]))).status_code == 404
        again = await fleet.keep(count, PAGE_MS + 60_000)
        fleet.ingest.unix_ms = PAGE_MS + 70_000
        assert (await fleet.ask_gateway(address_of(again))).content == again.data
        page = (await fleet.ask_gateway(f"public/{PAGE}")).json()
        assert [entry["index"] for entry in page["segments"]] == [count]


async def test_what_the_operators_page_deletes_is_the_past_and_all_of_it(redis_server: Redis) -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "how-to/operate/delete-the-past.md").read_text()
    every, one = re.findall(r"--scan --pattern '([^']+)'", page)
    async with running(redis_server, RULES) as fleet:
        for robot in ("hubo", "open"):
            kept = await fleet.keep(0, PAGE_MS, robot=robot, audiences=frozenset(Audience))
        live = {b"posecast:{hubo}:public:state", b"posecast:{open}:public:state"}
        for key in live:
            fleet.client.set(key, b"live")
        fleet.ingest.unix_ms = PAGE_MS + 30_000
        fleet.client.unlink(*fleet.client.scan_iter(match=one))
        assert not any("{hubo}" in key for key in fleet.list_keys())
        assert (await fleet.ask_gateway(f"/open/past/{address_of(kept)}")).status_code == 200
        fleet.client.unlink(*fleet.client.scan_iter(match=every))
        assert set(fleet.client.keys()) == live
        assert (await fleet.ask_gateway(f"/open/past/{address_of(kept)}")).status_code == 404
        again = await fleet.keep(1, PAGE_MS + 4000, robot="open")
        assert (await fleet.ask_gateway(f"/open/past/{address_of(again)}")).content == again.data
