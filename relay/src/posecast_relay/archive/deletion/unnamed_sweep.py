"""Deletes a robot's schemas and models in a store that no segment names any more."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import NamedTuple

from posecast_relay.archive.day_file import check_day, list_days, load_day, mend_day, mend_page
from posecast_relay.archive.names import MODELS, SCHEMAS
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.archive.retention import list_views

SCHEMA_FILE = re.compile(r"([0-9a-f]{64})\.json", re.ASCII)
SHA256 = re.compile(r"[0-9a-f]{64}", re.ASCII)


class NamedHashes(NamedTuple):
    """SHA-256 of schemas and models, in hexadecimal."""

    schemas: frozenset[str]
    models: frozenset[str]


ListInUse = Callable[[str], NamedHashes]


async def sweep_unnamed(store: ObjectStore, robot: str, list_in_use: ListInUse, unix_ms: int) -> NamedHashes:
    """Delete what no segment of a robot names, and return what was deleted. Raises ArchiveError.

    `list_in_use` returns what pending segments name: a schema is stored before its segments.
    """
    there = NamedHashes(await _list_schemas(store, robot), await _list_models(store, robot))
    if _subtract(there, await _list_named(store, robot, unix_ms, is_sure=False), list_in_use(robot)) == (
        *(frozenset(), frozenset()),
    ):
        return NamedHashes(frozenset(), frozenset())
    # summaries can be older than the segments, so read the segments before deleting
    named = await _list_named(store, robot, unix_ms, is_sure=True)
    gone = _subtract(there, named, list_in_use(robot))
    for sha256 in sorted(gone.schemas - list_in_use(robot).schemas):
        await store.delete(f"{robot}/{SCHEMAS}/{sha256}.json")
    for sha256 in sorted(gone.models - list_in_use(robot).models):
        await _delete_model(store, robot, sha256)
    return gone


def _subtract(there: NamedHashes, *named: NamedHashes) -> NamedHashes:
    schemas = there.schemas.difference(*(each.schemas for each in named))
    return NamedHashes(schemas, there.models.difference(*(each.models for each in named)))


async def _list_named(store: ObjectStore, robot: str, unix_ms: int, *, is_sure: bool) -> NamedHashes:
    """Return what the segments name. `is_sure`: first compare the days with their segments."""
    schemas: set[str] = set()
    models: set[str] = set()
    for view in await list_views(store, robot):
        for day_ms in await list_days(store, robot, view):
            if is_sure:
                wrong = await check_day(store, robot, view, day_ms, unix_ms)
                mended = {page_ms: await mend_page(store, robot, view, page_ms) for page_ms in wrong}
                if mended:
                    await mend_day(store, robot, view, day_ms, mended)
            day = (await load_day(store, robot, view, day_ms)).day
            schemas |= day.find_schemas()
            models |= set(day.find_models())
    return NamedHashes(frozenset(schemas), frozenset(models))


async def _list_schemas(store: ObjectStore, robot: str) -> frozenset[str]:
    found: set[str] = set()
    folder = f"{robot}/{SCHEMAS}/"
    async for part in store.list_objects(folder.rstrip("/")):
        names = (SCHEMA_FILE.fullmatch(each.key.removeprefix(folder)) for each in part)
        found |= {name[1] for name in names if name}
    return frozenset(found)


async def _list_models(store: ObjectStore, robot: str) -> frozenset[str]:
    folders = await store.list_folders(f"{robot}/{MODELS}")
    return frozenset(name for name in folders if SHA256.fullmatch(name))


async def _delete_model(store: ObjectStore, robot: str, sha256: str) -> None:
    """Delete the manifest first: without it the model does not exist, so a kill leaves no partial model."""
    folder = f"{robot}/{MODELS}/{sha256}"
    await store.delete(f"{folder}/manifest.json")
    async for part in store.list_objects(folder):
        for each in part:
            await store.delete(each.key)
