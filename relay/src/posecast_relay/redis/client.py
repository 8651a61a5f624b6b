"""The Redis client of all roles: one server, TLS or a Cluster, by URL. Defines keys, limits every call.

    posecast:{ROBOT}:generation   the newest claimed generation: see `scripts.py`
    posecast:{ROBOT}:writer       the writer's generation; expires after 1.5 s
    posecast:{ROBOT}:status       whether its agent is connected, age of its frames; expires after 3.5 s
    posecast:{ROBOT}:VIEW:state   hash: generation seq run stamp version schema key_id key ref frame info
                                  model events numbering
    posecast:{ROBOT}:model:HASH   hash: manifest, and the files' ranges as SHA256:OFFSET
    posecast:{ROBOT}:live         sharded channel: what changed, as `messages.py` packs it
    posecast:{-}:…                the directory: see `directory.py`

The braces are part of the name: they keep one robot's keys on one node of a Redis Cluster. No robot is
called `-`.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, TypeVar
from urllib.parse import urlsplit

import redis.asyncio as redis
from redis.asyncio.cluster import RedisCluster
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import NoScriptError, RedisClusterException, RedisError, ResponseError
from redis.maint_notifications import MaintNotificationsConfig

from posecast_relay.kit import Histogram, OutageLog
from posecast_relay.runtime.tasks import BlockingCalls, SharedTasks

T = TypeVar("T")
Call = tuple[str, Sequence[str], Sequence[Any]]  # a script, its keys and its arguments

TTL_S = 3600  # renewed by every KEY
TIMEOUT_S = 0.25  # of one exchange with Redis
STATUS_MS = 3500  # when a robot's status expires
CONNECTIONS = 32  # to a server; further calls wait
BATCH = 64  # calls in one exchange, so that it stays within the timeout
REDIS_ERRORS = (RedisError, RedisClusterException, OSError, TimeoutError)


def state_key(robot: str, view: str) -> str:
    """The hash with one stream's newest state."""
    return f"posecast:{{{robot}}}:{view}:state"


def generation_key(robot: str) -> str:
    """The counter of a robot's adopted runs."""
    return f"posecast:{{{robot}}}:generation"


def writer_key(robot: str) -> str:
    """The lease of the process that writes this robot."""
    return f"posecast:{{{robot}}}:writer"


def status_key(robot: str) -> str:
    """The robot's status, which also shows that a relay hears it."""
    return f"posecast:{{{robot}}}:status"


def bundle_key(robot: str, digest: str) -> str:
    """The hash with one model."""
    return f"posecast:{{{robot}}}:model:{digest}"


def channel(robot: str) -> str:
    """The channel with a robot's changes."""
    return f"posecast:{{{robot}}}:live"


