"""What the log says of the past's way to Redis: what begins and what ends, once each, and what is true."""

from __future__ import annotations

import pytest
from posecast_relay import kit
from posecast_relay.redis import past_writer
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_testing import until_async

from .past_doors import PAGE_MS, make_kept
from .past_redis import running
from .redis_server import Redis


async def test_a_redis_that_is_full_now_and_then_is_two_lines(
    redis_server: Redis, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(redis_server, None) as fleet:
        tight = round(fleet.client.info("memory")["used_memory"] / 0.8)
        fleet.client.config_set("maxmemory-policy", "volatile-lru")
        for n in range(6):
            fleet.client.config_set("maxmemory", (tight, 0, tight // 2, 0, tight, 0)[n])
            await fleet.keep(n, PAGE_MS + 4000 * n)
        assert (fleet.writer.written, fleet.writer.dropped) == (3, 3)
        assert [line for line in caplog.messages if "room" in line] == []
        monkeypatch.setattr(past_writer, "CALM_S", 0.0)
        for n in (6, 7):
            await fleet.keep(n, PAGE_MS + 4000 * n)
        assert sum("maxmemory" in line for line in caplog.messages) == 1
        assert sum("has had room" in line for line in caplog.messages) == 1


@pytest.mark.parametrize(("queue_bytes", "told"), [(1 << 25, "nothing was lost"), (5000, "gateways lack ")])
async def test_an_outage_is_a_gap_only_where_something_was_lost(
    redis_server: Redis,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    queue_bytes: int,
    told: str,
) -> None:
    monkeypatch.setattr(past_writer, "QUEUE_BYTES", queue_bytes)
    monkeypatch.setattr(kit, "CALM_S", 0.0)
    async with running(redis_server, None) as fleet:
        writer: RedisPastWriter = fleet.writer
        await fleet.keep(0, PAGE_MS)
        caplog.clear()  # a busy machine may have been late before
        redis_server.kill()
        for n in range(1, 9):
            fleet.ingest.past.add(make_kept(n, PAGE_MS + 4000 * n), 0.0)
        await until_async("it is noticed", writer.find_trouble)
        redis_server.start()
        await until_async("it is back", lambda: any("redis is back; " in line for line in caplog.messages))
        lines = [line for line in caplog.messages if line.startswith("the past: redis is back; ")]
        assert lines[-1].startswith(f"the past: redis is back; {told}")
        assert (writer.dropped > 0) == (told == "gateways lack ")
