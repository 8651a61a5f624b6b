"""The past of a process: who records it, where it is kept and read, and for how long.

all, ingest   record in memory, and pass segments on to Redis and the archive if there are any
gateway       reads from Redis, and older data from the archive
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING

from posecast_relay.auth.access import Access
from posecast_relay.config.robots_reader import format_duration
from posecast_relay.config.settings import Settings
from posecast_relay.core.policy import (
    Audience,
    Policy,
    Rule,
    compute_kept_longest_s,
    compute_kept_s,
    compute_recent_s,
    list_idle_keeps,
    list_lookers,
)
from posecast_relay.kit import write_count
from posecast_relay.models.cache import ModelCache, ModelSource
from posecast_relay.past.command_socket import PastSocket, find_socket_path
from posecast_relay.past.deletions import Deletion, Deletions
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.recorder import Recorder, RecordingPorts
from posecast_relay.past.segment import KeptSegment
from posecast_relay.past.service import PastService
from posecast_relay.past.source import PastSource
from posecast_relay.runtime.dispatcher import Dispatcher

if TYPE_CHECKING:
    from posecast_relay.redis.past_deletions import RedisDeletions
    from posecast_relay.redis.past_reader import RedisPast
    from posecast_relay.redis.past_writer import RedisPastWriter
    from posecast_relay.server.archive import ArchiveServices

log = logging.getLogger("posecast_relay")

CROWD_EVERY_S = 60.0  # between two lines about a robot
IDLE_NAMED = 5  # the most robots without a kept past named in the line at the start


def describe_past(settings: Settings, policy: Policy, *, is_new: bool = False) -> str:
    """Describe in a line whether and how long the past is kept. `is_new`: the folder was just created."""
    if settings.past is None:
        return "the past: off (--past 0)"
    archive = describe_archive(settings, policy, " (new, empty)" if is_new else "")
    if settings.role == "gateway":
        return "the past: from Redis" + archive
    kept_s = compute_kept_longest_s(policy, compute_recent_s if settings.archive else compute_kept_s)
    if not kept_s:
        nothing = "the past: nothing is kept, because nobody may look back (`past` in the file of robots)"
        return nothing + archive if policy.keeps_s else nothing
    return f"the past: {format_duration(kept_s)} in memory, up to {settings.past_memory >> 20} MB{archive}"


def describe_archive(settings: Settings, policy: Policy, remark: str = "") -> str:
    """Describe which robots are kept in the object store; empty if there is none. `remark`: about the
    store."""
    if settings.archive is None:
        return ""
    if settings.role == "gateway":
        return f"; before that from {settings.archive}"
    at = f"{settings.archive}{remark}"
    if policy.rules is None:
        return f"; nothing in {at}: `keep` needs a file of robots (--robots)"
    if not policy.keeps_s:
        return f"; nothing in {at}: no robot has `keep` in the file of robots"
    idle = list_idle_keeps(policy)
    kept = ", ".join(
        f"{robot} {format_duration(keep_s)}"
        for robot, keep_s in policy.keeps_s.items()
        if (robot, None) not in idle
    )
    rest = f"; in {at}: {kept:.200}" if kept else f"; nothing in {at}"
    return "; ".join([rest, *(_describe_idle(*each) for each in idle[:IDLE_NAMED])])


def _describe_idle(robot: str, view: str | None) -> str:
    of, what = repr(robot), "keep" if view is None else f"view {view!r}: keep"
    return f"{what} of {of} has no effect: nobody may look back; give an audience `past`"


class PastLog:
    """Logs changes."""

    def __init__(self) -> None:
        self._policy: Policy | None = None
        self._crowded: dict[str, int] = {}  # by robot, the count that was already logged
        self._reported_at: dict[str, float] = {}

    def follow(self, policy: Policy) -> None:
        """Log which audiences can no longer see a robot, or may look back differently, and which `keep` has
        no effect.

        `describe_past` reports the first policy.
        """
        before, self._policy = self._policy, policy
        if before is None:
            return
        idle = list_idle_keeps(policy)
        for robot in sorted({*(before.rules or ()), *(policy.rules or ())}):
            old, new = before.find_rules(robot), policy.find_rules(robot)
            for audience in Audience:
                for line in _list_changes(audience, old.get(audience), new.get(audience)):
                    log.info("%s, %s: %s", robot, audience.value, line)
            if before.keeps_s.get(robot) != policy.keeps_s.get(robot) and (robot, None) not in idle:
                _tell_keep(robot, policy.keeps_s.get(robot))
        if before != policy:
            for each in idle:
                log.warning("%s", _describe_idle(*each))

    def report_crowding(self, kept: MemoryPast, now: float) -> None:
        """Log each robot that has lost its oldest data because memory is full, at most once a minute."""
        for robot, count in kept.crowded.items():
            if count == self._crowded.get(robot, 0) or now < self._reported_at.get(robot, now):
                continue
            self._crowded[robot], self._reported_at[robot] = count, now + CROWD_EVERY_S
            reach = format_duration(round(kept.compute_reach_s(robot, now)))
            log.warning(
                "the past: memory is full (--past-memory, %d MB): %s uses most of it, lost its oldest "
                "data and reaches back %s",
                kept.bytes_max >> 20,
                robot,
                reach,
            )


def _tell_keep(robot: str, keep_s: float | None) -> None:
    if keep_s is not None:
        log.warning("%s: the store keeps its past for %s", robot, format_duration(keep_s))
        return
    log.warning(
        "%s: `keep` was removed: nothing more is written to the store, and existing data stays until you set "
        "`keep` again or run `posecast-relay past delete`",
        robot,
    )


def _list_changes(audience: Audience, old: Rule | None, new: Rule | None) -> Iterator[str]:
    if old is None or new is None:
        return  # other lines report an added or removed robot or audience
    if old.blackout != new.blackout:
        yield "blackout begins" if new.blackout else "blackout ends"
    before_s, after_s = old.compute_past_s(audience), new.compute_past_s(audience)
    if before_s != after_s:
        yield f"may look back {format_duration(after_s)}" if after_s else "may no longer look back"


class ObedientMemory:
    """Wraps memory for the recorder: deleted segments are removed.

    A segment that was being recorded when its deletion was ordered is neither kept when it closes nor passed
    on.
    """

    def __init__(self, kept: MemoryPast, deletions: Deletions) -> None:
        self._kept = kept
        self._deletions = deletions
        self._began_ms = time.time_ns() // 1_000_000
        deletions.on_added(self._delete)

    def add(self, segment: KeptSegment, now: float) -> None:
        """Keep a segment that has just closed, unless it was deleted. `now`: the core's clock."""
        if not self._deletions.cover_segment(segment):
            self._kept.add(segment, now)

    def _delete(self, deletion: Deletion) -> None:
        gone = self._kept.delete(deletion)
        is_new = deletion.at_ms >= self._began_ms  # older ones were logged by an earlier process
        level = logging.WARNING if gone or is_new else logging.INFO
        count = write_count(len(gone), "segment")
        log.log(level, "past delete: %s: deleted %s from memory", describe_deletion(deletion), count)


