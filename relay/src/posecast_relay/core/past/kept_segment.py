"""A closed segment as it is kept: its bytes, and what an index tells of it without reading them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from posecast_wire.messages import RobotStatus

from posecast_relay.core.policy.policy import Audience

OBJECT_BYTES = 1000  # of Python's own for one segment, its name and what its index tells


@dataclass(frozen=True, slots=True)
class SegmentName:
    """What a segment is called; never means two things. `take`: u64; `index`: in its take, from 0."""

    robot: str
    view: str
    take: int
    index: int


class PastEvent(NamedTuple):
    """An event. `at_ms`: when it was accepted, unix ms; `text`: JSON as every viewer got it."""

    at_ms: int
    text: str


class PastWord(NamedTuple):
    """What the robot's status was from `at_ms` on, unix ms."""

    at_ms: int
    word: RobotStatus


@dataclass(frozen=True, slots=True)
class KeptSegment:
    """A closed segment.

    `run`: u64, 0 if none was known; `from_ms`, `to_ms`: unix; `missing`: frames lost between the segment
    before and this one; `schema`: SHA-256 of `schema_text`, None without a schema; `model`: SHA-256 of the
    manifest at the beginning, hexadecimal; `sha256`: of `data`; `words`: the first is that of the beginning;
    `faults`: how many of `events` say that a fault began; `audiences`: those that could see all of it live.
    """

    name: SegmentName
    run: int
    from_ms: int
    to_ms: int
    frames: int
    first_seq: int
    last_seq: int
    missing: int
    schema: bytes | None
    model: str | None
    data: bytes = field(repr=False)
    sha256: bytes
    events: tuple[PastEvent, ...]
    words: tuple[PastWord, ...]
    faults: int
    audiences: frozenset[Audience]
    schema_text: str | None = field(default=None, repr=False)  # shared by all segments of that schema
    elsewhere_bytes: int = 0  # how many bytes it has that are not here: then `data` is empty

    @property
    def size(self) -> int:
        """How many bytes it has, wherever they are."""
        return len(self.data) + self.elsewhere_bytes

    @property
    def cost_bytes(self) -> int:
        """How many bytes of memory it takes, without its schema's text."""
        return OBJECT_BYTES + len(self.data) + sum(200 + 2 * len(event.text) for event in self.events)
