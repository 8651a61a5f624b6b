"""The indexes of an object store, of ten minutes and of a day: reads them, rebuilds missing entries from
segments, writes them.

The listing decides. An index only saves reading the segments: missing entries are read from the segments,
surplus ones are ignored. So whatever happens to an index, the past is the segments that exist.

A day's summary is rebuilt from the ten-minute indexes. There is one way to repair everything after segments
were added or deleted.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from posecast_wire.checked import loads
from posecast_wire.segment import EventRecord, FrameRecord, SegmentError, WordRecord, decode_segment

from posecast_relay.archive.names import (
    INDEX_NAME,
    ArchivedName,
    is_unfinished,
    make_day_folder,
    make_day_key,
    make_index_key,
    make_page_folder,
    make_view_folder,
    may_be_archived,
    name_segment,
    read_day,
    read_page,
    read_segment_key,
)
from posecast_relay.archive.store import ObjectStore
from posecast_relay.past.index import DayIndex, PageDigest, digest_page, pack_day, unpack_day
from posecast_relay.past.segment import (
    DAY_MS,
    PAGE_MS,
    KeptSegment,
    PastEvent,
    PastWord,
    SegmentName,
    dump_json,
    is_event,
    make_record,
    read_record,
)

log = logging.getLogger("posecast_relay")

VERSION = 1
INDEX_BYTES_MAX = 16 << 20
SEGMENTS_MAX = 20_000  # in ten minutes; any more are skipped
READ_AT_ONCE = 8

Known = Mapping[ArchivedName, KeptSegment]


@dataclass(frozen=True)
class PageListing:
    """The content of a ten-minute folder: segments by name, and the size of the index, if any.

    `unfinished`: keys of incomplete objects, left by a killed process or being written now.
    """

    names: tuple[ArchivedName, ...]
    index_bytes: int | None
    unfinished: tuple[str, ...] = ()


@dataclass(frozen=True)
class LoadedPage:
    """The index of ten minutes. `segments`: all readable ones, without their bytes, in order; `is_indexed`:
    the stored index is identical.
    """

    segments: tuple[KeptSegment, ...]
    is_indexed: bool


async def list_page(store: ObjectStore, robot: str, view: str, page_ms: int) -> PageListing:
    """List the segments of ten minutes, skipping foreign objects. Raises ArchiveError."""
    folder = make_page_folder(robot, view, page_ms)
    names: list[ArchivedName] = []
    index_bytes: int | None = None
    unfinished: list[str] = []
    async for part in store.list_objects(folder):
        for each in part:
            if each.key == f"{folder}/{INDEX_NAME}":
                index_bytes = each.size
            elif (name := read_segment_key(each.key)) is not None and each.size == name.size:
                names.append(name)
            elif is_unfinished(each.key):
                unfinished.append(each.key)
        if len(names) > SEGMENTS_MAX:
            break
    return PageListing(tuple(names[:SEGMENTS_MAX]), index_bytes, tuple(unfinished))


async def load_page(
    store: ObjectStore, robot: str, view: str, page_ms: int, known: Known | None = None
) -> LoadedPage:
    """Load the index of ten minutes, and read the segments missing from it.

    `known`: entries that need not be read. Raises ArchiveError.
    """
    listing = await list_page(store, robot, view, page_ms)
    indexed: dict[ArchivedName, KeptSegment] = {}
    if listing.index_bytes is not None and listing.index_bytes <= INDEX_BYTES_MAX:
        data = await store.get(make_index_key(robot, view, page_ms))
        if data is not None:
            indexed = await asyncio.to_thread(_unpack_known, robot, view, page_ms, data)
    found = indexed | dict(known or {})
    lacking = [name for name in listing.names if name not in found]
    found |= await _read_records(store, lacking)
    there = [found[name] for name in listing.names if name in found]
    there.sort(key=lambda segment: (segment.from_ms, segment.name.take, segment.name.index))
    readable = {name for name in listing.names if name in found}
    return LoadedPage(tuple(there), set(indexed) == readable and listing.index_bytes is not None)


def pack_index(robot: str, view: str, page_ms: int, segments: Iterable[KeptSegment]) -> bytes:
    """Encode the index of ten minutes. Raises ValueError if a value is not valid JSON."""
    records = [make_record(segment) for segment in segments]
    return dump_json({"v": VERSION, "robot": robot, "view": view, "page_ms": page_ms, "segments": records})


def unpack_index(robot: str, view: str, page_ms: int, data: bytes) -> list[KeptSegment]:
    """Parse the index of these ten minutes. Invalid entries are left out, duplicates count once.

    Raises ValueError if it is invalid or belongs to other ten minutes.
    """
    if len(data) > INDEX_BYTES_MAX:
        raise ValueError("index: too long")
    doc = loads(data)
    if not isinstance(doc, dict) or doc.get("v") != VERSION:
        raise ValueError("index: unsupported version")
    if [doc.get(name) for name in ("robot", "view", "page_ms")] != [robot, view, page_ms]:
        raise ValueError("index: belongs to another robot, view or time")
    records = doc.get("segments")
    if not isinstance(records, list):
        raise ValueError("index: invalid segments")
    found: dict[ArchivedName, KeptSegment] = {}
    for record in records[:SEGMENTS_MAX]:
        try:
            segment = read_record(robot, view, record)
        except ValueError:
            continue  # it will be read from the segment
        if segment.from_ms - segment.from_ms % PAGE_MS == page_ms:
            found[name_segment(segment)] = segment
    return list(found.values())


def make_segment_record(name: ArchivedName, data: bytes) -> KeptSegment:
    """Make a segment's index entry from its name and its bytes. The entry does not contain the bytes.

    Raises SegmentError if they are damaged or belong to another segment.
    """
    segment = decode_segment(data)
    start = segment.start
    if SegmentName(start.robot, start.view, start.take, start.index) != name.name or (
        (start.from_ms, segment.to_ms, len(data)) != (name.from_ms, name.to_ms, name.size)
    ):
        raise SegmentError("stored under the name of another segment")
    events = [each for each in segment.records if isinstance(each, EventRecord) and is_event(each.text)]
    words = [each for each in segment.records if isinstance(each, WordRecord)]
    frames = [each for each in segment.records if isinstance(each, FrameRecord)]
    return KeptSegment(
        name=name.name,
        run=start.run_id,
        from_ms=start.from_ms,
        to_ms=segment.to_ms,
        frames=len(frames),
        first_seq=frames[0].seq if frames else 0,
        last_seq=frames[-1].seq if frames else 0,
        missing=start.missing,
        schema=None if start.schema is None else bytes.fromhex(start.schema),
        model=start.model,
        data=b"",
        sha256=hashlib.sha256(data).digest(),
        events=tuple(PastEvent(start.from_ms + each.at_us // 1000, each.text) for each in events),
        words=(
            PastWord(start.from_ms, start.word),
            *(PastWord(start.from_ms + each.at_us // 1000, each.word) for each in words),
        ),
        faults=sum(_is_fault(each.text) for each in events),
        audiences=name.audiences,
        elsewhere_bytes=len(data),
    )


def forget_bytes(segment: KeptSegment) -> KeptSegment:
    """Return a segment without its bytes and its schema's text, as in an index."""
    return replace(segment, data=b"", schema_text=None, elsewhere_bytes=segment.size)


