"""`redis://` of a process that hears robots: the newest state of every stream for other processes.

Written by one task that nobody waits for. What waits to be written is the set of streams that changed; each
is read when its turn comes, so a slow or dead Redis costs newer states, never memory or a viewer's frame.
The same write tells the robot's channel what changed, so who subscribes and then reads has no gap.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Callable
from itertools import count
from typing import Any, NamedTuple

from redis.exceptions import NoScriptError

from posecast_relay.adapters.redis_board import BOARD, Board
from posecast_relay.adapters.redis_link import (
    REDIS_ERRORS,
    STATUS_MS,
    TTL_S,
    Link,
    channel,
    end,
    generation_key,
    name_of,
    state_key,
    status_key,
)
from posecast_relay.adapters.relayed import Standing, Update
from posecast_relay.core.histogram import Histogram
from posecast_relay.core.hub import Hub
from posecast_relay.core.robot import Robot
from posecast_relay.core.stream import Held, Stream

log = logging.getLogger("posecast_relay")

ROUND_S = 0.005  # between two rounds, so that many robots share one
BEAT_S = 1.0  # between two signs of life
BACKOFF_S = (0.1, 0.4)  # first and longest wait after a failure
STOP_S = 1.0

# An older (generation, seq) never replaces a newer one: 0. A light write (frame only) that finds another KEY
# or nothing there is refused with 2: the whole state is written next.
GUARD = """
local state, counter = KEYS[1], KEYS[2]
local generation, seq, full = tonumber(ARGV[1]), tonumber(ARGV[2]), ARGV[3] == '1'
local has = redis.call('HMGET', state, 'generation', 'seq', 'key_id')
local has_generation, has_seq = tonumber(has[1] or '-1'), tonumber(has[2] or '-1')
if generation < has_generation or (generation == has_generation and seq < has_seq) then return 0 end
if not full and (generation ~= has_generation or has[3] ~= ARGV[4]) then return 2 end
redis.call('HSET', state, 'generation', ARGV[1], 'seq', ARGV[2], 'key_id', ARGV[4], unpack(ARGV, 6))
if full then
  if tonumber(redis.call('GET', counter) or '0') < generation then redis.call('SET', counter, generation) end
  redis.call('EXPIRE', state, {ttl})
  redis.call('EXPIRE', counter, 2 * {ttl})
