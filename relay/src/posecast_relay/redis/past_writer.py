"""Writes closed segments to Redis for gateways, through a separate connection, without delaying live data.

The queue is bounded in bytes. If Redis is slow or away, the robots with the longest queues lose their oldest
segments. These are counted, and the past has a gap there.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections import Counter, deque
from collections.abc import Collection, Iterable
from typing import NamedTuple

from redis.exceptions import OutOfMemoryError

from posecast_relay.kit import RecentDict, write_count
from posecast_relay.past.deletions import Deletion, Deletions
from posecast_relay.past.segment import OBJECT_BYTES, KeptSegment, SegmentName, pack_record, unpack_record
from posecast_relay.redis.client import Call, RedisClient, RedisUser, cancel_tasks
from posecast_relay.redis.past_scripts import (
    DELETE,
    ENTER,
    EXPIRY_SPARE_MS,
    FORGET,
    FORGOTTEN_MAX,
    FULL,
    LACKS_SCHEMA,
    LEDGER,
    LOOK,
    WRITE,
    WRITTEN,
    LedgerEntry,
    make_delete_call,
    make_enter_call,
    make_forget_call,
    make_write_call,
    read_entry,
    stream_key,
)

log = logging.getLogger("posecast_relay")

QUEUE_BYTES = 32 << 20
BATCH = 64  # segments per exchange
BATCH_BYTES = 1 << 20  # bytes per exchange, except for a single segment
TRIES = 3  # to write one batch; then it is dropped, because it may be the cause
BACKOFF_S = (0.2, 2.0)  # the first and the longest wait after a failure
TROUBLE_LOOK_S = 1.0  # after a failure, how often to check whether it is over
CALM_S = 60.0  # without a refusal until Redis counts as having room again
STOP_S = 0.5  # to write the queue when the process stops
ROUNDED_UP = 1.25  # Redis needs at most this factor more memory than the bytes themselves
SCHEMAS_MAX = 10_000  # schemas known to be stored


class _Written(NamedTuple):
    """A segment as written to Redis. `schema_text`: "" if the schema should already be stored."""

    segment: KeptSegment
    entry: LedgerEntry
    record: bytes
    schema_text: str

    def make_call(self, expiry_ms: int, schema_text: str | None = None) -> Call:
        """Make the call that writes it."""
        text = self.schema_text if schema_text is None else schema_text
        return make_write_call(self.entry, self.record, self.segment.data, text, expiry_ms)


class RedisPastWriter(RedisUser):
    """Writes the segments that it gets to Redis, limited to `bytes_max` for all processes together."""

    def __init__(self, url: str, bytes_max: int, deletions: Deletions | None = None) -> None:
        super().__init__(url)
        self.written = 0  # segments written
        self.dropped = 0  # segments that were lost
        self.passed_over = 0  # invalid lines of the ledger
        self.bytes = 0  # in the queue
        self._bytes_max = bytes_max
        self._window_s = 0.0
        self._waiting: dict[str, deque[KeptSegment]] = {}  # by robot; the next one first
        self._sizes: Counter[str] = Counter()  # of those, by robot
        self._robots: Collection[str] = ()  # the robots that the policy names
        self._gone: dict[str, None] = {}  # robots whose past must be deleted there
        self._deletions = deletions or Deletions()
        self._deleting: dict[str, Deletion] = {}  # deletions to execute there, by id
        self._deletions.on_added(self._delete)
        self._schemas: RecentDict[tuple[str, bytes], None] = RecentDict(SCHEMAS_MAX)  # by robot: written
        self._tries = 0
        self._full_at: float | None = None  # when Redis last refused a segment; None: it has room
        self._dropped_before = 0  # the value of `dropped` when Redis last accepted something
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    def keep(self, segment: KeptSegment) -> None:
        """Queue a segment that has just closed. Returns at once."""
        robot = segment.name.robot
        self._waiting.setdefault(robot, deque()).append(segment)
        self._add(robot, segment.cost_bytes)
        if self.bytes > QUEUE_BYTES:
            self._shed()
        self._wake.set()

    def set_window(self, window_s: float) -> None:
        """Set how long segments are kept there, in seconds."""
        self._window_s = window_s

    def set_robots(self, robots: Collection[str]) -> None:
        """Set which robots the policy names. The past of robots that it no longer names is deleted there."""
        for robot in set(self._robots) - set(robots):
            self._gone[robot] = None
            while waiting := self._waiting.get(robot):
                self._take(robot, waiting.popleft())
        self._robots = robots
        self._wake.set()

    def _delete(self, deletion: Deletion) -> None:
        """Delete a span there and in the queue."""
        self._deleting[deletion.id] = deletion
        waiting = self._waiting.get(deletion.robot, ())
        for segment in [each for each in waiting if deletion.covers_segment(each)]:
            self._waiting[deletion.robot].remove(segment)
            self._take(deletion.robot, segment)
        self._wake.set()

    def start(self) -> None:
        """Start the writing task. Redis need not be up yet."""
        self._task = asyncio.create_task(self._work(), name="the past to redis")

    async def stop(self) -> None:
        """Write the queue within a short time, then close all connections."""
        await cancel_tasks(self._task)
        with contextlib.suppress(Exception):  # best effort
            async with asyncio.timeout(STOP_S):
                while self._waiting and self._trouble is None:
                    await self._write_batch(self._take_batch())
        await self.link.close()

    async def _work(self) -> None:
        wait_s = BACKOFF_S[0]
        while True:
            batch: list[KeptSegment] = []
            try:
                if self._trouble is not None:
                    await self._connect()
                while self._gone:
                    await self._forget(next(iter(self._gone)))
                await self._delete_all()
                while self._waiting:
                    batch = self._take_batch()
                    await self._write_batch(batch)
                    batch, self._tries, wait_s = [], 0, BACKOFF_S[0]
                    self._note_success()
                    await self._delete_all()
            except asyncio.CancelledError:  # `stop` writes the queue
                self._put_back(batch)
                raise
            except Exception as e:  # retry the batch, whatever it was
                await self._handle_failure(e)
                self._put_back(batch)
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, BACKOFF_S[1])
                continue
            try:
                async with asyncio.timeout(TROUBLE_LOOK_S if self.link.outage.is_open else None):
                    await self._wake.wait()
            except TimeoutError:  # the whole queue was written: check whether the problem is over
                self._note_success()
            self._wake.clear()

    async def _connect(self) -> None:
        await self.link.connect(ENTER, WRITE, DELETE, FORGET, LOOK)
        self._schemas.clear()  # they may be gone
        self._trouble = None

    def _note_success(self) -> None:
        if self.link.note_success():
            lost = self.dropped - self._dropped_before
            told = f"gateways lack {write_count(lost, 'segment')}" if lost else "nothing was lost"
            log.warning("the past: redis is back; %s", told)
        if not self.link.outage.is_open:
            self._dropped_before = self.dropped

    async def _handle_failure(self, error: Exception) -> None:
        if why := self.note_failure(error):
            log.warning(
                "the past: redis: %s; queueing up to %d MB, live data continues",
                why,
                QUEUE_BYTES >> 20,
            )
        await self.link.reset()

    # ---- the queue -----------------------------------------------------------

    def _add(self, robot: str, size: int) -> None:
        self.bytes += size
        self._sizes[robot] += size

    def _take(self, robot: str, segment: KeptSegment) -> None:
        """Account for a segment that was just taken from a robot's queue."""
        self._add(robot, -segment.cost_bytes)
        if not self._waiting[robot]:
            del self._waiting[robot], self._sizes[robot]

    def _shed(self) -> None:
        """Drop the oldest segments of the robots with more than their share, until an eighth is free."""
        aim = QUEUE_BYTES - QUEUE_BYTES // 8
        share = aim // len(self._waiting)
        for robot in sorted(self._sizes, key=self._sizes.__getitem__, reverse=True):
            while self.bytes > aim and self._sizes.get(robot, 0) > share:
                self._take(robot, self._waiting[robot].popleft())
                self.dropped += 1

    def _take_batch(self) -> list[KeptSegment]:
        """Return the oldest segments of the robots, in turn."""
        batch: list[KeptSegment] = []
        size = 0
        while self._waiting and len(batch) < BATCH:
            robot = next(iter(self._waiting))
            size += self._waiting[robot][0].cost_bytes
            if batch and size > BATCH_BYTES:
                break
            segments = self._waiting.pop(robot)
            self._waiting[robot] = segments  # now it is the turn of the others
            segment = segments.popleft()
            self._take(robot, segment)
            batch.append(segment)
        return batch

    def _put_back(self, batch: list[KeptSegment]) -> None:
        if not batch:
            return
        self._tries += 1
        if self._tries >= TRIES:
            self._tries = 0
            self.dropped += len(batch)
            return
        for segment in reversed(batch):
            robot = segment.name.robot
            if robot in self._gone or self._deletions.cover_segment(segment):
                continue
            self._waiting.setdefault(robot, deque()).appendleft(segment)
            self._add(robot, segment.cost_bytes)

    # ---- to Redis --------------------------------------------------------------

    async def _write_batch(self, batch: list[KeptSegment]) -> None:
        made = [found for segment in batch if (found := self._make(segment)) is not None]
        try:
            evicted = await self._make_room([each.entry for each in made])
        except OutOfMemoryError:  # live state and the past have used up its `maxmemory`
            self.dropped += len(batch)
            self._note_fullness(is_full=True)
            return
        made = [
            each for each in made if each.entry.name not in evicted
        ]  # an evicted one is larger than the whole limit
        expiry_ms = round(1000 * self._window_s) + EXPIRY_SPARE_MS
        results = await self.link.run_all([each.make_call(expiry_ms) for each in made])
        lacking = [
            each for each, result in zip(made, results, strict=True) if result == LACKS_SCHEMA
        ]  # it has expired in the meantime
        again = [each.make_call(expiry_ms, each.segment.schema_text or "") for each in lacking]
        results += await self.link.run_all(again)
        written = sum(result == WRITTEN for result in results)
        self.written += written
        self.dropped += len(batch) - written
        self._note_fullness(FULL in results)
        for each in made:
            if each.segment.schema is not None:
                self._schemas[each.segment.name.robot, each.segment.schema] = None

    def _make(self, segment: KeptSegment) -> _Written | None:
        """Return what to write for a segment; None if our own code fails on it, which loses only that
        segment."""
        try:
            record = pack_record(segment)
            is_known = (segment.name.robot, segment.schema) in self._schemas
            text = "" if is_known else segment.schema_text or ""
            size = OBJECT_BYTES + round(ROUNDED_UP * (len(segment.data) + len(record) + len(text)))
            schema = "-" if segment.schema is None else segment.schema.hex()
            return _Written(segment, LedgerEntry(segment.name, schema, size), record, text)
        except Exception as e:
            log.error("the past to redis: %s/%s", segment.name.robot, segment.name.view, exc_info=e)
            return None

    async def _make_room(self, entries: list[LedgerEntry]) -> set[object]:
        """Enter these into the ledger, and delete what it drops. Returns the dropped names."""
        gone: set[object] = set()
        fits = False
        while not fits:
            script, keys, args = make_enter_call(entries, self._window_s, self._bytes_max)
            told = await self.link.run(script, keys, *args)
            fits = bool(told[0]) or len(told) == 1
            evicted = self._read_entries(zip(told[1::2], told[2::2], strict=True))
            gone.update(entry.name for entry in evicted)
            entries = [entry for entry in entries if entry.name not in gone]
            await self.link.run_all([make_delete_call(entry) for entry in evicted])
        return gone

    async def _forget(self, robot: str) -> None:
        """Delete everything of a robot that the ledger lists. Repeating it is harmless."""
        lines: list[bytes] = []
        while True:
            script, keys, args = make_forget_call(robot, lines)
            lines = await self.link.run(script, keys, *args)
            if not lines:
                break
            entries = self._read_entries((robot.encode(), line) for line in lines)
            await self.link.run_all([make_delete_call(entry) for entry in entries])
        self._forget_schemas(robot)
        del self._gone[robot]

    async def _delete_all(self) -> None:
        """Execute the pending deletions. Repeating it is harmless."""
        while self._deleting:
            deletion = next(iter(self._deleting.values()))
            await delete_span(self.link, deletion)
            self._forget_schemas(deletion.robot)
            self._deleting.pop(deletion.id, None)

    def _forget_schemas(self, robot: str) -> None:
        for known in [known for known in self._schemas if known[0] == robot]:
            del self._schemas[known]

    def _read_entries(self, lines: Iterable[tuple[bytes, bytes]]) -> list[LedgerEntry]:
        entries: list[LedgerEntry] = []
        for robot, line in lines:
            try:
                entries.append(read_entry(robot, line))
            except ValueError:
                self.passed_over += 1  # another program wrote it
        return entries

    def _note_fullness(self, is_full: bool) -> None:
        now = time.monotonic()
        if is_full:
            if self._full_at is None:
                log.warning(
                    "the past: redis is near its maxmemory; gateways' past has gaps, live data continues"
                )
            self._full_at = now
        elif self._full_at is not None and now - self._full_at >= CALM_S:
            self._full_at = None
            log.warning("the past: redis has had room for %g s", CALM_S)


