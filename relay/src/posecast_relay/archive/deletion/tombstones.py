"""Tombstones: records of deletions in an object store, so that every process complies.

    tombstones/{robot}/{at_ms}-{id}.json   a deletion, as `past/deletion_record.py` packs it
    tombstones/{robot}/{at_ms}-{id}.done   empty, same name: the deletion is complete

The tombstone is written before anything is deleted. If the process is killed in between, the next process
that records finishes the job. Tombstones are kept for KEPT_MS. After that no process can hold older data.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from posecast_relay.archive.names import TOMBSTONES
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.past.deletion_record import RECORD_BYTES_MAX, pack_deletion, unpack_deletion
from posecast_relay.past.deletions import KNOWN_MAX, Deletion

KEPT_MS = 30 * 86_400_000
KEY = re.compile(rf"{TOMBSTONES}/([^/]+)/([0-9]{{1,16}})-([0-9a-f]{{16}})\.(json|done)", re.ASCII)


class TombstoneNames(NamedTuple):
    """Keys of tombstones, without `.json`: all of them, oldest first, at most KNOWN_MAX; and the completed
    ones.
    """

    all: tuple[str, ...]
    done: frozenset[str]


def make_stem(deletion: Deletion) -> str:
    """Return the key of a tombstone, without `.json` or `.done`."""
    return f"{TOMBSTONES}/{deletion.robot}/{deletion.at_ms}-{deletion.id}"


def read_age_ms(stem: str, now_ms: int) -> int:
    """Return how long ago the deletion was ordered, in ms, from its key."""
    return now_ms - int(stem.rpartition("/")[2].partition("-")[0])


async def list_tombstones(store: ObjectStore) -> TombstoneNames:
    """List the tombstones of a store, ignoring objects with other names. Raises ArchiveError."""
    stems: dict[str, set[str]] = {}
    async for part in store.list_objects(TOMBSTONES):
        for each in part:
            stem, _, kind = each.key.rpartition(".")
            if KEY.fullmatch(each.key) and (kind == "done" or 0 < each.size <= RECORD_BYTES_MAX):
                stems.setdefault(stem, set()).add(kind)
    found = sorted(
        (stem for stem, kinds in stems.items() if "json" in kinds), key=lambda stem: -read_age_ms(stem, 0)
    )
    return TombstoneNames(
        tuple(found[-KNOWN_MAX:]), frozenset(stem for stem, kinds in stems.items() if "done" in kinds)
    )


async def put_tombstone(store: ObjectStore, deletion: Deletion) -> None:
    """Write a tombstone. Raises ArchiveError."""
    await store.put(f"{make_stem(deletion)}.json", pack_deletion(deletion))


async def put_done(store: ObjectStore, stem: str) -> None:
    """Mark a deletion as complete. Raises ArchiveError."""
    await store.put(f"{stem}.done", b"")


async def get_tombstone(store: ObjectStore, stem: str) -> Deletion | None:
    """Read a tombstone; None if it is gone.

    Raises ArchiveError, and ValueError if it is invalid or stored under the wrong name.
    """
    data = await store.get(f"{stem}.json")
    if data is None:
        return None
    deletion = unpack_deletion(data)
    if make_stem(deletion) != stem:
        raise ValueError("deletion: stored under the name of another")
    return deletion


async def remove_tombstone(store: ObjectStore, stem: str) -> None:
    """Remove a tombstone that is no longer needed. Raises ArchiveError."""
    await store.delete(f"{stem}.json")
    await store.delete(f"{stem}.done")
