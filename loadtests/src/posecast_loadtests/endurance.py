"""Judges a soak test by its series: what grows, what returns to its start, what stays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import sqrt
from statistics import median
from typing import NamedTuple

GROWTH_MB_PER_H = 1.0
RETURN_WITHIN = 5
HEAP_MB = 1.0
FULL_MINUTES = 30.0
LEAK_MB = 5.0  # growth by this much in one run is a leak, however short the run
POINTS_MAX = 400  # bounds the number of points, because all pairs are compared
_Z95 = 1.96

KEPT, BROKEN, NOT_SHOWN = "kept", "BROKEN", "not shown"


class Point(NamedTuple):
    """One reading of a series. `at_s`: since the start of the load."""

    at_s: float
    value: float


@dataclass(frozen=True)
class SoakResult:
    """One row of the table."""

    name: str
    figure: str
    limit: str
    verdict: str


class Slope(NamedTuple):
    """A slope per second, with its 95 % confidence interval."""

    middle: float
    low: float
    high: float


def slope(points: Sequence[Point]) -> Slope:
    """Compute the Theil-Sen slope: the median slope of all pairs, which ignores single peaks.

    The interval is by Sen (1968), doi:10.1080/01621459.1968.10480934. Raises ValueError for fewer than three
    points.
    """
    if len(points) < 3:
        raise ValueError(f"slope: needs three points, got {len(points)}")
    step = -(-len(points) // POINTS_MAX)
    kept = points[::step]
    slopes = sorted(
        (b.value - a.value) / (b.at_s - a.at_s) for a, b in combinations(kept, 2) if b.at_s > a.at_s
    )
    n, pairs = len(kept), len(slopes)
    spread = _Z95 * sqrt(n * (n - 1) * (2 * n + 5) / 18)
    low, high = round((pairs - spread) / 2), round((pairs + spread) / 2)
    return Slope(median(slopes), slopes[max(0, low)], slopes[min(pairs - 1, high)])


def judge_growth(name: str, points: Sequence[Point], minutes: float) -> SoakResult:
    """Judge growth of memory in MB. It fails if the slope is certainly above the limit.

    A run shorter than the full length can't distinguish a slow leak from warming up, so there only large
    growth fails.
    """
    limit = f"≤ {GROWTH_MB_PER_H:g} MB/h"
    if len(points) < 3:
        return SoakResult(name, f"{len(points)} readings", limit, NOT_SHOWN)
    per_h = Slope(*(value * 3600 for value in slope(points)))
    third = max(1, len(points) // 3)
    first, last = (median(p.value for p in part) for part in (points[:third], points[-third:]))
    figure = f"{per_h.middle:+.2f} MB/h ({per_h.low:+.2f} to {per_h.high:+.2f}), {first:.1f} → {last:.1f} MB"
    if per_h.middle <= GROWTH_MB_PER_H:
        verdict = KEPT
    elif last - first > LEAK_MB or (minutes >= FULL_MINUTES and per_h.low > GROWTH_MB_PER_H):
        verdict = BROKEN
    else:
        verdict = NOT_SHOWN
    return SoakResult(name, figure, limit, verdict)


def judge_return(name: str, before: float, after: float, within: int = RETURN_WITHIN) -> SoakResult:
    """Judge a count at rest, before and after the load."""
    verdict = KEPT if abs(after - before) <= within else BROKEN
    return SoakResult(name, f"{before:g} → {after:g}", f"back within {within}", verdict)


def judge_heap(name: str, points: Sequence[Point], minutes: float) -> SoakResult:
    """Judge the heap in MB after forced collections: the minimum of the first third against that of the last.

    Fresh garbage can appear in a single reading. A leak raises the minimum.
    """
    limit = f"differs by ≤ {HEAP_MB:g} MB"
    if len(points) < 2:
        return SoakResult(name, f"{len(points)} readings", limit, NOT_SHOWN)
    third = max(1, len(points) // 3)
    first, last = (min(part, key=lambda p: p.value) for part in (points[:third], points[-third:]))
    more_mb = last.value - first.value
    figure = f"least {first.value:.2f} → {last.value:.2f} MB ({more_mb:+.2f})"
    for at_s, value in (points[0], points[-1]):
        figure += f", minute {at_s / 60:.1f} {value:.2f}"
    if abs(more_mb) <= HEAP_MB:
        verdict = KEPT
    else:
        verdict = BROKEN if minutes >= FULL_MINUTES or more_mb > LEAK_MB else NOT_SHOWN
    return SoakResult(name, figure, limit, verdict)


def table(findings: Sequence[SoakResult]) -> str:
    """Format the results for the terminal."""
    lines = [(f.name, f.figure, f.limit, f.verdict) for f in findings]
    widths = [max(len(line[i]) for line in lines) for i in range(4)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )
