"""What was deleted of the past leaves memory, Redis, and what gateways know; the rest stays."""

from __future__ import annotations

import asyncio
import dataclasses
from typing import Any

import pytest
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past.deletions import (
    KNOWN_MAX,
    SPANS_MAX,
    Deletion,
    Deletions,
    pack_deletion,
    unpack_deletion,
)
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.segment import pack_record
from posecast_relay.past_command.deletion import make_deletion
from posecast_relay.redis.past_deletions import KEY, RedisDeletions
from posecast_relay.redis.past_reader import PastReplica
from posecast_relay.redis.past_scripts import stream_key
from posecast_relay.server.past import ObedientMemory
from posecast_testing import until_async

from .past_doors import DAY, PAGE, PAGE_MS, PastDoors, address_of, make_kept
from .past_redis import PastFleet, running
from .redis_server import Redis

NOW_MS = PAGE_MS + 3_600_000
MINUTE_MS = 60_000
A = Audience.ANYONE


def order(from_ms: int, to_ms: int, view: str | None = None, robot: str = "r") -> Deletion:
    """A deletion of a span after PAGE_MS."""
    return make_deletion(robot, view, PAGE_MS + from_ms, PAGE_MS + to_ms, NOW_MS)


def test_what_overlaps_a_span_is_covered_and_its_neighbours_are_not() -> None:
    deletion = order(10_000, 20_000, "public")
    for from_ms, to_ms, is_covered in (
        (0, 10_000, False),
        (0, 10_001, True),
        (10_000, 14_000, True),
        (19_999, 24_000, True),
        (20_000, 24_000, False),
        (10_000, 10_000, True),  # of no length
    ):
        span = PAGE_MS + from_ms, PAGE_MS + to_ms
        assert deletion.covers("r", "public", *span) is is_covered, (from_ms, to_ms)
        assert not deletion.covers("r", "staff", *span)
        assert not deletion.covers("q", "public", *span)
    assert order(10_000, 20_000).covers("r", "staff", PAGE_MS + 12_000, PAGE_MS + 13_000)


def test_a_deletion_never_reaches_beyond_the_moment_when_it_was_ordered() -> None:
    assert make_deletion("r", None, 0, NOW_MS + 1, NOW_MS).to_ms == NOW_MS
    later = dataclasses.replace(order(0, 1000), to_ms=NOW_MS + 1)
    with pytest.raises(ValueError, match="not a time span that was over"):
        unpack_deletion(pack_deletion(later))


def test_a_record_comes_back_as_it_was_and_what_is_none_is_refused() -> None:
    deletion = order(0, 1000, "public")
    assert unpack_deletion(pack_deletion(deletion)) == deletion
    for wrong in (b"", b"[]", b"{}", b'{"v":2}', pack_deletion(deletion)[:-1], b" " * 5000):
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            unpack_deletion(wrong)
    for change in ({"robot": "../x"}, {"view": ""}, {"id": "AB"}, {"from_ms": -1}, {"to_ms": 0}):
        with pytest.raises(ValueError, match=r"^[ -~]+$"):
            unpack_deletion(pack_deletion(dataclasses.replace(deletion, **change)))


def test_deletions_are_known_once_and_bounded() -> None:
    deletions, heard = Deletions(), list[str]()
    deletions.on_added(lambda each: heard.append(each.id))
    first = order(0, 1000)
    assert deletions.add(first) is True
    assert deletions.add(first) is False
    assert heard == [first.id]
    for _ in range(KNOWN_MAX):
        deletions.add(order(0, 1, robot="q"))
    assert deletions.count == 1 + KNOWN_MAX
    assert not deletions.has(first.id)
    assert not deletions.cover("r", "public", PAGE_MS, PAGE_MS + 1)


def test_viewers_hear_of_the_spans_of_their_view_once_each_and_of_not_too_many() -> None:
    deletions = Deletions()
    assert deletions.list_spans("r", "public") == []
    for deletion in (order(5000, 9000), order(0, 2000, "public"), order(1000, 3000), order(4000, 5000)):
        deletions.add(deletion)
    deletions.add(order(20_000, 30_000, "staff"))
    deletions.add(order(40_000, 50_000, robot="q"))
    assert deletions.list_spans("r", "public") == [
        (PAGE_MS, PAGE_MS + 3000),
        (PAGE_MS + 4000, PAGE_MS + 9000),
    ]
    for n in range(2 * SPANS_MAX):
        deletions.add(order(100_000 + 10 * n, 100_005 + 10 * n))
    listed = deletions.list_spans("r", "public")
    assert len(listed) == SPANS_MAX
    assert listed[-1] == (PAGE_MS + 101_990, PAGE_MS + 101_995)


