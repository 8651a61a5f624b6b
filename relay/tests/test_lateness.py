"""How late one run's messages are."""

from __future__ import annotations

import pytest
from posecast_relay.core.robot import Lateness


def test_lateness_is_above_the_least_of_the_run() -> None:
    lateness = Lateness()
    at = [(0.0, 100.2), (1.0, 101.1), (2.0, 102.6), (3.0, 103.1)]  # stamp, arrival
    late = [lateness.record_arrival(stamp_s, now) for stamp_s, now in at]
    assert late == [pytest.approx(x, abs=1e-3) for x in (0.0, 0.0, 0.5, 0.0)]


def test_clocks_that_drift_apart_do_not_make_a_robot_late() -> None:
    lateness = Lateness()
    for hour in range(24):  # the edge's clock loses 80 ppm
        now = hour * 3600.0
        late = lateness.record_arrival(now * (1 - 80e-6), now)
    assert late < 0.01


def test_a_clock_that_stood_still_is_learned_anew_by_one_answer() -> None:
    lateness = Lateness()
    lateness.record_arrival(10.0, 110.0)
    assert not lateness.should_ask(110.0)
    assert lateness.record_arrival(10.03, 170.03) == pytest.approx(60.0, abs=0.01)  # asleep for a minute
    assert lateness.should_ask(170.03)
    lateness.record_answer(10.05, 0.02, 170.07)
    assert lateness.record_arrival(10.1, 170.1) == pytest.approx(0.0, abs=0.03)
    assert not lateness.should_ask(175.0)


def test_frames_that_are_late_stay_late_since_the_answer_is_late_as_well() -> None:
    lateness = Lateness()
    lateness.record_arrival(10.0, 110.0)
    assert lateness.record_arrival(10.03, 115.03) == pytest.approx(5.0, abs=0.01)  # a queue of five seconds
    assert lateness.should_ask(115.03)
    lateness.record_answer(15.1, 5.0, 120.1)  # it had to stand in the queue, too
    assert lateness.record_arrival(15.2, 120.2) == pytest.approx(5.0, abs=0.01)


def test_lateness_that_grows_without_a_step_raises_no_question() -> None:
    lateness = Lateness()
    for n in range(300):  # a full uplink
        lateness.record_arrival(n * 0.03, 100.0 + n * 0.04)
    assert lateness.seconds > 2.0
    assert not lateness.should_ask(120.0)


def test_questions_come_more_and_more_seldom_and_anew_after_a_quiet_minute() -> None:
    lateness = Lateness()
    lateness.record_arrival(0.0, 100.0)
    asked = []
    for n in range(2000):  # late for 200 s, and nobody answers
        now = 105.0 + n / 10
        lateness.record_arrival(n / 10, now)
        if lateness.should_ask(now):
            lateness.record_question(now)
            asked.append(now - 105.0)
    assert asked == [pytest.approx(x, abs=0.15) for x in (0, 1, 3, 7, 15, 31, 63, 95, 127, 159, 191)]
    lateness.record_arrival(400.0, 500.0)  # in time again
    lateness.record_arrival(400.1, 560.0)
    for now in (560.0, 561.1):
        assert lateness.should_ask(now)
        lateness.record_question(now)
        assert not lateness.should_ask(now + 0.9)


def test_a_message_with_a_stamp_from_the_far_end_of_the_clock_is_only_late_or_in_time() -> None:
    lateness = Lateness()
    for stamp_s in (0.0, 2**64 / 1e9, 1.0, 2**64 / 1e9):
        assert 0.0 <= lateness.record_arrival(stamp_s, 100.0) < float("inf")
