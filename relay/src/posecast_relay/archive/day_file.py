"""A day's summary in an object store: reads it, rebuilds missing parts from the ten-minute indexes, writes
it.

It also has one way to repair everything after segments were added or deleted.
"""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from posecast_relay.archive.names import (
    DAY_MS,
    INDEX_NAME,
    ArchivedName,
    is_unfinished,
    make_day_folder,
    make_day_key,
    make_index_key,
    make_view_folder,
    read_day,
    read_page,
    read_segment_key,
)
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.archive.page_index import Known, LoadedPage, list_page, load_page, pack_index
from posecast_relay.past.index import DayIndex, PageDigest, digest_page, pack_day, unpack_day

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
        said = (0, 0) if digest is None else (digest.count, digest.bytes)
        if said != (count, size) or indexes != bool(count):
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
