from __future__ import annotations

import math

from posecast_edge.pipeline.events import PER_SECOND, Event, EventLimit, EventWatch
from posecast_wire.schema import Schema, build_schema_text

SCHEMA = Schema.parse(
    build_schema_text(
        "r",
        {"joint": ["A", "B"], "ftf": ["RF.fz"]},
        [
            {"name": "ftf", "labels": "ftf", "unit": "N"},
            {"name": "flags", "labels": "joint", "bits": ["homed", "jam", "hot"]},
        ],
        {
            "severity": {"flags": {"homed": "state", "hot": "caution"}},
            "thresholds": {"ftf": {"RF.fz": {"low": -30, "high": 500}}},
        },
    )
)


def sample(
    watch: EventWatch, t: float, fz: float | None, a: int | None, b: int | None, now_s: float | None = None
) -> list[Event]:
    values: dict[str, list[float | None]] = {"ftf": [fz], "flags": [a, b]}
    return watch.check_sample(t, values.__getitem__, t if now_s is None else now_s)


def test_every_rise_and_fall_of_a_fault_bit_and_no_state_bit() -> None:
    watch = EventWatch(SCHEMA)
    assert sample(watch, 0.0, 0.0, 1, 0) == []  # homed is a state
    assert sample(watch, 0.1, 0.0, 3, 4) == [
        Event(0.1, "fault", "A", "jam", True),
        Event(0.1, "caution", "B", "hot", True),
    ]
    assert sample(watch, 0.2, 0.0, 3, 4) == []
    assert sample(watch, 0.3, 0.0, 0, 6) == [
        Event(0.3, "fault", "A", "jam", False),
        Event(0.3, "fault", "B", "jam", True),
    ]


def test_a_fault_that_is_there_from_the_start_is_told() -> None:
    assert sample(EventWatch(SCHEMA), 0.0, None, 2, 0) == [Event(0.0, "fault", "A", "jam", True)]


def test_no_reading_changes_nothing() -> None:
    watch = EventWatch(SCHEMA)
    sample(watch, 0.0, 600.0, 2, 0)
    assert sample(watch, 0.1, None, None, None) == []
    assert sample(watch, 0.2, math.nan, 2, 0) == []
    assert sample(watch, 0.3, 600.0, 0, 0) == [Event(0.3, "fault", "A", "jam", False)]


def test_a_limit_has_two_sides_and_hysteresis() -> None:
    watch = EventWatch(SCHEMA)
    told = []
    for i, fz in enumerate([0, 499, 501, 499, 501, 476, 474, -29, -31, -29, 510, 0]):
        told += [(fz, e.text, e.on) for e in sample(watch, float(i), float(fz), 0, 0)]
    assert told == [
        (501, "above 500 N", True),
        (474, "above 500 N", False),
        (-31, "below -30 N", True),
        (510, "below -30 N", False),
        (510, "above 500 N", True),
        (0, "above 500 N", False),
    ]


def test_source_silent_and_back() -> None:
    watch = EventWatch(SCHEMA)
    assert watch.check_time(100.0) == []  # never delivered: nothing to miss
    sample(watch, 7.0, 0.0, 0, 0, 100.0)
    assert watch.check_time(101.4) == []
    assert watch.check_time(101.5) == [Event(7.0, "caution", "source", "silent", True)]
    assert watch.silent
    assert watch.check_time(102.0) == []
    assert sample(watch, 9.0, 0.0, 0, 0, 103.0) == [Event(9.0, "caution", "source", "silent", False)]
    assert not watch.silent


def test_a_source_tells_its_trouble() -> None:
    watch = EventWatch(SCHEMA)
    told = [Event(0.0, "fault", "source", "samples are too large", True)]
    assert watch.check_time(100.0, "samples are too large") == told  # also before the first sample
    assert watch.check_time(100.1, "samples are too large") == []
    sample(watch, 7.0, 0.0, 0, 0, 100.2)
    assert watch.check_time(100.3) == [Event(7.0, "fault", "source", "samples are too large", False)]


def test_at_most_twenty_a_second_then_one_that_counts() -> None:
    limit = EventLimit()
    flood = [Event(float(i), "fault" if i == 30 else "info", "A", "x", True) for i in range(50)]
    out = limit.admit(flood[:15], 0.0) + limit.admit(flood[15:], 0.5)
    assert out == flood[:PER_SECOND]
    assert limit.admit([], 0.9) == []
    assert limit.admit([], 1.0) == [Event(49.0, "fault", "events", "30 more", True)]
    assert limit.admit([], 2.5) == []
    assert limit.admit(flood[:1], 2.6) == flood[:1]


def test_a_storm_stays_bounded() -> None:
    limit = EventLimit()
    watch = EventWatch(SCHEMA)
    out = []
    for i in range(2000):  # ten seconds at 200 Hz, all bits toggling
        now = i / 200
        out += limit.admit(sample(watch, now, 0.0, 6 * (i % 2), 6 * (i % 2)), now)
    assert len(out) <= 10 * PER_SECOND
    assert any(e.source == "events" for e in out)
