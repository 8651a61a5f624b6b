"""What is kept of the past in memory, what goes first, and what is found."""

from __future__ import annotations

import hashlib
import tracemalloc

import pytest
from posecast_relay.core.policy import Audience
from posecast_relay.past.memory import MemoryPast
from posecast_relay.past.segment import KeptSegment, PastEvent, PastWord, SegmentName, TakeSpan

SCHEMA = "{}"
SCHEMA_HASH = hashlib.sha256(SCHEMA.encode()).digest()


def make_segment(
    robot: str = "demo", index: int = 0, take: int = 1, size: int = 1000, view: str = "public"
) -> KeptSegment:
    from_ms = 1_700_000_000_000 + 1000 * index
    return KeptSegment(
        name=SegmentName(robot, view, take, index),
        run=7,
        from_ms=from_ms,
        to_ms=from_ms + 1000,
        frames=30,
        first_seq=30 * index,
        last_seq=30 * index + 29,
        missing=0,
        schema=SCHEMA_HASH,
        model=None,
        data=bytes(size),
        sha256=hashlib.sha256(bytes(size)).digest(),
        events=(PastEvent(from_ms, f"event {index}"),),
        words=(PastWord(from_ms, "online"),),
        faults=0,
        audiences=frozenset({Audience.ANYONE}),
        schema_text=SCHEMA,
    )


def list_indices(past: MemoryPast, robot: str, view: str = "public") -> list[int]:
    return [segment.name.index for segment in past.list_segments(robot, view)]


def test_what_was_added_is_found() -> None:
    past = MemoryPast(1_000_000)
    told: list[KeptSegment] = []
    stop = past.on_added(told.append)
    segments = [make_segment(index=index) for index in range(3)]
    for segment in segments:
        past.add(segment, 0.0)
    stop()
    past.add(make_segment(index=0, take=2), 0.0)
    past.add(make_segment(index=0, view="lab"), 0.0)
    assert told == segments
    assert past.find(segments[1].name) is segments[1]
    assert past.find(SegmentName("demo", "public", 1, 3)) is None
    newest = past.find_newest("demo", "public")
    assert newest is not None
    assert newest.name == SegmentName("demo", "public", 2, 0)
    assert past.find_newest("demo", "other") is None
    at_ms = segments[1].from_ms
    assert past.list_segments("demo", "public", at_ms, at_ms + 1000) == [segments[1]]
    assert past.list_takes("demo", "public") == [TakeSpan(1, 0, 2), TakeSpan(2, 0, 0)]
    assert past.list_views("demo") == ["public", "lab"]
    assert past.find_schema_text("demo", "public", SCHEMA_HASH) == SCHEMA
    assert past.find_schema_text("demo", "other", SCHEMA_HASH) is None


def test_a_name_never_means_two_things() -> None:
    past = MemoryPast(1_000_000)
    past.add(make_segment(), 0.0)
    with pytest.raises(ValueError, match="segment 0000000000000001,0 of demo/public: added twice"):
        past.add(make_segment(), 1.0)
    assert len(past) == 1


def test_who_has_most_loses_its_oldest_first() -> None:
    cost = make_segment().cost_bytes
    past = MemoryPast(10 * cost + 100)
    for index in range(3):
        past.add(make_segment("small", index), 0.0)
    for index in range(20):
        past.add(make_segment("large", index), 0.0)
    assert list_indices(past, "small") == [0, 1, 2]
    assert list_indices(past, "large") == list(range(13, 20))
    for index in range(3, 10):
        past.add(make_segment("small", index), 0.0)
    assert len(list_indices(past, "small")) == len(list_indices(past, "large")) == 5
    assert past.bytes <= past.bytes_max
    assert past.crowded_out == 20
    assert past.added == 30


def test_what_is_old_goes_whatever_its_clock_told() -> None:
    past = MemoryPast(1_000_000)
    past.add(make_segment(index=9000), 0.0)  # by a wall clock that was set back then
    past.add(make_segment(index=0, take=2), 10.0)
    past.forget_older(lambda *_: 5.0, 10.0)
    assert list_indices(past, "demo") == [0]
    past.forget_older(lambda *_: 5.0, 15.5)
    assert len(past) == past.bytes == 0
    assert past.find_schema_text("demo", "public", SCHEMA_HASH) is None
    assert past.list_views("demo") == []


def test_each_robot_and_view_is_kept_as_long_as_it_may_be_asked_for() -> None:
    past = MemoryPast(1_000_000)
    for index in range(10):
        for robot, view in (("one", "public"), ("one", "lab"), ("two", "public"), ("gone", "public")):
            past.add(make_segment(robot, index, view=view), float(index))
    kept_s = {("one", "public"): 3.0, ("one", "lab"): 60.0, ("two", "public"): 6.0}
    past.forget_older(lambda robot, view: kept_s.get((robot, view), 0.0), 9.0)
    assert list_indices(past, "one") == [6, 7, 8, 9]
    assert list_indices(past, "one", "lab") == list(range(10))
    assert list_indices(past, "two") == list(range(3, 10))
    assert list_indices(past, "gone") == []
    past.drop_oldest("one")  # of its views the older one's
    assert list_indices(past, "one", "lab") == list(range(1, 10))
    past.forget_older(lambda *_: 0.0, 9.0)
    assert len(past) == past.bytes == 0


def test_the_bytes_counted_are_those_taken() -> None:
    past = MemoryPast(1 << 30)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for index in range(2000):
            past.add(make_segment(index=index, size=300), 0.0)
        taken = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert 0.7 * past.bytes < taken < past.bytes
