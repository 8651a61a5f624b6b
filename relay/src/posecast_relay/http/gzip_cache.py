"""Compresses answers that never change with gzip, once for all who accept it."""

from __future__ import annotations

import asyncio
import gzip
from functools import partial
from typing import cast

from posecast_relay.models.memory import ModelMemory
from posecast_relay.shared_tasks import SharedTasks

WORTH = 0.95  # a file that compresses worse is sent as it is
LEVEL = 6
AT_ONCE = 2  # files compressed in parallel; more have to wait


class GzipCache:
    """Compresses the content of a ModelMemory in a thread, and keeps the result there too.

    If no memory is left, answers are sent uncompressed.
    """

    def __init__(self, room: ModelMemory) -> None:
        self._room = room
        self._turn = asyncio.Semaphore(AT_ONCE)
        self._under_way = SharedTasks("pack")

    async def pack(self, robot: str, name: str) -> int:
        """Compress `name`, keep it as `make_packed_name(name)`, and return its size in bytes.

        Returns 0 if it does not get much smaller, or if no room is free. `robot`: whose memory it uses.
        """
        known = cast("bytes | None", self._room.get(make_packed_name(name)))
        if known is not None:
            return len(known)
        return await self._under_way.run(name, partial(self._pack, robot, name))

    async def _pack(self, robot: str, name: str) -> int:
        async with self._turn:
            plain = cast("bytes | bytearray | None", self._room.get(name))
            claim = self._room.claim(robot, len(plain), lambda: None) if plain is not None else None
            if plain is None or claim is None:
                return 0
            try:
                packed = await asyncio.to_thread(gzip.compress, plain, LEVEL, mtime=0)
                if len(packed) > WORTH * len(plain):
                    packed = b""  # remembers that compression does not help
                self._room.keep(claim, make_packed_name(name), packed, len(packed))
            finally:
                self._room.release(claim)
            return len(packed) if self._room.get(make_packed_name(name)) is not None else 0


def make_packed_name(name: str) -> str:
    """Return the name of the compressed form of `name`."""
    return f"{name}.gz"
