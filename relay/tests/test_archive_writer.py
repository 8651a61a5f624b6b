"""Segments on their way to an object store: in order, bounded, and never in the way of what is live."""

from __future__ import annotations

import asyncio
import logging
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from posecast_relay.archive.names import name_segment, read_segment_key
from posecast_relay.archive.writer import PUTS_AT_ONCE, ROBOTS_AT_ONCE, ArchiveWriter
from posecast_relay.past.segment import KeptSegment
from posecast_testing import until_async

from .archive_world import ArchiveWorld, GatedStore, break_store, make_run
from .past_doors import PAGE_MS, SCHEMA, SCHEMA_HASH, make_kept


def read_written(world: ArchiveWorld, robot: str = "r") -> list[int]:
    """The indexes of a robot's segments that are in the store."""
    names = [read_segment_key(key) for key in world.list_files(".segment")]
    return sorted(name.name.index for name in names if name is not None and name.name.robot == robot)


async def test_a_segment_is_there_byte_for_byte_and_its_schema_once(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    segments = make_run(3)
    await world.write(*segments)
    for segment in segments:
        assert await world.store.get(name_segment(segment).key) == segment.data
    assert await world.store.get(f"r/schemas/{SCHEMA_HASH.hex()}.json") == SCHEMA.text.encode()
    assert len(world.list_files()) == 4
    assert (world.writer.written, world.writer.dropped, world.writer.waiting_bytes) == (3, 0, 0)
    assert world.writer.written_bytes == sum(segment.size for segment in segments)


async def test_nothing_is_written_that_was_not_decided(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store", ["r"])
    await world.write(make_kept(0, PAGE_MS, robot="other"))
    assert world.list_files() == []
    gated = GatedStore(tmp_path / "store")
    held = ArchiveWorld(tmp_path / "store", ["r"], store=gated)
    held.writer.keep(make_kept(0, PAGE_MS))
    await until_async("one is written", lambda: gated.at_once)
    held.writer.keep(make_kept(1, PAGE_MS + 4000))
    held.keep({})
    gated.gate.set()
    await held.written()
    assert read_written(held) in ([0], [])  # the one that was on its way may be there
    held.writer.keep(make_kept(2, PAGE_MS + 8000))
    assert held.writer.waiting_bytes == 0


async def test_each_robots_are_written_in_order_and_several_robots_at_once(tmp_path: Path) -> None:
    gated = GatedStore(tmp_path / "store")
    robots = [f"r{n}" for n in range(ROBOTS_AT_ONCE + 5)]
    world = ArchiveWorld(tmp_path / "store", robots, store=gated)
    for n in range(3):
        for robot in robots:
            world.writer.keep(make_kept(n, PAGE_MS + 4000 * n, robot=robot, schema_text=None))
    await until_async("many wait at the gate", lambda: gated.at_once >= ROBOTS_AT_ONCE)
    assert gated.most_at_once <= ROBOTS_AT_ONCE * PUTS_AT_ONCE
    gated.gate.set()
    await world.written()
    names = [name for key in gated.puts if (name := read_segment_key(key)) is not None]
    for robot in robots:
        assert sorted(name.name.index for name in names if name.name.robot == robot) == [0, 1, 2]


async def test_one_that_keeps_up_is_written_one_by_one(tmp_path: Path) -> None:
    gated = GatedStore(tmp_path / "store")
    gated.gate.set()
    world = ArchiveWorld(tmp_path / "store", store=gated)
    for segment in make_run(10):
        await world.write(segment)
    names = [name for key in gated.puts if (name := read_segment_key(key)) is not None]
    assert [name.name.index for name in names] == list(range(10))
    assert gated.most_at_once == 1


async def test_what_waits_is_bounded_and_the_oldest_goes(tmp_path: Path) -> None:
    gated = GatedStore(tmp_path / "store")
    segments = make_run(20)
    cost = segments[0].cost_bytes
    world = ArchiveWorld(
        tmp_path / "store", ["r", "s"], store=gated, robot_bytes=10 * cost + 100, all_bytes=12 * cost + 100
    )
    for segment in segments:
        world.writer.keep(segment)
    assert world.writer.dropped == 10
    for n in range(5):
        world.writer.keep(make_kept(n, PAGE_MS + 4000 * n, robot="s"))
    assert world.writer.dropped == 13  # of the robot that has most
    assert world.writer.waiting_bytes <= 12 * cost + 100
    gated.gate.set()
    await world.written()
    assert read_written(world) == list(range(13, 20))
    assert read_written(world, "s") == list(range(5))


async def test_a_store_that_is_away_is_told_of_once_and_nothing_is_lost(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArchiveWorld(tmp_path / "store")
    segments = make_run(20)
    await world.write(*segments[:3])
    mend = break_store(world.folder)
    with caplog.at_level(logging.WARNING, "posecast_relay"):
        for segment in segments[3:]:
            world.writer.keep(segment)
        await until_async("it was tried often", lambda: world.writer.failures > 4)
        assert world.writer.find_trouble() == "its folder is gone"
        mend()
        await world.written()
        await until_async("it is said", lambda: world.writer.find_trouble() is None)
    assert [record.message for record in caplog.records] == [
        "the archive: its folder is gone; queueing up to 16 MB per robot, live data continues",
        "the archive is back; nothing was lost",
    ]
    assert read_written(world) == list(range(20))
    assert world.writer.dropped == 0


async def test_what_was_lost_meanwhile_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    segments = make_run(20)
    world = ArchiveWorld(tmp_path / "store", robot_bytes=5 * segments[0].cost_bytes + 100)
    mend = break_store(world.folder)
    with caplog.at_level(logging.WARNING, "posecast_relay"):
        world.writer.keep(segments[0])
        await until_async("it failed", lambda: world.writer.failures)
        for segment in segments[1:]:
            world.writer.keep(segment)
        mend()
        await world.written()
        await until_async("it is said", lambda: world.writer.find_trouble() is None)
    assert caplog.records[-1].message == "the archive is back; dropped 15 segments"
    assert read_written(world)[-5:] == list(range(15, 20))


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Path:
    """A file system of 256 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=256k", "none", str(folder)], capture_output=True, check=False
    )
    if done.returncode:
        pytest.skip("file systems can't be mounted here")
    return folder


async def test_a_full_disk_leaves_nothing_half_written(tiny_disk: Path) -> None:
    try:
        world = ArchiveWorld(tiny_disk / "store")
        segments = [replace(segment, data=b"x" * 40_000) for segment in make_run(12, schema_text=None)]
        for segment in segments:
            world.writer.keep(segment)
        await until_async("it is full", lambda: world.writer.find_trouble() == "no space is left")
        await world.indexer.space.look()
        assert (world.indexer.space.find_trouble() or "").startswith("the disk is nearly full: ")
        for key in world.list_files(".segment"):
            assert (tiny_disk / "store" / key).stat().st_size == 40_000
        whole = lambda: set(world.list_files()) == set(world.list_files(".segment"))  # noqa: E731
        await until_async("nothing half-written is left of an attempt", whole)
        written = read_written(world)
        for key in world.list_files(".segment"):  # somebody makes room
            (tiny_disk / "store" / key).unlink()
        await until_async("it goes on", lambda: world.writer.written > len(written))
        await world.writer.stop(0.05)
    finally:
        subprocess.run(["umount", "-l", str(tiny_disk)], check=True)


async def test_what_is_deleted_does_not_come_back(tmp_path: Path) -> None:
    gone: set[int] = {1}
    gated = GatedStore(tmp_path / "store")

    def is_deleted(segment: KeptSegment) -> bool:
        return segment.name.index in gone

    world = ArchiveWorld(tmp_path / "store", store=gated, is_deleted=is_deleted)
    for segment in make_run(4, schema_text=None):
        world.writer.keep(segment)
    await until_async("all wait", lambda: gated.at_once == 3)
    gone.add(2)  # while it is written
    world.writer.drop_waiting(is_deleted)
    gated.gate.set()
    await world.written()
    await until_async("it is deleted again", lambda: read_written(world) == [0, 3])
    assert world.writer.written == 2
    assert world.writer.dropped == 0


async def test_what_waits_is_written_at_the_end_if_that_is_soon_done(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    for segment in make_run(5):
        world.writer.keep(segment)
    await world.writer.stop()
    assert read_written(world) == list(range(5))
    gated = GatedStore(tmp_path / "other")
    slow = ArchiveWorld(tmp_path / "other", store=gated)
    slow.writer.keep(make_kept(0, PAGE_MS))
    await asyncio.wait_for(slow.writer.stop(0.05), 5)
    assert read_written(slow) == []


async def test_a_view_whose_name_is_ours_has_no_place(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArchiveWorld(tmp_path / "store")
    for n in range(2):
        world.writer.keep(make_kept(n, PAGE_MS, view="models"))
    assert world.writer.waiting_bytes == 0
    assert [record.message for record in caplog.records] == [
        "the archive: r/models: not kept: the archive has a folder of that name"
    ]


async def test_a_mistake_of_ours_ends_one_segment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    write = ArchiveWriter._write

    async def fail(self: ArchiveWriter, segment: KeptSegment) -> None:
        if segment.name.index == 1:
            raise ZeroDivisionError
        await write(self, segment)

    monkeypatch.setattr(ArchiveWriter, "_write", fail)
    world = ArchiveWorld(tmp_path / "store")
    await world.write(*make_run(3))
    assert read_written(world) == [0, 2]
    assert world.writer.dropped == 1
