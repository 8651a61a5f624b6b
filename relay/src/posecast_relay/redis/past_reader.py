"""A gateway's past: read from Redis when it is asked for, on a connection of its own. It writes nothing.

Of a view that somebody asks for it knows the records as of a moment ago, and keeps some segments' bytes. When
Redis does not answer, whoever asks is told so at once; live goes on, it has another connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import logging
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from posecast_relay.core.histogram import Histogram
from posecast_relay.core.past.deletions import Deletion, Deletions
from posecast_relay.core.past.kept_segment import KeptSegment, SegmentName
from posecast_relay.core.past.memory_store import MemoryPast, TakeSpan
from posecast_relay.past_source import ListWaiting, PastAway, Wake
from posecast_relay.past_source_recent import RecentOnly
from posecast_relay.redis.client import REDIS_ERRORS, RedisClient, cancel_tasks, name_error
from posecast_relay.redis.past_replica import PastReplica
from posecast_relay.redis.past_scripts import LOOK, schema_key, segment_key, stream_key
from posecast_relay.shared_tasks import SharedTasks

T = TypeVar("T")
log = logging.getLogger("posecast_relay")

FRESH_S = 0.2  # what is known of a view is this old at most, when it is asked for
POLL_S = 0.2  # between two looks at the views of which something new is waited for, and more for many
POLL_EACH_S = 0.002  # of them
RETRY_S = 0.2  # while Redis is gone
AT_ONCE = 16  # exchanges
TURN_S = 1.0  # to wait for one's turn among these
RECORDS = 100  # in one answer
LOOKS_MAX = 1000  # answers for one view
VIEWS_MAX = 1000  # of which something is known
VIEW_BYTES = 1000  # of Python's own for one
DATA_BYTES = 16 << 20  # of segments' bytes
SCHEMAS_MAX = 64
BUSY = "the past is asked for by many just now: ask again"
AWAY = "the past can't be read just now: ask again"
TOO_MUCH = "there is more past of this robot than --past-memory holds here"


class RedisPast(RecentOnly):
    """A PastSource, and the KeptPast of it, that knows what is in Redis. `now`: the core's clock in seconds;
    `bytes_max`: for all that it knows of segments, without their bytes.
    """

    def __init__(
        self, url: str, bytes_max: int, now: Callable[[], float], deletions: Deletions | None = None
    ) -> None:
        self.link = RedisClient(url)
        self.losses = 0  # times that Redis, having been there, was not any more
        self.passed_over = 0  # records and segments that are damaged, or of another version
        self._bytes_max = bytes_max
        self._now = now
        self._views: OrderedDict[tuple[str, str], PastReplica] = OrderedDict()  # the last one asked for last
        self._data: OrderedDict[SegmentName, bytes] = OrderedDict()  # likewise
        self._data_bytes = 0
        self._schemas: OrderedDict[tuple[str, bytes], str] = OrderedDict()  # by robot
        self._told: set[str] = set()  # robots of which something was passed over
        self._asked = SharedTasks("the past")
        self._turns = asyncio.Semaphore(AT_ONCE)
        self._list_waiting: ListWaiting = tuple
        self._wake: Wake = lambda _robot, _view: None
        self._trouble: str | None = "redis: not connected yet"
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
        """Whether it may hold what was recorded before this process began."""
        return True

    def find(self, name: SegmentName) -> KeptSegment | None:
        """Return the segment of this name; None when it is not known."""
        return self._get(name.robot, name.view).find(name)

    def find_oldest(self, robot: str, view: str) -> KeptSegment | None:
        """Return the segment of a view that was added first of those that are known."""
        return self._get(robot, view).find_oldest(robot, view)

    def list_segments(
        self, robot: str, view: str, from_ms: int = 0, to_ms: int | None = None
    ) -> list[KeptSegment]:
        """Return the segments that begin from `from_ms` on and before `to_ms`, unix; None: all later."""
        return self._get(robot, view).list_segments(robot, view, from_ms, to_ms)

    def list_takes(self, robot: str, view: str) -> list[TakeSpan]:
        """Return the takes of which there is something, in the order in which they began."""
        return self._get(robot, view).list_takes(robot, view)

    def list_after(self, name: SegmentName) -> list[KeptSegment]:
        """Return the segments of its view that were added after the one of this name."""
        return self._get(name.robot, name.view).list_after(name)

    def _get(self, robot: str, view: str) -> MemoryPast:
        replica = self._views.get((robot, view))
        return MemoryPast(0) if replica is None else replica.kept

    # ---- a source ------------------------------------------------------------------

    def follow(self, list_waiting: ListWaiting, wake: Wake) -> None:
        """Look often at the views that `list_waiting` returns, and `wake` when there is something new."""
        self._list_waiting, self._wake = list_waiting, wake

    async def refresh(self, robot: str, view: str, *, anew: bool = False) -> None:
        """Bring up to date what is known of a view: FRESH_S old at most, or `anew`, by a look of now.

        Raises PastAway.
        """
        key = robot, view
        since_s = self._now() - (0 if anew else FRESH_S)
        for _ in range(2):  # a look that is under way may have begun before
            self._check()
            replica = self._views.get(key)
            if replica is not None and replica.looked_at > since_s:
                self._views.move_to_end(key)
                return
            await self._share(key, partial(self._look, robot, view))

    async def load(self, segments: Sequence[KeptSegment]) -> list[KeptSegment]:
        """Return these segments with their bytes, without those that are gone or damaged. Raises PastAway."""
        self._check()
        names = [segment.name for segment in segments]
        found = {name: self._data[name] for name in names if name in self._data}
        lacking = tuple(name for name in names if name not in found)
        if lacking:
            found |= await self._share(lacking, partial(self._read_data, lacking))
        whole = []
        for segment in segments:
            data = found.get(segment.name)
            if self._deletions.cover_segment(segment):
                continue
            if data is not None and hashlib.sha256(data).digest() == segment.sha256:
                self._keep_data(segment.name, data)
                whole.append(replace(segment, data=data, elsewhere_bytes=0))
                continue
            if data is not None:
                self._pass_over(segment.name.robot, "a segment whose bytes are damaged")
            replica = self._views.get((segment.name.robot, segment.name.view))
            if replica is not None:
                replica.drop(segment.name)
        return whole

    async def load_schema(self, robot: str, view: str, sha256: bytes) -> str | None:  # noqa: ARG002
        """Return the text of a schema that a segment names; None when it is gone. Raises PastAway."""
        schema = sha256
        self._check()
        known = self._schemas.get((robot, schema))
        if known is not None:
            return known
        data = await self._share((robot, schema), partial(self._read_schema, robot, schema))
        if data is None or hashlib.sha256(data).digest() != schema:
            if data is not None:
                self._pass_over(robot, "a schema that is damaged")
            return None
        text: str = data.decode()  # its hash is that of a text
        self._schemas[robot, schema] = text
        if len(self._schemas) > SCHEMAS_MAX:
            self._schemas.popitem(last=False)
        return text

    def find_trouble(self) -> str | None:
        """Return what is wrong with Redis; None when all is well."""
        return self._trouble

    def get_exchanges(self) -> tuple[Histogram, int]:
        """Return how long exchanges with Redis took, and how often it was lost."""
        return self.link.seconds, self.losses

    def start(self) -> None:
        """Start to connect, and to look at what is waited for. Redis need not be there yet."""
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
            except Exception as e:  # whatever it was: it is begun anew
                self._lose(e)
            if self._trouble is not None:
                for key in self._list_waiting():  # they are told
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
        if why := self.link.note_failure(error):
            log.warning("the past: redis: %s; who asks is told, live goes on", why)
        self.losses += self._trouble is None
        self._trouble = name_error(error)  # /readyz is public: no addresses
        self._lost.set()

    async def _look_again(self, robot: str, view: str) -> None:
        try:
            await self.refresh(robot, view)
        except PastAway:
            return  # whoever waits will be told
        except Exception as e:  # a mistake of ours, at this view
            self._pass_over(robot, repr(e))

    def _check(self) -> None:
        if self._trouble is not None:
            raise PastAway(AWAY)

    async def _share(self, key: Hashable, ask: Callable[[], Awaitable[T]]) -> T:
        """Wait for what somebody asks for already, or ask. Raises PastAway."""
        return await self._asked.run(key, partial(self._ask, ask))

    async def _ask(self, ask: Callable[[], Awaitable[T]]) -> T:
        """What Redis does to one exchange it does to all; what our own code does ends this one."""
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

    # ---- what comes from Redis: a stranger's --------------------------------------------

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
            if not told:  # one from the middle is gone, or all
                replica = self._make_replica(robot, view)
                is_whole = True
        if self._deletions.count != deleted:  # meanwhile: what was read may hold it
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
        """Forget what is known of a robot of which something is deleted: the rest is read anew."""
        for key in [key for key in self._views if key[0] == deletion.robot]:
            del self._views[key]
        for name in [name for name in self._data if name.robot == deletion.robot]:
            self._data_bytes -= len(self._data.pop(name))
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
        if robot not in self._told:
            self._told.add(robot)
            log.warning("the past in redis: %s: passed over: %.200s", robot, why)

    def _keep_data(self, name: SegmentName, data: bytes) -> None:
        if name not in self._data:
            self._data_bytes += len(data)
        self._data[name] = data
        self._data.move_to_end(name)
        while self._data_bytes > DATA_BYTES:
            self._data_bytes -= len(self._data.popitem(last=False)[1])

    def _make_room(self) -> None:
        """Forget the views that were not asked for longest."""
        size = sum(VIEW_BYTES + replica.kept.bytes for replica in self._views.values())
        while len(self._views) > 1 and (size > self._bytes_max or len(self._views) > VIEWS_MAX):
            size -= VIEW_BYTES + self._views.popitem(last=False)[1].kept.bytes
