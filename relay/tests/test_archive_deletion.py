"""What was deleted leaves an object store, with the indexes, schemas and models of it, whoever is killed."""

from __future__ import annotations

import asyncio
import dataclasses
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.archive.deletion import (
    CLOCKS_APART_MS,
    KEPT_MS,
    SETTLED_MS,
    Erased,
    NamedHashes,
    TombstoneFollower,
    erase,
    get_tombstone,
    list_tombstones,
    make_stem,
    put_tombstone,
    remove_tombstone,
    sweep_unnamed,
)
from posecast_relay.archive.index import check_day, load_day
from posecast_relay.archive.names import name_segment, read_segment_key
from posecast_relay.archive.store import ArchiveAway, ObjectStore, open_object_store
from posecast_relay.past.deletions import Deletion, Deletions, pack_deletion
from posecast_relay.past.segment import DAY_MS
from posecast_relay.past_command.deletion import make_deletion
from posecast_wire.segment import decode_segment, encode_segment

from .archive_world import ArchiveWorld, GatedStore, make_run
from .past_doors import PAGE_MS, SCHEMA, make_kept

MINUTE_MS, HOUR_MS = 60_000, 3_600_000
NOW_MS = PAGE_MS + 3 * HOUR_MS
SPAN = PAGE_MS + HOUR_MS, PAGE_MS + 2 * HOUR_MS
NOTHING = NamedHashes(frozenset(), frozenset())


def order(from_ms: int = SPAN[0], to_ms: int = SPAN[1], view: str | None = None) -> Deletion:
    """A deletion of an hour, unless said otherwise."""
    return make_deletion("r", view, from_ms, to_ms, NOW_MS)


async def fill(world: ArchiveWorld) -> None:
    """Three hours of a robot in two views, an hour of another, indexes, and what is not ours."""
    for view in ("public", "staff"):
        await world.write(*make_run(18, PAGE_MS, 10 * MINUTE_MS, view=view))
    await world.write(*make_run(12, SPAN[0], 5 * MINUTE_MS, robot="q"))
    world.unix_ms = NOW_MS
    await world.index()
    foreign = next(world.folder.glob("r/public/*/*")) / "notes.txt"
    foreign.write_text("mine")


def list_covered(world: ArchiveWorld, deletion: Deletion) -> list[str]:
    """The files of segments that should be gone."""
    names = ((file, read_segment_key(file)) for file in world.list_files(".segment"))
    return [
        file
        for file, name in names
        if name and deletion.covers(name.name.robot, name.name.view, name.from_ms, name.to_ms)
    ]