class RedisClient:
    """A client with timeouts. After a failure call `reset`, then `connect`."""

    def __init__(self, url: str) -> None:
        scheme, _, rest = url.partition("://")
        self.is_cluster = scheme.endswith("+cluster")
        self._url = f"{scheme.removesuffix('+cluster')}://{rest}"
        self._lookup = HostLookup(urlsplit(self._url).hostname or "localhost")
        self.seconds = Histogram()  # of exchanges, also of those that failed
        self._scripts: dict[str, str] = {}  # text → SHA-1, once loaded
        self.outage = OutageLog()
        self.client: Any = self._open(self._url)

    def _open(self, url: str) -> Any:
        options: dict[str, Any] = {"socket_timeout": TIMEOUT_S, "socket_connect_timeout": TIMEOUT_S}
        options["retry"] = Retry(NoBackoff(), 0)
        # By default, each connection starts with three commands that Redis may not know (library name,
        # version and maintenance notices). Each refusal leaves a reference cycle.
        options["driver_info"] = None
        options["maint_notifications_config"] = MaintNotificationsConfig(enabled=False)
        if self.is_cluster:
            return RedisCluster.from_url(url, **options)
        options |= {"max_connections": CONNECTIONS, "timeout": TIMEOUT_S}
        return redis.Redis.from_pool(redis.BlockingConnectionPool.from_url(url, **options))

    async def connect(self, *scripts: str) -> None:
        """Connect to Redis and load these scripts."""
        await self.call(self._lookup.find())
        if self.is_cluster:  # several exchanges with several nodes
            async with asyncio.timeout(4 * TIMEOUT_S):
                await self.client.initialize()
        await self._load(*scripts)

    async def _load(self, *scripts: str) -> None:
        for text in scripts:
            self._scripts[text] = await self.call(self.client.script_load(text))

    def note_failure(self, error: BaseException) -> str | None:
        """Record a failure. Return the reason if it should be logged: see OutageLog."""
        return self.outage.note_failure(error, time.monotonic())

    def note_success(self) -> bool:
        """Record a success. Return whether to log that Redis is back: see OutageLog."""
        return self.outage.note_success(time.monotonic())

    async def reset(self) -> None:
        """Drop every connection, so that requests from before a failure get no late answer."""
        try:
            if self.is_cluster:
                await self.call(self.client.aclose())
            else:
                await self.call(self.client.connection_pool.disconnect())
        except REDIS_ERRORS:
            self.client = self._open(self._url)

    async def close(self) -> None:
        """Close all connections."""
        try:
            await self.call(self.client.aclose())
        except REDIS_ERRORS:
            return

    async def call(self, asked: Awaitable[T]) -> T:
        """Wait for one exchange, at most TIMEOUT_S seconds."""
        began = time.monotonic()
        try:
            async with asyncio.timeout(TIMEOUT_S):  # wait_for may swallow a cancellation
                return await asked
        except (RuntimeError, AttributeError) as e:  # from redis-py: the connection was dropped
            raise ConnectionError(str(e)) from None
        finally:
            self.seconds.add(time.monotonic() - began)

    async def run(self, script: str, keys: Sequence[str], *args: bytes | str | int | float) -> Any:
        """Run a script that `connect` has loaded, and return its result."""
        try:
            return await self.call(self.client.evalsha(self._scripts[script], len(keys), *keys, *args))
        except NoScriptError:  # Redis was restarted, or rid of its scripts
            await self._load(script)
            return await self.call(self.client.evalsha(self._scripts[script], len(keys), *keys, *args))

    async def run_all(self, calls: Sequence[Call]) -> list[Any]:
        """Run several scripts with their keys and arguments, BATCH per exchange, and return their results.

        If Redis refuses a call, its result is the ResponseError. An error that concerns all calls is raised.
        """
        results: list[Any] = []
        for at in range(0, len(calls), BATCH):
            batch = calls[at : at + BATCH]
            if self.is_cluster:  # its pipelines take no scripts
                asked = (self.run(script, keys, *args) for script, keys, args in batch)
                results += await asyncio.gather(*asked, return_exceptions=True)
                continue
            answers = await self._exchange(batch)
            if any(isinstance(answer, NoScriptError) for answer in answers):
                await self._load(*{script for script, _, _ in batch})
                answers = await self._exchange(batch)  # running a call twice does no harm
            results += answers
        return _check_results(results)

    async def _exchange(self, batch: Sequence[Call]) -> list[Any]:
        pipe = self.client.pipeline(transaction=False)
        for script, keys, args in batch:
            pipe.evalsha(self._scripts[script], len(keys), *keys, *args)
        answers: list[Any] = await self.call(pipe.execute(raise_on_error=False))
        return answers

    async def read_all(self, ask: Callable[[Any], None]) -> list[Any]:
        """Send the commands that `ask` adds to a pipeline, in one exchange, and return the answers, errors
        too.
        """
        pipe = self.client.pipeline(transaction=False)
        ask(pipe)
        return _check_results(await self.call(pipe.execute(raise_on_error=False)))

    def open_listener(self, robot: str) -> tuple[tuple[str, int], Any]:
        """Return the server of a robot's channel, and a client for it.

        In a cluster, `connect` comes first.
        """
        if not self.is_cluster:
            return ("", 0), self.client
        node = self.client.get_node_from_key(channel(robot))
        kwargs = dict(node.connection_kwargs)
        pool = redis.ConnectionPool(connection_class=node.connection_class, **kwargs)
        return (str(node.host), int(node.port)), redis.Redis(connection_pool=pool)