def _is_fault(text: str) -> bool:
    """Whether an event begins a fault."""
    try:
        doc = loads(text)
    except ValueError:
        return False
    return isinstance(doc, dict) and doc.get("level") == "fault" and doc.get("state") == "on"


def _unpack_known(robot: str, view: str, page_ms: int, data: bytes) -> dict[ArchivedName, KeptSegment]:
    try:
        return {name_segment(segment): segment for segment in unpack_index(robot, view, page_ms, data)}
    except ValueError:
        return {}  # it will be rebuilt


async def _read_records(store: ObjectStore, names: list[ArchivedName]) -> dict[ArchivedName, KeptSegment]:
    """Read segments and make their index entries, leaving out damaged ones."""
    found: dict[ArchivedName, KeptSegment] = {}
    for at in range(0, len(names), READ_AT_ONCE):
        part = names[at : at + READ_AT_ONCE]
        read = await asyncio.gather(*(store.get(name.key) for name in part))
        there = [(name, data) for name, data in zip(part, read, strict=True) if data is not None]
        found |= await asyncio.to_thread(_make_records, there)
    return found


def _make_records(read: list[tuple[ArchivedName, bytes]]) -> dict[ArchivedName, KeptSegment]:
    found: dict[ArchivedName, KeptSegment] = {}
    for name, data in read:
        try:
            found[name] = make_segment_record(name, data)
        except SegmentError as e:
            PASSED_OVER.report(name, str(e))
    return found


