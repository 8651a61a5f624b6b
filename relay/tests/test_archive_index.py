"""Indexes of an archive: what is recorded, what the segments say, what is found after anything went wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from posecast_relay.archive.index import (
    check_day,
    forget_bytes,
    list_days,
    load_day,
    load_page,
    make_segment_record,
    pack_index,
    unpack_index,
)
from posecast_relay.archive.names import make_day_key, make_index_key, name_segment, read_segment_key
from posecast_relay.core.policy import Audience
from posecast_relay.past.index import DayIndex, digest_page, list_shown, pack_day, sum_minutes, unpack_day
from posecast_relay.past.segment import (
    DAY_MS,
    PAGE_MS,
    KeptSegment,
    PastWord,
    pack_audiences,
    unpack_audiences,
)
from posecast_testing import count_examples
from posecast_wire.messages import RobotStatus
from posecast_wire.segment import SegmentError

from . import past_doors
from .archive_world import ArchiveWorld, make_run
from .past_doors import make_kept

START = past_doors.PAGE_MS
DAY_START = START - START % DAY_MS


def test_what_is_read_from_a_segment_is_what_was_recorded() -> None:
    segment = make_kept(3, START + 1234, missing=0, faults=0)
    found = make_segment_record(name_segment(segment), segment.data)
    assert found == replace(forget_bytes(segment), events=found.events)
    assert [(each.at_ms, each.text) for each in found.events] == [
        (each.at_ms, each.text) for each in segment.events
    ]


def test_bytes_under_the_name_of_another_are_refused() -> None:
    one, other = make_kept(0, START), make_kept(1, START)
    with pytest.raises(SegmentError, match="under the name of another"):
        make_segment_record(name_segment(other), one.data)
    with pytest.raises(SegmentError):
        make_segment_record(name_segment(one), one.data[:-5])


def test_an_index_is_read_as_it_was_written_and_that_of_others_is_refused() -> None:
    segments = [forget_bytes(each) for each in make_run(5)]
    data = pack_index("r", "public", START, segments)
    assert unpack_index("r", "public", START, data) == segments
    for robot, view, page_ms in (
        ("s", "public", START),
        ("r", "all", START),
        ("r", "public", START + PAGE_MS),
    ):
        with pytest.raises(ValueError, match="belongs to another"):
            unpack_index(robot, view, page_ms, data)
    doc = json.loads(data)
    doc["segments"][1]["take"] = "no take"
    doc["segments"][2]["from"] += PAGE_MS
    doc["segments"][2]["to"] += PAGE_MS
    left = unpack_index("r", "public", START, json.dumps(doc).encode())
    assert [each.name.index for each in left] == [0, 3, 4]
    for wrong in (b"", b"[]", b"{}", b"{", b"null", data[:-3], b'{"v":1,"segments":3}'):
        with pytest.raises(ValueError, match=r"index|Expecting|Unterminated|object"):
            unpack_index("r", "public", START, wrong)


AUDIENCES = st.frozensets(st.sampled_from(Audience))


@given(st.lists(st.tuples(st.integers(0, PAGE_MS - 1), AUDIENCES), max_size=30))
@settings(max_examples=count_examples(50), deadline=None)
def test_a_day_is_read_as_it_was_written(found: list[tuple[int, frozenset[Audience]]]) -> None:
    segments = [
        make_small(n, START + at, audiences)
        for n, (at, audiences) in enumerate(found)
    ]  # fmt: skip
    digest = digest_page(START, segments)
    day = DayIndex("r", "public", DAY_START, {START: digest})
    assert unpack_day("r", "public", DAY_START, pack_day(day)) == day
    assert sum(row.segments for row in digest.minutes) == digest.count == len(segments)
    assert sorted(digest.minutes) == sorted(sum_minutes(segments))
    seen = frozenset().union(*(audiences for _, audiences in found)) if found else frozenset()
    assert day.find_models() == ({"ab" * 32: seen} if found else {})
    for span in list_shown(day).spans:
        own = [each for each in segments if each.audiences == span.audiences]
        assert (span.from_ms, span.to_ms) == (min(e.from_ms for e in own), max(e.to_ms for e in own))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([(0, "silent"), (0, "online")], "online"),  # a take before its first frame
        ([(0, "online"), (20_000, "silent"), (26_000, "online")], "online"),  # 6 s are not a minute
        ([(0, "online"), (20_000, "silent"), (50_000, "online")], "silent"),
        (
            [(0, "online"), (10_000, "silent"), (25_000, "online"), (30_000, "silent"), (45_000, "online")],
            "silent",
        ),
        ([(0, "online"), (20_000, "silent")], "silent"),
        ([(0, "online"), (50_000, "silent")], "online"),
        ([(0, "online"), (59_000, "offline")], "offline"),  # and was so until something came again
        ([(0, "online"), (9, "silent"), (9, "offline")], "offline"),
        ([(0, "online"), (10_000, "offline"), (20_000, "online")], "online"),
        ([(56_000, "online"), (60_270, "silent")], "online"),  # in the next minute
        ([(0, "online")], "online"),
        ([], "online"),
    ],
)
def test_a_minute_is_told_as_silent_if_the_robot_was_for_half_of_it(
    words: list[tuple[int, RobotStatus]], told: RobotStatus
) -> None:
    first = START + (words[0][0] if words else 0)
    own = tuple(PastWord(START + at_ms, word) for at_ms, word in words)
    segment = replace(make_small(0, first, frozenset({Audience.ANYONE})), words=own)
    assert [row.word for row in sum_minutes([segment])] == [told]


@pytest.mark.parametrize(("back_s", "told"), [(80, "online"), (105, "silent")])
def test_a_silence_is_of_the_minute_in_which_it_was(back_s: int, told: RobotStatus) -> None:
    """It begins with the end of a segment of the minute before, as a robot's silence does 1.5 s after it."""
    everybody = frozenset({Audience.ANYONE})
    away = (PastWord(START + 56_000, "online"), PastWord(START + 60_270, "silent"))
    again = (PastWord(START + 1000 * back_s, "online"),)
    before = replace(make_small(0, START + 56_000, everybody), words=away)
    after = replace(make_small(1, START + 1000 * back_s, everybody), words=again)
    assert [row.word for row in sum_minutes([before, after])] == ["online", told]


