"""Keeps the last readings of each publisher: a topic of a robot, or a part of a program.

A reading is kept until it is replaced or expires, so the arm's publisher does not erase the leg's readings.
The readings of a dead publisher expire after a while, so it never looks like a robot at rest. Does no I/O;
time is an argument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, TypeVar

STREAM_S = 1.5  # readings of motion expire after this; the page shows STALE after the same time
STATE_S = 60.0  # readings that are published rarely or only when they change
LABELS_MAX = 1 << 14  # of all publishers (the wire format has 4,096 channels)

_T = TypeVar("_T")


@dataclass
class _Publisher(Generic[_T]):
    """`source` and `labels` say who it is. `readings`: the last ones, None before the first. `life_s`: how
    long they are valid. `number`: counts what all publishers have sent."""

    source: str
    labels: tuple[str, ...]
    readings: _T | None = None
    life_s: float = math.inf
    heard_s: float = 0.0
    number: int = 0


class LatestReadings(Generic[_T]):
    """Holds at most `most` publishers and LABELS_MAX labels; beyond that, the publishers silent longest are
    dropped. Not thread-safe."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._publishers: dict[tuple[str, tuple[str, ...]], _Publisher[_T]] = {}  # by source and labels
        self._newest: dict[str, _Publisher[_T]] = {}  # by source: usually found without hashing its labels
        self._labels = 0  # of all publishers
        self._count = 0

    def replace(
        self, source: str, labels: tuple[str, ...], readings: _T, life_s: float, now_s: float
    ) -> _T | None:
        """Keep `readings`, which are valid for `life_s`. Returns those that they replace, None if the
        publisher is new."""
        publisher = self._newest.get(source)
        if publisher is None or (publisher.labels is not labels and publisher.labels != labels):
            publisher = self._newest[source] = self._find(source, labels)
        self._count += 1
        before, publisher.readings = publisher.readings, readings
        publisher.life_s, publisher.heard_s, publisher.number = life_s, now_s, self._count
        return before

    def forget(self, source: str) -> None:
        """Drop all publishers of this source."""
        for publisher in [p for p in self._publishers.values() if p.source == source]:
            self._drop(publisher)

    def list_all(self) -> list[tuple[str, tuple[str, ...], _T]]:
        """Source, labels and last readings of each publisher, the one silent longest first."""
        ordered = sorted(self._publishers.values(), key=lambda p: p.number)
        return [(p.source, p.labels, p.readings) for p in ordered if p.readings is not None]

    def list_valid(self, now_s: float) -> list[tuple[str, tuple[str, ...], _T]]:
        """The publishers whose readings are valid at `now_s`, as in `list_all`. Drops the others."""
        for publisher in [p for p in self._publishers.values() if now_s - p.heard_s >= p.life_s]:
            self._drop(publisher)
        return self.list_all()

    def _find(self, source: str, labels: tuple[str, ...]) -> _Publisher[_T]:
        publisher = self._publishers.get((source, labels))
        if publisher is None:
            while self._publishers and (
                len(self._publishers) >= self._most or self._labels + len(labels) > LABELS_MAX
            ):
                self._drop(min(self._publishers.values(), key=lambda p: p.number))
            publisher = self._publishers[source, labels] = _Publisher(source, labels)
            self._labels += len(labels)
        return publisher

    def _drop(self, publisher: _Publisher[_T]) -> None:
        del self._publishers[publisher.source, publisher.labels]
        self._labels -= len(publisher.labels)
        if self._newest.get(publisher.source) is publisher:
            del self._newest[publisher.source]