class _PassedOver:
    """Logs once per robot that something in the store can't be read, and counts it."""

    def __init__(self) -> None:
        self.count = 0
        self._reported: set[str] = set()

    def report(self, name: ArchivedName, why: str) -> None:
        self.count += 1
        if name.name.robot not in self._reported and len(self._reported) < 1000:
            self._reported.add(name.name.robot)
            log.warning("the archive: skipped: %s: %.200s", name.key, why)


PASSED_OVER = _PassedOver()


PAGES_AT_ONCE = 4
DAYS_MAX = 40_000  # the most folders to look at
KILLED_MS = 3_600_000  # this long after a day has ended, no process writes to it any more
OWN_FOLDERS = 200  # the most folders to look at in a day, which has 144 of ten minutes

LoadPage = Callable[[ObjectStore, str, str, int], Awaitable[LoadedPage]]


@dataclass(frozen=True)
class LoadedDay:
    """A day's index. `is_written`: the stored summary is identical."""

    day: DayIndex
    is_written: bool


async def list_days(store: ObjectStore, robot: str, view: str) -> list[int]:
    """Return the start of each day that has a folder, unix ms, oldest first. Raises ArchiveError."""
    names = await store.list_folders(make_view_folder(robot, view))
    days = (read_day(name) for name in names[-DAYS_MAX:])
    return sorted(day for day in days if day is not None)


async def list_pages(store: ObjectStore, robot: str, view: str, day_ms: int) -> list[int]:
    """Return the start of each ten minutes of a day that have a folder, unix ms. Raises ArchiveError."""
    names = await store.list_folders(make_day_folder(robot, view, day_ms))
    pages = (read_page(name) for name in names[:OWN_FOLDERS])
    return sorted(day_ms + page for page in pages if page is not None)


async def load_day(
    store: ObjectStore, robot: str, view: str, day_ms: int, load: LoadPage = load_page
) -> LoadedDay:
    """Load the index of a day.

    Ten minutes missing from its file are loaded one by one with `load`; entries without a folder are left
    out. Raises ArchiveError.
    """
    written, folders = await asyncio.gather(
        _read_day_file(store, robot, view, day_ms), list_pages(store, robot, view, day_ms)
    )
    known = {} if written is None else written.pages
    pages = {at_ms: known[at_ms] for at_ms in folders if at_ms in known}
    lacking = [at_ms for at_ms in folders if at_ms not in known]
    for at in range(0, len(lacking), PAGES_AT_ONCE):
        part = lacking[at : at + PAGES_AT_ONCE]
        loaded = await asyncio.gather(*(load(store, robot, view, at_ms) for at_ms in part))
        for at_ms, page in zip(part, loaded, strict=True):
            if page.segments:
                pages[at_ms] = digest_page(at_ms, page.segments)
    return LoadedDay(DayIndex(robot, view, day_ms, pages), pages == known and written is not None)


async def mend_page(
    store: ObjectStore, robot: str, view: str, page_ms: int, known: Known | None = None
) -> PageDigest | None:
    """Write the index of ten minutes if it differs from the segments there, or delete it if there are none.

    Returns what is there; None for nothing. Raises ArchiveError.
    """
    page = await load_page(store, robot, view, page_ms, known)
    if not page.segments:
        if (await list_page(store, robot, view, page_ms)).index_bytes is not None:
            await store.delete(make_index_key(robot, view, page_ms))
        return None
    if not page.is_indexed:
        data = await asyncio.to_thread(pack_index, robot, view, page_ms, page.segments)
        await store.put(make_index_key(robot, view, page_ms), data)
    return await asyncio.to_thread(digest_page, page_ms, page.segments)


