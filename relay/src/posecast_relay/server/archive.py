"""The archive of a process: written where robots are heard, and read wherever the past is read.

Its upkeep executes deletions, stores the models that segments name, and sweeps unnamed data.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from posecast_relay.archive.deletion import NamedHashes, TombstoneFollower, sweep_unnamed
from posecast_relay.archive.joined import JoinedPast
from posecast_relay.archive.models import JoinedModelSource, ModelKeeper
from posecast_relay.archive.names import PageKey
from posecast_relay.archive.reader import ArchiveReader
from posecast_relay.archive.store import ArchiveError, BackgroundTrouble, ObjectStore, open_object_store
from posecast_relay.archive.upkeep import Indexer
from posecast_relay.archive.writer import ArchiveWriter
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.config.store_url import StoreUrlError
from posecast_relay.core.policy import Policy
from posecast_relay.http.metrics import ArchiveFigures
from posecast_relay.kit import write_count
from posecast_relay.models.cache import ModelCache, ModelSource
from posecast_relay.past.deletions import Deletion, Deletions
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.source import PastSource
from posecast_relay.runtime.dispatcher import Dispatcher

log = logging.getLogger("posecast_relay")

SWEEP_EVERY_S = 3600.0  # between sweeps of robots with expired data


class ArchiveUpkeep:
    """Executes deletions. `writer` None: in a gateway, which only reads."""

    def __init__(
        self,
        store: ObjectStore,
        deletions: Deletions,
        reader: ArchiveReader,
        writer: ArchiveWriter | None,
        mend: Callable[[PageKey], None] | None,
        trouble: BackgroundTrouble,
    ) -> None:
        self._store = store
        self._reader = reader
        self._writer = writer
        self._kept: MemoryPast | None = None
        self._source: JoinedModelSource | None = None
        self._keeper: ModelKeeper | None = None
        self._keeps: Mapping[str, float] = {}
        self._expired: set[str] = set()  # robots with expired data since the last sweep
        self._tasks: list[asyncio.Task[None]] = []
        self._follower = TombstoneFollower(
            store,
            deletions,
            self._compute_unix_ms,
            erases=writer is not None,
            sweep=self.sweep,
            mend=mend,
            trouble=trouble,
        )
        deletions.on_added(self._forget)

    def join_models(self, live: ModelSource) -> JoinedModelSource:
        """Return a source that combines the models of `live` and those in the store."""
        self._source = JoinedModelSource(live, self._store)
        return self._source

    def keep_models(self, models: ModelCache, kept: MemoryPast) -> None:
        """From now on, store the models that kept segments name."""
        self._kept, self._keeper = kept, ModelKeeper(self._store, models)
        self._keeper.set_robots(self._keeps)
        kept.on_added(self._keeper.keep)

    def set_keeps(self, keeps_s: Mapping[str, float]) -> None:
        """Set which robots are kept, each for how many seconds."""
        self._keeps = keeps_s
        if self._keeper is not None:
            self._keeper.set_robots(keeps_s)

    def note_expired(self, robot: str) -> None:
        """Note that a robot's data has expired, so that its schemas and models may be unused."""
        self._expired.add(robot)

    def start(self) -> None:
        """Start the background work."""
        self._tasks = [asyncio.create_task(self._follower.run(), name="tombstones")]
        if self._writer is not None:
            self._tasks.append(asyncio.create_task(self._sweep_expired(), name="sweeping the archive"))

    async def stop(self) -> None:
        """End the background work."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._keeper is not None:
            await self._keeper.stop()

    async def sweep(self, robot: str) -> None:
        """Delete the schemas and models of a robot that no segment names. Raises ArchiveError."""
        gone = await sweep_unnamed(self._store, robot, self._list_in_use, self._compute_unix_ms())
        if gone.schemas or gone.models:
            self._forget_named(robot)
            schemas, models = write_count(len(gone.schemas), "schema"), write_count(len(gone.models), "model")
            log.info("the archive: %s: deleted %s and %s that no segment names", robot, schemas, models)

    async def _sweep_expired(self) -> None:
        while True:
            await asyncio.sleep(SWEEP_EVERY_S)
            for robot in sorted(self._expired):
                try:
                    await self.sweep(robot)
                    self._expired.discard(robot)
                except ArchiveError:  # the writer reports it; retried later
                    continue
                except Exception as e:  # a bug of ours, with this robot
                    log.error("the archive: sweeping %s", robot, exc_info=e)

    def _list_in_use(self, robot: str) -> NamedHashes:
        segments = [] if self._writer is None else self._writer.list_waiting(robot)
        if self._kept is not None:
            for view in self._kept.list_views(robot):
                segments += self._kept.list_segments(robot, view)
        schemas = {segment.schema.hex() for segment in segments if segment.schema is not None}
        models = {segment.model for segment in segments if segment.model is not None}
        if self._keeper is not None:
            models |= self._keeper.find_storing(robot)
        return NamedHashes(frozenset(schemas), frozenset(models))

    def _forget(self, deletion: Deletion) -> None:
        if self._writer is not None:
            self._writer.drop_waiting(deletion.covers_segment)
        self._reader.forget(deletion.robot)
        self._forget_named(deletion.robot)  # any process may sweep the store: write what is named again

    def _forget_named(self, robot: str) -> None:
        if self._writer is not None:
            self._writer.forget_schemas(robot)
        if self._keeper is not None:
            self._keeper.forget(robot)
        if self._source is not None:
            self._source.forget(robot)

    def _compute_unix_ms(self) -> int:
        return round(1000 * Dispatcher.unix_s())


READ_S = 3.0  # for a call that a waiting request needs


@dataclass(frozen=True)
class ArchiveServices:
    """The reader of an object store; in processes that hear robots, also its writer and its indexer."""

    store: ObjectStore
    reader: ArchiveReader
    upkeep: ArchiveUpkeep
    trouble: BackgroundTrouble
    writer: ArchiveWriter | None = None
    indexer: Indexer | None = None

    def join(self, front: PastSource) -> PastSource:
        """Return a past that combines recent data in `front` with older data in the store."""
        return JoinedPast(front, self.reader, self.find_trouble)

    def find_trouble(self) -> str | None:
        """Return why the store can't be used, or that it is nearly full; None if all is well."""
        return self._find_store_trouble() or (
            None if self.indexer is None else self.indexer.space.find_trouble()
        )

    def _find_store_trouble(self) -> str | None:
        trouble = None if self.writer is None else self.writer.find_trouble()
        return trouble or self.trouble.find_trouble()

    def measure(self) -> ArchiveFigures:
        """Return its current state. Only where it is written; callable from any thread."""
        writer, indexer = self.writer, self.indexer
        assert writer is not None
        assert indexer is not None
        space = indexer.space.space
        return ArchiveFigures(
            trouble=self._find_store_trouble(),
            written=writer.written,
            dropped=writer.dropped,
            expired=indexer.expired,
            failures=writer.failures + indexer.failures,
            waiting_bytes=writer.waiting_bytes,
            stored_bytes=indexer.stored_bytes,
            free_bytes=None if space is None else space.free,
            disk_bytes=None if space is None else space.total,
        )

    def set_policy(self, policy: Policy) -> None:
        """Set which robots are kept, and how long."""
        self.upkeep.set_keeps(policy.keeps_s)
        if self.writer is not None and self.indexer is not None:
            self.writer.set_keeps(policy.keeps_s)
            self.indexer.set_keeps(policy.keeps_s)

    def start(self) -> None:
        """Start the background work."""
        self.upkeep.start()
        if self.indexer is not None:
            self.indexer.start()

    async def stop(self) -> None:
        """Write the queue and its indexes within a short time, then end."""
        await self.upkeep.stop()
        if self.writer is not None and self.indexer is not None:
            await self.writer.stop()
            await self.indexer.stop()


