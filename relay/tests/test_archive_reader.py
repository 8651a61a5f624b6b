"""What is asked of an archive at the same time, or again, is read once, and as it is now."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from pathlib import Path

import pytest
from posecast_relay.archive import joined
from posecast_relay.archive.reader import OLD_S
from posecast_relay.archive.store import ObjectStore
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.segment import DAY_MS, PAGE_MS, KeptSegment
from posecast_testing import until_async

from . import past_doors
from .archive_world import ArchiveWorld, make_run

START = past_doors.PAGE_MS
DAY_START = START - START % DAY_MS


async def test_a_day_and_its_first_ten_minutes_are_asked_for_at_once(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    await world.write(*make_run(3, DAY_START))
    await world.index()
    day, segments = await asyncio.gather(
        world.reader.load_day("r", "public", DAY_START), world.reader.load_page("r", "public", DAY_START)
    )
    assert [page.count for page in day.list_pages()] == [len(segments)] == [3]


async def test_who_asks_after_a_deletion_does_not_get_what_was_read_before(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    await world.write(*make_run(3))
    await world.index()
    gate, reads = asyncio.Event(), 0
    ask = world.reader._read_day

    async def read_slowly(robot: str, view: str, day_ms: int) -> object:
        nonlocal reads
        reads += 1
        found = await ask(robot, view, day_ms)
        await gate.wait()
        return found

    world.reader._read_day = read_slowly  # type: ignore[assignment, method-assign]
    before = asyncio.create_task(world.reader.load_day("r", "public", DAY_START))
    await until_async("it is read", lambda: reads)
    world.reader.forget("r")
    after = asyncio.create_task(world.reader.load_day("r", "public", DAY_START))
    await until_async("it is read anew", lambda: reads == 2, 2.0)
    gate.set()
    await asyncio.gather(before, after)


async def test_ten_minutes_without_an_index_are_read_once_and_then_what_is_new(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = ArchiveWorld(tmp_path)
    run = make_run(40)
    await world.write(*run[:30])
    gets, get = list[str](), ObjectStore.get

    async def count(store: ObjectStore, key: str) -> bytes | None:
        gets.append(key)
        return await get(store, key)

    monkeypatch.setattr(ObjectStore, "get", count)

    async def look() -> tuple[int, int]:
        world.now += OLD_S / 2
        gets.clear()
        (reach,) = await world.reader.load_reaches("r", "public", 0, START + DAY_MS)
        day = await world.reader.load_day("r", "public", DAY_START)
        segments = await world.reader.load_page("r", "public", START)
        assert [page.count for page in day.list_pages()] == [len(segments)]
        assert max(span.last_index for span in reach.takes.values()) == len(segments) - 1
        return len(segments), sum(key.endswith(".segment") for key in gets)

    assert await look() == (30, 30)
    await world.write(*run[30:])
    assert await look() == (40, 10)
    assert await look() == (40, 0)
    world.reader.forget("r")
    assert await look() == (40, 40)
    await world.index()
    assert await look() == (40, 0)


async def test_who_plays_an_older_past_costs_no_more_than_the_segments(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = ArchiveWorld(tmp_path)
    older, newer = make_run(20), make_run(20, START + PAGE_MS, take=5)
    await world.write(*older)
    await world.index()
    front = MemoryPast(1 << 26)
    for segment in newer:
        front.add(segment, 0.0)
    world.unix_ms = START + 2 * PAGE_MS
    async with world.make_doors(
        {"r": {Audience.ANYONE: Rule(past_s=86400.0)}}, MemoryPastSource(front)
    ) as doors:
        put_together, times = joined._put_together, 0

        def count(*parts: Iterable[KeptSegment]) -> MemoryPast:
            nonlocal times
            times += 1
            return put_together(*parts)

        monkeypatch.setattr(joined, "_put_together", count)
        for segment in (*older, *newer):
            assert (await doors.ask(past_doors.address_of(segment))).content == segment.data
        assert times == 0
        after = f"public/{older[0].name.take:016x}/{len(older)}"
        assert (await doors.ask(after)).json()["next"] == {"take": f"{5:016x}", "index": 0}
        assert times == 1
