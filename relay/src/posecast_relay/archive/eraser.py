"""Erases from an object store what a deletion covers. What is foreign there is passed over and stays."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from typing import NamedTuple

from posecast_relay.archive.names import (
    DAY_MS,
    PAGE_MS,
    SPAN_MS_MAX,
    ArchivedName,
    make_day_key,
    make_index_key,
    make_page_folder,
    may_be_archived,
    read_day,
    read_page,
    read_segment_key,
)
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.core.past.deletions import Deletion

AT_ONCE = 16  # objects being deleted


class Erased(NamedTuple):
    """How much was erased."""

    segments: int
    bytes: int


Progress = Callable[[Erased], None]


async def find_covered(store: ObjectStore, deletion: Deletion) -> AsyncIterator[list[ArchivedName]]:
    """Yield what a store has of what a deletion covers, ten minutes at a time. Raises ArchiveError."""
    async for robot, view, page_ms in _list_pages(store, deletion):
        folder = make_page_folder(robot, view, page_ms)
        found: list[ArchivedName] = []
        async for part in store.list_objects(folder):
            names = (read_segment_key(each.key) for each in part)
            found += [
                each
                for each in names
                if each is not None and deletion.covers(robot, view, each.from_ms, each.to_ms)
            ]
        if found:
            yield found


async def erase(store: ObjectStore, deletion: Deletion, progress: Progress = lambda _: None) -> Erased:
    """Delete the segments that a deletion covers, and the indexes that tell of them, which are made anew of
    what stays; twice does no harm. `progress` is told the sum so far. Raises ArchiveError.
    """
    erased = Erased(0, 0)
    async for names in find_covered(store, deletion):
        robot, view, page_ms = names[0].name.robot, names[0].name.view, names[0].page_ms
        indexes = [make_index_key(robot, view, page_ms), make_day_key(robot, view, page_ms)]
        await _delete_all(store, indexes)
        for at in range(0, len(names), AT_ONCE):
            part = names[at : at + AT_ONCE]
            await _delete_all(store, (each.key for each in part))
            erased = Erased(erased.segments + len(part), erased.bytes + sum(each.size for each in part))
            progress(erased)
        await _delete_all(store, indexes)  # one that was made meanwhile may tell of them
    return erased


async def _list_pages(store: ObjectStore, deletion: Deletion) -> AsyncIterator[tuple[str, str, int]]:
    """Yield robot, view and beginning of each ten minutes of which a deletion may cover something."""
    robot, first_ms = deletion.robot, deletion.from_ms - SPAN_MS_MAX
    views = [deletion.view] if deletion.view else await store.list_folders(robot)
    for view in (view for view in views if may_be_archived(robot, view)):
        for day in await store.list_folders(f"{robot}/{view}"):
            day_ms = read_day(day)
            if day_ms is None or not first_ms - DAY_MS < day_ms < deletion.to_ms:
                continue
            for page in await store.list_folders(f"{robot}/{view}/{day}"):
                begins = read_page(page)
                if begins is not None and first_ms - PAGE_MS < day_ms + begins < deletion.to_ms:
                    yield robot, view, day_ms + begins


async def _delete_all(store: ObjectStore, keys: Iterable[str]) -> None:
    async with asyncio.TaskGroup() as group:
        for key in keys:
            group.create_task(store.delete(key))
