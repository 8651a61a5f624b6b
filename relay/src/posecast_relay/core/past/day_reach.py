"""The little that is known of a day where months of them are looked at: who could see any of it, and when."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from posecast_relay.core.past.audience_letters import write_letters
from posecast_relay.core.past.day_index import DayIndex
from posecast_relay.core.past.memory_store import TakeSpan
from posecast_relay.core.policy.policy import Audience

REACH_BYTES, SPAN_BYTES = 600, 250  # of Python's own


class SeenSpan(NamedTuple):
    """From when to when, unix ms, there is anything that some audiences could see."""

    audiences: frozenset[Audience]
    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True)
class DayReach:
    """What is known of a day. `takes`: by take, from which index to which; `schemas`, `models`: SHA-256."""

    day_ms: int
    spans: tuple[SeenSpan, ...]
    takes: dict[int, TakeSpan]
    schemas: frozenset[str]
    models: frozenset[str] = frozenset()

    @property
    def cost_bytes(self) -> int:
        """How many bytes of memory it takes, about."""
        rows = len(self.spans) + len(self.takes) + len(self.schemas) + len(self.models)
        return REACH_BYTES + SPAN_BYTES * rows


def reach_day(day: DayIndex) -> DayReach:
    """Make what is known of a day where months of them are looked at."""
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
