"""Due or not."""

from __future__ import annotations

import itertools
import random

import pytest
from posecast_relay.core.room import RateTimer
from posecast_relay.core.stream import Cadence
from posecast_relay.core.viewer import grant_hz

from .sim import World


def due(source_hz: float, hz: float, frames: int, jitter_s: float = 0.0) -> list[int]:
    """Which frames of a steady source go out, when nothing but arrival jitters."""
    chance = random.Random(1)
    cadence, pace, found = Cadence(), RateTimer(hz), []
    for n in range(frames):
        stamp_s = 5.0 + n / source_hz
        cadence.record_stamp(stamp_s)
        now = 1000.0 + stamp_s + chance.uniform(0.0, jitter_s)
        if pace.is_due(1, stamp_s, cadence.interval_s, now):
            pace.record_sent(1, stamp_s, cadence.interval_s, now)
            found.append(n)
    return found


@pytest.mark.parametrize(("hz", "step"), [(30, 1), (15, 2), (10, 3), (5, 6), (3, 10), (1, 30)])
@pytest.mark.parametrize("jitter_s", [0.0, 0.025])
def test_whole_parts_of_the_rate_are_exact(hz: float, step: int, jitter_s: float) -> None:
    settled = [n for n in due(30, hz, 900, jitter_s) if n > 60]
    assert {b - a for a, b in itertools.pairwise(settled)} == {step}


@pytest.mark.parametrize("hz", [20, 12, 25, 7])
def test_other_rates_hold_on_average(hz: float) -> None:
    assert len(due(30, hz, 1200)) == pytest.approx(40 * hz, rel=0.03)


@pytest.mark.parametrize("source_hz", [29.9, 30.02, 30.2])
def test_a_source_a_little_off_loses_nothing(source_hz: float) -> None:
    assert due(source_hz, 30, 900) == list(range(900))
    settled = [n for n in due(source_hz, 10, 900) if n > 60]
    assert {b - a for a, b in itertools.pairwise(settled)} == {3}


def test_a_viewer_faster_than_the_source_gets_every_frame() -> None:
    assert due(10, 60, 100) == list(range(100))


def test_frames_held_up_and_let_go_at_once_are_not_all_passed_on() -> None:
    cadence, pace = Cadence(), RateTimer(10)
    for n in range(30):
        cadence.record_stamp(n / 30)
    passed = 0
    for n in range(30, 60):  # a second's worth within 3 ms
        stamp_s, now = n / 30, 100.0 + n * 1e-4
        cadence.record_stamp(stamp_s)
        if pace.is_due(1, stamp_s, cadence.interval_s, now):
            pace.record_sent(1, stamp_s, cadence.interval_s, now)
            passed += 1
    assert passed == 1


def test_a_new_run_is_due_at_once() -> None:
    pace = RateTimer(1)
    pace.record_sent(1, 1000.0, 0.03, 50.0)
    assert not pace.is_due(1, 1000.1, 0.03, 50.1)
    assert pace.is_due(2, 0.0, 0.03, 50.1)


def test_cadence_does_not_count_the_frames_an_unchanged_robot_skips() -> None:
    cadence, stamp_s = Cadence(), 0.0
    for n in range(64):
        stamp_s += 0.5 if n % 4 == 3 else 1 / 30
        cadence.record_stamp(stamp_s)
    assert cadence.interval_s == pytest.approx(1 / 30)


@pytest.mark.parametrize(
    ("asked_hz", "granted"),
    [
        (0, 0),
        (-5, 0),
        (1e-320, 0.1),
        (0.0999, 0.1),
        (0.123, 0.12),
        (1.26, 1.3),
        (9.99, 10),
        (29.97, 30),
        (7.5, 7.5),
        (1000, 60),
    ],
)
def test_rates_are_granted_in_steps(asked_hz: float, granted: float) -> None:
    assert grant_hz(asked_hz, 60.0) == granted


def test_no_rate_is_granted_beyond_what_the_policy_allows() -> None:
    assert grant_hz(60.0, 10.26) == 10.26
    assert grant_hz(0.001, 0.25) == 0.1


def test_however_many_rates_are_asked_for_there_are_few_groups() -> None:
    assert len({grant_hz(n / 1000, 60.0) for n in range(60_001)}) < 300


@pytest.mark.parametrize("hz", [1e-320, 5e-324, 7e-310, 1e-9, 0.1])
def test_the_slowest_rate_there_is_harms_nobody_elses(hz: float) -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    slow, slow_screen = world.join(hz)
    for n in range(90):
        world.say(slow, type="rate", hz=hz if n % 2 else 0) if n % 5 == 0 else None
        world.pass_time(1 / 30)
        world.publish(edge)
    assert [frame.seq for frame in screen.states[1:]] == list(range(1, 91))
    assert slow_screen.ended is None


def test_the_rate_is_that_of_the_frames_and_not_of_the_source() -> None:
    """A source of 50 Hz, of which the agent takes the newest sample 30 times a second."""
    cadence = Cadence()
    assert cadence.hz == 0
    for n in range(3000):
        cadence.record_stamp(int(n / 30 * 50) / 50)
        if n > 32:
            assert cadence.hz == pytest.approx(30, rel=0.06)