async def assert_whole(world: ArchiveWorld, deletion: Deletion, before: set[str]) -> None:
    """Only what is covered is gone, and the indexes say so."""
    after = set(world.list_files(".segment"))
    assert after == {file for file in before if file not in set(list_covered_names(before, deletion))}
    assert world.list_files("notes.txt")
    for view in ("public", "staff"):
        for day_ms in {PAGE_MS // DAY_MS * DAY_MS, NOW_MS // DAY_MS * DAY_MS}:
            assert await check_day(world.store, "r", view, day_ms) == []
            day = (await load_day(world.store, "r", view, day_ms)).day
            of_view = [file for file in after if file.startswith(f"r/{view}/")]
            assert sum(page.count for page in day.pages.values()) == len(of_view)
    for index in world.list_files("index.json"):
        if index.startswith("r/"):
            for record in json.loads((world.folder / index).read_bytes())["segments"]:
                assert not deletion.covers("r", index.split("/")[1], record["from"], record["to"])


def list_covered_names(files: set[str], deletion: Deletion) -> Iterator[str]:
    """Those of these files that are covered."""
    for file in files:
        name = read_segment_key(file)
        if name and deletion.covers(name.name.robot, name.name.view, name.from_ms, name.to_ms):
            yield file


async def test_an_hour_is_deleted_and_everything_else_stays(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path, ("r", "q"))
    await fill(world)
    before, said = set(world.list_files(".segment")), list[Erased]()
    only = order(view="staff")
    covered = list_covered(world, only)
    assert len(covered) == 6
    erased = await erase(world.store, only, said.append)
    assert erased == said[-1]
    assert erased.segments == 6
    await assert_whole(world, only, before)
    assert (await erase(world.store, only)).segments == 0  # twice does no harm
    both = order()
    assert (await erase(world.store, both)).segments == 6
    await assert_whole(world, both, before)
    everything = order(0, NOW_MS)
    await erase(world.store, everything)
    left = [file for file in world.list_files() if file.startswith("r/") and "schemas" not in file]
    assert [file.rpartition("/")[2] for file in left] == ["notes.txt"]
    assert len([file for file in world.list_files(".segment") if file.startswith("q/")]) == 12


class MortalStore(ObjectStore):
    """A store whose user dies at a call that changes something."""

    def __init__(self, folder: Path, dies_at: int) -> None:
        under = open_object_store(f"file://{folder}")
        super().__init__(under._store, folder=folder)
        self.left = dies_at

    def _count(self) -> None:
        self.left -= 1
        if self.left < 0:
            raise ArchiveAway("killed")

    async def put(self, key: str, data: bytes) -> None:
        """Write, while alive."""
        self._count()
        await super().put(key, data)

    async def delete(self, key: str) -> None:
        """Delete, while alive."""
        self._count()
        await super().delete(key)


async def test_whoever_is_killed_in_the_middle_of_it_the_next_start_finishes_it(tmp_path: Path) -> None:
    deletion = order(SPAN[0] + 25 * MINUTE_MS, SPAN[0] + 55 * MINUTE_MS)
    steps, is_done = 0, False
    while not is_done:
        folder = tmp_path / str(steps)
        folder.mkdir()
        world = ArchiveWorld(folder, ("r", "q"))
        await fill(world)
        before = set(world.list_files(".segment"))
        await put_tombstone(world.store, deletion)
        try:
            await erase(MortalStore(folder, steps), deletion)
            is_done = True
        except ArchiveAway:
            pass
        deletions = Deletions()
        follower = TombstoneFollower(world.store, deletions, lambda: NOW_MS, erases=True)
        await look(follower)
        assert deletions.has(deletion.id)
        await assert_whole(world, deletion, before)
        steps += 1
    assert steps > 8  # index, segments, index and day anew, in each of three ten minutes


async def look(follower: TombstoneFollower) -> None:
    """One look, and what comes of it."""
    await follower.look()
    if follower._erasing is not None:
        await follower._erasing


async def test_what_comes_later_is_deleted_too_until_it_is_settled(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    deletion = order()
    await put_tombstone(world.store, deletion)
    at_ms = NOW_MS
    follower = TombstoneFollower(world.store, Deletions(), lambda: at_ms, erases=True)
    await look(follower)
    late = make_kept(0, SPAN[0])
    await world.write(late)  # by a process that did not know yet
    assert world.list_files(".segment")
    at_ms += SETTLED_MS
    await look(follower)
    assert world.list_files(".segment") == []
    stem = make_stem(deletion)
    assert (await list_tombstones(world.store)).done == {stem}
    await look(follower)
    at_ms += KEPT_MS + 1
    await look(follower)
    assert world.list_files() == [f for f in world.list_files() if f.startswith("r/schemas/")]


@pytest.mark.parametrize("ahead_ms", [CLOCKS_APART_MS + 1, 90_000, DAY_MS])
async def test_what_is_ordered_by_a_clock_ahead_deletes_nothing_to_come_and_is_obeyed_when_it_has_come(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, ahead_ms: int
) -> None:
    world = ArchiveWorld(tmp_path)
    kept = make_kept(0, SPAN[0])
    await world.write(kept)
    late = dataclasses.replace(order(), to_ms=NOW_MS + ahead_ms, at_ms=NOW_MS + ahead_ms)
    await put_tombstone(world.store, late)
    now_ms = NOW_MS
    deletions = Deletions()
    follower = TombstoneFollower(world.store, deletions, lambda: now_ms, erases=True)
    for _ in range(3):
        await look(follower)
    assert deletions.count == 0
    assert world.list_files(".segment")
    for now_ms in (late.to_ms - CLOCKS_APART_MS - 1, late.to_ms - CLOCKS_APART_MS, late.to_ms + SETTLED_MS):
        await look(follower)
        assert deletions.cover_segment(kept) == (now_ms >= late.to_ms - CLOCKS_APART_MS)
        assert bool(world.list_files(".segment")) != deletions.cover_segment(kept)
    assert deletions.count == 1
    assert (await list_tombstones(world.store)).done == {make_stem(late)}
    assert caplog.text.count("its end is in the future by this machine's clock") == 1


async def test_a_span_that_is_over_is_deleted_at_once_whatever_the_clock_that_ordered_it(
    tmp_path: Path,
) -> None:
    world = ArchiveWorld(tmp_path)
    await world.write(make_kept(0, SPAN[0]))
    await put_tombstone(world.store, dataclasses.replace(order(), at_ms=NOW_MS + DAY_MS))
    deletions = Deletions()
    await look(TombstoneFollower(world.store, deletions, lambda: NOW_MS, erases=True))
    assert deletions.count == 1
    assert world.list_files(".segment") == []


async def test_a_postponed_deletion_that_is_withdrawn_is_forgotten(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    late = dataclasses.replace(order(), to_ms=NOW_MS + DAY_MS, at_ms=NOW_MS + DAY_MS)
    await put_tombstone(world.store, late)
    now_ms = NOW_MS
    deletions = Deletions()
    follower = TombstoneFollower(world.store, deletions, lambda: now_ms, erases=True)
    await look(follower)
    await remove_tombstone(world.store, make_stem(late))
    now_ms += 2 * DAY_MS
    await look(follower)
    assert deletions.count == 0


async def test_a_gateway_only_reads(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    await world.write(make_kept(0, SPAN[0]))
    await put_tombstone(world.store, order())
    files, deletions = world.list_files(), Deletions()
    await look(TombstoneFollower(world.store, deletions, lambda: NOW_MS + KEPT_MS, erases=False))
    assert deletions.count == 1
    assert world.list_files() == files


async def test_tombstones_of_strangers_are_passed_over(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    world = ArchiveWorld(tmp_path)
    good, lying = order(), order()
    folder = tmp_path / "tombstones" / "r"
    folder.mkdir(parents=True)
    stem = f"{NOW_MS}-{'0' * 16}"
    (folder / f"{stem}.json").write_bytes(pack_deletion(lying))  # under another one's name
    (folder / "notes.json").write_text("mine")
    (folder / f"{NOW_MS}-{'1' * 16}.json").write_text("")
    (folder / f"{NOW_MS}-{'2' * 16}.json").write_bytes(b" " * 100_000)
    (folder / f"{NOW_MS}-{'3' * 16}.json").write_bytes(b"\xff{")
    await put_tombstone(world.store, good)
    deletions = Deletions()
    follower = TombstoneFollower(world.store, deletions, lambda: NOW_MS, erases=True)
    for _ in range(3):
        await look(follower)
    assert deletions.has(good.id)
    assert deletions.count == 1
    assert caplog.text.count("tombstones: skipped") == 2  # once each
    assert (folder / "notes.json").read_text() == "mine"
    assert await get_tombstone(world.store, make_stem(good)) == good


async def test_schemas_and_models_go_with_the_last_segment_that_names_them(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path)
    old, new = "a" * 64, "b" * 64
    await world.write(*make_run(2, PAGE_MS, model=old), *make_run(2, SPAN[0], take=2, model=new))
    other = "another text"
    sha256 = hashlib.sha256(other.encode()).digest()
    await world.write(make_kept(9, SPAN[0] + MINUTE_MS, schema=sha256, schema_text=other, model=new))
    await world.index()
    for digest in (old, new):
        for path in ("manifest.json", "meshes/arm.glb"):
            await world.store.put(f"r/models/{digest}/{path}", b"x")
    await world.store.put("r/models/mine.txt", b"x")
    assert await sweep(world) == NOTHING
    await erase(world.store, order())
    in_use = NamedHashes(frozenset({sha256.hex()}), frozenset({new}))
    assert await sweep(world, in_use) == NOTHING  # more of it is on its way
    assert await sweep(world) == in_use
    assert {f for f in world.list_files() if "/models/" in f} == {
        *(f"r/models/{old}/manifest.json", f"r/models/{old}/meshes/arm.glb"),
        "r/models/mine.txt",
    }
    own = hashlib.sha256(SCHEMA.text.encode()).hexdigest()
    assert [f for f in world.list_files() if "/schemas/" in f] == [f"r/schemas/{own}.json"]
    # a summary that is older than the segments does not count
    plain = make_kept(3, PAGE_MS + 30_000)
    segment = decode_segment(plain.data)
    start = dataclasses.replace(segment.start, schema=sha256.hex())
    data = encode_segment(dataclasses.replace(segment, start=start))
    await world.write(dataclasses.replace(plain, data=data, schema=sha256, schema_text=other))
    await world.store.put(f"r/schemas/{sha256.hex()}.json", other.encode())
    assert await sweep(world) == NOTHING
    await erase(world.store, order(0, NOW_MS))
    assert (await sweep(world)).models == {old}
    assert [f for f in world.list_files() if not f.endswith("mine.txt")] == []


async def sweep(world: ArchiveWorld, in_use: NamedHashes = NOTHING) -> NamedHashes:
    """What is swept of `r`."""
    return await sweep_unnamed(world.store, "r", lambda _robot: in_use, NOW_MS)


async def test_what_waits_and_what_is_being_put_is_not_there_later(tmp_path: Path) -> None:
    deletions = Deletions()
    gated = GatedStore(tmp_path)
    world = ArchiveWorld(tmp_path, store=gated, is_deleted=deletions.cover_segment)
    deletions.on_added(lambda each: world.writer.drop_waiting(each.covers_segment))
    stays = make_kept(50, SPAN[1] + MINUTE_MS)
    for segment in (*make_run(10, SPAN[0]), stays):
        world.writer.keep(segment)
    while not gated.at_once:
        await asyncio.sleep(0.005)
    deletions.add(order())
    gated.gate.set()
    await world.written()
    late = make_kept(51, SPAN[1] + 2 * MINUTE_MS)
    await world.write(late)
    pages = world.writer.list_open_pages()
    assert any(late.name == known.name for page in pages for known in world.writer.find_known(page))
    deletions.add(order(late.from_ms, late.to_ms))
    assert not any(late.name == known.name for page in pages for known in world.writer.find_known(page))
    await world.store.delete(name_segment(late).key)
    names: list[Any] = [read_segment_key(file) for file in world.list_files(".segment")]
    assert [name.name for name in names] == [stays.name]