def make_archive(settings: Settings, deletions: Deletions) -> ArchiveServices | None:
    """Make the archive for `settings`; None without one. Raises StartError."""
    if settings.archive is None:
        return None
    try:
        store = open_object_store(settings.archive, makes_folder=settings.role != "gateway")
        quick = open_object_store(settings.archive, READ_S, makes_folder=False)
    except StoreUrlError as e:
        raise StartError(f"--past {settings.archive}: {e}") from None
    writer: ArchiveWriter | None = None
    indexer: Indexer | None = None
    if settings.role == "gateway":
        reader = ArchiveReader(quick, Dispatcher.now, Dispatcher.unix_s, deletions.cover)
    else:
        indexer = Indexer(store, Dispatcher.unix_s)
        reader = ArchiveReader(quick, Dispatcher.now, Dispatcher.unix_s, deletions.cover, indexer.mend)
        writer = ArchiveWriter(store, indexer.mend, deletions.cover_segment)
        indexer.writer = writer
    trouble = BackgroundTrouble() if indexer is None else indexer.trouble
    mend = None if indexer is None else indexer.mend
    upkeep = ArchiveUpkeep(store, deletions, reader, writer, mend, trouble)
    if indexer is not None:
        indexer.on_deleted(upkeep.note_expired)
    return ArchiveServices(store, reader, upkeep, trouble, writer, indexer)