def describe_deletion(deletion: Deletion) -> str:
    """Describe in a few words what a deletion covers."""
    view = "all views" if deletion.view is None else f"view {deletion.view}"
    return f"{deletion.robot}, {view}, {_write(deletion.from_ms)} to {_write(deletion.to_ms)}"


def _write(unix_ms: int) -> str:
    try:
        return datetime.fromtimestamp(unix_ms / 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):  # after the year 9999
        return f"{unix_ms} ms"


FORGET_EVERY_S = 5.0


@dataclass(frozen=True)
class PastServices:
    """The source of the past, and its connection to Redis if there is one. In processes that hear robots,
    also the recorder and the memory. With `--past 0`, nothing at all.
    """

    source: PastSource | None = None
    kept: MemoryPast | None = None
    recorder: Recorder | None = None
    writer: RedisPastWriter | None = None
    reader: RedisPast | None = None
    deletions: Deletions = field(default_factory=Deletions)
    deletion_feed: RedisDeletions | None = None  # passes deletions through Redis
    socket: PastSocket | None = None
    archive: ArchiveServices | None = None

    @property
    def connection(self) -> RedisPastWriter | RedisPast | None:
        """The connection that writes to Redis, or reads from it."""
        return self.writer or self.reader

    @property
    def written_archive(self) -> ArchiveServices | None:
        """The archive, if this process writes it."""
        return None if self.archive is None or self.archive.writer is None else self.archive

    @property
    def is_store_new(self) -> bool:
        """Whether this process's store is a folder that was just created."""
        return self.archive is not None and self.archive.store.is_new

    def make_service(self, dispatcher: Dispatcher) -> PastService | None:
        """Make what the routes of the past need; None if there is no past."""
        if self.source is None:
            return None
        return PastService(
            self.source,
            dispatcher.now,
            dispatcher.unix_s,
            self.deletions,
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

        Data is dropped at once when the policy changes, and regularly as time passes. Without a past it
        returns at once.
        """
        if self.source is None:
            return
        if self.connection is not None:
            self.connection.start()
        if self.deletion_feed is not None:
            self.deletion_feed.start()
        if self.archive is not None:
            self.archive.start()
        async with self.socket or contextlib.nullcontext():
            await self._follow(access, now)

    async def _follow(self, access: Access, now: Callable[[], float]) -> None:
        log_lines = PastLog()
        access.on_policy(lambda policy: self.forget(policy, now()))
        access.on_policy(log_lines.follow)
        while True:
            await asyncio.sleep(FORGET_EVERY_S)
            self.forget(access.policy, now())
            if self.kept is not None:
                log_lines.report_crowding(self.kept, now())

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
        if self.connection is not None:
            await self.connection.stop()
        if self.deletion_feed is not None:
            await self.deletion_feed.stop()
        if self.archive is not None:
            await self.archive.stop()


def make_past_services(settings: Settings, port: int = 0) -> PastServices:
    """Make the past for the role in `settings`. `port`: where the relay listens."""
    if settings.past is None:
        return PastServices()
    deletions, deletion_feed = Deletions(), None
    if settings.uses_redis:
        from posecast_relay.redis.past_deletions import RedisDeletions  # noqa: PLC0415

        deletion_feed = RedisDeletions(settings.store, deletions)
    archive: ArchiveServices | None = None
    if settings.archive is not None:
        from posecast_relay.server.archive import make_archive  # noqa: PLC0415 — seldom wanted

        archive = make_archive(settings, deletions)
    if settings.role == "gateway":
        from posecast_relay.redis.past_reader import RedisPast  # noqa: PLC0415 — half of the time to start

        reader = RedisPast(settings.store, settings.past_memory, Dispatcher.now, deletions)
        source = reader if archive is None else archive.join(reader)
        return PastServices(
            source, reader=reader, deletions=deletions, deletion_feed=deletion_feed, archive=archive
        )
    kept = MemoryPast(settings.past_memory)
    memory = ObedientMemory(kept, deletions)
    ports = RecordingPorts(memory.add, lambda: secrets.randbits(64), time.time)
    writer = None
    if settings.uses_redis:
        from posecast_relay.redis.past_writer import RedisPastWriter  # noqa: PLC0415

        writer = RedisPastWriter(settings.store, settings.past_memory, deletions)
        kept.on_added(writer.keep)
    if archive is not None and archive.writer is not None:
        kept.on_added(archive.writer.keep)
    memory_source = MemoryPastSource(kept)
    path = find_socket_path(settings.past_socket, port)
    return PastServices(
        memory_source if archive is None else archive.join(memory_source),
        kept=kept,
        recorder=Recorder(ports, list_lookers),
        writer=writer,
        deletions=deletions,
        deletion_feed=deletion_feed,
        socket=None if path is None else PastSocket(path, kept, deletions, settings.archive),
        archive=archive,
    )