async def test_a_list_that_a_browser_has_is_asked_for_again_and_lacks_what_was_deleted() -> None:
    async with PastDoors({"r": {A: Rule(past_s=1000)}}) as doors:
        for index in range(3):
            doors.keep(index, PAGE_MS + 60_000 * index)
        ObedientMemory(doors.past, doors.service.deletions)
        doors.unix_ms = PAGE_MS + 700_000
        had: dict[str, str] = {}
        for path in ("", f"public/{DAY}", f"public/{PAGE}", f"public/{PAGE}/keys"):
            answer = await doors.ask(path)
            assert "max-age=1" in answer.headers["cache-control"].split(", "), path
            had[path] = answer.headers["etag"]
            assert (await doors.ask(path, if_none_match=had[path])).status_code == 304, path
        doors.service.deletions.add(order(60_000, 61_000))
        doors.service.deletions.add(order(-500_000, -400_000))  # out of sight
        for path, etag in had.items():
            answer = await doors.ask(path, if_none_match=etag)
            assert answer.status_code == 200, path
        page = (await doors.ask(f"public/{PAGE}")).json()
        assert [entry["index"] for entry in page["segments"]] == [0, 2]
        assert (await doors.ask("")).json()["deleted"] == [
            {"from_ms": PAGE_MS + 60_000, "to_ms": PAGE_MS + 61_000}
        ]


def test_memory_loses_the_middle_and_counts_as_if_it_had_never_been_there() -> None:
    past, twin = MemoryPast(1 << 26), MemoryPast(1 << 26)
    for index in range(10):
        segment = make_kept(index, PAGE_MS + 60_000 * index)
        past.add(segment, float(index))
        if index not in (3, 4, 5):
            twin.add(segment, float(index))
    staff = make_kept(0, PAGE_MS + 240_000, view="staff")
    for each in (past, twin):
        each.add(staff, 10.0)
    gone = past.delete(order(180_000, 301_000, "public"))
    assert [segment.name.index for segment in gone] == [3, 4, 5]
    for each in (past, twin):
        assert len(each) == 8
    assert past.bytes == twin.bytes
    listed = [past.list_segments("r", "public"), twin.list_segments("r", "public")]
    assert listed[0] == listed[1]
    assert past.list_segments("r", "public", PAGE_MS, PAGE_MS + 600_000) == listed[0]
    assert past.find(gone[0].name) is None
    assert past.find(staff.name) is staff
    past.forget_older(lambda _robot, _view: 1.0, 100.0)
    assert (len(past), past.bytes) == (0, 0)


def test_what_was_open_when_it_was_ordered_does_not_come_in_later() -> None:
    past, deletions = MemoryPast(1 << 26), Deletions()
    memory = ObedientMemory(past, deletions)
    memory.add(make_kept(0, PAGE_MS), 0.0)
    deletions.add(order(0, 6000))
    memory.add(make_kept(1, PAGE_MS + 4000), 1.0)  # began before 6000
    memory.add(make_kept(2, PAGE_MS + 8000), 2.0)
    assert [segment.name.index for segment in past.list_segments("r", "public")] == [2]


async def test_an_answer_that_is_being_made_holds_nothing_that_was_deleted() -> None:
    past, under_way, go_on = MemoryPast(1 << 26), asyncio.Event(), asyncio.Event()

    class SlowSource(MemoryPastSource):
        async def load(self, segments: Any) -> Any:
            under_way.set()
            await go_on.wait()
            return list(segments)

    doors = PastDoors(None, SlowSource(past))
    await doors.start()
    try:
        # bytes that are elsewhere: they have to be waited for
        segment = make_kept(0, PAGE_MS, elsewhere_bytes=1)
        doors.unix_ms = PAGE_MS + 10_000
        for path in (address_of(segment), f"public/{PAGE}/keys"):
            deletions = doors.service.deletions = Deletions()  # as in a process that knows of none
            deletions.on_added(doors.service._forget)
            ObedientMemory(past, deletions)
            past.add(segment, 0.0)
            doors.service.answers.clear()
            assert (await doors.ask(f"public/{DAY}")).json()["minutes"]
            under_way.clear()
            go_on.clear()
            asked = asyncio.create_task(doors.ask(path))
            await under_way.wait()
            deletions.add(order(0, 600_000))
            go_on.set()
            assert (await asked).status_code in (404, 503), path
            # at once, though an answer of before is younger than a second
            assert (await doors.ask(f"public/{DAY}")).json()["minutes"] == []
            assert not doors.service.keys._poses.cost
    finally:
        go_on.set()
        await doors.stop()


