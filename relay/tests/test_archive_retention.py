"""What is older than `keep` is deleted, and nothing else."""

from __future__ import annotations

from pathlib import Path

from posecast_relay.archive.index import check_day, load_day
from posecast_relay.archive.names import DAY_MS, PAGE_MS, read_segment_key

from . import past_doors
from .archive_world import ArchiveWorld, make_run
from .past_doors import make_kept

START = past_doors.PAGE_MS
DAY_START = START - START % DAY_MS
HOUR_MS = 3_600_000


def list_hours(world: ArchiveWorld) -> list[float]:
    """When the segments that are there began, in hours since START."""
    names = [read_segment_key(key) for key in world.list_files(".segment")]
    return sorted((name.from_ms - START) / HOUR_MS for name in names if name is not None)


async def make_world(folder: Path) -> ArchiveWorld:
    """A segment every two hours for three days, of two robots."""
    world = ArchiveWorld(folder, ["r", "other"])
    await world.write(*make_run(36, step_ms=2 * HOUR_MS))
    await world.write(*make_run(36, step_ms=2 * HOUR_MS, robot="other"))
    await world.index()
    world.unix_ms = START + 72 * HOUR_MS
    return world


async def test_what_is_too_old_goes_with_its_indexes(tmp_path: Path) -> None:
    world = await make_world(tmp_path / "store")
    (world.folder / "r" / "public" / "mine.txt").write_text("mine")
    world.keep({"r": 24 * 3600.0, "other": 30 * 86400.0})
    await world.indexer.delete_old()
    hours = list_hours(world)
    assert hours.count(0.0) == 1  # the other robot's
    mine = [key for key in world.list_files() if key.startswith("r/public/")]
    left = [name.from_ms for key in mine if (name := read_segment_key(key)) is not None]
    assert min(left) + PAGE_MS > world.unix_ms - 24 * HOUR_MS
    assert len(left) == 12  # what began just 24 hours ago is over them when its ten minutes are
    assert sorted({key.split("/")[2] for key in mine}) == ["2026-11-20", "2026-11-21", "mine.txt"]
    assert sum(key.endswith("index.json") for key in mine) == 12
    day = await load_day(world.store, "r", "public", DAY_START + 2 * DAY_MS)
    assert day.is_written
    assert await check_day(world.store, "r", "public", DAY_START + 2 * DAY_MS) == []
    assert world.indexer.expired == 24


async def test_keep_that_is_gone_deletes_nothing(tmp_path: Path) -> None:
    world = await make_world(tmp_path / "store")
    before = world.list_files()
    world.keep({"other": 30 * 86400.0})
    await world.indexer.delete_old()
    assert world.list_files() == before
    world.keep({"r": 600.0})  # given again, and shorter
    await world.indexer.delete_old()
    assert [key for key in world.list_files(".segment") if key.startswith("r/")] == []
    assert not (world.folder / "r" / "public").exists()  # empty folders are gone
    assert [key for key in world.list_files() if key.startswith("other")] == [
        key for key in before if key.startswith("other")
    ]


async def test_what_a_killed_process_left_goes_when_the_day_is_long_over(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    await world.write(make_kept(0, START))
    await world.index()
    key = world.list_files(".segment")[0]
    (world.folder / f"{key}#1").write_bytes(b"half")
    await world.indexer.walk_all()
    assert (world.folder / f"{key}#1").exists()  # somebody may be at it
    world.unix_ms = DAY_START + DAY_MS + 2 * HOUR_MS
    await world.indexer.walk_all()
    assert not (world.folder / f"{key}#1").exists()
    assert (world.folder / key).exists()