# Deletes a span of a robot's past from Redis: segments, records, their lines in the ledger, schemas that no
# segment names any more.

RECORDS = 100  # in one answer
LOOKS_MAX = 10_000  # for one view


async def delete_span(link: RedisClient, deletion: Deletion) -> int:
    """Delete what a deletion covers, and return how many segments that was; twice does no harm.

    `link` must have been given LOOK, DELETE and FORGET.
    """
    lines = await _read_ledger(link, deletion.robot)
    views = {name.view for name in lines} | ({deletion.view} if deletion.view else set())
    gone: list[LedgerEntry] = []
    for view in sorted(view for view in views if deletion.view in (None, view)):
        gone += await _find_covered(link, deletion, view, lines)
    for at in range(0, len(gone), FORGOTTEN_MAX):
        part = gone[at : at + FORGOTTEN_MAX]
        await link.run_all([make_delete_call(entry) for entry in part])
        known = [lines[entry.name][1] for entry in part if entry.name in lines]
        if known:
            script, keys, args = make_forget_call(deletion.robot, known)
            await link.run(script, keys, *args)
    return len(gone)


async def _read_ledger(link: RedisClient, robot: str) -> dict[SegmentName, tuple[LedgerEntry, bytes]]:
    """Return what the ledger has of a robot, with its lines as they stand there."""
    key = f"{LEDGER}:{robot}"
    if await link.call(link.client.type(key)) != b"zset":
        return {}
    found: dict[SegmentName, tuple[LedgerEntry, bytes]] = {}
    at = 0
    while lines := await link.call(link.client.zrange(key, at, at + FORGOTTEN_MAX - 1)):
        at += len(lines)
        for line in lines:
            try:
                entry = read_entry(robot.encode(), line)
            except ValueError:  # somebody else wrote it
                continue
            found[entry.name] = entry, line
    return found


async def _find_covered(
    link: RedisClient, deletion: Deletion, view: str, lines: dict[SegmentName, tuple[LedgerEntry, bytes]]
) -> list[LedgerEntry]:
    found: list[LedgerEntry] = []
    after = b"-"
    for _ in range(LOOKS_MAX):
        _, _, *told = await link.run(LOOK, [stream_key(deletion.robot, view)], after, RECORDS)
        if not told:
            break
        for record in told[1::2]:
            try:
                segment = unpack_record(deletion.robot, view, record)
            except ValueError:  # gateways show nothing of it either, and it expires
                continue
            if deletion.covers_segment(segment):
                schema = "-" if segment.schema is None else segment.schema.hex()
                entry, _ = lines.get(segment.name, (LedgerEntry(segment.name, schema, 0), b""))
                found.append(entry)
        after = told[-2]
    return found
