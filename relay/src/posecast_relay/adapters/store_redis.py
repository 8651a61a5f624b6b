"""`redis://`: the newest state of every stream in Redis, for other processes and for whoever looks.

Written by one task that nobody waits for. What waits to be written is the set of streams that changed; each
is read when its turn comes, so a slow or dead Redis costs newer states, never memory or a viewer's frame.

    posecast:{ROBOT}:generation   how many runs were adopted (INCR)
    posecast:{ROBOT}:VIEW:state   hash: generation seq run schema key_id key ref frame info model events

The braces are part of the name: they keep one robot's keys on one node of a Redis Cluster.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from typing import Any, NamedTuple

import redis.asyncio as redis
from redis.backoff import NoBackoff
from redis.exceptions import NoScriptError, RedisError
from redis.retry import Retry

from posecast_relay.core.stream import Held, Stream

log = logging.getLogger("posecast_relay")

TTL_S = 3600  # renewed by every KEY
TIMEOUT_S = 1.0  # of one call to Redis
ROUND_S = 0.02  # between two rounds, so that many robots share one
BACKOFF_S = (0.25, 1.0)  # first and longest wait after a failure

# An older (generation, seq) never replaces a newer one. A light write (frame only) that finds another KEY or
# nothing there is refused with 2: the whole state is written next.
GUARD = """
local state, counter = KEYS[1], KEYS[2]
local generation, seq, full = tonumber(ARGV[1]), tonumber(ARGV[2]), ARGV[3] == '1'
local has = redis.call('HMGET', state, 'generation', 'seq', 'key_id')
local has_generation, has_seq = tonumber(has[1] or '-1'), tonumber(has[2] or '-1')
if generation < has_generation or (generation == has_generation and seq < has_seq) then return 0 end
if not full and (generation ~= has_generation or has[3] ~= ARGV[4]) then return 2 end
redis.call('HSET', state, 'generation', ARGV[1], 'seq', ARGV[2], 'key_id', ARGV[4], unpack(ARGV, 5))
if full then
  if tonumber(redis.call('GET', counter) or '0') < generation then redis.call('SET', counter, generation) end
  redis.call('EXPIRE', state, {ttl})
  redis.call('EXPIRE', counter, 2 * {ttl})
end
return 1
""".replace("{ttl}", str(TTL_S))


class _Written(NamedTuple):
    """What of a stream stands in Redis."""

    generation: int
    key: Held
    ref: Held | None
    version: int
    event_n: int


def state_key(robot: str, view: str) -> str:
    """The hash with one stream's newest state."""
    return f"posecast:{{{robot}}}:{view}:state"


def generation_key(robot: str) -> str:
    """The counter of a robot's adopted runs."""
    return f"posecast:{{{robot}}}:generation"


class RedisStore:
    """See the module. `writes` and `failures` are for metrics."""

    def __init__(self, url: str) -> None:
        self.writes = 0
        self.failures = 0
        self._client: Any = redis.from_url(
            url,
            socket_timeout=TIMEOUT_S,
            socket_connect_timeout=TIMEOUT_S,
            retry=Retry(NoBackoff(), 0),
        )
        self._dirty: dict[Stream, None] = {}
        self._written: dict[Stream, _Written] = {}
        self._generations: dict[str, tuple[int, int]] = {}  # robot → run, generation
        self._wake = asyncio.Event()
        self._trouble: str | None = "redis: not connected yet"
        self._sha = ""
        self._task: asyncio.Task[None] | None = None

    def keep(self, stream: Stream) -> None:
        """Put the stream on the list; returns at once."""
        self._dirty[stream] = None
        self._wake.set()

    def trouble(self) -> str | None:
        """What is wrong with Redis, if anything."""
        return self._trouble

    async def start(self) -> None:
        """Start the writing task; Redis may come later."""
        self._task = asyncio.create_task(self._work(), name="redis")

    async def stop(self) -> None:
        """One last round, then let go."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
        with contextlib.suppress(RedisError, OSError, TimeoutError):
            async with asyncio.timeout(TIMEOUT_S):
                if self._trouble is None:
                    await self._round()
                await self._client.aclose()

    async def _work(self) -> None:
        wait_s = BACKOFF_S[0]
        while True:
            try:
                async with asyncio.timeout(2 * TIMEOUT_S):
                    if self._trouble is not None:
                        await self._connect()
                    await self._round()
                wait_s = BACKOFF_S[0]
            except (RedisError, OSError, TimeoutError) as e:
                await self._failed(e)
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, BACKOFF_S[1])
                continue
            await asyncio.sleep(ROUND_S)
            await self._wake.wait()
            self._wake.clear()

    async def _connect(self) -> None:
        self._sha = await self._client.script_load(GUARD)
        self._written.clear()  # whatever stands there, write it whole
        if self.failures:
            log.warning("redis is back")
        self._trouble = None

    async def _failed(self, error: Exception) -> None:
        if self._trouble is None or not self.failures:
            log.warning("redis: %s; viewers notice nothing, trying on", error or type(error).__name__)
        self.failures += 1
        self._trouble = f"redis: {type(error).__name__}"  # /readyz is public: no addresses
        with contextlib.suppress(RedisError, OSError, TimeoutError):
            async with asyncio.timeout(TIMEOUT_S):
                await self._client.connection_pool.disconnect()

    async def _round(self) -> None:
        """Write every stream that changed, in one exchange."""
        batch, self._dirty = self._dirty, {}
        try:
            ready = [s for s in batch if s.newest is not None and s.key is not None]
            for stream in ready:
                await self._generation(stream)
            if not ready:
                return
            pipe = self._client.pipeline(transaction=False)
            for stream in ready:
                self._add(pipe, stream)
            results = await pipe.execute(raise_on_error=False)
            for stream, result in zip(ready, results, strict=True):
                if isinstance(result, Exception):
                    raise result
                if result == 2:
                    del self._written[stream]
                    self._dirty[stream] = None
                    self._wake.set()
                self.writes += 1
        except NoScriptError:  # Redis was restarted between two rounds
            self._dirty = batch | self._dirty
            await self._connect()
            self._wake.set()
        except BaseException:
            self._dirty = batch | self._dirty
            self._written.clear()
            self._wake.set()
            raise

    async def _generation(self, stream: Stream) -> None:
        known = self._generations.get(stream.robot)
        if known is None or known[0] != stream.run_id:
            generation = await self._client.incr(generation_key(stream.robot))
            self._generations[stream.robot] = (stream.run_id, generation)

    def _add(self, pipe: Any, stream: Stream) -> None:
        key, newest, ref = stream.key, stream.newest, stream.ref
        assert key is not None
        assert newest is not None
        generation = self._generations[stream.robot][1]
        state = _Written(generation, key, ref, stream.version, stream.event_n)
        before = self._written.get(stream)
        light = before is not None and before == state._replace(ref=before.ref)
        values: list[bytes | str | int] = ["frame", newest.payload]
        if before is None or ref is not before.ref or not light:
            values += ["ref", ref.payload if ref else b""]
        if not light:
            values += ["run", f"{stream.run_id:016x}", "schema", stream.schema.text if stream.schema else ""]
            values += ["key", key.payload, "info", json.dumps(stream.info), "model", stream.model or ""]
            values += ["events", "[" + ",".join(event.text for event in stream.events) + "]"]
        self._written[stream] = state
        names = (state_key(stream.robot, stream.view), generation_key(stream.robot))
        pipe.evalsha(self._sha, 2, *names, generation, newest.seq, "0" if light else "1", key.id, *values)
