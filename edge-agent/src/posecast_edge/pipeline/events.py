"""Detects events: faults that appear and clear, a source that falls silent, a limit that is crossed. Does no
I/O.

Checks every sample that the source delivers, not only those that are sent: a fault in a single sample at
200 Hz still becomes two events.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from posecast_wire.mapping import Threshold
from posecast_wire.schema import Field, Schema

SILENT_S = 1.5  # the page shows STALE after the same time
PER_SECOND = 20
HYSTERESIS = 0.05  # of the limit: how far back a value must go before the limit counts as left
LEVELS = ("info", "caution", "fault")


@dataclass(frozen=True)
class Event:
    """An event for the relay. `t_s`: robot clock, seconds; `on`: True at its begin, False at its end."""

    t_s: float
    level: str
    source: str
    text: str
    on: bool


class EventLimit:
    """Lets at most PER_SECOND events a second through; drops the rest and adds one event that counts them."""

    def __init__(self) -> None:
        self._since_s = -math.inf
        self._sent = 0
        self._held: list[Event] = []  # the newest one only; `_count` says how many
        self._count = 0

    def admit(self, events: Sequence[Event], now_s: float) -> list[Event]:
        """Return those of `events` that may be sent at `now_s` (monotonic seconds). Call it regularly, also
        with no events: when it is due, it adds the event that counts the dropped ones."""
        out: list[Event] = []
        if now_s - self._since_s >= 1.0:
            if self._count:
                last = self._held[0]
                out.append(Event(last.t_s, last.level, "events", f"{self._count} more", True))
            self._since_s, self._sent, self._count, self._held = now_s, len(out), 0, []
        for event in events:
            if self._sent < PER_SECOND:
                self._sent += 1
                out.append(event)
                continue
            worst = max((event, *self._held), key=lambda e: LEVELS.index(e.level))
            self._held = [Event(event.t_s, worst.level, event.source, event.text, event.on)]
            self._count += 1
        return out


Values = Sequence[float | None]


class _Bits:
    """Watches the masks of one field."""

    def __init__(self, field: Field, named_bits: Sequence[tuple[int, str, str]]) -> None:
        self.name = field.name
        self._labels = field.labels
        self._named_bits = named_bits  # mask, name, level
        self._all = sum(mask for mask, _, _ in named_bits)
        self._newest: Values = ()
        self._known: list[float | None] = [0] * field.size  # the newest reading of each

    def carry_over(self, old: _Bits) -> None:
        """Take over the state of `old`, label by label and bit by bit."""
        own = {name: mask for mask, name, _ in self._named_bits}
        before = dict(zip(old._labels, old._known, strict=True))
        for i, label in enumerate(self._labels):
            mask = int(before.get(label) or 0)
            self._known[i] = sum(own.get(name, 0) for bit, name, _ in old._named_bits if mask & bit)

    def look(self, t_s: float, masks: Values) -> list[Event]:
        events: list[Event] = []
        if masks is self._newest or masks == self._newest:  # the common case, 200 times a second
            return events
        self._newest = masks
        for i, mask in enumerate(masks):
            before = self._known[i]
            if mask is None or mask == before:
                continue  # no reading: keep the last state
            self._known[i] = mask
            changed = (int(mask) ^ int(before or 0)) & self._all
            if changed:
                for bit, name, level in self._named_bits:
                    if changed & bit:
                        events.append(Event(t_s, level, self._labels[i], name, bool(int(mask) & bit)))
        return events


class _Limit:
    """Watches one channel against one threshold. `index`: the channel's position in its field."""

    def __init__(self, index: int, label: str, unit: str, threshold: Threshold) -> None:
        self.index = index
        self.label = label
        low, high = threshold.low, threshold.high
        self.low = -math.inf if low is None else low
        self.high = math.inf if high is None else high
        # where the value counts as back within the limit
        self._low_back = self.low if low is None else low + HYSTERESIS * (abs(low) or 1.0)
        self._high_back = self.high if high is None else high - HYSTERESIS * (abs(high) or 1.0)
        self._words = {-1: f"below {self.low:g} {unit}".strip(), 1: f"above {self.high:g} {unit}".strip()}
        self.side = 0  # -1 below low, 1 above high

    def look(self, t_s: float, value: float) -> list[Event]:
        if math.isnan(value):
            return []
        side = -1 if value < self.low else 1 if value > self.high else 0
        if side == 0 and (
            (self.side == 1 and value > self._high_back) or (self.side == -1 and value < self._low_back)
        ):
            return []
        if side == self.side:
            return []
        sides = ((self.side, False), (side, True))
        self.side = side
        return [Event(t_s, "caution", self.label, self._words[s], on) for s, on in sides if s]


