"""A closed segment: its bytes, and the facts that an index holds about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from posecast_wire.messages import RobotStatus

from posecast_relay.core.policy import Audience

OBJECT_BYTES = 1000  # Python's overhead for one segment, its name and its index entry


@dataclass(frozen=True, slots=True)
class SegmentName:
    """The unique name of a segment. `take`: u64; `index`: its position in the take, from 0."""

    robot: str
    view: str
    take: int
    index: int


class PastEvent(NamedTuple):
    """An event. `at_ms`: when it was accepted, unix ms; `text`: the JSON that every viewer got."""

    at_ms: int
    text: str


class PastWord(NamedTuple):
    """The robot's status from `at_ms` on, unix ms."""

    at_ms: int
    word: RobotStatus


@dataclass(frozen=True, slots=True)
class KeptSegment:
    """A closed segment.

    `run`: u64, 0 if none was known; `from_ms`, `to_ms`: unix ms; `missing`: frames lost since the previous
    segment; `schema`: SHA-256 of `schema_text`, or None; `model`: SHA-256 of the manifest at the start, in
    hexadecimal; `sha256`: of `data`; `words`: the first is the status at the start; `faults`: how many of
    `events` begin a fault; `audiences`: those that could see all of it live.
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
    schema_text: str | None = field(default=None, repr=False)  # shared by all segments with that schema
    elsewhere_bytes: int = 0  # its size if its bytes are not here; `data` is then empty

    @property
    def size(self) -> int:
        """Its size in bytes, wherever the bytes are."""
        return len(self.data) + self.elsewhere_bytes

    @property
    def cost_bytes(self) -> int:
        """How many bytes of memory it takes, without its schema's text."""
        return OBJECT_BYTES + len(self.data) + sum(200 + 2 * len(event.text) for event in self.events)
