"""A gateway's past: read from Redis on demand, through a separate connection. It never writes.

For each requested view it keeps the records as of a moment ago, and some segments' bytes. If Redis does not
answer, requests fail at once. Live data has another connection and goes on.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import logging
from collections import OrderedDict, deque
from collections.abc import Awaitable, Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from posecast_relay.kit import NEVER, ExpiringCache, RecentDict
from posecast_relay.past.deletions import Deletion, Deletions
from posecast_relay.past.memory import MemoryPast, PastByView
from posecast_relay.past.segment import KeptSegment, SegmentName, unpack_record
from posecast_relay.past.source import ListWaiting, PastAway, RecentOnly, Wake
from posecast_relay.redis.client import REDIS_ERRORS, RedisUser, cancel_tasks
from posecast_relay.redis.past_scripts import LOOK, schema_key, segment_key, stream_key
from posecast_relay.runtime.tasks import SharedTasks

log = logging.getLogger("posecast_relay")

T = TypeVar("T")

FRESH_S = 0.2  # the maximum age of a view's records when they are requested
POLL_S = 0.2  # between two polls of the views that have waiting requests,
POLL_EACH_S = 0.002  # plus this per view
RETRY_S = 0.2  # while Redis is gone
AT_ONCE = 16  # concurrent exchanges
TURN_S = 1.0  # to wait for a free one
RECORDS = 100  # per answer
LOOKS_MAX = 1000  # the most answers for one view
VIEWS_MAX = 1000  # the most views with known records
VIEW_BYTES = 1000  # Python's overhead per view
DATA_BYTES = 16 << 20  # cached bytes of segments
SCHEMAS_MAX = 64
BUSY = "too many requests for the past right now: retry"
AWAY = "the past can't be read right now: retry"
TOO_MUCH = "the past of this robot is larger than --past-memory of this process"


class RedisPast(RedisUser, PastByView, RecentOnly):
    """A PastSource for Redis, and its own KeptPast. `now`: the core's clock in seconds; `bytes_max`: the
    limit for its records, not counting segments' bytes.
    """

    def __init__(
        self, url: str, bytes_max: int, now: Callable[[], float], deletions: Deletions | None = None
    ) -> None:
        super().__init__(url)
        self.passed_over = 0  # damaged or unsupported records and segments
        self._bytes_max = bytes_max
        self._now = now
        self._views: OrderedDict[tuple[str, str], PastReplica] = OrderedDict()  # most recently requested last
        self._data: ExpiringCache[bytes] = ExpiringCache(DATA_BYTES)  # by SegmentName
        self._schemas: RecentDict[tuple[str, bytes], str] = RecentDict(SCHEMAS_MAX)  # by robot
        self._reported: set[str] = set()  # robots that had something skipped
        self._asked = SharedTasks("the past")
        self._turns = asyncio.Semaphore(AT_ONCE)
        self._list_waiting: ListWaiting = tuple
        self._wake: Wake = lambda _robot, _view: None
        self._lost = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._deletions = deletions or Deletions()
        self._deletions.on_added(self._forget_deleted)

    # ---- what is known -----------------------------------------------------------

    @property
    def kept(self) -> RedisPast:
        """Itself."""
        return self

    @property
    def is_older(self) -> bool:
        """Whether it may hold data recorded before this process started."""
        return True

    def get_view(self, robot: str, view: str) -> MemoryPast:
        """Return what is known of a view."""
        replica = self._views.get((robot, view))
        return MemoryPast(0) if replica is None else replica.kept

    # ---- a source ------------------------------------------------------------------

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Poll the views that `list_waiting` returns, and call `wake` when there is something new."""
        self._list_waiting, self._wake = list_waiting, wake

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Update what is known of a view: at most FRESH_S old, or with `anew` read now.

        Raises PastAway.
        """
        key = robot, view
        since_s = self._now() - (0 if anew else FRESH_S)
        for _ in range(2):  # a read in progress may have started earlier
            self._check()
            replica = self._views.get(key)
            if replica is not None and replica.looked_at > since_s:
                self._views.move_to_end(key)
                return
            await self._share(key, partial(self._look, robot, view))

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, except those that are gone or damaged. Raises PastAway."""
        self._check()
        names = [segment.name for segment in segments]
        found = {name: data for name in names if (data := self._data.find(name, 0.0)) is not None}
        lacking = tuple(name for name in names if name not in found)
        if lacking:
            found |= await self._share(lacking, partial(self._read_data, lacking))
        whole = []
        for segment in segments:
            data = found.get(segment.name)
            if self._deletions.cover_segment(segment):
                continue
            if data is not None and hashlib.sha256(data).digest() == segment.sha256:
                self._data.put(segment.name, data, len(data), NEVER)
                whole.append(replace(segment, data=data, elsewhere_bytes=0))
                continue
            if data is not None:
                self._pass_over(segment.name.robot, "a segment whose bytes are damaged")
            replica = self._views.get((segment.name.robot, segment.name.view))
            if replica is not None:
                replica.drop(segment.name)
        return whole

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:  # noqa: ARG002
        """Return the text of a schema that a segment names; None if it is gone. Raises PastAway."""
        self._check()
        key = robot, sha256
        if key not in self._schemas:
            data = await self._share(key, partial(self._read_schema, robot, sha256))
            if data is None or hashlib.sha256(data).digest() != sha256:
                if data is not None:
                    self._pass_over(robot, "a schema that is damaged")
                return None
            self._schemas[key] = data.decode()  # its hash proves that it is text
        return self._schemas[key]

    def start(self) -> None:
        """Start to connect and to poll. Redis need not be up yet."""
        self._task = asyncio.create_task(self._work(), name="the past from redis")

    async def stop(self) -> None:
        """Close all connections."""
        await cancel_tasks(self._task, *self._asked.list_running())
        await self.link.close()

    # ---- the connection --------------------------------------------------------------

    async def _work(self) -> None:
        waiting: list[tuple[str, str]] = []
        while True:
            try:
                if self._trouble is not None:
                    await self._connect()
                waiting = list(self._list_waiting())
                await asyncio.gather(*(self._look_again(*key) for key in waiting))
            except Exception as e:  # start again, whatever it was
                self._lose(e)
            if self._trouble is not None:
                for key in self._list_waiting():  # wake them, so that they get the error
                    self._wake(*key)
                await self.link.reset()
                await asyncio.sleep(RETRY_S)
                continue
            if self.link.note_success():
                log.warning("the past: redis is back")
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(POLL_S, POLL_EACH_S * len(waiting))):
                    await self._lost.wait()

    async def _connect(self) -> None:
        await self.link.connect(LOOK)
        for replica in self._views.values():
            replica.note_look(float("-inf"))
        self._lost.clear()
        self._trouble = None

    def _lose(self, error: Exception) -> None:
        if why := self.note_failure(error):
            log.warning("the past: redis: %s; requests for the past fail, live data continues", why)
        self._lost.set()

    async def _look_again(self, robot: str, view: str) -> None:
        try:
            await self.refresh(robot, view)
        except PastAway:
            return  # the requests that wait will get the error
        except Exception as e:  # a bug of ours, with this view
            self._pass_over(robot, repr(e))

    def _check(self) -> None:
        if self._trouble is not None:
            raise PastAway(AWAY)

    async def _share(self, key: Hashable, ask: Callable[[], Awaitable[T]]) -> T:
        """Wait for the same request if one is already running; otherwise make it. Raises PastAway."""
        return await self._asked.run(key, partial(self._ask, ask))

    async def _ask(self, ask: Callable[[], Awaitable[T]]) -> T:
        """Make one exchange. An error of Redis affects all requests, an error of our own code only this
        one."""
        try:
            return await ask()
        except REDIS_ERRORS as e:
            self._lose(e)
            raise PastAway(AWAY) from None

    async def _exchange(self, ask: Callable[[], Awaitable[T]]) -> T:
        try:
            async with asyncio.timeout(TURN_S):
                await self._turns.acquire()
        except TimeoutError:
            raise PastAway(BUSY) from None
        try:
            self._check()
            return await ask()
        finally:
            self._turns.release()

    # ---- input from Redis, not trusted -------------------------------------------------

    async def _look(self, robot: str, view: str) -> None:
        key = robot, view
        replica = self._views.get(key) or self._make_replica(robot, view)
        began_at, is_new, is_whole, deleted = self._now(), False, False, self._deletions.count
        for _ in range(LOOKS_MAX):
            args = LOOK, [stream_key(robot, view)], replica.newest, RECORDS
            count, oldest, *told = await self._exchange(partial(self.link.run, *args))
            is_new |= replica.append(told)
            if count:
                replica.drop_before(oldest)
            if replica.kept.bytes > self._bytes_max:
                self._views.pop(key, None)
                raise PastAway(TOO_MUCH)
            if replica.count == count or (is_whole and not told):
                break
            if not told:  # one in the middle is gone, or all are
                replica = self._make_replica(robot, view)
                is_whole = True
        if self._deletions.count != deleted:  # deleted in the meantime: the result may contain it
            self._views.pop(key, None)
            await self._look(robot, view)
            return
        replica.note_look(began_at)
        is_grown = is_new or key not in self._views
        self._views[key] = replica
        self._views.move_to_end(key)
        if is_grown:
            self._make_room()
        if is_new:
            self._wake(robot, view)

    def _make_replica(self, robot: str, view: str) -> PastReplica:
        return PastReplica(robot, view, partial(self._pass_over, robot), self._deletions.cover_segment)

    def _forget_deleted(self, deletion: Deletion) -> None:
        """Drop a robot's data because part of it is being deleted. The rest will be read again."""
        for key in [key for key in self._views if key[0] == deletion.robot]:
            del self._views[key]
        self._data.forget(lambda name: isinstance(name, SegmentName) and name.robot == deletion.robot)
        for schema in [schema for schema in self._schemas if schema[0] == deletion.robot]:
            del self._schemas[schema]

    async def _read_data(self, names: Sequence[SegmentName]) -> dict[SegmentName, bytes]:
        def ask(pipe: Any) -> None:
            for name in names:
                pipe.hget(segment_key(name), "data")

        answers = await self._exchange(partial(self.link.read_all, ask))
        return {
            name: data for name, data in zip(names, answers, strict=True) if isinstance(data, bytes) and data
        }

    async def _read_schema(self, robot: str, schema: bytes) -> bytes | None:
        def ask(pipe: Any) -> None:
            pipe.hget(schema_key(robot, schema.hex()), "text")

        (answer,) = await self._exchange(partial(self.link.read_all, ask))
        return answer if isinstance(answer, bytes) else None

    def _pass_over(self, robot: str, why: str) -> None:
        self.passed_over += 1
        if robot not in self._reported:
            self._reported.add(robot)
            log.warning("the past in redis: %s: skipped: %.200s", robot, why)

    def _make_room(self) -> None:
        """Drop the least recently requested views."""
        size = sum(VIEW_BYTES + replica.kept.bytes for replica in self._views.values())
        while len(self._views) > 1 and (size > self._bytes_max or len(self._views) > VIEWS_MAX):
            size -= VIEW_BYTES + self._views.popitem(last=False)[1].kept.bytes


