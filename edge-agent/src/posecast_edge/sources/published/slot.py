"""A one-place buffer between the program that publishes and the thread that sends: the newest readings win.

A program may write here at 1 kHz; the reader takes the content when a frame is due. Readings that a call
leaves out keep their value for a while. So positions and temperatures, or left and right arm, may come at
different rates and from different threads. Only faults are not replaced: changed flags are kept, the newest
KEPT_MAX of them, and checked one by one.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from posecast_edge.sample import Reading
from posecast_edge.sources.published.copier import Copied

Readings = dict[str, Reading]  # by label

STRANDS_MAX = 64  # strands: combinations of a field and its labels
LABELS_MAX = 1 << 14  # of all of them (the wire has 4,096 channels)
KEPT_MAX = 64
STREAM_S = 1.5  # how long readings of motion are valid; the page shows STALE after the same time
STATE_S = 60.0  # the same for readings that are published rarely or only when they change
STREAMS = frozenset(
    ("pos", "vel", "effort", "base", "baseq", "ftf", "ftm", "quat", "tilt", "gyro", "acc"),
)
FLAGS = "flags"


@dataclass
class _Strand:
    """The last readings of one field and set of labels. `number`: of the call."""

    labels: tuple[str, ...]
    readings: Sequence[Reading] = ()
    put_s: float = 0.0
    number: int = 0


class Taken(NamedTuple):
    """The content of the slot. `t_s`: the robot's time, seconds. `flags`: (robot time, readings) of flags
    that were replaced before they were read, the oldest first."""

    t_s: float
    values: dict[str, Readings]
    info: Mapping[str, str]
    flags: list[tuple[float, Readings]]


class PublishedSlot:
    """Any thread may call `put`; one thread calls `take` and `wait`. Times are seconds of kit.now_s(),
    `t_s` is the robot's."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bell = threading.Event()
        self._waiting = False
        self._fresh = False
        self._t_s = 0.0
        self._strands: dict[tuple[str, tuple[str, ...]], _Strand] = {}
        self._newest: dict[str, _Strand] = {}  # of each field
        self._labels = 0  # of all strands
        self._info: Mapping[str, str] = {}
        self._flags: deque[tuple[float, Readings]] = deque(maxlen=KEPT_MAX)
        self.published = 0  # calls

    def put(self, t_s: float, copies: Sequence[Copied], info: Mapping[str, str], now_s: float) -> None:
        """Replace these readings and texts."""
        with self._lock:
            self.published += 1
            for name, labels, readings in copies:
                strand = self._newest.get(name)
                if strand is None or (strand.labels is not labels and strand.labels != labels):
                    strand = self._find_strand(name, labels)
                elif name == FLAGS and self._fresh and strand.readings != readings:
                    self._flags.append((self._t_s, dict(zip(labels, strand.readings, strict=True))))
                strand.readings, strand.put_s, strand.number = readings, now_s, self.published
            if info:
                self._info = info
            self._t_s, self._fresh = t_s, True
            wake, self._waiting = self._waiting, False
        if wake:
            self._bell.set()

    def wait(self, seconds: float) -> None:
        """Return when there is something new, or after `seconds`. `put` wakes only a waiting reader, so at
        most one call per frame has that cost."""
        with self._lock:
            if self._fresh:
                return
            self._bell.clear()
            self._waiting = True
        self._bell.wait(seconds)

    def take(self, now_s: float) -> Taken | None:
        """All valid readings; None when nothing has been published since the last call."""
        with self._lock:
            if not self._fresh:
                return None
            self._fresh = False
            values: dict[str, Readings] = {}
            strands = sorted(self._strands.items(), key=lambda item: item[1].number)
            for (name, labels), strand in strands:
                if now_s - strand.put_s < (STREAM_S if name in STREAMS else STATE_S):
                    values.setdefault(name, {}).update(zip(labels, strand.readings, strict=True))
            flags = list(self._flags)
            self._flags.clear()
            return Taken(self._t_s, values, self._info, flags)

    def _find_strand(self, name: str, labels: tuple[str, ...]) -> _Strand:
        """The strand of these labels, which becomes the field's newest. May evict the one silent longest."""
        key = (name, labels)
        if key not in self._strands:
            while self._strands and (
                len(self._strands) >= STRANDS_MAX or self._labels + len(labels) > LABELS_MAX
            ):
                oldest = min(self._strands, key=lambda key: self._strands[key].number)
                gone = self._strands.pop(oldest)
                self._labels -= len(gone.labels)
                if self._newest.get(oldest[0]) is gone:
                    del self._newest[oldest[0]]
            self._strands[key] = _Strand(labels)
            self._labels += len(labels)
        strand = self._newest[name] = self._strands[key]
        return strand
