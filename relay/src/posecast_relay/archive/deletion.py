"""Deletes from an object store what a deletion covers, so that every process complies.

    tombstones/{robot}/{at_ms}-{id}.json   a deletion, as `past/deletions.py` packs it
    tombstones/{robot}/{at_ms}-{id}.done   empty, same name: the deletion is complete

The tombstone is written before anything is deleted. If the process is killed in between, the next process
that records finishes the job. Tombstones are kept for KEPT_MS. After that no process can hold older data.

A process learns of deletions within seconds, because it follows the tombstones. One that records also
executes them, and finishes those that another process left undone. Unknown objects are skipped.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from typing import NamedTuple

from posecast_relay.archive.index import (
    check_day,
    list_days,
    list_pages,
    list_views,
    load_day,
    mend_day,
    mend_page,
)
from posecast_relay.archive.names import (
    MODELS,
    SCHEMAS,
    TOMBSTONES,
    UNFINISHED,
    ArchivedName,
    PageKey,
    make_index_key,
    make_page_folder,
    may_be_archived,
    read_segment_key,
)
from posecast_relay.archive.store import ArchiveError, BackgroundTrouble, ObjectStore
from posecast_relay.kit import write_count
from posecast_relay.past.deletions import (
    KNOWN_MAX,
    RECORD_BYTES_MAX,
    Deletion,
    Deletions,
    pack_deletion,
    unpack_deletion,
)
from posecast_relay.past.index import PageDigest
from posecast_relay.past.segment import DAY_MS, PAGE_MS, SHA256, SPAN_MS_MAX

log = logging.getLogger("posecast_relay")

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


ERASED_AT_ONCE = 16  # objects being deleted


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
            for at in range(0, len(names), ERASED_AT_ONCE):
                part = names[at : at + ERASED_AT_ONCE]
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


SCHEMA_FILE = re.compile(r"([0-9a-f]{64})\.json", re.ASCII)


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
    nothing = NamedHashes(frozenset(), frozenset())
    summed = await _list_named(store, robot, unix_ms, is_sure=False)
    if _subtract(there, summed, list_in_use(robot)) == nothing:
        return nothing
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


EVERY_S = 3.0
SETTLED_MS = 60_000  # after this every process has complied, and pending writes have reached the store
READ_AT_ONCE = 16
CLOCKS_APART_MS = 60_000  # the largest expected clock difference to the machine that ordered a deletion


class TombstoneFollower:
    """Adds a store's tombstones to `deletions`.

    `erases`: also deletes what they cover, then calls `sweep` with the robot; a gateway only reads.
    `compute_unix_ms`: returns the time now.
    """

    def __init__(
        self,
        store: ObjectStore,
        deletions: Deletions,
        compute_unix_ms: Callable[[], int],
        *,
        erases: bool,
        sweep: Callable[[str], Awaitable[None]] | None = None,
        mend: Callable[[PageKey], None] | None = None,
        trouble: BackgroundTrouble | None = None,
    ) -> None:
        """`mend` gets each ten minutes whose index needs repair; None: repair it here. `trouble` is told
        whether the store works.
        """
        self._store = store
        self._deletions = deletions
        self._compute_unix_ms = compute_unix_ms
        self._erases = erases
        self._sweep = sweep
        self._mend = mend
        self._trouble = trouble or BackgroundTrouble()
        self._read: dict[str, Deletion | None] = {}  # by key; None: invalid, or early
        self._early: dict[str, Deletion] = {}  # by key: those that this machine's clock has yet to reach
        self._erased: set[str] = set()  # keys of those that were executed here
        self._erasing: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Follow until cancelled. Retries while the store is away."""
        try:
            while True:
                try:
                    await self.look()
                    self._trouble.note_success("deletions ordered")
                except ArchiveError as e:
                    self._trouble.note_failure("deletions ordered", str(e))
                except Exception as e:  # a bug of ours
                    log.error("tombstones", exc_info=e)
                await asyncio.sleep(EVERY_S)
        finally:
            if self._erasing is not None:
                self._erasing.cancel()

    async def look(self) -> None:
        """Read new tombstones, and start to execute them. Raises ArchiveError."""
        names = await list_tombstones(self._store)
        self._read = {stem: self._read[stem] for stem in names.all if stem in self._read}
        new = [stem for stem in names.all if stem not in self._read]
        for at in range(0, len(new), READ_AT_ONCE):
            await asyncio.gather(*(self._take(stem) for stem in new[at : at + READ_AT_ONCE]))
        self._early = {stem: of for stem, of in self._early.items() if stem in self._read}
        for stem in [stem for stem, of in self._early.items() if not self._is_early(of)]:
            self._obey(stem, self._early.pop(stem))
        if not self._erases or (self._erasing is not None and not self._erasing.done()):
            return
        open_ = [(stem, of) for stem in names.all if stem not in names.done and (of := self._read.get(stem))]
        old = [stem for stem in names.all if read_age_ms(stem, self._compute_unix_ms()) > KEPT_MS]
        self._erased.intersection_update(names.all)
        due = [(stem, of) for stem, of in open_ if stem not in self._erased or self._is_settled(stem)]
        if due or old:
            self._erasing = asyncio.create_task(self._carry_out(due, old), name="deletions in the store")

    def _is_settled(self, stem: str) -> bool:
        return read_age_ms(stem, self._compute_unix_ms()) >= SETTLED_MS

    async def _take(self, stem: str) -> None:
        try:
            deletion = await get_tombstone(self._store, stem)
        except ValueError as e:
            log.warning("tombstones: skipped: %s: %.200s", stem, e)
            self._read[stem] = None
            return
        if deletion is None:  # gone, or not there yet
            return
        if self._is_early(deletion):
            log.warning("tombstones: postponed: %s: its end is in the future by this machine's clock", stem)
            self._read[stem], self._early[stem] = None, deletion
        else:
            self._obey(stem, deletion)

    def _is_early(self, deletion: Deletion) -> bool:
        # obeyed now, an order by a wrong clock would delete everything recorded until that time
        return deletion.to_ms > self._compute_unix_ms() + CLOCKS_APART_MS

    def _obey(self, stem: str, deletion: Deletion) -> None:
        self._read[stem] = deletion
        self._deletions.add(deletion)

    async def _carry_out(self, due: list[tuple[str, Deletion]], old: list[str]) -> None:
        """Execute deletions while `look` goes on, so that new ones take effect meanwhile."""
        try:
            for stem, deletion in due:
                settled = self._is_settled(stem)
                erased = await erase(self._store, deletion, mend=self._mend)
                if erased != Erased(0, 0):
                    count = write_count(erased.segments, "segment")
                    log.warning("past delete: %s: deleted %s from the store", stem, count)
                if self._sweep is not None:
                    await self._sweep(deletion.robot)
                self._erased.add(stem)
                if settled:  # no more of its data can arrive
                    await put_done(self._store, stem)
            for stem in old:
                await remove_tombstone(self._store, stem)
            self._trouble.note_success("deletions")
        except ArchiveError as e:  # the next look tries again
            self._trouble.note_failure("deletions", str(e))
        except Exception as e:  # a bug of ours
            log.error("deletions in the store", exc_info=e)
