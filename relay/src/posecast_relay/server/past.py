"""The past of a process: who records it, where it is kept and read, and for how long.

all, ingest   record in memory, and pass segments on to Redis and the archive if there are any
gateway       reads from Redis, and older data from the archive
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from posecast_relay.auth.access import Access
from posecast_relay.config.settings import Settings
from posecast_relay.core.past.deletions import Deletions
from posecast_relay.core.past.memory_store import MemoryPast
from posecast_relay.core.past.recorder import Recorder
from posecast_relay.core.past.stream_recording import RecordingPorts
from posecast_relay.core.policy.past import (
    compute_kept_longest_s,
    compute_kept_s,
    compute_recent_s,
    list_lookers,
)
from posecast_relay.core.policy.policy import Policy
from posecast_relay.http.past.desk import PastDesk
from posecast_relay.models.cache import ModelCache, ModelSource
from posecast_relay.past_source import PastSource
from posecast_relay.past_source_memory import MemoryPastSource
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.past_deletion import ObedientMemory
from posecast_relay.server.past_log import PastLog
from posecast_relay.server.past_socket import PastSocket, find_socket_path

if TYPE_CHECKING:
    from posecast_relay.redis.deletions.feed import RedisDeletions
    from posecast_relay.redis.past_reader import RedisPast
    from posecast_relay.redis.past_writer import RedisPastWriter
    from posecast_relay.server.archive import ArchiveServices

FORGET_EVERY_S = 5.0


@dataclass(frozen=True)
class PastServices:
    """The source of the past, and its connection to Redis if there is one. In processes that hear robots,
    also the recorder and the memory.
    """

    source: PastSource
    kept: MemoryPast | None = None
    recorder: Recorder | None = None
    writer: RedisPastWriter | None = None
    reader: RedisPast | None = None
    deletions: Deletions = field(default_factory=Deletions)
    told: RedisDeletions | None = None  # passes deletions through Redis
    socket: PastSocket | None = None
    archive: ArchiveServices | None = None

    @property
    def way(self) -> RedisPastWriter | RedisPast | None:
        """The connection that writes to Redis, or reads from it."""
        return self.writer or self.reader

    @property
    def written_archive(self) -> ArchiveServices | None:
        """The archive, if this process writes it."""
        return None if self.archive is None or self.archive.writer is None else self.archive

    def make_desk(self, dispatcher: Dispatcher) -> PastDesk:
        """Make what the routes of the past need."""
        return PastDesk(
            *(self.source, dispatcher.now, dispatcher.unix_s, self.deletions),
            has_models=self.archive is not None,
        )

    def join_models(self, live: ModelSource) -> ModelSource:
        """Return a source of models that also has those of the past, if they are kept."""
        return live if self.archive is None else self.archive.upkeep.join_models(live)

    def keep_models(self, models: ModelCache) -> None:
        """Keep the models that the past names, if it is kept in a store."""
        if self.archive is not None and self.kept is not None:
            self.archive.upkeep.keep_models(models, self.kept)

    async def run(self, access: Access, now: Callable[[], float]) -> None:
        """Connect to Redis, open the socket for `past`, and drop expired data, until cancelled.

        Data is dropped at once when the policy changes, and regularly as time passes.
        """
        if self.way is not None:
            self.way.start()
        if self.told is not None:
            self.told.start()
        if self.archive is not None:
            self.archive.start()
        async with self.socket or contextlib.nullcontext():
            await self._follow(access, now)

    async def _follow(self, access: Access, now: Callable[[], float]) -> None:
        said = PastLog()
        access.on_policy(lambda policy: self.forget(policy, now()))
        access.on_policy(said.follow)
        while True:
            await asyncio.sleep(FORGET_EVERY_S)
            self.forget(access.policy, now())
            if self.kept is not None:
                said.report_crowding(self.kept, now())

    def forget(self, policy: Policy, now: float) -> None:
        """Drop what can't be requested any more under this policy."""
        kept_s = compute_kept_s if self.archive is None else compute_recent_s
        if self.kept is not None:
            self.kept.forget_older(partial(kept_s, policy), now)
        if self.writer is not None:
            self.writer.set_window(compute_kept_longest_s(policy, kept_s))
            self.writer.set_robots(policy.rules or ())
        if self.archive is not None:
            self.archive.set_policy(policy)

    async def stop(self, now: float) -> None:
        """Close the open segments, then the connection to Redis."""
        if self.recorder is not None:
            self.recorder.close_all(now)
        if self.way is not None:
            await self.way.stop()
        if self.told is not None:
            await self.told.stop()
        if self.archive is not None:
            await self.archive.stop()


def is_store_new(past: PastServices | None) -> bool:
    """Whether this process's store is a folder that was just created."""
    return past is not None and past.archive is not None and past.archive.store.is_new


def make_past_services(settings: Settings, port: int = 0) -> PastServices | None:
    """Make the past for the role in `settings`; None with `--past 0`. `port`: where the relay listens."""
    if settings.past is None:
        return None
    deletions, told = Deletions(), None
    if settings.store != "memory://":
        from posecast_relay.redis.deletions.feed import RedisDeletions  # noqa: PLC0415

        told = RedisDeletions(settings.store, deletions)
    archive: ArchiveServices | None = None
    if settings.archive is not None:
        from posecast_relay.server.archive import make_archive  # noqa: PLC0415 — seldom wanted

        archive = make_archive(settings, deletions)
    if settings.role == "gateway":
        from posecast_relay.redis.past_reader import RedisPast  # noqa: PLC0415 — half of the time to start

        reader = RedisPast(settings.store, settings.past_memory, Dispatcher.now, deletions)
        source = reader if archive is None else archive.join(reader)
        return PastServices(source, reader=reader, deletions=deletions, told=told, archive=archive)
    kept = MemoryPast(settings.past_memory)
    memory = ObedientMemory(kept, deletions)
    ports = RecordingPorts(memory.add, lambda: secrets.randbits(64), time.time)
    writer = None
    if settings.store != "memory://":
        from posecast_relay.redis.past_writer import RedisPastWriter  # noqa: PLC0415

        writer = RedisPastWriter(settings.store, settings.past_memory, deletions)
        kept.on_added(writer.keep)
    if archive is not None and archive.writer is not None:
        kept.on_added(archive.writer.keep)
    memory_source = MemoryPastSource(kept)
    path = find_socket_path(settings.past_socket, port)
    return PastServices(
        *(
            memory_source if archive is None else archive.join(memory_source),
            kept,
            Recorder(ports, list_lookers),
            writer,
            None,
            deletions,
            told,
        ),
        socket=None if path is None else PastSocket(path, kept, deletions, settings.archive),
        archive=archive,
    )
