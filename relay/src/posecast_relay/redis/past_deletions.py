"""Tells every process that shares a Redis what was deleted of the past, and hears it from them.

    posecast:{-}:past-deleted   stream: a deletion each, as `past/deletions.py` packs it

Whoever hears of a deletion elsewhere (from the command, from an object store) writes it there; each process
reads there once a second. While Redis is away it is tried again; the connection of the past itself logs that.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import OrderedDict

from posecast_relay.past.deletions import KNOWN_MAX, Deletion, Deletions, pack_deletion, unpack_deletion
from posecast_relay.redis.client import REDIS_ERRORS, RedisClient, cancel_tasks

log = logging.getLogger("posecast_relay")

KEY = "posecast:{-}:past-deleted"
EVERY_S = 1.0
READ_MAX = 500  # in one answer
EXPIRY_S = 30 * 86400  # after the last one: nothing that it tells of is there any more


class RedisDeletions:
    """Passes deletions to and from Redis. What it hears goes into `deletions`."""

    def __init__(self, url: str, deletions: Deletions) -> None:
        self.link = RedisClient(url)
        self._deletions = deletions
        self._waiting: OrderedDict[str, Deletion] = OrderedDict()  # to be told, KNOWN_MAX at most
        self._there: set[str] = set()  # ids that stand there
        self._newest = b"-"
        self._connected = False
        self._task: asyncio.Task[None] | None = None
        deletions.on_added(self._keep)

    def start(self) -> None:
        """Start to read and write. Redis need not be there yet."""
        self._task = asyncio.create_task(self._work(), name="deletions through redis")

    async def stop(self) -> None:
        """Write what waits, if that is soon done, then close the connection."""
        await cancel_tasks(self._task)
        if self._connected:
            with contextlib.suppress(*REDIS_ERRORS):
                await self._tell()
        await self.link.close()

    def _keep(self, deletion: Deletion) -> None:
        if deletion.id not in self._there:
            self._waiting[deletion.id] = deletion
            if len(self._waiting) > KNOWN_MAX:
                self._waiting.popitem(last=False)

    async def _work(self) -> None:
        while True:
            try:
                if not self._connected:
                    await self.link.connect()
                    self._connected, self._newest = True, b"-"  # maybe it is another one by now
                    self._there.clear()
                await self._read()
                await self._tell()
            except REDIS_ERRORS:
                self._connected = False
                await self.link.reset()
            except Exception as e:  # a mistake of ours
                log.error("deletions through redis", exc_info=e)
            await asyncio.sleep(EVERY_S)

    async def _read(self) -> None:
        if await self.link.call(self.link.client.type(KEY)) not in (b"stream", b"none"):
            await self.link.call(self.link.client.delete(KEY))  # somebody else put something there
        while True:
            after = b"-" if self._newest == b"-" else b"(" + self._newest
            found = await self.link.call(self.link.client.xrange(KEY, after, "+", count=READ_MAX))
            for id_, fields in found:
                self._newest = id_
                try:
                    deletion = unpack_deletion(fields.get(b"deletion", b""))
                except ValueError as e:
                    log.warning("deletions in redis: one was passed over: %.200s", e)
                    continue
                self._there.add(deletion.id)
                self._waiting.pop(deletion.id, None)
                self._deletions.add(deletion)
            if len(found) < READ_MAX:
                break

    async def _tell(self) -> None:
        while self._waiting:
            id_, deletion = next(iter(self._waiting.items()))
            fields = {"deletion": pack_deletion(deletion)}
            await self.link.call(self.link.client.xadd(KEY, fields, maxlen=KNOWN_MAX, approximate=True))
            await self.link.call(self.link.client.expire(KEY, EXPIRY_S))
            self._there.add(id_)
            self._waiting.pop(id_, None)