def test_a_gateway_leaves_out_what_is_deleted_and_still_stands_in_redis() -> None:
    deletions = Deletions()
    deletions.add(order(0, 5000))
    replica = PastReplica("r", "public", pytest.fail, deletions.cover_segment)
    records = [pack_record(make_kept(index, PAGE_MS + 10_000 * index)) for index in range(3)]
    told = [each for pair in zip([b"1-0", b"2-0", b"3-0"], records, strict=True) for each in pair]
    assert replica.append(told)
    assert replica.count == 3
    assert [each.name.index for each in replica.kept.list_segments("r", "public")] == [1, 2]
    replica.drop_before(b"2-0")
    assert (replica.count, len(replica.kept)) == (2, 2)
    assert not PastReplica("r", "public", pytest.fail, deletions.cover_segment).append(told[:2])


async def ask_all(fleet: PastFleet, path: str) -> list[Any]:
    """The same request to all; a busy machine may keep a gateway from Redis for a moment."""
    while True:
        answers = await fleet.ask(path)
        if not any(answer.status_code == 503 for answer in answers):
            return answers


async def test_a_deletion_at_one_process_reaches_redis_and_each_gateway(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        here = fleet.writer._deletions
        ObedientMemory(fleet.ingest.past, here)
        ways = [RedisDeletions(redis_server.url, here)]
        for door, reader in zip(fleet.gateways, fleet.readers, strict=True):
            door.service.deletions = reader._deletions
            reader._deletions.on_added(door.service._forget)
            ways.append(RedisDeletions(redis_server.url, reader._deletions))
        for way in ways:
            way.start()
        segments = [await fleet.keep(index, PAGE_MS + 60_000 * index) for index in range(6)]
        other = await fleet.keep(0, PAGE_MS, robot="q")
        fleet.ingest.unix_ms = PAGE_MS + 600_000
        gone, stays = segments[2:4], [*segments[:2], *segments[4:]]
        for segment in gone:
            assert [each.status_code for each in await ask_all(fleet, address_of(segment))] == [200] * 3
        here.add(order(120_000, 200_000))
        await until_async("gateways know", lambda: all(way._deletions.count for way in ways), 30.0)
        await until_async("redis has no more of it", lambda: len(fleet.list_keys()) == 5 + 2 + 2, 30.0)
        for segment in gone:
            for answer in await ask_all(fleet, address_of(segment)):
                assert answer.status_code != 200 or answer.json()["next"]
        for segment in stays:
            answers = await ask_all(fleet, address_of(segment))
            assert [each.content for each in answers] == [segment.data] * 3
        index = [answer.json() for answer in await ask_all(fleet, f"public/{PAGE}")]
        assert [each["index"] for each in index[1]["segments"]] == [0, 1, 4, 5]
        assert index[0] == index[1] == index[2]
        assert (await ask_all(fleet, f"/q/past/{address_of(other)}"))[1].status_code == 200
        assert not any(
            reader._data.find(name, 0.0) for reader in fleet.readers for name in [g.name for g in gone]
        )
        # what has waited all the time is not written
        before = fleet.writer.written
        fleet.writer._put_back([make_kept(7, PAGE_MS + 130_000)])
        assert not fleet.writer._waiting
        assert fleet.writer.written == before
        here.add(make_deletion("r", None, 0, NOW_MS, NOW_MS))  # all of it, with the schema
        await until_async(  # an empty stream expires by itself
            "all is gone",
            lambda: {key for key in fleet.list_keys() if "{r}" in key} == {stream_key("r", "public")},
        )
        assert fleet.client.xlen(stream_key("r", "public")) == 0
        await until_async("its sum is", lambda: int(fleet.client.hget("posecast:{-}:past", "r")) == 0, 30.0)
        sums = fleet.client.hgetall("posecast:{-}:past")
        assert int(sums[b""]) == int(sums[b"q"]) > 0
        for way in ways:
            await way.stop()


async def test_strangers_bytes_among_the_deletions_in_redis_are_passed_over(redis_server: Redis) -> None:
    async with running(redis_server, None) as fleet:
        fleet.client.set(KEY, "no stream")
        deletions = Deletions()
        way = RedisDeletions(redis_server.url, deletions)
        way.start()
        await until_async("it is removed", lambda: fleet.client.type(KEY) == b"none")
        for fields in ({"deletion": b"\xff"}, {"other": "x"}, {"deletion": pack_deletion(order(0, 1000))}):
            fleet.client.xadd(KEY, fields)
        await until_async("the one that is one", lambda: deletions.count == 1)
        redis_server.kill()
        redis_server.start()
        deletions.add(order(0, 2000))  # while it may not be connected yet
        await until_async("it is told", lambda: fleet.client.xlen(KEY) == 1)
        await way.stop()
