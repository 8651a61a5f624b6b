"""Deletions of the past: time spans of a robot that nobody keeps, writes or shows any more.

A deletion only affects what was recorded before it was ordered. Later recordings are kept. It is encoded in
an object store (a tombstone), in Redis, and on the way from the command to a relay. What is read is not
trusted: if it is malformed or of another version, reading raises ValueError with a one-line message.
"""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict, dataclass, field

from posecast_wire import check_name
from posecast_wire.checked import loads

from posecast_relay.kit import json_bytes
from posecast_relay.past.segment import WHOLE_MAX, KeptSegment

KNOWN_MAX = 10_000  # some megabytes; beyond that the oldest is forgotten, which was executed long ago

SPANS_MAX = 100  # reported to viewers


@dataclass(frozen=True, slots=True)
class Deletion:
    """Deletes every segment that overlaps a time span of a robot's past.

    `view` None: every view; `from_ms`, `to_ms`: unix ms; `at_ms`: when it was ordered, unix ms; `id`: unique.
    """

    robot: str
    view: str | None
    from_ms: int
    to_ms: int
    at_ms: int
    id: str

    def covers(self, robot: str, view: str, from_ms: int, to_ms: int) -> bool:
        """Whether the span from `from_ms` to `to_ms`, unix ms, of a view overlaps the deletion.

        A partly covered segment is deleted as a whole.
        """
        return (
            robot == self.robot
            and self.view in (None, view)
            and from_ms < self.to_ms
            and max(to_ms, from_ms + 1) > self.from_ms
        )

    def covers_segment(self, segment: KeptSegment) -> bool:
        """Whether this deletes a segment."""
        name = segment.name
        return self.covers(name.robot, name.view, segment.from_ms, segment.to_ms)


Listener = Callable[[Deletion], None]


@dataclass
class Deletions:
    """The deletions that a process knows of, from any source, each once."""

    count: int = 0  # since the process started
    _known: OrderedDict[str, Deletion] = field(default_factory=OrderedDict)
    _of: dict[str, dict[str, Deletion]] = field(default_factory=dict)  # the known deletions by robot
    _listeners: list[Listener] = field(default_factory=list)

    def add(self, deletion: Deletion) -> bool:
        """Add a deletion and tell the listeners, which must not raise. Returns False if it was already
        known."""
        if deletion.id in self._known:
            return False
        self._known[deletion.id] = deletion
        self._of.setdefault(deletion.robot, {})[deletion.id] = deletion
        self.count += 1
        if len(self._known) > KNOWN_MAX:
            id_, oldest = self._known.popitem(last=False)
            del self._of[oldest.robot][id_]
            if not self._of[oldest.robot]:
                del self._of[oldest.robot]
        for listener in tuple(self._listeners):
            listener(deletion)
        return True

    def on_added(self, listener: Listener) -> None:
        """Call `listener` with each deletion added from now on."""
        self._listeners.append(listener)

    def has(self, id_: str) -> bool:
        """Whether a deletion with this id is known."""
        return id_ in self._known

    def cover(self, robot: str, view: str, from_ms: int, to_ms: int) -> bool:
        """Whether any deletion overlaps the span from `from_ms` to `to_ms`, unix ms, of a view."""
        return any(each.covers(robot, view, from_ms, to_ms) for each in self._of.get(robot, {}).values())

    def list_spans(self, robot: str, view: str) -> list[tuple[int, int]]:
        """Return the spans of a view that are deleted, unix ms, in order and merged: the newest SPANS_MAX."""
        merged: list[tuple[int, int]] = []
        known = self._of.get(robot, {}).values()
        for span in sorted((of.from_ms, of.to_ms) for of in known if of.view in (None, view)):
            if merged and span[0] <= merged[-1][1]:
                merged[-1] = merged[-1][0], max(merged[-1][1], span[1])
            else:
                merged.append(span)
        return merged[-SPANS_MAX:]

    def cover_segment(self, segment: KeptSegment) -> bool:
        """Whether any deletion covers a segment."""
        return any(each.covers_segment(segment) for each in self._of.get(segment.name.robot, {}).values())


VERSION = 1
RECORD_BYTES_MAX = 4096
ID = re.compile("[0-9a-f]{16}", re.ASCII)


def pack_deletion(deletion: Deletion) -> bytes:
    """Encode a deletion."""
    return json_bytes({"v": VERSION} | asdict(deletion))


def unpack_deletion(data: bytes) -> Deletion:
    """Parse a deletion. Raises ValueError if it is invalid."""
    if len(data) > RECORD_BYTES_MAX:
        raise ValueError("deletion: too long")
    doc = loads(data)
    if not isinstance(doc, dict):
        raise ValueError("deletion: not an object")
    if doc.get("v") != VERSION:
        raise ValueError(f"deletion: unsupported version {doc.get('v')!r:.20}")
    robot, view, id_ = doc.get("robot"), doc.get("view"), doc.get("id")
    if not isinstance(robot, str) or not (view is None or isinstance(view, str)):
        raise ValueError("deletion: invalid robot or view")
    if not isinstance(id_, str) or not ID.fullmatch(id_):
        raise ValueError("deletion: invalid id")
    from_ms, to_ms, at_ms = (_read_ms(doc.get(name)) for name in ("from_ms", "to_ms", "at_ms"))
    if not from_ms <= to_ms <= at_ms:
        raise ValueError("deletion: not a time span that was over when it was ordered")
    check_name("robot", robot)
    if view is not None:
        check_name("view", view)
    return Deletion(robot, view, from_ms, to_ms, at_ms, id_)


def _read_ms(found: object) -> int:
    if type(found) is not int or not 0 <= found <= WHOLE_MAX:
        raise ValueError("deletion: invalid time")
    return found
