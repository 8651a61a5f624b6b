"""What the first worker and a further one say on the feed, as bytes.

A message is its length (4 bytes), its kind (1), the length of a robot's name (1), the name, and what follows:

    → WANT    from now on, tell of this robot
    → LEAVE   no more of this robot
    → AGAIN   all of this robot once more
    ← SAID    an update or presence, as `redis/messages.py` packs it
    ← STATE   all of one view, in the values that `redis/messages.py` unpacks

In a state, first comes the view, then names and values in turns, each behind its length (4 bytes).
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import NamedTuple

from posecast_relay.redis.messages import BYTES_MAX

HEAD = struct.Struct(">IBB")
LENGTH = struct.Struct(">I")
STATE_BYTES_MAX = 1 << 22  # schema, info, three frames, a hundred events


class Kind(IntEnum):
    """What a message is."""

    WANT = 1
    LEAVE = 2
    AGAIN = 3
    SAID = 4
    STATE = 5


class FeedMessage(NamedTuple):
    """A message of the feed, about one robot."""

    kind: Kind
    robot: str
    body: bytes


def pack_message(kind: Kind, robot: str, body: bytes = b"") -> bytes:
    """Encode a message."""
    name = robot.encode()
    return HEAD.pack(len(body), kind, len(name)) + name + body


async def read_message(reader: asyncio.StreamReader) -> FeedMessage:
    """Read the next message. Raises EOFError at the end, ValueError when it is none."""
    size, kind, name_size = HEAD.unpack(await reader.readexactly(HEAD.size))
    if size > (STATE_BYTES_MAX if kind == Kind.STATE else BYTES_MAX):
        raise ValueError("feed: a message is too long")
    robot = (await reader.readexactly(name_size)).decode()
    return FeedMessage(Kind(kind), robot, await reader.readexactly(size))


def pack_state(view: str, values: Iterable[bytes | str | int]) -> bytes:
    """Encode the state of a view: names and values in turns."""
    parts = [view.encode()]
    parts += [each if isinstance(each, bytes) else str(each).encode() for each in values]
    return b"".join(LENGTH.pack(len(part)) + part for part in parts)


def unpack_state_values(body: bytes) -> tuple[str, dict[bytes, bytes]]:
    """Return the view and its values by name. Raises ValueError when it is no state."""
    view, *rest = _split(body)
    return view.decode(), dict(zip(rest[::2], rest[1::2], strict=True))


def _split(body: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(body):
        if at + LENGTH.size > len(body):
            raise ValueError("feed: a state is cut short")
        (size,) = LENGTH.unpack_from(body, at)
        at += LENGTH.size
        if at + size > len(body):
            raise ValueError("feed: a state is cut short")
        yield body[at : at + size]
        at += size
