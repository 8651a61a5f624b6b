"""A summary of a day, for looking through months: which audiences could see anything, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from posecast_relay.core.past.audience_letters import write_letters
from posecast_relay.core.past.day_index import DayIndex
from posecast_relay.core.past.memory_store import TakeSpan
from posecast_relay.core.policy import Audience

REACH_BYTES, SPAN_BYTES = 600, 250  # overhead of Python objects


class SeenSpan(NamedTuple):
    """A time span, unix ms, in which some audiences could see something."""

    audiences: frozenset[Audience]
    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True)
class DayReach:
    """The summary of a day. `takes`: the first and last index of each take; `schemas`, `models`: SHA-256."""

    day_ms: int
    spans: tuple[SeenSpan, ...]
    takes: dict[int, TakeSpan]
    schemas: frozenset[str]
    models: frozenset[str] = frozenset()

    @property
    def cost_bytes(self) -> int:
        """Roughly how many bytes of memory it takes."""
        rows = len(self.spans) + len(self.takes) + len(self.schemas) + len(self.models)
        return REACH_BYTES + SPAN_BYTES * rows


def reach_day(day: DayIndex) -> DayReach:
    """Summarise a day's index."""
    spans: dict[str, SeenSpan] = {}
    takes: dict[int, TakeSpan] = {}
    for row in day.list_minutes():
        letters = write_letters(row.audiences)
        span = spans.get(letters, SeenSpan(row.audiences, row.from_ms, row.to_ms))
        spans[letters] = SeenSpan(row.audiences, min(span.from_ms, row.from_ms), max(span.to_ms, row.to_ms))
    for page in day.list_pages():
        for take in page.takes:
            known = takes.get(take.take, take)
            first, last = min(known.first_index, take.first_index), max(known.last_index, take.last_index)
            takes[take.take] = TakeSpan(take.take, first, last)
    return DayReach(
        *(day.day_ms, tuple(spans.values()), takes),
        *(frozenset(day.find_schemas()), frozenset(day.find_models())),
    )
