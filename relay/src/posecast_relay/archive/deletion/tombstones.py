"""Tombstones: what was deleted, as it stands in an object store, so that every process obeys.

    tombstones/{robot}/{at_ms}-{id}.json   a deletion, as `deletion_record.py` packs it
    tombstones/{robot}/{at_ms}-{id}.done   the same, and empty: it is carried out, and nothing came later

A tombstone comes first, and then what it tells of is deleted: whoever is killed between the two leaves it to
the next process that records. It stays for KEPT_MS, in which nobody can have anything of before any more.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from posecast_relay.archive.names import TOMBSTONES
from posecast_relay.archive.object_store import ObjectStore
from posecast_relay.core.past.deletions import KNOWN_MAX, Deletion
from posecast_relay.deletion_record import RECORD_BYTES_MAX, pack_deletion, unpack_deletion

KEPT_MS = 30 * 86_400_000
KEY = re.compile(rf"{TOMBSTONES}/([^/]+)/([0-9]{{1,16}})-([0-9a-f]{{16}})\.(json|done)", re.ASCII)


class TombstoneNames(NamedTuple):
    """Keys of tombstones, without `.json`: of all, the newest last, KNOWN_MAX at most, and of those that are
    carried out.
    """

    all: tuple[str, ...]
    done: frozenset[str]


def make_stem(deletion: Deletion) -> str:
    """Return the key of a tombstone, without `.json` or `.done`."""
    return f"{TOMBSTONES}/{deletion.robot}/{deletion.at_ms}-{deletion.id}"


def read_age_ms(stem: str, now_ms: int) -> int:
    """Return how long ago it was ordered, by its key."""
    return now_ms - int(stem.rpartition("/")[2].partition("-")[0])


async def list_tombstones(store: ObjectStore) -> TombstoneNames:
    """List the tombstones of a store; what has another name is foreign. Raises ArchiveError."""
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
    """Note that a deletion is carried out. Raises ArchiveError."""
    await store.put(f"{stem}.done", b"")


async def get_tombstone(store: ObjectStore, stem: str) -> Deletion | None:
    """Read a tombstone; None when it is gone.

    Raises ArchiveError, and ValueError when it is none, or lies under another one's name.
    """
    data = await store.get(f"{stem}.json")
    if data is None:
        return None
    deletion = unpack_deletion(data)
    if make_stem(deletion) != stem:
        raise ValueError("deletion: it lies under another one's name")
    return deletion


async def remove_tombstone(store: ObjectStore, stem: str) -> None:
    """Remove a tombstone that nobody needs any more. Raises ArchiveError."""
    await store.delete(f"{stem}.json")
    await store.delete(f"{stem}.done")
