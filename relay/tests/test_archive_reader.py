"""What is asked of an archive at the same time, or again, is read once, and as it is now."""

from __future__ import annotations

import asyncio
from pathlib import Path

from posecast_relay.archive.names import DAY_MS

from . import past_doors
from .archive_world import ArchiveWorld, make_run, until

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
    await until("it is read", lambda: reads)
    world.reader.forget("r")
    after = asyncio.create_task(world.reader.load_day("r", "public", DAY_START))
    await until("it is read anew", lambda: reads == 2, 2.0)
    gate.set()
    await asyncio.gather(before, after)
