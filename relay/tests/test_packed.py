"""Packing once, within bounds."""

from __future__ import annotations

import asyncio
import gzip
import os

from posecast_relay.adapters.packed import Packed


async def test_what_shrinks_is_packed_once_and_unpacks_to_the_same() -> None:
    packed = Packed(1_000_000)
    text = b"joint " * 1000
    first, again = await asyncio.gather(packed.pack("a", text), packed.pack("a", text))
    assert first is not None
    assert first is again is await packed.pack("a", text)
    assert gzip.decompress(first) == text
    assert len(first) < 100


async def test_what_does_not_shrink_is_left_alone_and_not_tried_twice() -> None:
    packed = Packed(1_000_000)
    noise = os.urandom(10_000)
    assert await packed.pack("noise", noise) is None
    assert await packed.pack("noise", b"joint " * 1000) is None  # the name alone decides


async def test_when_full_the_oldest_goes() -> None:
    packed = Packed(400)
    made = [await packed.pack(str(i), bytes([i]) * 10_000) for i in range(6)]
    assert all(made)
    assert await packed.pack("5", b"") is made[5]
    assert await packed.pack("0", b"other" * 10_000) is not made[0]
