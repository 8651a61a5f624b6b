"""A robot that is removed takes its past in Redis with it, and another one of its name has nothing of it."""

from __future__ import annotations

from posecast_relay.core.policy.policy import Audience, Rule
from posecast_relay.redis.past_scripts import (
    FORGOTTEN_MAX,
    LEDGER,
    schema_key,
    segment_key,
    stream_key,
)

from .past_doors import PAGE, PAGE_MS, SCHEMA_HASH, address_of
from .past_redis import running, until
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
        await until("it is deleted", lambda: not gone & fleet.list_keys())
        assert fleet.list_keys() - {stream_key("r", "public")} == {
            segment_key(other.name),
            stream_key("open", "public"),
            schema_key("open", SCHEMA_HASH.hex()),
        }
        await until("the ledger knows", lambda: not fleet.client.exists(f"{LEDGER}:r"))
        assert fleet.client.hget(LEDGER, "r") == b"0"
        assert fleet.client.hget(LEDGER, "") == fleet.client.hget(LEDGER, "open")
        assert (await fleet.ask_gateway(address_of(segments[0]))).status_code == 404
        again = await fleet.keep(count, PAGE_MS + 60_000)
        fleet.ingest.unix_ms = PAGE_MS + 70_000
        assert (await fleet.ask_gateway(address_of(again))).content == again.data
        page = (await fleet.ask_gateway(f"public/{PAGE}")).json()
        assert [entry["index"] for entry in page["segments"]] == [count]
