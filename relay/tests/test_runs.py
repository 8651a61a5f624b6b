"""Runs: who is current, who is retired, how late."""

from __future__ import annotations

import pytest
from posecast_relay.core.runs import Runs
from posecast_wire import Stamp


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
    assert runs.is_retired(1, 10.5)  # was still on its way
    assert not runs.conflict(10.5)
    assert runs.is_retired(1, 12.0)
    assert runs.conflict(12.0)
    assert runs.conflict(14.9)
    assert not runs.conflict(15.1)


def test_retired_runs_are_bounded() -> None:
    runs = Runs()
    for run_id in range(1, 200):
        runs.adopt(run_id, float(run_id))
    assert sum(runs.is_retired(run_id, 300.0) for run_id in range(1, 200)) == 64


def test_lateness_is_above_the_least_of_the_run() -> None:
    runs = Runs()
    runs.adopt(1, 100.0)
    at = [(0.0, 100.2), (1.0, 101.1), (2.0, 102.6), (3.0, 103.1)]  # stamp, arrival
    late = [runs.arrived(Stamp(1, round(stamp * 1e9)), now) for stamp, now in at]
    assert late == [pytest.approx(x, abs=1e-3) for x in (0.0, 0.0, 0.5, 0.0)]


def test_a_new_run_has_its_own_minimum() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.arrived(Stamp(1, 0), 0.0)
    runs.adopt(2, 50.0)
    assert runs.arrived(Stamp(2, 0), 50.0) == 0.0


def test_clocks_that_drift_apart_do_not_make_a_robot_late() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    for hour in range(24):  # the edge's clock loses 80 ppm
        now = hour * 3600.0
        late = runs.arrived(Stamp(1, round(now * (1 - 80e-6) * 1e9)), now)
    assert late < 0.01
