"""A closed segment: its bytes, the facts that an index holds about it, and their encoding as the index entry
that is stored next to the bytes in Redis and in an object store.

Input is not trusted. If it is malformed or of another version, reading raises ValueError with a one-line
message.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, cast, get_args

from posecast_wire.checked import loads
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


PAGE_MS = 600_000  # segments are grouped by the page of this length in which they begin
DAY_MS, MINUTE_MS = 86_400_000, 60_000


class TakeSpan(NamedTuple):
    """A take that has segments here, with the indexes of its oldest and newest one."""

    take: int
    first_index: int
    last_index: int


LETTERS = {Audience.ANYONE: "a", Audience.LINK: "l", Audience.SIGNED_IN: "s"}
NOBODY = "x"
FORM = re.compile("a?l?s?|x", re.ASCII)


def pack_audiences(audiences: Iterable[Audience]) -> str:
    """Return one letter for each audience, sorted; x for none."""
    return "".join(sorted(LETTERS[audience] for audience in audiences)) or NOBODY


def unpack_audiences(text: str) -> frozenset[Audience]:
    """Parse what `pack_audiences` wrote. Raises ValueError."""
    if not text or not FORM.fullmatch(text):
        raise ValueError("invalid audiences")
    return frozenset(audience for audience, letter in LETTERS.items() if letter in text)


VERSION = 1
RECORD_BYTES_MAX = 1 << 22  # a segment holds at most 1 MB of events; escaping can make them longer
SEGMENT_BYTES_MAX = 3 << 20
U32_MAX, WHOLE_MAX = (1 << 32) - 1, (1 << 53) - 1
SPAN_MS_MAX = 600_000
LISTED_MAX = 1 << 19  # events or statuses: more do not fit into a segment
U64 = re.compile("[0-9a-f]{16}", re.ASCII)
SHA256 = re.compile("[0-9a-f]{64}", re.ASCII)
WORDS = get_args(RobotStatus)


def pack_record(segment: KeptSegment) -> bytes:
    """Encode the index entry of a segment, without its robot and view. Raises ValueError."""
    return dump_json(make_record(segment))


def make_record(segment: KeptSegment) -> dict[str, object]:
    """Make the index entry of a segment, without its robot and view."""
    return {
        "v": VERSION,
        "take": f"{segment.name.take:016x}",
        "index": segment.name.index,
        "run": f"{segment.run:016x}",
        "from": segment.from_ms,
        "to": segment.to_ms,
        "frames": segment.frames,
        "first": segment.first_seq,
        "last": segment.last_seq,
        "missing": segment.missing,
        "schema": None if segment.schema is None else segment.schema.hex(),
        "model": segment.model,
        "bytes": segment.size,
        "sha256": segment.sha256.hex(),
        "events": segment.events,
        "words": segment.words,
        "faults": segment.faults,
        "audiences": sorted(segment.audiences),
    }


def unpack_record(robot: str, view: str, data: bytes) -> KeptSegment:
    """Parse the index entry of a segment whose bytes are elsewhere. Raises ValueError if it is invalid."""
    if len(data) > RECORD_BYTES_MAX:
        raise ValueError("record: too long")
    return read_record(robot, view, loads(data))


def read_record(robot: str, view: str, doc: object) -> KeptSegment:
    """Read the index entry of a segment from parsed JSON. Raises ValueError if it is invalid."""
    if not isinstance(doc, dict):
        raise ValueError("record: not an object")
    if doc.get("v") != VERSION:
        raise ValueError(f"record: unsupported version {doc.get('v')!r:.20}")
    schema, from_ms = doc.get("schema"), _whole(doc, "from", WHOLE_MAX - SPAN_MS_MAX)
    to_ms = _whole(doc, "to", from_ms + SPAN_MS_MAX)
    if to_ms < from_ms:
        raise ValueError("record: it ends before it begins")
    return KeptSegment(
        name=SegmentName(robot, view, int(_hex(doc, "take", U64), 16), _whole(doc, "index", U32_MAX)),
        run=int(_hex(doc, "run", U64), 16),
        from_ms=from_ms,
        to_ms=to_ms,
        frames=_whole(doc, "frames", U32_MAX),
        first_seq=_whole(doc, "first", U32_MAX),
        last_seq=_whole(doc, "last", U32_MAX),
        missing=_whole(doc, "missing", U32_MAX),
        schema=None if schema is None else bytes.fromhex(_hex(doc, "schema", SHA256)),
        model=None if doc.get("model") is None else _hex(doc, "model", SHA256),
        data=b"",
        sha256=bytes.fromhex(_hex(doc, "sha256", SHA256)),
        events=tuple(PastEvent(*pair) for pair in _pairs(doc, "events", is_event)),
        words=tuple(PastWord(at, cast(RobotStatus, word)) for at, word in _pairs(doc, "words", _is_word)),
        faults=_whole(doc, "faults", U32_MAX),
        audiences=_audiences(doc),
        elsewhere_bytes=_whole(doc, "bytes", SEGMENT_BYTES_MAX),
    )


def is_event(text: str) -> bool:
    """Whether it is a numbered event: an index copies it without parsing it."""
    try:
        doc = loads(text)
    except ValueError:
        return False
    return isinstance(doc, dict) and type(doc.get("n")) is int and text[0] == "{" and text[-1] == "}"


def dump_json(doc: object) -> bytes:
    """Encode as JSON. Raises ValueError for values that JSON can't hold: 1e999, half a surrogate pair."""
    return json.dumps(doc, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def _whole(doc: dict[str, Any], name: str, most: int) -> int:
    found = doc.get(name)
    if type(found) is not int or not 0 <= found <= most:
        raise ValueError(f"record: invalid {name}")
    return found


def _hex(doc: dict[str, Any], name: str, form: re.Pattern[str]) -> str:
    found = doc.get(name)
    if not isinstance(found, str) or not form.fullmatch(found):
        raise ValueError(f"record: invalid {name}")
    return found


def _pairs(doc: dict[str, Any], name: str, is_text: Callable[[str], bool]) -> list[tuple[int, str]]:
    found = doc.get(name)
    if not isinstance(found, list) or len(found) > LISTED_MAX:
        raise ValueError(f"record: invalid {name}")
    for pair in found:
        whole = isinstance(pair, list) and len(pair) == 2 and type(pair[0]) is int
        if not whole or not 0 <= pair[0] <= WHOLE_MAX or not isinstance(pair[1], str) or not is_text(pair[1]):
            raise ValueError(f"record: invalid {name}")
    return [(at, text) for at, text in found]


def _is_word(text: str) -> bool:
    return text in WORDS


def _audiences(doc: dict[str, Any]) -> frozenset[Audience]:
    """The audiences known to this version. An unknown name from another version sees nothing."""
    found = doc.get("audiences")
    if not isinstance(found, list):
        raise ValueError("record: invalid audiences")
    return frozenset(audience for audience in Audience if audience.value in found)
