"""Runs: who is current, who is retired, who returns."""

from __future__ import annotations

from posecast_relay.core.robot import RETURN_AFTER_S, Runs
from posecast_wire import Stamp


def hear(runs: Runs, run_id: int, now: float) -> None:
    """A frame of the current run."""
    runs.record_arrival(Stamp(run_id, round(now * 1e9)), now)


def test_the_newest_run_wins_and_the_one_before_stays_retired() -> None:
    runs = Runs()
    runs.adopt(5, 0.0)
    runs.adopt(3, 10.0)  # a smaller number: runs have no order by value
    assert runs.current == 3
    assert runs.is_retired(5, 10.1)
    assert not runs.is_retired(3, 10.1)
    assert not runs.is_retired(99, 10.1)
    assert runs.adopted == 2


def test_a_retired_run_that_goes_on_is_a_conflict_for_a_while() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 10.0)
    hear(runs, 2, 10.4)
    assert runs.is_retired(1, 10.5)  # was still on its way
    assert not runs.is_in_conflict(10.5)
    hear(runs, 2, 11.9)
    assert runs.is_retired(1, 12.0)
    assert runs.is_in_conflict(12.0)
    assert runs.is_in_conflict(14.9)
    assert not runs.is_in_conflict(15.1)


def test_a_run_returns_when_the_newer_one_has_ended() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 10.0)
    hear(runs, 2, 20.0)
    assert runs.is_retired(1, 20.0 + RETURN_AFTER_S)
    assert not runs.is_retired(1, 20.1 + RETURN_AFTER_S)
    runs.adopt(1, 24.0)
    assert runs.current == 1
    assert runs.is_retired(2, 24.1)  # the newer one, should it go on: one of them, not both in turns
    hear(runs, 1, 40.0)
    assert runs.is_retired(2, 40.1)


def test_two_edges_of_one_name_that_both_send_do_not_take_turns() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 1.0)
    for n in range(1, 600):
        now = 1.0 + n / 10
        hear(runs, 2, now)
        assert runs.is_retired(1, now)
    assert runs.adopted == 2


def test_retired_runs_are_bounded() -> None:
    runs = Runs()
    for run_id in range(1, 200):
        runs.adopt(run_id, float(run_id))
    assert sum(runs.is_retired(run_id, 199.5) for run_id in range(1, 200)) == 64


def test_a_new_run_has_its_own_minimum() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.record_arrival(Stamp(1, 0), 0.0)
    runs.adopt(2, 50.0)
    assert runs.record_arrival(Stamp(2, 0), 50.0) == 0.0


def test_an_answer_of_another_run_says_nothing_of_this_ones_clock() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.record_arrival(Stamp(1, 0), 0.0)
    runs.record_answer(Stamp(2, 0), 0.0, 60.0)
    assert runs.record_arrival(Stamp(1, 10 * 10**9), 70.0) > 59.0