BEGINNING = b"-"
UNBOUNDED = 1 << 62  # the owner of the replicas bounds them together


class PastReplica:
    """A view's records, without the segments' bytes. `pass_over` is called with the reason when a record is
    skipped; deleted records are skipped silently.
    """

    def __init__(
        self,
        robot: str,
        view: str,
        pass_over: Callable[[str], None],
        is_deleted: Callable[[KeptSegment], bool] = lambda _segment: False,
    ) -> None:
        self.kept = MemoryPast(UNBOUNDED)
        self.looked_at = float("-inf")  # seconds of the core's clock
        self._robot = robot
        self._view = view
        self._pass_over = pass_over
        self._is_deleted = is_deleted
        self._rows: deque[tuple[bytes, SegmentName | None]] = deque()  # None: skipped

    @property
    def newest(self) -> bytes:
        """The id after which to look for new records."""
        return self._rows[-1][0] if self._rows else BEGINNING

    @property
    def count(self) -> int:
        """How many records it has, including skipped ones."""
        return len(self._rows)

    def note_look(self, at_s: float) -> None:
        """Note when it was last compared with Redis; minus infinity: compare it before use."""
        self.looked_at = at_s

    def append(self, told: Sequence[bytes]) -> bool:
        """Append alternating ids and records. Returns whether any was a segment."""
        found = False
        for id_, record in zip(told[::2], told[1::2], strict=True):
            try:
                segment = unpack_record(self._robot, self._view, record)
                if self._is_deleted(segment):  # Redis is about to delete it, too
                    self._rows.append((id_, None))
                    continue
                self.kept.add(segment, 0.0)
            except ValueError as e:
                self._pass_over(str(e))
                self._rows.append((id_, None))
            else:
                self._rows.append((id_, segment.name))
                found = True
        return found

    def drop_before(self, oldest: bytes) -> None:
        """Drop the records older than this id."""
        first = _order(oldest)
        while self._rows and _order(self._rows[0][0]) < first:
            _, name = self._rows.popleft()
            if name is not None and self.kept.find(name) is not None:
                self.kept.drop_oldest(self._robot)

    def drop(self, name: SegmentName) -> None:
        """Drop one segment because it is gone or damaged."""
        segments = self.kept.list_segments(self._robot, self._view)
        self.kept = MemoryPast(UNBOUNDED)
        for segment in segments:
            if segment.name != name:
                self.kept.add(segment, 0.0)


def _order(id_: bytes) -> tuple[int, int]:
    """Return a stream id as a sortable pair."""
    ms, _, n = id_.partition(b"-")
    return int(ms), int(n or b"0")
