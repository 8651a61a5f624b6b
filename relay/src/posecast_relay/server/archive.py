"""The archive of a process: written where robots are heard, and read wherever the past is read."""

from __future__ import annotations

from dataclasses import dataclass

from posecast_relay.archive.background_trouble import BackgroundTrouble
from posecast_relay.archive.indexer import Indexer
from posecast_relay.archive.joined_past import JoinedPast
from posecast_relay.archive.object_store import ObjectStore, open_object_store
from posecast_relay.archive.reader import ArchiveReader
from posecast_relay.archive.writer import ArchiveWriter
from posecast_relay.config.settings import Settings, StartError
from posecast_relay.config.store_url import StoreUrlError
from posecast_relay.core.past.deletions import Deletions
from posecast_relay.core.policy.policy import Policy
from posecast_relay.http.metrics import ArchiveFigures
from posecast_relay.past_source import PastSource
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.archive_upkeep import ArchiveUpkeep

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
        """Return its current state. Callable from any thread."""
        writer, indexer = self.writer, self.indexer
        space = None if indexer is None else indexer.space.space
        return ArchiveFigures(
            trouble=self._find_store_trouble(),
            written=0 if writer is None else writer.written,
            dropped=0 if writer is None else writer.dropped,
            expired=0 if indexer is None else indexer.expired,
            failures=(0 if writer is None else writer.failures)
            + (0 if indexer is None else indexer.failures),
            waiting_bytes=0 if writer is None else writer.waiting_bytes,
            stored_bytes=0 if indexer is None else indexer.stored_bytes,
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
