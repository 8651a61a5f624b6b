"""Deletes expired data: ten minutes at a time, and whole days with their summary."""

from __future__ import annotations

import logging
from collections.abc import AsyncIterator

from posecast_relay.archive.day_file import delete_page, list_days, list_pages, mend_day
from posecast_relay.archive.names import DAY_MS, PAGE_MS, ArchivedName, make_day_key, may_be_archived
from posecast_relay.archive.object_store import ObjectStore

log = logging.getLogger("posecast_relay")

SPARE_MS = 10_000  # this long after their end, the last segment that began in ten minutes has ended


async def list_views(store: ObjectStore, robot: str) -> list[str]:
    """Return the views of a robot that may have data in a store. Raises ArchiveError."""
    return [view for view in await store.list_folders(robot) if may_be_archived(robot, view)]


async def delete_old(
    store: ObjectStore, robot: str, keep_s: float, unix_ms: int
) -> AsyncIterator[tuple[str, int, list[ArchivedName]]]:
    """Delete a robot's data that is older than `keep_s` at the time `unix_ms`, day by day, oldest first.

    Yields what was deleted, by view and day, after each. Raises ArchiveError; you can then start again.
    """
    before_ms = unix_ms - round(1000 * keep_s)
    for view in await list_views(store, robot):
        for day_ms in await list_days(store, robot, view):
            if day_ms + PAGE_MS + SPARE_MS > before_ms:
                break
            gone: list[ArchivedName] = []
            pages = await list_pages(store, robot, view, day_ms)
            old = [page_ms for page_ms in pages if page_ms + PAGE_MS + SPARE_MS <= before_ms]
            for page_ms in old:
                gone += await delete_page(store, robot, view, page_ms)
            if day_ms + DAY_MS + SPARE_MS <= before_ms:
                await store.delete(make_day_key(robot, view, day_ms))
            elif gone:
                await mend_day(store, robot, view, day_ms, dict.fromkeys(old))
            if gone or day_ms + DAY_MS + SPARE_MS <= before_ms:
                yield view, day_ms, gone
