from __future__ import annotations

from posecast_edge.sampler import CONFIRM_S, Due, Sampler
from posecast_wire.quantiser import Quantiser
from posecast_wire.schema import Schema, build_schema_text

SCHEMA = Schema.parse(
    build_schema_text("r", {"joint": ["A", "B"]}, [{"name": "pos", "labels": "joint", "scale": 0.001}])
)


def sampler() -> Sampler:
    return Sampler(Quantiser(SCHEMA, 0.3))


def test_nothing_without_a_sample() -> None:
    s = sampler()
    assert s.tick(0.0) is None
    s.force_key()
    assert s.tick(10.0) is None


def test_first_frame_is_a_key_and_only_the_newest_sample_counts() -> None:
    s = sampler()
    s.offer(1.0, [0.1, 0.2])
    s.offer(1.1, [0.3, 0.4])
    assert s.tick(0.0) == Due([300, 400], 1.1, True)
    assert s.tick(0.1) is None
    s.offer(1.2, [0.5, 0.4])
    assert s.tick(0.2) == Due([500, 400], 1.2, False)


def test_deduplication_compares_codes_and_never_time() -> None:
    s = sampler()
    sent = []
    for i in range(
        100
    ):  # ten seconds of an unchanged robot, flickering inside the deadband, its clock running
        s.offer(i * 0.1, [0.1 + 0.0007 * (i % 2), 0.2])
        due = s.tick(i * 0.1)
        if due:
            sent.append(i)
    assert sent == list(range(0, 100, 5))


def test_a_silent_source_sends_nothing() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2])
    assert s.tick(0.0)
    assert [s.tick(i * 0.1) for i in range(1, 100)] == [None] * 99


def test_an_unchanged_sample_is_confirmed_once_and_then_needs_a_new_one() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2])
    assert s.tick(0.0)
    s.offer(0.2, [0.1, 0.2])
    assert s.tick(CONFIRM_S - 0.01) is None
    assert s.tick(CONFIRM_S) == Due([100, 200], 0.2, False)
    assert s.tick(10.0) is None


def test_a_forced_key_goes_at_once_with_the_next_sample() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2])
    assert s.tick(0.0)
    s.force_key()
    assert s.tick(0.03) is None  # the source must deliver
    s.offer(0.04, [0.1, 0.2])
    assert s.tick(0.06) == Due([100, 200], 0.04, True)
    s.offer(0.05, [0.1, 0.2])
    assert s.tick(0.09) is None


def test_a_reading_that_goes_away_is_a_change() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2])
    first = s.tick(0.0)
    s.offer(0.1, [0.1, None])
    second = s.tick(0.1)
    assert first
    assert second
    assert first.codes[1] != second.codes[1]
