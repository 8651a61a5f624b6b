"""The soak's verdicts on series made up here."""

from __future__ import annotations

import random

import pytest
from posecast_loadtests.endurance import (
    BROKEN,
    KEPT,
    NOT_SHOWN,
    Point,
    judge_growth,
    judge_heap,
    judge_return,
    slope,
    table,
)


def series(mb_per_h: float, noise_mb: float = 0.0, minutes: float = 25, start_mb: float = 60) -> list[Point]:
    """One reading every 5 s."""
    source = random.Random(7)
    times = range(0, round(minutes * 60), 5)
    return [Point(t, start_mb + mb_per_h * t / 3600 + source.gauss(0, noise_mb)) for t in times]


def test_the_slope_of_a_line_is_its_slope() -> None:
    found = slope(series(3.6))
    assert found.middle == pytest.approx(3.6 / 3600)
    assert found.low == pytest.approx(found.high)


def test_a_few_peaks_do_not_move_it() -> None:
    points = [Point(p.at_s, p.value + (50 if i % 20 == 0 else 0)) for i, p in enumerate(series(0.0))]
    assert abs(slope(points).middle) * 3600 < 0.01


def test_the_interval_holds_the_slope_and_shrinks_with_time() -> None:
    short, long = slope(series(2.0, 0.5, minutes=5)), slope(series(2.0, 0.5, minutes=100))
    assert long.low <= 2.0 / 3600 <= long.high
    assert long.high - long.low < (short.high - short.low) / 3


def test_two_points_have_no_slope() -> None:
    with pytest.raises(ValueError, match="needs three points, got 2"):
        slope([Point(0, 1), Point(1, 2)])


@pytest.mark.parametrize(
    ("mb_per_h", "noise_mb", "minutes", "verdict"),
    [
        (0.0, 0.3, 30.0, KEPT),
        (-4.0, 0.3, 30.0, KEPT),
        (12.0, 0.3, 30.0, BROKEN),
        (1.2, 2.0, 30.0, NOT_SHOWN),  # steeper, but it can't be told from the noise
        (12.0, 0.3, 10.0, NOT_SHOWN),  # 2 MB in ten minutes may be warming up
        (60.0, 0.3, 10.0, BROKEN),  # 10 MB are none
    ],
)
def test_growth(mb_per_h: float, noise_mb: float, minutes: float, verdict: str) -> None:
    points = series(mb_per_h, noise_mb, minutes)
    assert judge_growth("RSS", points, minutes).verdict == verdict


def test_growth_without_readings_is_not_shown() -> None:
    assert judge_growth("RSS", [], 30.0).verdict == NOT_SHOWN


def test_what_was_opened_must_be_closed() -> None:
    assert judge_return("descriptors", 30, 35).verdict == KEPT
    assert judge_return("descriptors", 30, 36).verdict == BROKEN
    assert judge_return("descriptors", 30, 24).verdict == BROKEN


def test_heap() -> None:
    def heap(first_mb: float, last_mb: float, minutes: float) -> str:
        points = [Point(300, first_mb), Point(900, 99.0), Point(1800, last_mb)]
        return judge_heap("heap", points, minutes).verdict

    assert heap(10.0, 10.9, 30) == KEPT
    assert heap(10.0, 11.5, 30) == BROKEN
    assert heap(10.0, 8.5, 30) == BROKEN  # it differs: the first was not warm, and says nothing
    assert heap(10.0, 11.5, 10) == NOT_SHOWN
    assert heap(10.0, 16.0, 10) == BROKEN
    swinging = [Point(300 + 30 * i, 13.0 + 5.3 * (i % 3)) for i in range(51)]  # resolutions come and go
    assert judge_heap("heap", swinging, 30).verdict == KEPT
    leaking = [Point(at_s, mb + 2 * at_s / 1800) for at_s, mb in swinging]
    assert judge_heap("heap", leaking, 30).verdict == BROKEN
    assert judge_heap("heap", [Point(300, 10.0)], 30).verdict == NOT_SHOWN


def test_the_table_names_figure_limit_and_verdict() -> None:
    line = table([judge_return("relay descriptors", 30, 31)])
    assert line == "relay descriptors  30 → 31  back within 5  kept"