def make_small(index: int, from_ms: int, audiences: frozenset[Audience]) -> KeptSegment:
    """What an index tells of a segment of 9 ms."""
    name = replace(SEGMENT.name, index=index)
    return replace(
        SEGMENT, name=name, from_ms=from_ms, to_ms=from_ms + 9, audiences=audiences, model="ab" * 32
    )


SEGMENT = forget_bytes(make_kept(0, START))


def test_a_day_of_another_or_damaged_is_refused() -> None:
    day = DayIndex("r", "public", DAY_START, {START: digest_page(START, make_run(3))})
    data = pack_day(day)
    for robot, view, day_ms in (("s", "public", DAY_START), ("r", "x", DAY_START), ("r", "public", 0)):
        with pytest.raises(ValueError, match="day: belongs to another"):
            unpack_day(robot, view, day_ms, data)
    doc = json.loads(data)
    page = doc["pages"][0]
    for change in (
        {"at_ms": START + 1},
        {"at_ms": START + DAY_MS},
        {"count": -1},
        {"takes": [["x", 0, 1]]},
        {"takes": 3},
        {"minutes": [[0, "als", 1, 1, 1, "dead", 0, 0, 0]]},
        {"minutes": [[0, "xa", 1, 1, 1, "online", 0, 0, 0]]},
        {"minutes": [[0, "", 1, 1, 1, "online", 0, 0, 0]]},
        {"minutes": [[10, "a", 1, 1, 1, "online", 0, 0, 0]]},
        {"minutes": [[0, "a", 1, 1, 1, "online", 0, 5, 4]]},
        {"schemas": [["no hash", "a", 0, 1]]},
    ):
        with pytest.raises(ValueError, match=r"^day: |^invalid audiences"):
            unpack_day("r", "public", DAY_START, json.dumps(doc | {"pages": [page | change]}).encode())


def test_letters() -> None:
    assert pack_audiences([]) == "x"
    assert unpack_audiences("x") == frozenset()
    for text in ("", "b", "aa", "sl", "ax"):
        with pytest.raises(ValueError, match="audiences"):
            unpack_audiences(text)