class _Limits:
    """Watches the channels of one field that have a threshold."""

    def __init__(self, field: Field, limits: Sequence[_Limit]) -> None:
        self.name = field.name
        self._limits = limits
        self._newest: Values = ()

    def carry_over(self, old: _Limits) -> None:
        """Take over the state of `old`, label by label."""
        sides = {limit.label: limit.side for limit in old._limits}
        for limit in self._limits:
            limit.side = sides.get(limit.label, 0)

    def look(self, t_s: float, values: Values) -> list[Event]:
        if values is self._newest or values == self._newest:  # temperatures hardly change
            return []
        self._newest = values
        events: list[Event] = []
        for limit in self._limits:
            value = values[limit.index]
            if value is not None and (limit.side or not limit.low <= value <= limit.high):
                events += limit.look(t_s, value)
        return events


class EventWatch:
    """Compares each sample with the one before and makes events. Not thread-safe: use one thread or a
    lock."""

    def __init__(self, schema: Schema) -> None:
        """A bit whose severity is `state` makes no event. Limits are those of the schema's mapping."""
        self._watched = _list_watched(schema)
        self._last_s: float | None = None
        self._t_s = 0.0
        self._trouble = ""
        self.silent = False

    def change_schema(self, schema: Schema) -> None:
        """Switch to other channels. Known channels keep their state; new ones start without a fault."""
        bits = {watched.name: watched for watched in self._watched if isinstance(watched, _Bits)}
        limits = {watched.name: watched for watched in self._watched if isinstance(watched, _Limits)}
        self._watched = _list_watched(schema)
        for watched in self._watched:
            if isinstance(watched, _Limits):
                if watched.name in limits:
                    watched.carry_over(limits[watched.name])
            elif watched.name in bits:
                watched.carry_over(bits[watched.name])

    @property
    def started(self) -> bool:
        """Whether a sample has been checked yet."""
        return self._last_s is not None

    def check_sample(
        self, t_s: float, values_of: Callable[[str], Values | None], now_s: float
    ) -> list[Event]:
        """Return the events that a sample causes. `values_of` returns a field's values in the order of its
        labels, or None when the sample lacks the field. It is called only for fields that can cause one."""
        events: list[Event] = []
        self._last_s, self._t_s = now_s, t_s
        if self.silent:
            self.silent = False
            events.append(Event(t_s, "caution", "source", "silent", False))
        for watched in self._watched:
            values = values_of(watched.name)
            if values is not None:
                events += watched.look(t_s, values)
        return events

    def check_time(self, now_s: float, trouble: str = "") -> list[Event]:
        """Return the events for a source that has fallen silent, and for `trouble` that began or ended (see
        base.Troubled). Call it between samples."""
        events: list[Event] = []
        if trouble != self._trouble:
            texts = ((self._trouble, False), (trouble, True))
            events = [Event(self._t_s, "fault", "source", text, on) for text, on in texts if text]
            self._trouble = trouble
        if self.silent or self._last_s is None or now_s - self._last_s < SILENT_S:
            return events
        self.silent = True
        return [*events, Event(self._t_s, "caution", "source", "silent", True)]


def _list_watched(schema: Schema) -> list[_Bits | _Limits]:
    watched: list[_Bits | _Limits] = []
    for field in schema.fields:
        levels = [schema.mapping.find_severity(field.name, bit) for bit in field.bits]
        named_bits = [(1 << i, field.bits[i], level) for i, level in enumerate(levels) if level != "state"]
        if named_bits:
            watched.append(_Bits(field, named_bits))
        thresholds = [schema.mapping.find_threshold(field.name, label) for label in field.labels]
        limits = [
            _Limit(i, label, field.unit, threshold)
            for i, (label, threshold) in enumerate(zip(field.labels, thresholds, strict=True))
            if threshold is not None
        ]
        if limits:
            watched.append(_Limits(field, limits))
    return watched
