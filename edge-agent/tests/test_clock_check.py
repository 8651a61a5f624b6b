"""The robot's time that a program gives, beside the time that passes."""

from __future__ import annotations

import pytest
from posecast_edge.sources.published.checks import BACK, ClockCheck, ProblemList


def told(times: list[tuple[float, float]]) -> dict[str, int]:
    problems = ProblemList()
    check = ClockCheck(problems)
    for t_s, now_s in times:
        check.check_time(t_s, now_s)
    return problems.get_counts()


@pytest.mark.parametrize(
    ("pace", "said"),
    [
        (1.0, {}),
        (20.0, {}),  # a replay
        (0.0, {}),
        (1000.0, {"t runs 1,000 times too fast: are these milliseconds?": 3}),
        (1e6, {"t runs 1,000,000 times too fast: are these microseconds?": 3}),
        (1e9, {"t runs 1,000,000,000 times too fast: are these nanoseconds?": 3}),
    ],
)
def test_the_unit_shows_in_the_pace(pace: float, said: dict[str, int]) -> None:
    assert told([(5.0 + pace * tick / 8, 7.0 + tick / 8) for tick in range(25)]) == said


def test_a_clock_that_steps_back_is_told_and_counts_anew() -> None:
    assert told([(10.0, 0.0), (9.5, 0.1), (3.0, 0.2), (3.1, 0.3), (1000.0, 0.4), (1.0, 0.5)]) == {BACK: 2}
