"""Gateways answer of the past as the relay that recorded it, and are never its harm."""

from __future__ import annotations

import asyncio
import json
import logging
import re
from pathlib import Path
from typing import Any

import pytest
from posecast_relay import kit
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past import routes, service
from posecast_relay.past.segment import KeptSegment, PastEvent, pack_record
from posecast_relay.redis import past_reader, past_writer
from posecast_relay.redis.client import TIMEOUT_S
from posecast_relay.redis.past_reader import BEGINNING, PastReplica
from posecast_relay.redis.past_scripts import (
    FORGOTTEN_MAX,
    LEDGER,
    LedgerEntry,
    make_delete_call,
    schema_key,
    segment_key,
    stream_key,
)
from posecast_relay.redis.past_writer import RedisPastWriter
from posecast_testing import until_async

from .past_doors import DAY, PAGE, PAGE_MS, SCHEMA, SCHEMA_HASH, TAKE, address_of, link, make_kept
from .past_redis import running
from .redis_cluster import Cluster
from .redis_server import Redis
from .test_cluster import cluster

A, S, L = Audience.ANYONE, Audience.SIGNED_IN, Audience.LINK
RULES = {
    "r": {A: Rule(delay_s=5.0, past_s=600.0), S: Rule(), L: Rule("lab", past_s=60.0)},
    "open": {A: Rule()},
}
SECOND = 0xB  # a take


def events(count: int, size: int) -> tuple[PastEvent, ...]:
    """Some of them, long ones."""
    texts = (json.dumps({"type": "event", "text": f"{n}" * size, "n": n}) for n in range(1, count + 1))
    return tuple(PastEvent(PAGE_MS + n, text) for n, text in enumerate(texts))