end
redis.call('SPUBLISH', KEYS[3], ARGV[5])
return 1
""".replace("{ttl}", str(TTL_S))

# A process whose run was replaced by another process's says nothing about the robot: 0
STATUS = """
if tonumber(redis.call('GET', KEYS[2]) or '0') > tonumber(ARGV[1]) then return 0 end
redis.call('SET', KEYS[1], ARGV[2], 'PX', {ms})
redis.call('SPUBLISH', KEYS[3], ARGV[2])
return 1
""".replace("{ms}", str(STATUS_MS))


class _Written(NamedTuple):
    """What of a stream stands in Redis."""

    generation: int
    key: Held
    ref: Held | None
    version: int
    event_n: int


class RedisStore:
    """See the module. `describe` gives a robot's document for the board."""

    def __init__(
        self, url: str, hub: Hub, now: Callable[[], float], describe: Callable[[Robot], dict[str, Any]]
    ) -> None:
        self.failures = 0
        self.losses = 0  # times that Redis, having been there, was not any more
        self.link = Link(url)
        self.board = Board(self.link)
        self._hub = hub
        self._now = now
        self._describe = describe
        self._dirty: dict[Stream, None] = {}
        self._written: dict[Stream, _Written] = {}
        self._generations: dict[str, tuple[int, int]] = {}  # robot → run, generation
        self._tokens: dict[str, bool] = {}  # as told last
        self._superseded: set[str] = set()  # robots that another process writes
        self._take_over_at = 0.0  # not before: who writes them may still be on the way to Redis
        self._resumed: set[Stream] = set()
        self._told_n: dict[Stream, int] = {}  # its newest event that reached Redis
        self._counts = count(1)
        self._wake = asyncio.Event()
        self._beat_at = 0.0
        self._trouble: str | None = "redis: not connected yet"
        self._task: asyncio.Task[None] | None = None

    def keep(self, stream: Stream) -> None:
        """Put the stream on the list; returns at once."""
        self._dirty[stream] = None
        self._wake.set()

    def trouble(self) -> str | None:
        """What is wrong with Redis, if anything."""
        return self._trouble

    def exchanges(self) -> tuple[Histogram, int] | None:
        """With Redis."""
        return self.link.seconds, self.losses

    def robots(self) -> list[dict[str, Any]] | None:
        """The core hears them."""
        return None

    def viewers_elsewhere(self, robot: str) -> int:
        """As the board says; none while Redis is gone."""
        return 0 if self._trouble else self.board.viewers_elsewhere(robot)

    async def start(self) -> None:
        """Start the writing task; Redis may come later."""
        self._task = asyncio.create_task(self._work(), name="redis")

    async def stop(self) -> None:
        """One last round, then let go."""
        await end(self._task)
        with contextlib.suppress(*REDIS_ERRORS):
            async with asyncio.timeout(STOP_S):
                if self._trouble is None:
                    await self._round()
        await self.link.close()

    async def _work(self) -> None:
        wait_s = BACKOFF_S[0]
        while True:
            try:
                if self._trouble is not None:
                    await self._connect()
                await self._round()
                if self._now() >= self._beat_at:
                    self._beat_at = self._now() + BEAT_S
                    await self._beat()
                wait_s = BACKOFF_S[0]
            except REDIS_ERRORS as e:
                await self._failed(e)
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, BACKOFF_S[1])
                continue
            await asyncio.sleep(ROUND_S)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(0.0, self._beat_at - self._now())):
                    await self._wake.wait()
            self._wake.clear()

    async def _connect(self) -> None:
        await self.link.connect(GUARD, STATUS, BOARD)
        self._written.clear()  # whatever stands there, write it whole
        self._take_over_at = self._now() + STATUS_MS / 1000
        for robot in self._hub.robots.values():
            self._dirty |= {room.stream: None for room in robot.rooms.values()}
        self._beat_at = 0.0
        if self.failures:
            log.warning("redis is back")
        self._trouble = None

    async def _failed(self, error: BaseException) -> None:
        if why := self.link.news(error):
            log.warning("redis: %s; viewers here notice nothing, trying on", why)
        self.failures += 1
        self.losses += self._trouble is None
        self._trouble = name_of(error)  # /readyz is public: no addresses
        await self.link.reset()

    async def _round(self) -> None:
        """Write every stream that changed."""
        batch, self._dirty = self._dirty, {}
        try:
            await self._write(batch)
        except NoScriptError:  # Redis was restarted between two rounds
            self._dirty = batch | self._dirty
            await self._connect()
            self._wake.set()
        except BaseException:
            self._dirty = batch | self._dirty
            self._written.clear()
            raise

    async def _write(self, batch: dict[Stream, None]) -> None:
        ready = [s for s in batch if s.newest is not None and s.key is not None]
        for stream in ready:
            await self._generation(stream)
        ready = [s for s in ready if s.robot not in self._superseded]
        results = await self.link.run_all([self._call(stream) for stream in ready])
        for stream, result in zip(ready, results, strict=True):
            if result == 1:
                self._told_n[stream] = self._written[stream].event_n
                continue
            self._written.pop(stream, None)
            if result == 2:
                self.keep(stream)
            else:
                self._superseded.add(stream.robot)
                self._take_over_at = self._now() + STATUS_MS / 1000  # who replaced it has hardly begun
        told = {s.robot: self._hub.robots.get(s.robot) for s in batch}
        await self._tell([r for r in told.values() if r and self._tokens.get(r.name) != r.liveness.token])

    async def _generation(self, stream: Stream) -> None:
        """Adopt its run; its events go on counting where an earlier process stopped."""
        known = self._generations.get(stream.robot)
        if known is None or known[0] != stream.run_id:
            client = self.link.client
            generation = await self.link.call(client.incr(generation_key(stream.robot)))
            self._generations[stream.robot] = (stream.run_id, int(generation))
            self._superseded.discard(stream.robot)
            self._tokens.pop(stream.robot, None)  # told with this write: until then nobody seems to write it
        if stream not in self._resumed:
            client = self.link.client
            names = ["events", "numbering"]
            texts, numbering = await self.link.call(client.hmget(state_key(stream.robot, stream.view), names))
            stream.numbering = f"{self.board.id}:{next(self._counts)}"  # unless somebody's count is there
            if texts and numbering:
                try:
                    told = [_text(event) for event in json.loads(texts)]
                    stream.resume(numbering.decode(), told, self._told_n.get(stream, 0))
                except (ValueError, TypeError) as e:
                    log.warning("events of %s/%s in redis: %.200s", stream.robot, stream.view, e)
            self._resumed.add(stream)

    def _call(self, stream: Stream) -> tuple[str, list[str], list[Any]]:
        key, newest, ref = stream.key, stream.newest, stream.ref
        assert key is not None
        assert newest is not None
        generation = self._generations[stream.robot][1]
        state = _Written(generation, key, ref, stream.version, stream.event_n)
        before = self._written.get(stream)
        light = before is not None and before == state._replace(ref=before.ref)
        version = f"{self.board.id}:{stream.version}"
        values: list[bytes | str | int] = ["frame", newest.payload, "stamp", round(newest.stamp_s * 1e9)]
        if before is None or ref is not before.ref or not light:
            values += ["ref", ref.payload if ref else b""]
        if not light:
            values += ["run", f"{stream.run_id:016x}", "schema", stream.schema.text if stream.schema else ""]
            values += ["key", key.payload, "info", json.dumps(stream.info), "model", stream.model or ""]
            values += ["events", "[" + ",".join(event.text for event in stream.events) + "]"]
            values += ["version", version, "numbering", stream.numbering]
        # what others lack, bases first; frames that were never live here come by the snapshot alone
        age_s = stream.age_s(self._now())
        lacking: list[Held] = []
        if age_s is not None:
            bases = [key if before is None or key is not before.key else None]
            bases.append(ref if ref is not None and (before is None or ref is not before.ref) else None)
            lacking = [base for base in bases if base is not None and base is not newest] + [newest]
        told_n = before.event_n if before is not None else 0
        update = Update(
            stream.view,
            generation,
            stream.run_id,
            version,
            stream.numbering,
            age_s or 0.0,
            tuple((round(held.stamp_s * 1e9), held.payload) for held in lacking),
            tuple(event.text for event in stream.events if event.n > told_n),
        )
        self._written[stream] = state
        names = [state_key(stream.robot, stream.view), generation_key(stream.robot), channel(stream.robot)]
        args = [generation, newest.seq, "0" if light else "1", key.id, update.pack(), *values]
        return GUARD, names, args

    async def _beat(self) -> None:
        """Say of every robot how it is; take over those that another process has ceased to write."""
        for robot in tuple(self._superseded) if self._now() >= self._take_over_at else ():
            if not await self.link.call(self.link.client.exists(status_key(robot))):
                self._superseded.discard(robot)
                self._generations.pop(robot, None)
                of = self._hub.robots.get(robot)
                for room in of.rooms.values() if of else ():
                    self._resumed.discard(room.stream)
                    self.keep(room.stream)
        heard = [robot for robot in self._hub.robots.values() if robot.heard_at is not None]
        mine = await self._tell(heard)
        known = {robot.name for robot in heard}
        for stream in {s for s in (*self._resumed, *self._told_n) if s.robot not in known}:  # by the core
            self._written.pop(stream, None)
            self._told_n.pop(stream, None)
            self._resumed.discard(stream)
            self._generations.pop(stream.robot, None)
        viewers = {r.name: r.viewer_count() for r in self._hub.robots.values() if r.has_viewers()}
        told = {robot.name: self._describe(robot) for robot in mine}
        await self.board.exchange(self._now(), viewers, told)
        for of_mine in heard:
            of_mine.followed = self.board.viewers_elsewhere(of_mine.name) > 0

    async def _tell(self, robots: list[Robot]) -> list[Robot]:
        """Returns those of which nobody else tells."""
        now = self._now()
        calls: list[tuple[str, list[str], list[Any]]] = []
        for robot in robots:
            ages_s = {view: room.stream.age_s(now) for view, room in robot.rooms.items()}
            standing = Standing(robot.liveness.token, ages_s).pack()
            names = [status_key(robot.name), generation_key(robot.name), channel(robot.name)]
            calls.append((STATUS, names, [self._generations.get(robot.name, (0, 0))[1], standing]))
        results = await self.link.run_all(calls)
        self._tokens |= {robot.name: robot.liveness.token for robot in robots}
        return [robot for robot, result in zip(robots, results, strict=True) if result == 1]


def _text(event: dict[str, Any]) -> str:
    return json.dumps(event, separators=(",", ":"), ensure_ascii=False)
