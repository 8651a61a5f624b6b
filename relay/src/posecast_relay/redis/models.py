"""Stores models in Redis. The process that hears a robot writes them, and gateways read them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence

from redis.exceptions import ResponseError

from posecast_relay.core.hub import Hub
from posecast_relay.models.cache import RANGE_BYTES, Absent, ModelCache, Unavailable
from posecast_relay.redis.client import REDIS_ERRORS, TTL_S, RedisClient, bundle_key, cancel_tasks

log = logging.getLogger("posecast_relay")

LOOK_S = 2.0  # between two checks for models that Redis lacks
MANIFEST = "manifest"


class RedisModels:
    """A gateway's ModelSource: it reads models from Redis."""

    def __init__(self, link: RedisClient, hub: Hub) -> None:
        self._link = link
        self._hub = hub

    def offers(self, robot: str, digest: str) -> bool:  # noqa: ARG002
        """Return True: only Redis knows, because this gateway may not subscribe to the robot."""
        return True

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        """Return a model's manifest. Raises Absent or Unavailable."""
        return await self._field(robot, digest, MANIFEST)

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:  # noqa: ARG002
        """Return the range of a file that starts at `off`. Raises Absent or Unavailable."""
        return await self._field(robot, digest, f"{sha256}:{off}")

    async def _field(self, robot: str, digest: str, field: str) -> bytes:
        try:
            data: bytes | None = await self._link.call(
                self._link.client.hget(bundle_key(robot, digest), field)
            )
        except REDIS_ERRORS:
            raise Unavailable("the store does not answer") from None
        if data is None:
            of = self._hub.robots.get(robot)
            if of is not None and any(room.stream.model == digest for room in of.rooms.values()):
                raise Unavailable("the model is still being copied: try again later")
            raise Absent("no such model")
        return data


class ModelUploader:
    """Copies all models that robots announce to Redis.

    A robot's models are copied one after the other; different robots are copied in parallel.
    """

    def __init__(self, link: RedisClient, hub: Hub, models: ModelCache) -> None:
        self._link = link
        self._hub = hub
        self._models = models
        self._task: asyncio.Task[None] | None = None
        self._carrying: dict[str, asyncio.Task[None]] = {}  # by robot

    def start(self) -> None:
        """Start copying."""
        self._task = asyncio.create_task(self._work(), name="models to redis")

    async def stop(self) -> None:
        """Stop copying, even in the middle of a model."""
        await cancel_tasks(self._task)
        for task in list(self._carrying.values()):
            await cancel_tasks(task)

    async def _work(self) -> None:
        while True:
            announced = {
                robot.name: {room.stream.model for room in robot.rooms.values()} - {None}
                for robot in self._hub.robots.values()
                if robot.liveness.token
            }
            for robot, task in list(self._carrying.items()):
                if not announced.get(robot):
                    task.cancel()
            for robot, digests in announced.items():
                if digests and robot not in self._carrying:
                    task = asyncio.create_task(self._carry_all(robot, sorted(filter(None, digests))))
                    self._carrying[robot] = task
                    task.add_done_callback(lambda _, robot=robot: self._carrying.pop(robot))  # type: ignore[misc]
            await asyncio.sleep(LOOK_S)

    async def _carry_all(self, robot: str, digests: Sequence[str]) -> None:
        for digest in digests:
            try:
                await self._carry(robot, digest)
            except (*REDIS_ERRORS, Absent, Unavailable) as e:  # the store reports it too; tried again
                log.info("copying a model of %s to redis: %s", robot, e)
            except Exception as e:  # a bug in the relay, for this model
                log.error("copying a model of %s to redis", robot, exc_info=e)

    async def _carry(self, robot: str, digest: str) -> None:
        """Copy a model. The manifest comes last, so that it implies that all files are there."""
        link, key = self._link, bundle_key(robot, digest)
        try:
            if await link.call(link.client.hexists(key, MANIFEST)):
                await link.call(link.client.expire(key, TTL_S))
                return
        except ResponseError as e:
            if not str(e).startswith("WRONGTYPE"):
                raise
            # somebody else put something there
            await link.call(link.client.delete(key))
        for path in await self._models.load_entries(robot, digest):
            name, _, size = await self._models.load_file(robot, digest, path)
            for off in range(0, size, RANGE_BYTES):
                await link.call(link.client.hset(key, f"{name}:{off}", self._piece(name, off, RANGE_BYTES)))
        name, _, size = await self._models.load_manifest(robot, digest)
        await link.call(link.client.hset(key, MANIFEST, self._piece(name, 0, size)))
        await link.call(link.client.expire(key, TTL_S))

    def _piece(self, name: str, off: int, size: int) -> bytes:
        piece = self._models.copy_piece(name, off, size)
        if piece is None:
            raise Unavailable("no memory for this model: other robots' models need it")
        return piece
