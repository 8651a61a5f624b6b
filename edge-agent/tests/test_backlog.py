from __future__ import annotations

import pytest
from posecast_edge.pipeline.intake import HOLD_S, Backlog

ROBOT_S = 1000.0  # the robot's clock when ours is 0


def steady(backlog: Backlog, until_s: float, hz: float = 30.0) -> None:
    for i in range(int(until_s * hz)):
        assert not backlog.is_old(ROBOT_S + i / hz, i / hz)


def test_after_a_pause_what_was_sent_before_is_old_and_what_is_sent_now_is_not() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    said = [backlog.is_old(ROBOT_S + 2.0 + i / 30, 12.0 + i / 30000) for i in range(300)]
    old = said.index(False)
    assert all(said[:old])
    assert not any(said[old:])
    assert 295 <= old <= 299, "new is what is at most a tenth of a second late"


def test_a_robot_that_paused_is_back_at_once() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 12.0, 12.0)


@pytest.mark.parametrize("step_s", [-3600.0, 3600.0])
def test_a_clock_that_stepped_is_no_backlog(step_s: float) -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 2.0 + step_s, 2.03), "while samples come nothing is judged"
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(ROBOT_S + 12.0 + step_s, 12.0)


def test_a_clock_that_stood_still_as_well_is_believed_after_a_second() -> None:
    """A simulation that was paused goes on where it stood."""
    backlog = Backlog()
    steady(backlog, 2.0)
    said = [backlog.is_old(ROBOT_S + 2.0 + i / 30, 12.0 + i / 30) for i in range(60)]
    assert said == [True] * round(HOLD_S * 30) + [False] * (60 - round(HOLD_S * 30))


@pytest.mark.parametrize("pace", [0.3, 1.0, 3.0])
def test_a_slow_source_whatever_its_clock_is_never_held(pace: float) -> None:
    backlog = Backlog()
    assert not any(backlog.is_old(ROBOT_S + pace * i, float(i)) for i in range(100))


def test_a_sample_without_a_time_says_nothing() -> None:
    backlog = Backlog()
    steady(backlog, 2.0)
    assert not backlog.is_old(float("nan"), 2.0)
    assert backlog.is_old(ROBOT_S + 2.0, 12.0)
