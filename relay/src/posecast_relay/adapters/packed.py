"""Answers that never change, packed with gzip once for all who can unpack them."""

from __future__ import annotations

import asyncio
import gzip
from collections import OrderedDict

WORTH = 0.95  # what shrinks less travels as it is
LEVEL = 6


class Packed:
    """Packs in a thread of its own and keeps. When memory is full what was asked for longest ago goes."""

    def __init__(self, cache_bytes: int) -> None:
        self._cache_bytes = cache_bytes
        self._kept_bytes = 0
        self._kept: OrderedDict[str, bytes | None] = OrderedDict()
        self._under_way: dict[str, asyncio.Task[bytes | None]] = {}

    async def pack(self, name: str, data: bytes) -> bytes | None:
        """`data` in gzip's format, or None where that is not worth it. The same name means the same data."""
        if name in self._kept:
            self._kept.move_to_end(name)
            return self._kept[name]
        task = self._under_way.get(name)
        if task is None:
            task = self._under_way[name] = asyncio.create_task(self._pack(name, data))
            task.add_done_callback(lambda _: self._under_way.pop(name))
        return await asyncio.shield(task)

    async def _pack(self, name: str, data: bytes) -> bytes | None:
        packed = await asyncio.to_thread(gzip.compress, data, LEVEL, mtime=0)
        result = packed if len(packed) <= WORTH * len(data) else None
        self._kept[name] = result
        self._kept_bytes += _size(result)
        while self._kept_bytes > self._cache_bytes:
            _, gone = self._kept.popitem(last=False)
            self._kept_bytes -= _size(gone)
        return result


def _size(packed: bytes | None) -> int:
    """What it counts for; a "not worth it" is remembered, too, and must not be free."""
    return 64 + (len(packed) if packed is not None else 0)