async def mend_day(
    store: ObjectStore, robot: str, view: str, day_ms: int, pages: dict[int, PageDigest | None]
) -> None:
    """Rewrite the summary of a day with new data for some of its ten minutes; delete it if nothing is left.

    Raises ArchiveError.
    """
    written = await _read_day_file(store, robot, view, day_ms)
    loaded = written or (await load_day(store, robot, view, day_ms)).day
    day = DayIndex(robot, view, day_ms, dict(loaded.pages))
    for at_ms, digest in pages.items():
        if digest is None:
            day.pages.pop(at_ms, None)
        else:
            day.pages[at_ms] = digest
    if written is not None and day.pages == written.pages:
        return
    key = make_day_key(robot, view, day_ms)
    if day.pages:
        await store.put(key, await asyncio.to_thread(pack_day, day))
    elif written is not None:
        await store.delete(key)


async def check_day(
    store: ObjectStore, robot: str, view: str, day_ms: int, unix_ms: int | None = None
) -> list[int]:
    """Return the ten minutes of a day whose listing, index and summary disagree. Raises ArchiveError.

    With the current time in `unix_ms`, also deletes what killed processes left half written.
    """
    written = await _read_day_file(store, robot, view, day_ms)
    known = {} if written is None else written.pages
    sizes: defaultdict[int, list[int]] = defaultdict(lambda: [0, 0, 0])  # segments, bytes, indexes
    folder = make_day_folder(robot, view, day_ms)
    async for part in store.list_objects(folder):
        for each in part:
            name = read_segment_key(each.key)
            if name is not None and name.size == each.size:
                sums = sizes[name.page_ms]
                sums[0] += 1
                sums[1] += each.size
            elif is_unfinished(each.key):
                if unix_ms is not None and unix_ms > day_ms + DAY_MS + KILLED_MS:
                    await store.delete(each.key)
            elif (at_ms := _read_index_key(each.key, folder, day_ms)) is not None:
                sizes[at_ms][2] += 1
    wrong = {at_ms for at_ms in known if at_ms not in sizes}
    for at_ms, (count, size, indexes) in sizes.items():
        digest = known.get(at_ms)
        summed = (0, 0) if digest is None else (digest.count, digest.bytes)
        if summed != (count, size) or indexes != bool(count):
            wrong.add(at_ms)
    return sorted(wrong)


async def delete_page(store: ObjectStore, robot: str, view: str, page_ms: int) -> list[ArchivedName]:
    """Delete ten minutes: segments first, then the index. Unknown files stay. Returns what was deleted.

    Raises ArchiveError; you can then call it again.
    """
    listing = await list_page(store, robot, view, page_ms)
    for key in (*(name.key for name in listing.names), *listing.unfinished):
        await store.delete(key)
    if listing.index_bytes is not None:
        await store.delete(make_index_key(robot, view, page_ms))
    return list(listing.names)


def _read_index_key(key: str, folder: str, day_ms: int) -> int | None:
    """Return the start of the ten minutes, unix ms, from the key of an index of this day; None if it is not
    one."""
    below = key.removeprefix(f"{folder}/").split("/")
    at_ms = read_page(below[0]) if len(below) == 2 and below[1] == INDEX_NAME else None
    return None if at_ms is None else day_ms + at_ms


async def _read_day_file(store: ObjectStore, robot: str, view: str, day_ms: int) -> DayIndex | None:
    data = await store.get(make_day_key(robot, view, day_ms))
    if data is None:
        return None
    try:
        return await asyncio.to_thread(unpack_day, robot, view, day_ms, data)
    except ValueError:
        return None  # it will be rebuilt


async def list_views(store: ObjectStore, robot: str) -> list[str]:
    """Return the views of a robot that may have data in a store. Raises ArchiveError."""
    return [view for view in await store.list_folders(robot) if may_be_archived(robot, view)]
