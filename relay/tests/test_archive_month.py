"""A month of one robot in an archive: any minute of it is opened with few requests and little to load."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path

import pytest
from posecast_relay.archive import reader
from posecast_relay.archive.index import make_segment_record, mend_day, mend_page
from posecast_relay.archive.names import make_day_key, make_page_folder, name_segment
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past.address import write_day, write_minute
from posecast_relay.past.index import DayIndex, PageDigest, digest_page, pack_day
from posecast_relay.past.segment import DAY_MS, PAGE_MS, KeptSegment, TakeSpan
from posecast_wire.segment import EventRecord, Record, Segment, decode_segment, encode_segment

from . import past_doors
from .archive_world import ArchiveWorld

DEMO = Path(__file__).parents[2] / "wire" / "vectors" / "segments"
SCHEMA = (DEMO / "schema.json").read_text()
MONTH_DAYS = 30
END = past_doors.PAGE_MS - past_doors.PAGE_MS % DAY_MS
BEGIN = END - MONTH_DAYS * DAY_MS
STEP_MS = 4000
OPENED = [BEGIN + 3 * PAGE_MS, BEGIN + 14 * DAY_MS + 85 * PAGE_MS, END - PAGE_MS]


def make_demo(index: int, from_ms: int) -> KeptSegment:
    """Four seconds of the demo robot as it was recorded once, at another time; each fifth with an event."""
    recorded = decode_segment((DEMO / "key.pcs").read_bytes())
    start = replace(recorded.start, robot="r", view="public", take=0xA, index=index, from_ms=from_ms)
    event = json.dumps(
        {"type": "event", "level": "fault", "text": "right knee: over current", "n": index + 1}
    )
    records: tuple[Record, ...] = tuple(
        each for each in recorded.records if not isinstance(each, EventRecord)
    )
    if index % 5 == 0:
        records += (EventRecord(records[-1].at_us, event),)
    data = encode_segment(Segment(start, from_ms + STEP_MS, records))
    blank = past_doors.make_kept(index, from_ms, data=data, audiences=frozenset({Audience.ANYONE}))
    found = make_segment_record(name_segment(blank), data)
    return replace(found, data=data, elsewhere_bytes=0, schema_text=SCHEMA)


def move(digest: PageDigest, by_ms: int) -> PageDigest:
    """The same ten minutes at another time."""
    count, steps = digest.count, by_ms // PAGE_MS
    spans = [each._replace(from_ms=each.from_ms + by_ms, to_ms=each.to_ms + by_ms) for each in digest.schemas]
    return PageDigest(
        digest.at_ms + by_ms,
        count,
        digest.bytes,
        (TakeSpan(0xA, steps * count, steps * count + count - 1),),
        tuple(
            row._replace(at_ms=row.at_ms + by_ms, from_ms=row.from_ms + by_ms, to_ms=row.to_ms + by_ms)
            for row in digest.minutes
        ),
        tuple(spans),
        (),
    )


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine takes longer to read than a relay waits; requests and bytes are what is counted here."""
    monkeypatch.setattr(reader, "ASKED_S", 60.0)


@pytest.fixture(scope="module")
def month(tmp_path_factory: pytest.TempPathFactory) -> ArchiveWorld:
    """Days by their summaries and folders; of three ten minutes also the segments."""
    return asyncio.run(make_month(tmp_path_factory.mktemp("month") / "store"))


async def make_month(folder: Path) -> ArchiveWorld:
    world = ArchiveWorld(folder)
    per_page = PAGE_MS // STEP_MS
    digest = digest_page(BEGIN, [make_demo(n, BEGIN + n * STEP_MS) for n in range(per_page)])
    for day in range(MONTH_DAYS):
        day_ms = BEGIN + day * DAY_MS
        pages = [move(digest, day_ms - BEGIN + n * PAGE_MS) for n in range(DAY_MS // PAGE_MS)]
        for page in pages:
            (world.folder / make_page_folder("r", "public", page.at_ms)).mkdir(parents=True)
        summary = DayIndex("r", "public", day_ms, {page.at_ms: page for page in pages})
        (world.folder / make_day_key("r", "public", day_ms)).write_bytes(pack_day(summary))
    for page_ms in OPENED:
        first = (page_ms - BEGIN) // STEP_MS
        for n in range(per_page):
            segment = make_demo(first + n, page_ms + n * STEP_MS)
            (world.folder / name_segment(segment).key).write_bytes(segment.data)
        made = await mend_page(world.store, "r", "public", page_ms)
        await mend_day(world.store, "r", "public", page_ms - page_ms % DAY_MS, {page_ms: made})
    await world.write(make_demo(0, END))
    await world.index()
    world.unix_ms = END + PAGE_MS
    return world


RULES = {"r": {Audience.ANYONE: Rule(past_s=(MONTH_DAYS + 2) * 86400.0)}}


@pytest.mark.parametrize("page_ms", OPENED)
async def test_any_minute_opens_with_few_requests_and_little_to_load(
    month: ArchiveWorld, page_ms: int
) -> None:
    async with month.make_doors(RULES) as doors:
        page = write_minute(page_ms)
        summary = await doors.ask("")
        assert len(summary.json()["days"]) == MONTH_DAYS + 1
        assert summary.json()["from_ms"] == BEGIN
        assert summary.json()["newest"] == {"take": f"{10:016x}", "index": 0}
        day = await doors.ask(f"public/{write_day(page_ms)}")
        assert len(day.json()["minutes"]) == 1440
        index = await doors.ask(f"public/{page}")
        segments = index.json()["segments"]
        assert len(segments) == PAGE_MS // STEP_MS
        keys = await doors.ask(f"public/{page}/keys")
        schema = await doors.ask(f"public/schema/{segments[77]['schema']}")
        answers = [summary, day, index, keys, schema]
        assert {answer.status_code for answer in answers} == {200}
        sizes = [len(answer.content) for answer in answers]
        print(f"month: {len(answers)} requests, {sum(sizes)} bytes before the segment: {sizes}")
        assert len(answers) <= 6
        assert sum(sizes) <= 300_000
        found = segments[77]
        segment = await doors.ask(f"public/{found['take']}/{found['index']}")
        assert segment.status_code == 200
        assert decode_segment(segment.content).start.from_ms == found["from_ms"]


async def test_a_link_to_a_segment_is_found_in_a_month(month: ArchiveWorld) -> None:
    """A cold process is asked for a segment, and for nothing before."""
    async with month.make_doors(RULES) as doors:
        first = (OPENED[1] - BEGIN) // STEP_MS
        assert (await doors.ask(f"public/{10:016x}/{first + 20}")).status_code == 200
        assert (await doors.ask(f"public/{11:016x}/{first + 20}")).status_code == 404


async def test_what_is_known_of_a_month_is_bounded(month: ArchiveWorld) -> None:
    reaches = await month.make_reader().load_reaches("r", "public", BEGIN, END)
    assert len(reaches) == MONTH_DAYS
    assert sum(reach.cost_bytes for reach in reaches) < 100_000