async def test_a_gateway_answers_as_the_relay_that_recorded(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(routes, "HOLD_S", 0.02)
    async with running(redis_server, RULES) as fleet:
        kept = []
        for index in range(8):
            fleet.ingest.unix_ms = PAGE_MS + 4000 * (index + 1)
            dark: dict[str, Any] = {"audiences": frozenset({L})} if index in (2, 5) else {}
            place = {"take": TAKE, "index": index} if index < 6 else {"take": SECOND, "index": index - 6}
            kept.append(await fleet.keep(place["index"], take=place["take"], **dark))
            fleet.ingest.keep(index, view="lab", words=(), events=events(3, 2000))
            fleet.ingest.keep(index, robot="open", model="ab" * 32)
        await fleet.written()
        paths = ["", f"public/{DAY}", f"public/{PAGE}", f"public/{PAGE}?after={TAKE:016x},2", "lab/" + PAGE]
        paths += [f"public/{PAGE}/keys", f"public/{PAGE}/keys?every=3", "lab/" + PAGE + "/keys", "?view=lab"]
        paths += [f"{view}/schema/{SCHEMA_HASH.hex()}" for view in ("public", "lab")]
        paths += [f"public/schema/{'0' * 64}", f"public/{TAKE:016x}/77", f"public/{3:016x}/0"]
        paths += [address_of(segment) for segment in kept] + [f"lab/{TAKE:016x}/0"]
        paths += ["/open/past", f"/open/past/public/{PAGE}", f"/open/past/public/{TAKE:016x}/4"]
        statuses = set()
        for later_ms in (0, 4500, 60_000, 700_000):
            fleet.ingest.unix_ms = PAGE_MS + 32_000 + later_ms
            for token in (None, "somebody", link("r")):
                for path in paths:
                    first, *others = await fleet.ask(path, token)
                    statuses.add(first.status_code)
                    for other in others:
                        assert other.status_code == first.status_code, (path, token, later_ms)
                        assert other.content == first.content, (path, token, later_ms)
                        names = ("etag", "cache-control", "content-type", "retry-ms")
                        assert [other.headers.get(n) for n in names] == [first.headers.get(n) for n in names]
        assert statuses == {200, 204, 403, 404}
        (answer, *_) = await fleet.ask(address_of(kept[0]), "somebody")
        assert answer.content == kept[0].data
        for answer in await fleet.ask(address_of(kept[2]), "somebody"):  # withheld whole
            assert answer.json() == {"next": {"take": f"{TAKE:016x}", "index": 3}}
        assert [reader.passed_over for reader in fleet.readers] == [0, 0]


async def test_a_blackout_closes_it_at_a_gateway(redis_server: Redis) -> None:
    async with running(redis_server, {"r": {A: Rule()}}) as fleet:
        segment = await fleet.keep(0)
        assert (await fleet.ask_gateway(address_of(segment))).content == segment.data
        fleet.gateways[0].allow({"r": {A: Rule(blackout=True)}})
        assert (await fleet.ask_gateway(address_of(segment))).status_code == 404


async def test_a_request_that_is_held_at_a_gateway_wakes(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        first = await fleet.keep(0, PAGE_MS)
        fleet.ingest.unix_ms = PAGE_MS + 10_000
        for gateway in fleet.gateways:
            gateway.unix_ms = fleet.ingest.unix_ms
        path = f"public/{TAKE:016x}/1"
        held = [asyncio.create_task(gateway.ask(path)) for gateway in fleet.gateways for _ in range(10)]
        for gateway in fleet.gateways:
            await gateway.until_held(10)
        segment = await fleet.keep(1, PAGE_MS + 4000)
        for answer in await asyncio.wait_for(asyncio.gather(*held), 5):
            assert (answer.status_code, answer.content) == (200, segment.data)
        assert first.data != segment.data


async def test_takes_of_two_ingests_merge(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet, running(redis_server, None) as standby:
        for n in range(4):
            for each, take in ((fleet, TAKE), (standby, SECOND)):
                each.ingest.unix_ms = PAGE_MS + 4000 * (n + 1)
                await each.keep(n, take=take)
        # the first one has ended; the standby goes on
        last = await standby.keep(4, PAGE_MS + 16_000, take=SECOND)
        fleet.ingest.unix_ms = PAGE_MS + 20_000
        page = (await fleet.ask_gateway(f"public/{PAGE}")).json()
        assert len(page["segments"]) == 9
        answer = await fleet.ask_gateway(f"public/{TAKE:016x}/4")
        assert answer.json() == {"next": {"take": f"{SECOND:016x}", "index": 3}}
        assert (await fleet.ask_gateway(address_of(last))).content == last.data


async def test_the_bound_holds_and_who_has_most_loses_the_oldest(redis_server: Redis) -> None:
    bytes_max = 400_000
    async with running(redis_server, None, bytes_max) as fleet:
        live = {f"posecast:{{r}}:live{n}": b"x" * 1000 for n in range(50)}
        for key, value in live.items():
            fleet.client.set(key, value, ex=3600)
        modest = [await fleet.keep(n, PAGE_MS + 4000 * n, robot="modest") for n in range(5)]
        flood = []
        for n in range(200):
            more: dict[str, Any] = {"schema": bytes([n]) * 32, "schema_text": f"{n:05}" * 100}
            segment = make_kept(n, PAGE_MS + 4000 * n, robot="flood", events=events(2, 2000), **more)
            fleet.ingest.past.add(segment, 0.0)
            flood.append(segment)
            if n % 20 == 0:
                await fleet.written()
        await fleet.written()
        assert fleet.writer.dropped == 0
        sums = fleet.client.hgetall("posecast:{-}:past")
        assert bytes_max * 0.9 < int(sums[b""]) <= bytes_max
        assert int(sums[b""]) == int(sums[b"flood"]) + int(sums[b"modest"])
        takes = sum(fleet.client.memory_usage(key, samples=0) for key in fleet.client.keys("posecast:*past*"))
        assert takes <= bytes_max
        assert {key: fleet.client.get(key) for key in live} == live
        fleet.ingest.unix_ms = PAGE_MS + 900_000
        for segment in modest:
            answer = await fleet.ask_gateway(f"/modest/past/{address_of(segment)}")
            assert answer.content == segment.data
        shown = [await fleet.ask_gateway(f"/flood/past/{address_of(each)}") for each in flood]
        left = [n for n, answer in enumerate(shown) if answer.content == flood[n].data]
        assert left == list(range(200 - len(left), 200))
        assert 10 < len(left) < 150
        # and nothing of the others is there
        assert len(fleet.list_keys()) == 2 + len(modest) + 1 + 2 * len(left)
        assert fleet.client.xlen(stream_key("flood", "public")) == len(left)


async def test_near_its_maxmemory_nothing_is_added(
    redis_server: Redis, caplog: pytest.LogCaptureFixture
) -> None:
    async with running(redis_server, None) as fleet:
        first = await fleet.keep(0, PAGE_MS)
        fleet.client.set("posecast:{r}:public:state", b"live" * 1000, ex=3600)
        used = fleet.client.info("memory")["used_memory"]
        fleet.client.config_set("maxmemory-policy", "volatile-lru")
        fleet.client.config_set("maxmemory", round(used / 0.8))
        for n in (1, 2):
            await fleet.keep(n, PAGE_MS + 4000 * n)
        assert (fleet.writer.written, fleet.writer.dropped) == (1, 2)
        assert fleet.client.exists("posecast:{r}:public:state") == 1
        assert sum("maxmemory" in line for line in caplog.messages) == 1
        fleet.client.config_set("maxmemory", 0)
        third = await fleet.keep(3, PAGE_MS + 12_000)
        fleet.ingest.unix_ms = PAGE_MS + 60_000
        for segment in (first, third):
            assert (await fleet.ask_gateway(address_of(segment))).content == segment.data


async def test_what_is_deleted_in_redis_is_gone_at_gateways_at_once(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        segments = [await fleet.keep(n, PAGE_MS + 4000 * n) for n in range(4)]
        fleet.ingest.unix_ms = PAGE_MS + 60_000
        for segment in segments:
            assert (await fleet.ask_gateway(address_of(segment))).content == segment.data
        name = segments[1].name
        await fleet.writer.link.run(*_flat(LedgerEntry(name, SCHEMA_HASH.hex(), 0)))
        answer = await fleet.ask_gateway(address_of(segments[1]))
        assert answer.json() == {"next": {"take": f"{TAKE:016x}", "index": 2}}
        page = (await fleet.ask_gateway(f"public/{PAGE}")).json()
        assert [each["index"] for each in page["segments"]] == [0, 2, 3]
        fleet.client.flushall()
        assert (await fleet.ask_gateway(address_of(segments[0]))).status_code == 404
        assert (await fleet.ask_gateway(f"public/schema/{SCHEMA_HASH.hex()}")).status_code == 404


def _flat(entry: LedgerEntry) -> tuple[str, list[str]]:
    script, keys, _ = make_delete_call(entry)
    return script, list(keys)


async def test_what_is_damaged_or_of_another_version_is_passed_over_in_one_line(
    redis_server: Redis, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    async with running(redis_server, None) as fleet:
        stream = stream_key("r", "public")
        first = await fleet.keep(0, PAGE_MS)
        (_, fields) = fleet.client.xrange(stream)[0]
        old = json.loads(fields[b"record"]) | {"v": 0, "take": "f" * 16}
        for record in (json.dumps(old), b"\xff", "{}", fields[b"record"]):
            fleet.client.xadd(stream, {"record": record})
        second = await fleet.keep(1, PAGE_MS + 4000)
        third = await fleet.keep(2, PAGE_MS + 8000)
        fleet.client.hset(segment_key(second.name), "data", second.data[:-1] + b"\x00")
        fleet.ingest.unix_ms = PAGE_MS + 60_000
        page = (await fleet.ask_gateway(f"public/{PAGE}")).json()
        assert [each["index"] for each in page["segments"]] == [0, 1, 2]
        answer = await fleet.ask_gateway(address_of(second))
        assert answer.json() == {"next": {"take": f"{TAKE:016x}", "index": 2}}
        keys = await fleet.ask_gateway(f"public/{PAGE}/keys")
        assert keys.status_code == 200
        for segment in (first, third):
            assert (await fleet.ask_gateway(address_of(segment))).content == segment.data
        assert sum("skipped" in line for line in caplog.messages) == 1
        # keys of another type, and a ledger that somebody else has written into
        for key in fleet.client.keys("posecast:*past*"):
            fleet.client.delete(key)
            fleet.client.set(key, "nonsense")
        assert (await fleet.ask_gateway(address_of(first))).status_code == 404
        again = await fleet.keep(3, PAGE_MS + 12_000)
        assert (await fleet.ask_gateway(address_of(again))).content == again.data
        assert fleet.writer.dropped == 0


async def test_a_dead_redis_is_said_at_once_and_comes_back(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        first = await fleet.keep(0, PAGE_MS)
        fleet.ingest.unix_ms = PAGE_MS + 10_000
        for gateway in fleet.gateways:
            gateway.unix_ms = fleet.ingest.unix_ms
        assert (await fleet.ask_gateway(address_of(first))).status_code == 200
        held = asyncio.create_task(fleet.gateways[0].ask(f"public/{TAKE:016x}/1"))
        await fleet.gateways[0].until_held(1)
        redis_server.kill()
        answer = await asyncio.wait_for(held, 5)  # a held one, too
        for refused in (answer, await fleet.ask_gateway(address_of(first)), await fleet.ask_gateway("")):
            assert refused.status_code == 503
            assert refused.headers["retry-after"] == "1"
            assert "retry-after" in refused.headers["access-control-expose-headers"]
            assert refused.headers["cache-control"] == "public, max-age=1"
            assert refused.json()["error"] == past_reader.AWAY
        assert fleet.readers[0].losses == 1
        ready = await fleet.gateways[0].ask_ready()
        assert ready.json() == {"status": "degraded", "why": "the past: redis: ConnectionError"}
        assert ready.status_code == 200
        assert (await fleet.ingest.ask_ready()).json() == {"status": "ready"}  # it reads its own
        assert await fleet.ingest.ask(address_of(first))  # where it was recorded nobody notices
        fleet.ingest.keep(1, PAGE_MS + 4000)
        redis_server.start()
        await fleet.written()
        await until_async("it is back", lambda: fleet.readers[0].find_trouble() is None)
        assert (await fleet.gateways[0].ask_ready()).json() == {"status": "ready"}
        ended = await fleet.ask_gateway(address_of(first))  # with Redis
        assert ended.json() == {"next": {"take": f"{TAKE:016x}", "index": 1}}
        second = await fleet.keep(2, PAGE_MS + 8000)
        fleet.ingest.unix_ms = PAGE_MS + 20_000
        assert (await fleet.ask_gateway(address_of(second))).content == second.data
        schema = await fleet.ask_gateway(f"public/schema/{SCHEMA_HASH.hex()}")
        assert schema.text == SCHEMA.text


async def test_a_frozen_redis_holds_nobody_up(redis_server: Redis, monkeypatch: pytest.MonkeyPatch) -> None:
    async with running(redis_server, None, patience_s=TIMEOUT_S) as fleet:
        await fleet.keep(0, PAGE_MS)
        redis_server.freeze()
        # one after the other, they would wait for longer than who asks
        answers = await asyncio.gather(*(fleet.gateways[0].ask("") for _ in range(100)))
        assert {answer.status_code for answer in answers} == {503}
        asked: list[object] = []
        with monkeypatch.context() as patch:  # and Redis is not asked again for each of them
            patch.setattr(fleet.readers[0], "_exchange", asked.append)
            for path in ("", f"public/{PAGE}", f"public/{TAKE:016x}/0"):
                assert (await fleet.ask_gateway(path)).status_code == 503
        assert asked == []
        # what waits is bounded: the oldest of who has most goes
        monkeypatch.setattr(past_writer, "QUEUE_BYTES", 60_000)
        for n in range(1, 60):
            fleet.ingest.keep(n, PAGE_MS + 4000 * n, robot="flood")
        fleet.ingest.keep(0, PAGE_MS, robot="modest")
        assert fleet.writer.bytes <= 60_000
        assert fleet.writer.dropped > 10
        redis_server.thaw()
        await until_async("all is written", lambda: fleet.writer.bytes == 0 and fleet.writer.written > 5)
        await until_async("it is back", lambda: fleet.readers[0].find_trouble() is None)
        fleet.ingest.unix_ms = PAGE_MS + 300_000
        assert (await fleet.ask_gateway("/modest/past")).json()["newest"]["index"] == 0
        assert (await fleet.ask_gateway("/flood/past")).json()["newest"]["index"] == 59


async def test_a_batch_whose_answer_was_lost_is_written_again_and_does_no_harm(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(redis_server, None) as fleet:
        run_all = fleet.writer.link.run_all
        lost: list[object] = []

        async def lose_one(calls: list[Any]) -> list[Any]:
            results = await run_all(calls)
            if calls and not lost:
                lost.append(results)
                raise TimeoutError
            return results

        monkeypatch.setattr(fleet.writer.link, "run_all", lose_one)
        segment = await fleet.keep(0, PAGE_MS)
        assert len(lost) == 1
        assert (fleet.writer.written, fleet.writer.dropped, fleet.writer.losses) == (1, 0, 1)
        assert fleet.client.xlen(stream_key("r", "public")) == 1
        assert fleet.client.hget(schema_key("r", SCHEMA_HASH.hex()), "named") == b"1"
        sums = fleet.client.hgetall("posecast:{-}:past")
        assert sums[b"r"] == sums[b""]
        assert int(sums[b""]) < 2 * segment.cost_bytes + 2 * len(SCHEMA.text)
        # what never can be written is given up, and what comes after it is written

        async def lose_each(calls: list[Any]) -> list[Any]:
            lost.clear()
            return await lose_one(calls)

        monkeypatch.setattr(fleet.writer.link, "run_all", lose_each)
        await fleet.keep(1, PAGE_MS + 4000)
        assert (fleet.writer.written, fleet.writer.dropped) == (1, 1)
        monkeypatch.setattr(fleet.writer.link, "run_all", run_all)
        await fleet.keep(2, PAGE_MS + 8000)
        assert fleet.writer.written == 2


async def test_what_fails_at_one_robot_is_no_other_robots(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Injected(Exception):
        pass

    async with running(redis_server, None) as fleet:

        def failing_pack(segment: KeptSegment) -> bytes:
            if segment.name.robot == "hurt":
                raise Injected
            return pack_record(segment)

        monkeypatch.setattr(past_writer, "pack_record", failing_pack)
        fleet.ingest.keep(0, PAGE_MS, robot="hurt")
        other = await fleet.keep(0, PAGE_MS, robot="other")
        assert (fleet.writer.written, fleet.writer.dropped) == (1, 1)
        look = fleet.readers[0]._look

        async def failing_look(robot: str, view: str) -> None:
            if robot == "hurt":
                raise Injected
            await look(robot, view)

        monkeypatch.setattr(fleet.readers[0], "_look", failing_look)
        fleet.readers[0].follow(lambda: [("hurt", "public"), ("other", "public")], lambda _robot, _view: None)
        await until_async("it has failed", lambda: fleet.readers[0].passed_over > 0)
        fleet.ingest.unix_ms = PAGE_MS + 10_000
        assert (await fleet.ask_gateway(f"/other/past/{address_of(other)}")).content == other.data
        assert fleet.readers[0].losses == 0


async def test_pages_of_keys_are_read_in_parts_and_hold_fewer_poses_where_it_is_much(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running(redis_server, None) as fleet:
        size = 0
        for n in range(16):
            size = len((await fleet.keep(n, PAGE_MS + 4000 * n)).data)
        fleet.ingest.unix_ms = PAGE_MS + 300_000
        monkeypatch.setattr(service, "LOADED_BYTES", 3 * size)
        monkeypatch.setattr(service, "LOADED_BYTES_MAX", 9 * size)
        half = await fleet.ingest.ask(f"public/{PAGE}/keys?every=2")
        whole, *answers = await fleet.ask(f"public/{PAGE}/keys")
        assert len(whole.content) > len(half.content)
        assert [answer.content == half.content for answer in answers] == [True, True]


async def test_a_segment_expires_with_the_window(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        await fleet.keep(0, PAGE_MS)
        left_ms = {key: fleet.client.pttl(key) for key in fleet.client.keys("posecast:*past*")}
        assert len(left_ms) == 5
        assert all(1_700_000 < ms <= 2 * 1_860_000 for ms in left_ms.values()), left_ms
        # the ledger forgets what is older, and has it deleted
        fleet.writer.set_window(0.01)
        await asyncio.sleep(0.02)
        second = await fleet.keep(1, PAGE_MS + 4000)
        assert fleet.client.exists(segment_key(second.name)) == 1
        assert len([key for key in fleet.list_keys() if ":past:" in key and "schema" not in key]) == 1


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


OPEN_RULES = {"r": {Audience.ANYONE: Rule()}, "open": {Audience.ANYONE: Rule()}}


async def test_a_robot_that_is_removed_loses_its_past_at_gateways(redis_server: Redis) -> None:
    async with running(redis_server, OPEN_RULES) as fleet:
        fleet.writer.set_robots(OPEN_RULES)
        count = FORGOTTEN_MAX + 50  # more than one call lists
        segments = [fleet.ingest.keep(index, PAGE_MS + 100 * index) for index in range(count)]
        other = await fleet.keep(0, PAGE_MS, robot="open")
        fleet.ingest.unix_ms = PAGE_MS + 60_000
        assert (await fleet.ask_gateway(address_of(segments[0]))).status_code == 200
        fleet.writer.set_robots({"open"})
        fleet.writer.set_robots(OPEN_RULES)  # another gets its name
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
    async with running(redis_server, OPEN_RULES) as fleet:
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


SEGMENTS = [make_kept(n, PAGE_MS + 4000 * n) for n in range(5)]


def told(*records: tuple[bytes, KeptSegment | None]) -> list[bytes]:
    """As Redis tells them; None: something else."""
    return [each for id_, of in records for each in (id_, b"?" if of is None else pack_record(of))]


def list_indexes(replica: PastReplica) -> list[int]:
    """Of what it knows."""
    return [segment.name.index for segment in replica.kept.list_segments("r", "public")]


def test_it_follows_the_stream() -> None:
    passed_over: list[str] = []
    replica = PastReplica("r", "public", passed_over.append)
    assert (replica.newest, replica.count) == (BEGINNING, 0)
    assert replica.append(told((b"9-0", SEGMENTS[0]), (b"9-1", None), (b"9-2", SEGMENTS[1])))
    assert not replica.append(told((b"10-0", SEGMENTS[0]), (b"10-1", None)))  # a name twice
    assert replica.append(told((b"10-2", SEGMENTS[2]), (b"11-0", SEGMENTS[3])))
    assert (replica.newest, replica.count) == (b"11-0", 7)
    assert len(passed_over) == 3
    assert list_indexes(replica) == [0, 1, 2, 3]
    replica.drop_before(b"9-2")  # 9 is before 10, as numbers are
    assert (replica.count, list_indexes(replica)) == (5, [1, 2, 3])
    replica.drop(SEGMENTS[2].name)
    assert (replica.count, list_indexes(replica)) == (5, [1, 3])
    replica.drop_before(b"11-0")
    assert (replica.count, list_indexes(replica)) == (1, [3])
    replica.drop_before(b"12-0")
    assert (replica.newest, replica.count, list_indexes(replica)) == (BEGINNING, 0, [])