class RedisUser:
    """Something that works with Redis, through a connection of its own."""

    def __init__(self, url: str) -> None:
        self.link = RedisClient(url)
        self.losses = 0  # how often Redis was lost
        self._trouble: str | None = "redis: not connected yet"

    def find_trouble(self) -> str | None:
        """Return the problem with Redis; None if it works."""
        return self._trouble

    def get_exchanges(self) -> tuple[Histogram, int]:
        """Return how long exchanges with Redis took, and how often it was lost."""
        return self.link.seconds, self.losses

    def note_failure(self, error: BaseException) -> str | None:
        """Note that Redis is lost. Return the reason if it should be logged: see OutageLog."""
        self.losses += self._trouble is None
        self._trouble = f"redis: {type(error).__name__}"  # /readyz is public: no addresses
        return self.link.note_failure(error)


def _check_results(results: list[Any]) -> list[Any]:
    """Return the results, unless one is an error of Redis as a whole: then raise it."""
    errors = [result for result in results if isinstance(result, BaseException)]
    for error in errors:
        of_one = type(error) is ResponseError and len(errors) < len(results)
        if not of_one and not str(error).startswith("WRONGTYPE"):
            raise error
    return results


async def cancel_tasks(*tasks: asyncio.Task[None] | None) -> None:
    """Cancel tasks and wait for them, for at most 2 × TIMEOUT_S seconds."""
    going = {task for task in tasks if task is not None and not task.done()}
    for task in going:
        task.cancel()
    if going:
        await asyncio.wait(going, timeout=2 * TIMEOUT_S)


# Estimates Redis's clock, so that processes can tell how long ago another one wrote something.
#
# Hosts' clocks differ, and each process's monotonic clock starts at an arbitrary value. Each exchange that
# returns Redis's time limits the difference from both sides. The narrowest limits are used until an exchange
# contradicts them, which means that a clock was set or stopped.

ERROR_S = 0.05
DRIFT = 1e-4  # clocks drift apart by up to 100 ppm


class RedisClock:
    """Estimates Redis's clock.

    Times are in seconds; `now`, `asked_at`, `answered_at` of this process's clock.
    """

    def __init__(self) -> None:
        self._least = float("-inf")  # of Redis's clock less this process's
        self._most = float("inf")
        self._seen_at = 0.0

    def record_time(self, redis_s: float, asked_at: float, answered_at: float) -> None:
        """Record the time that Redis returned between these two moments."""
        least, most = redis_s - answered_at, redis_s - asked_at
        parted = DRIFT * max(0.0, answered_at - self._seen_at)
        narrow = max(least, self._least - parted), min(most, self._most + parted)
        self._least, self._most = narrow if narrow[0] <= narrow[1] else (least, most)
        self._seen_at = answered_at

    def estimate_time(self, now: float) -> float | None:
        """Return Redis's time at `now`; None before any exchange."""
        if self._most == float("inf"):
            return None
        return now + (self._least + self._most) / 2

    def compute_elapsed(self, sent_s: float | None, now: float) -> float | None:
        """Return how many seconds before `now` something was sent at Redis's time `sent_s`; None when
        unknown.
        """
        redis_s = self.estimate_time(now)
        if redis_s is None or sent_s is None:
            return None
        error_s = self._most - self._least + ERROR_S  # of the writer's estimate and of this one
        return (
            max(0.0, redis_s - sent_s) if sent_s <= redis_s + error_s else None
        )  # the clock has been set back


# Looks up a host's name in a separate thread, so that nothing else waits for the answer.
#
# A resolver that does not answer blocks its caller for half a minute. The event loop's lookups would queue up
# behind it, and the process could not exit meanwhile.


class HostLookup:
    """Looks up one host's name, in one thread at a time."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._calls = BlockingCalls(1, "lookup")
        self._under_way = SharedTasks("lookup")

    async def find(self) -> None:
        """Return when the name is found.

        Raises OSError if it is not found. Callers may cancel the wait at any time.
        """
        await self._under_way.run(self._host, self._ask)

    async def _ask(self) -> None:
        try:
            await self._calls.run(socket.getaddrinfo, self._host, None, type=socket.SOCK_STREAM)
        except UnicodeError as e:  # not a valid name
            raise OSError(str(e)) from None
