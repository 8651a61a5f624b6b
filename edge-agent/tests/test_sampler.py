from __future__ import annotations

from posecast_edge.pipeline.stream import CONFIRM_S, Due, Sampler
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
    s.offer(1.0, [0.1, 0.2], 1.0)
    s.offer(1.1, [0.3, 0.4], 1.1)
    assert s.tick(0.0) == Due([300, 400], 1.1, True, 1.1)
    assert s.tick(0.1) is None
    s.offer(1.2, [0.5, 0.4], 1.2)
    assert s.tick(0.2) == Due([500, 400], 1.2, False, 1.2)


def test_deduplication_compares_codes_and_never_time() -> None:
    s = sampler()
    sent = []
    for i in range(
        100
    ):  # ten seconds of an unchanged robot, flickering inside the deadband, its clock running
        s.offer(i * 0.1, [0.1 + 0.0007 * (i % 2), 0.2], i * 0.1)
        due = s.tick(i * 0.1)
        if due:
            sent.append(i)
    assert sent == list(range(0, 100, 5))


def test_a_silent_source_sends_nothing() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    assert s.tick(0.0)
    assert [s.tick(i * 0.1) for i in range(1, 100)] == [None] * 99


def test_an_unchanged_sample_is_confirmed_once_and_then_needs_a_new_one() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    assert s.tick(0.0)
    s.offer(0.2, [0.1, 0.2], 0.2)
    assert s.tick(CONFIRM_S - 0.01) is None
    assert s.tick(CONFIRM_S) == Due([100, 200], 0.2, False, 0.2)
    assert s.tick(10.0) is None


def test_a_forced_key_goes_at_once_with_the_next_sample() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    assert s.tick(0.0)
    s.force_key()
    assert s.tick(0.03) is None  # the source must deliver
    s.offer(0.04, [0.1, 0.2], 0.04)
    assert s.tick(0.06) == Due([100, 200], 0.04, True, 0.04)
    s.offer(0.05, [0.1, 0.2], 0.05)
    assert s.tick(0.09) is None


def test_a_reading_that_goes_away_is_a_change() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    first = s.tick(0.0)
    s.offer(0.1, [0.1, None], 0.1)
    second = s.tick(0.1)
    assert first
    assert second
    assert first.codes[1] != second.codes[1]


def test_a_sample_that_is_too_old_is_left_over_and_the_next_one_goes() -> None:
    s = sampler()
    s.offer(5.0, [0.1, 0.2], taken_s=10.0)
    assert s.tick(20.0, oldest_s=19.5) is None
    assert not s.fresh, "nobody waits for it any more"
    left = s.find_unsent(oldest_s=19.0)
    assert left is not None
    assert (left.t_s, left.values) == (5.0, [0.1, 0.2])
    assert s.find_unsent(oldest_s=9.0) is None, "it may still be sent"
    s.offer(5.5, [0.3, 0.2], taken_s=20.0)
    assert s.tick(20.0, oldest_s=19.5) == Due([300, 200], 5.5, True, 20.0)
    assert s.find_unsent(oldest_s=99.0) is None


def test_a_confirmation_is_as_old_as_its_sample() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    assert s.tick(0.0)
    s.offer(0.1, [0.1, 0.2], 0.1)  # the source's last word
    due = s.tick(CONFIRM_S)
    assert due is not None
    assert due.taken_s == 0.1


def test_what_can_not_be_sent_is_not_tried_again() -> None:
    s = sampler()
    s.offer(0.0, [0.1, 0.2], 0.0)
    s.skip_sample()
    assert not s.fresh
    s.offer(0.1, [0.1, 0.2], 0.1)
    assert s.tick(0.1) == Due([100, 200], 0.1, True, 0.1)
