"""What somebody has deleted of the past: spans of a robot's time that nobody keeps, writes or shows any
more.

A deletion reaches back only: it ends, at the latest, when it was ordered. What is recorded later is kept.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from posecast_relay.core.past.kept_segment import KeptSegment

KNOWN_MAX = 10_000  # some megabytes; then the one that was known first is forgotten: it is long carried out


@dataclass(frozen=True, slots=True)
class Deletion:
    """All that overlaps a span of a robot's past is deleted. `view` None: in each view; `from_ms`, `to_ms`:
    unix; `at_ms`: when it was ordered, unix; `id`: never means two deletions.
    """

    robot: str
    view: str | None
    from_ms: int
    to_ms: int
    at_ms: int
    id: str

    def covers(self, robot: str, view: str, from_ms: int, to_ms: int) -> bool:
        """Whether something of a view that lasted from `from_ms` to `to_ms`, unix, is deleted, if only in
        part: a segment is whole or not at all.
        """
        return (
            robot == self.robot
            and self.view in (None, view)
            and from_ms < self.to_ms
            and max(to_ms, from_ms + 1) > self.from_ms
        )

    def covers_segment(self, segment: KeptSegment) -> bool:
        """Whether a segment is deleted."""
        name = segment.name
        return self.covers(name.robot, name.view, segment.from_ms, segment.to_ms)


Listener = Callable[[Deletion], None]


@dataclass
class Deletions:
    """The deletions that a process knows of, wherever it heard of them, each once."""

    count: int = 0  # since the process began
    _known: OrderedDict[str, Deletion] = field(default_factory=OrderedDict)
    _of: dict[str, dict[str, Deletion]] = field(default_factory=dict)  # the same by robot
    _listeners: list[Listener] = field(default_factory=list)

    def add(self, deletion: Deletion) -> bool:
        """Note a deletion and tell the listeners, which must not raise. False: it was known already."""
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
        """Call `listener` with each deletion that is added from now on."""
        self._listeners.append(listener)

    def has(self, id_: str) -> bool:
        """Whether the deletion of this id is known."""
        return id_ in self._known

    def list_known(self) -> Iterable[Deletion]:
        """Return all that are known, in the order in which they became known."""
        return tuple(self._known.values())

    def cover(self, robot: str, view: str, from_ms: int, to_ms: int) -> bool:
        """Whether something of a view that lasted from `from_ms` to `to_ms`, unix, is deleted."""
        return any(each.covers(robot, view, from_ms, to_ms) for each in self._of.get(robot, {}).values())

    def cover_segment(self, segment: KeptSegment) -> bool:
        """Whether a segment is deleted."""
        return any(each.covers_segment(segment) for each in self._of.get(segment.name.robot, {}).values())
