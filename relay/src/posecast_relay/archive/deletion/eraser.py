"""Erases what a deletion covers from an object store. Unknown objects are skipped."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from typing import NamedTuple

from posecast_relay.archive.day_file import check_day, list_days, list_pages, mend_day, mend_page
from posecast_relay.archive.names import (
    DAY_MS,
    PAGE_MS,
    SPAN_MS_MAX,
    UNFINISHED,
    ArchivedName,
    PageKey,
    make_index_key,
    make_page_folder,
    may_be_archived,
    read_segment_key,
)
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.past.deletions import Deletion
from posecast_relay.past.index import PageDigest

AT_ONCE = 16  # objects being deleted


class Erased(NamedTuple):
    """How much was erased."""

    segments: int
    bytes: int


Progress = Callable[[Erased], None]


async def find_covered(store: ObjectStore, deletion: Deletion) -> AsyncIterator[list[ArchivedName]]:
    """Yield the segments in a store that a deletion covers, ten minutes at a time. Raises ArchiveError."""
    async for view, _, pages in _list_days(store, deletion):
        for page_ms in pages:
            names, _ = await _list_covered(store, deletion, view, page_ms)
            if names:
                yield names


async def erase(
    store: ObjectStore,
    deletion: Deletion,
    progress: Progress = lambda _: None,
    mend: Callable[[PageKey], None] | None = None,
) -> Erased:
    """Delete the segments that a deletion covers, and repair the indexes. Repeating it is harmless.

    `progress` gets the totals so far. `mend` gets the indexes to repair if another task repairs them one by
    one. Raises ArchiveError; you can then call it again.
    """
    erased = Erased(0, 0)
    span = _find_pages(deletion)

    async def mend_one(view: str, page_ms: int, mended: dict[int, PageDigest | None]) -> None:
        if mend is not None:
            mend((deletion.robot, view, page_ms))
        else:
            mended[page_ms] = await mend_page(store, deletion.robot, view, page_ms)

    async for view, day_ms, pages in _list_days(store, deletion):
        mended: dict[int, PageDigest | None] = {}
        for page_ms in pages:
            names, unfinished = await _list_covered(store, deletion, view, page_ms)
            await _delete_all(store, unfinished)
            if names:  # delete the index first: it contains texts, and a killed process must not leave them
                await store.delete(make_index_key(deletion.robot, view, page_ms))
            for at in range(0, len(names), AT_ONCE):
                part = names[at : at + AT_ONCE]
                await _delete_all(store, (each.key for each in part))
                erased = Erased(erased.segments + len(part), erased.bytes + sum(each.size for each in part))
                progress(erased)
            if names:
                await mend_one(view, page_ms, mended)
        # also what a killed process left
        for page_ms in await check_day(store, deletion.robot, view, day_ms, deletion.at_ms):
            if page_ms in span and page_ms not in mended:
                await mend_one(view, page_ms, mended)
        if mended:
            await mend_day(store, deletion.robot, view, day_ms, mended)
    return erased


async def _list_covered(
    store: ObjectStore, deletion: Deletion, view: str, page_ms: int
) -> tuple[list[ArchivedName], list[str]]:
    """Return the covered segments, and the keys of objects that were never written completely."""
    found: list[ArchivedName] = []
    unfinished: list[str] = []
    async for part in store.list_objects(make_page_folder(deletion.robot, view, page_ms)):
        for each in part:
            whole = UNFINISHED.sub("", each.key)
            name = read_segment_key(whole)
            if name is None or not deletion.covers(deletion.robot, view, name.from_ms, name.to_ms):
                continue
            if whole == each.key:
                found.append(name)
            else:
                unfinished.append(each.key)
    return found, unfinished


async def _list_days(store: ObjectStore, deletion: Deletion) -> AsyncIterator[tuple[str, int, list[int]]]:
    """Yield the view and start of each day, with those of its ten minutes that a deletion may overlap."""
    robot, span = deletion.robot, _find_pages(deletion)
    views = [deletion.view] if deletion.view else await store.list_folders(robot)
    for view in (view for view in views if may_be_archived(robot, view)):
        for day_ms in await list_days(store, robot, view):
            if span.start - DAY_MS < day_ms < span.stop:
                pages = await list_pages(store, robot, view, day_ms)
                yield view, day_ms, [page_ms for page_ms in pages if page_ms in span]


def _find_pages(deletion: Deletion) -> range:
    """Return the range of start times, unix ms, of the ten minutes that a deletion may overlap."""
    return range(deletion.from_ms - SPAN_MS_MAX - PAGE_MS + 1, deletion.to_ms)


async def _delete_all(store: ObjectStore, keys: Iterable[str]) -> None:
    results = await asyncio.gather(*map(store.delete, keys), return_exceptions=True)
    for error in results:
        if error is not None:
            raise error
