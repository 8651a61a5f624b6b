"""The routes of the past over an archive: what they answer, to whom, and what when the store is away."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.archive.joined import JoinedPast
from posecast_relay.archive.store import ObjectStore
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past import routes
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.segment import DAY_MS

from . import past_doors
from .archive_world import ArchiveWorld, break_store, make_run
from .past_doors import DAY, PAGE, SCHEMA_HASH, PastDoors, address_of, link, make_kept

START = past_doors.PAGE_MS
MONTH_S = 30 * 86400.0
OPEN = Rule(past_s=MONTH_S)
RULES = {"r": {Audience.ANYONE: OPEN, Audience.SIGNED_IN: OPEN, Audience.LINK: OPEN}}
NEXT_PAGE = "2026-11-18T11:30Z"
PATHS = (
    *("", "?view=public", f"public/{DAY}", "public/2026-11-19", f"public/{PAGE}", f"public/{NEXT_PAGE}"),
    *(f"public/{PAGE}?after={10:016x},7", f"public/{PAGE}/keys", f"public/{PAGE}/keys?every=7"),
    *(f"public/schema/{SCHEMA_HASH.hex()}", f"public/schema/{'0' * 64}"),
    *(f"public/{10:016x}/0", f"public/{10:016x}/149", f"public/{10:016x}/150", f"public/{10:016x}/170"),
    *(f"public/{10:016x}/199", f"public/{9:016x}/0", f"public/{11:016x}/3"),
)


@pytest.fixture(autouse=True)
def short_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """No test here waits for what does not come."""
    monkeypatch.setattr(routes, "HOLD_S", 0.05)


@pytest.fixture
async def world(tmp_path: Path) -> ArchiveWorld:
    """Thirteen minutes of a robot, and some of them not for everybody."""
    found = ArchiveWorld(tmp_path / "store")
    await found.write(*make_segments())
    await found.index()
    found.unix_ms = START + DAY_MS
    return found


def make_segments() -> list[Any]:
    segments = make_run(200)
    hidden = frozenset({Audience.SIGNED_IN})
    segments[20:40] = [replace(each, audiences=hidden) for each in segments[20:40]]
    segments[170] = replace(segments[170], audiences=hidden)
    return segments + [make_kept(n, START + 900_000 + 4000 * n, take=0xB) for n in range(3)]


def remember(segments: list[Any]) -> MemoryPast:
    """A memory that has these."""
    past = MemoryPast(1 << 26)
    for segment in segments:
        past.add(segment, 0.0)
    return past


@pytest.fixture
async def memory(world: ArchiveWorld) -> AsyncIterator[PastDoors]:
    """A process that has all in memory."""
    async with PastDoors(RULES, MemoryPastSource(remember(make_segments()))) as found:
        found.unix_ms = world.unix_ms
        yield found


@pytest.fixture
async def archive(world: ArchiveWorld) -> AsyncIterator[PastDoors]:
    """A process that has just begun over an archive."""
    async with world.make_doors(RULES) as found:
        yield found


@pytest.mark.parametrize("token", [None, "somebody", "link"])
async def test_an_archive_answers_as_memory_does(
    memory: PastDoors, archive: PastDoors, token: str | None
) -> None:
    shown = link("r") if token == "link" else token
    for path in PATHS:
        want = await memory.ask(path, shown)
        got = await archive.ask(path, shown)
        assert got.status_code == want.status_code, (path, got.text)
        if got.status_code == 200 and path.partition("?")[0] == f"public/{PAGE}":
            assert got.json() == want.json()
        assert got.content == want.content, path
        assert got.headers.get("cache-control") == want.headers.get("cache-control"), path
        assert got.headers.get("etag") == want.headers.get("etag"), path


async def test_what_an_audience_could_not_see_live_it_never_sees(archive: PastDoors) -> None:
    page = (await archive.ask(f"public/{PAGE}")).json()["segments"]
    assert [each["index"] for each in page] == [*range(20), *range(40, 150)]
    mine = (await archive.ask(f"public/{PAGE}", "somebody")).json()["segments"]
    assert len(mine) == 150
    assert (await archive.ask(f"public/{10:016x}/25")).json() == {"next": {"take": f"{10:016x}", "index": 40}}
    day = (await archive.ask(f"public/{DAY}")).json()["minutes"]
    whole = (await archive.ask(f"public/{DAY}", "somebody")).json()["minutes"]
    assert sum(each["frames"] for each in whole) - sum(each["frames"] for each in day) == 21


async def test_rules_that_are_taken_back_close_it_at_once(archive: PastDoors) -> None:
    assert (await archive.ask(f"public/{10:016x}/3")).status_code == 200
    for rule in (Rule(blackout=True, past_s=MONTH_S), Rule(past_s=0.0), Rule(past_s=3600.0), Rule("other")):
        archive.allow({"r": {Audience.ANYONE: rule}})
        for path in (f"public/{10:016x}/3", f"public/schema/{SCHEMA_HASH.hex()}"):
            assert (await archive.ask(path)).status_code in (403, 404), rule
        for path in (f"public/{DAY}", f"public/{PAGE}"):
            answer = await archive.ask(path)
            assert answer.status_code != 200 or not (
                answer.json().get("minutes") or answer.json().get("segments")
            )
    archive.allow(RULES)
    assert (await archive.ask(f"public/{10:016x}/3")).status_code == 200


async def test_what_is_recent_and_what_is_older_are_one_past(world: ArchiveWorld, memory: PastDoors) -> None:
    recent = MemoryPastSource(remember(make_segments()[100:]))
    async with world.make_doors(RULES, recent) as joined:
        for path in PATHS:
            want, got = await memory.ask(path), await joined.ask(path)
            assert (got.status_code, got.content) == (want.status_code, want.content), path


async def test_while_the_store_is_away_what_is_in_memory_is_served(world: ArchiveWorld) -> None:
    async with world.make_doors(RULES, MemoryPastSource(remember(make_segments()[100:]))) as joined:
        world.folder.rename(world.folder.with_name("elsewhere"))
        world.folder.write_text("no folder")
        for path in ("", f"public/{DAY}", f"public/{NEXT_PAGE}", f"public/{10:016x}/150"):
            answer = await joined.ask(path)
            assert answer.status_code == 200, (path, answer.text)
        page = await joined.ask(f"public/{PAGE}")
        assert [each["index"] for each in page.json()["segments"]] == list(range(100, 150))
        assert page.headers["cache-control"] == "public, max-age=1"  # there may be more
        joined.now += 2
        for path in ("public/2026-11-17", f"public/{10:016x}/3"):
            answer = await joined.ask(path)
            assert answer.status_code == 503, path
            assert answer.headers["retry-after"] == "1"
            assert answer.json()["error"].endswith("retry")
        ready = (await joined.ask_ready()).json()
        assert ready["status"] == "degraded"
        assert ready["why"].startswith("the past: the archive: ")
        assert str(world.folder) not in ready["why"]


async def test_a_segment_that_is_damaged_or_gone_is_not_found(world: ArchiveWorld) -> None:
    async with world.make_doors(RULES) as doors:
        assert (await doors.ask(f"public/{PAGE}")).status_code == 200
        keys = world.list_files(".segment")
        (world.folder / keys[5]).unlink()
        path = world.folder / keys[6]
        path.write_bytes(b"\0" * path.stat().st_size)
        for index in (5, 6):
            assert (await doors.ask(f"public/{10:016x}/{index}")).status_code == 404
        assert (await doors.ask(f"public/{10:016x}/7")).status_code == 200


async def test_many_who_ask_for_the_same_cost_one_read(
    world: ArchiveWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    reads: list[str] = []
    get = ObjectStore.get

    async def count(self: ObjectStore, key: str) -> bytes | None:
        reads.append(key)
        return await get(self, key)

    monkeypatch.setattr(ObjectStore, "get", count)
    async with world.make_doors(RULES) as doors:
        answers = await asyncio.gather(*(doors.ask(f"public/{10:016x}/3") for _ in range(50)))
        assert {answer.status_code for answer in answers} == {200}
        assert len(reads) == len(set(reads)) + sum(key.endswith("day.json") for key in reads) - 1
        assert sum(key.endswith(".segment") for key in reads) == 1


async def test_a_robot_that_was_long_gone_is_found_by_its_past(world: ArchiveWorld) -> None:
    rules = {"gone": {Audience.ANYONE: OPEN}}
    segment = make_kept(0, START, robot="gone")
    world.keep({"gone": MONTH_S})
    await world.write(segment)
    await world.index()
    async with world.make_doors(rules) as doors:
        answer = await doors.ask("/gone/past")
        assert answer.status_code == 200
        assert answer.json()["days"] == [DAY]
        assert (await doors.ask(f"/gone/past/{address_of(segment)}")).content == segment.data
        doors.allow({"gone": {Audience.ANYONE: OPEN}, "never": {Audience.ANYONE: OPEN}})
        assert (await doors.ask("/never/past")).status_code == 404


async def test_a_store_that_was_away_is_read_again(world: ArchiveWorld) -> None:
    async with world.make_doors(RULES) as doors:
        mend = break_store(world.folder)
        assert isinstance(doors.source, JoinedPast)
        reader = doors.source._reader
        for _ in range(3):  # a crowd does not ask a store that is away again and again
            for _ in range(20):
                assert (await doors.ask(f"public/{PAGE}")).status_code == 503
            world.now += 0.1
        assert reader.failures == 1
        mend()
        world.now += 2.0
        assert (await doors.ask(f"public/{PAGE}")).status_code == 200
        assert reader.find_trouble() is None
