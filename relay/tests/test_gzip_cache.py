"""Packing once, within bounds."""

from __future__ import annotations

import asyncio
import gzip
import os

from posecast_relay.http.models import GzipCache, make_packed_name
from posecast_relay.models.memory import ENTRY_BYTES, ModelMemory


def room_with(**files: bytes) -> ModelMemory:
    """What is kept of a robot."""
    room = ModelMemory(1_000_000, lambda: 0.0)
    for name, data in files.items():
        claim = room.claim("r", len(data), lambda: None)
        assert claim is not None
        room.keep(claim, name, data, len(data))
        room.release(claim)
    return room


async def test_what_shrinks_is_packed_once_and_unpacks_to_the_same() -> None:
    text = b"joint " * 1000
    room = room_with(a=text)
    packed = GzipCache(room)
    sizes = await asyncio.gather(packed.pack("r", "a"), packed.pack("r", "a"))
    made = room.get(make_packed_name("a"))
    assert isinstance(made, bytes)
    assert set(sizes) == {len(made)}
    assert gzip.decompress(made) == text
    assert await packed.pack("r", "a") == len(made) < 100
    assert room.get(make_packed_name("a")) is made
    assert room.used == len(text) + len(made) + 2 * ENTRY_BYTES


async def test_what_does_not_shrink_is_left_alone_and_not_tried_twice() -> None:
    room = room_with(noise=os.urandom(10_000))
    packed = GzipCache(room)
    assert await packed.pack("r", "noise") == 0
    assert room.get(make_packed_name("noise")) == b""
    assert await packed.pack("r", "noise") == 0
    assert room.used == 10_000 + 2 * ENTRY_BYTES


async def test_what_is_not_here_is_not_packed_and_all_stays_within_the_room() -> None:
    room = room_with(a=b"joint " * 100_000)
    assert await GzipCache(room).pack("r", "b") == 0
    assert room.claim("other", 300_000, lambda: None)
    assert (
        await GzipCache(room).pack("r", "a") > 0
    )  # beside the other's there was room for one of the two only
    assert room.get("a") is None
    assert room.used < room.most