async def test_indexes_are_written_when_ten_minutes_are_over_and_at_the_end(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    segments = make_run(200)  # thirteen minutes
    await world.indexer.do_due()  # there is nothing to look through
    await world.write(*segments)
    await world.indexer.do_due()
    assert world.list_files("index.json") == [make_index_key("r", "public", START)]
    await world.index()
    assert world.list_files("index.json") == [
        make_index_key("r", "public", START),
        make_index_key("r", "public", START + PAGE_MS),
    ]
    page = await load_page(world.store, "r", "public", START)
    assert page.is_indexed
    assert page.segments == tuple(forget_bytes(each) for each in segments[:150])
    day = await load_day(world.store, "r", "public", DAY_START)
    assert day.is_written
    assert day.day.bytes == sum(each.size for each in segments) == world.indexer.stored_bytes
    assert await check_day(world.store, "r", "public", DAY_START) == []


async def test_ten_minutes_in_which_the_robot_went_silent_are_over_too(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    await world.indexer.do_due()
    await world.write(*make_run(5))
    await world.indexer.do_due()
    assert world.list_files("index.json") == []
    world.unix_ms += PAGE_MS + 20_000
    world.indexer._ended_at = float("-inf")
    await world.indexer.do_due()
    assert len(world.list_files("index.json")) == 1


def delete_index(world: ArchiveWorld) -> None:
    (world.folder / make_index_key("r", "public", START)).unlink()


def damage_index(world: ArchiveWorld) -> None:
    (world.folder / make_index_key("r", "public", START)).write_bytes(b'{"v":1,"robot":"r"')


def swap_index(world: ArchiveWorld) -> None:
    other = [forget_bytes(each) for each in make_run(3, robot="s")]
    path = world.folder / make_index_key("r", "public", START)
    path.write_bytes(pack_index("s", "public", START, other))


def delete_day(world: ArchiveWorld) -> None:
    (world.folder / make_day_key("r", "public", START)).unlink()


def empty_day(world: ArchiveWorld) -> None:
    path = world.folder / make_day_key("r", "public", START)
    path.write_bytes(pack_day(DayIndex("r", "public", DAY_START)))


def delete_segments(world: ArchiveWorld) -> None:
    for key in world.list_files(".segment")[10:20]:
        (world.folder / key).unlink()


def delete_all(world: ArchiveWorld) -> None:
    for key in world.list_files(".segment"):
        (world.folder / key).unlink()


def damage_segment(world: ArchiveWorld) -> None:
    delete_index(world)
    path = world.folder / world.list_files(".segment")[7]
    path.write_bytes(path.read_bytes()[:-1] + b"x")


def cut_segment(world: ArchiveWorld) -> None:
    path = world.folder / world.list_files(".segment")[7]
    path.write_bytes(path.read_bytes()[:100])


def put_foreign(world: ArchiveWorld) -> None:
    folder = (world.folder / make_index_key("r", "public", START)).parent
    (folder / "notes.txt").write_text("mine")
    (folder / "0-1-x.segment").write_text("mine")
    (folder.parent / "25-00").mkdir()
    (folder.parent.parent / "2026-99-99").mkdir()
    (folder.parent.parent / "README").write_text("mine")


@pytest.mark.parametrize(
    "harm",
    [delete_index, damage_index, swap_index, delete_day, empty_day, delete_segments, delete_all,
     damage_segment, cut_segment, put_foreign],
)  # fmt: skip
async def test_whatever_happens_to_the_indexes_the_past_is_the_segments(
    tmp_path: Path, harm: Callable[[ArchiveWorld], None]
) -> None:
    world = ArchiveWorld(tmp_path / "store")
    await world.write(*make_run(60))
    await world.index()
    harm(world)
    foreign = {key for key in world.list_files() if key.endswith(("notes.txt", "x.segment", "README"))}
    there = [name for key in world.list_files(".segment") if (name := read_segment_key(key)) is not None]
    readable = [
        name.name.index
        for name in there
        if (data := (world.folder / name.key).read_bytes()) and len(data) == name.size and data[-1:] != b"x"
    ]
    page = await world.make_reader().load_page("r", "public", START)  # at once, without any index
    assert [each.name.index for each in page] == sorted(readable)
    day = await world.make_reader().load_day("r", "public", DAY_START)
    if harm not in (delete_segments, cut_segment, delete_all, damage_segment):  # there it has to be mended
        assert [row.segments for row in day.list_minutes()] == [r.segments for r in sum_minutes(page)]
    fresh = ArchiveWorld(world.folder)
    fresh.unix_ms = START + PAGE_MS + 70_000
    await fresh.indexer.walk_all()
    await fresh.make_reader().load_page("r", "public", START)  # who reads sees what is in an index
    await fresh.index()
    if harm is not damage_segment:
        assert await check_day(fresh.store, "r", "public", DAY_START) == []
    loaded = await load_page(fresh.store, "r", "public", START)
    assert loaded.is_indexed is bool(readable)
    if readable:
        data = (world.folder / make_index_key("r", "public", START)).read_bytes()
        named = [each.name for each in unpack_index("r", "public", START, data)]
        assert named == [each.name for each in loaded.segments], "and nothing of what is gone"
    day = (await load_day(fresh.store, "r", "public", DAY_START)).day
    assert list(day.list_minutes()) == sum_minutes(loaded.segments)
    assert foreign <= set(fresh.list_files())


async def test_ten_thousand_foreign_files_harm_nothing(tmp_path: Path) -> None:
    world = ArchiveWorld(tmp_path / "store")
    await world.write(*make_run(3))
    folder = (world.folder / make_index_key("r", "public", START)).parent
    for n in range(10_000):
        (folder / f"{n}.jpg").touch()
    await world.index()
    page = await world.make_reader().load_page("r", "public", START)
    assert [each.name.index for each in page] == [0, 1, 2]


async def test_two_that_write_one_robot_lose_nothing_of_each_other(tmp_path: Path) -> None:
    one, two = ArchiveWorld(tmp_path / "store"), ArchiveWorld(tmp_path / "store")
    await one.write(*make_run(20))
    await two.write(*make_run(20, START + 2000, take=0xB))
    await one.index()
    await two.index()
    page = await load_page(one.store, "r", "public", START)
    assert page.is_indexed
    assert len(page.segments) == 40
    assert (await load_day(one.store, "r", "public", DAY_START)).day.pages[START].count == 40
    assert await list_days(one.store, "r", "public") == [DAY_START]


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
