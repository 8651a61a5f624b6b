"""Sharded subscriptions: one connection to each server that has a subscribed channel."""

from __future__ import annotations

import asyncio
import contextlib
from collections import Counter
from collections.abc import Callable
from typing import Any

from posecast_relay.redis.client import REDIS_ERRORS, RedisClient, cancel_tasks, channel

PREFIX, SUFFIX = "posecast:{", "}:live"


class RedisSubscriber:
    """Calls `heard(robot, message)` in the order of each robot's messages, and `lost(error)` if a connection
    fails. Then `close` it and make a new one. It calls `failed(robot, error)` if a bug prevents a robot's
    subscription. None of the three may raise.
    """

    def __init__(
        self,
        link: RedisClient,
        heard: Callable[[str, bytes], None],
        lost: Callable[[BaseException], None],
        failed: Callable[[str, Exception], None],
    ) -> None:
        self._link = link
        self._heard = heard
        self._lost = lost
        self._failed = failed
        self._at: dict[tuple[str, int], tuple[Any, asyncio.Task[None]]] = {}
        self._asking = asyncio.Lock()
        self._confirmed: dict[str, asyncio.Future[None]] = {}
        self._pubsubs: dict[str, Any] = {}
        self._leaving: Counter[str] = Counter()  # robots whose unsubscription has not been confirmed

    async def subscribe(self, *robots: str) -> None:
        """Subscribe to robots. After this returns, no message is missed. Raises REDIS_ERRORS."""
        async with self._asking:  # the first caller opens a server's only connection
            asked = [robot for robot in robots if await self._guarded(robot)]
        await self._link.call(asyncio.gather(*(self._confirmed[robot] for robot in asked)))

    def is_subscribed(self, robot: str) -> bool:
        """Whether this robot is subscribed."""
        return robot in self._pubsubs

    async def _guarded(self, robot: str) -> bool:
        try:
            await self._ask(robot)
        except REDIS_ERRORS:
            raise
        except Exception as e:
            self._pubsubs.pop(robot, None)
            self._failed(robot, e)
            return False
        return True

    async def _ask(self, robot: str) -> None:
        address, client = self._link.open_listener(robot)
        self._confirmed[robot] = asyncio.get_running_loop().create_future()
        known = self._at.get(address)
        pubsub = client.pubsub() if known is None else known[0]
        self._pubsubs[robot] = pubsub
        await self._link.call(pubsub.ssubscribe(channel(robot)))
        if known is None:
            self._at[address] = (pubsub, asyncio.create_task(self._listen(pubsub), name="redis ear"))

    async def unsubscribe(self, robot: str) -> None:
        """Unsubscribe from a robot. Raises REDIS_ERRORS."""
        async with self._asking:
            pubsub = self._pubsubs.pop(robot, None)
            self._confirmed.pop(robot, None)
            if pubsub is not None:
                self._leaving[robot] += 1
                await self._link.call(pubsub.sunsubscribe(channel(robot)))

    async def close(self) -> None:
        """Drop all connections."""
        listening, self._at = self._at, {}
        await cancel_tasks(*(task for _, task in listening.values()))
        for pubsub, _ in listening.values():
            with contextlib.suppress(*REDIS_ERRORS):
                await self._link.call(pubsub.aclose())

    async def _listen(self, pubsub: Any) -> None:
        try:
            while True:
                message = await pubsub.get_message(timeout=None)
                if message is not None:
                    self._take(message["type"], _read_robot(message["channel"]), message["data"])
        except Exception as e:  # a connection that is lost, or closed under way; a message that is none
            self._lost(e)

    def _take(self, kind: str, robot: str, data: Any) -> None:
        if kind == "smessage":
            self._heard(robot, data)
        elif kind == "ssubscribe":
            confirmed = self._confirmed.get(robot)
            if confirmed is not None and not confirmed.done():
                confirmed.set_result(None)
        elif kind == "sunsubscribe" and self._leaving[robot] > 0:
            self._leaving[robot] -= 1
            if not self._leaving[robot]:
                del self._leaving[robot]
        elif kind == "sunsubscribe" and robot in self._pubsubs:
            raise ConnectionError("the channel has moved to another node")


def _read_robot(name: bytes) -> str:
    return name.decode().removeprefix(PREFIX).removesuffix(SUFFIX)
