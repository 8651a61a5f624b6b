"""What a parser's work costs, measured so that a busy machine can't spoil it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

SPAN = 16  # from the smallest input to the largest


def cost(work: Callable[[], object]) -> int:
    """How many lines of Python run, and how many calls into C are made."""
    steps = 0

    def count(_frame: FrameType, _event: str, _arg: object) -> Any:
        nonlocal steps
        steps += 1
        return count

    def count_call(_frame: FrameType, _event: str, _arg: object) -> None:
        nonlocal steps
        steps += 1

    trace, profile = sys.gettrace(), sys.getprofile()
    sys.settrace(count)
    sys.setprofile(count_call)
    try:
        work()
    finally:
        sys.setprofile(profile)
        sys.settrace(trace)
    return steps


def best_s(work: Callable[[], object], runs: int = 5) -> float:
    """The least of several runs, in seconds of this process: what C does is not counted in steps."""
    times = []
    for _ in range(runs):
        began_s = time.process_time()
        work()
        times.append(time.process_time() - began_s)
    return min(times)


def grows_linearly(steps: Callable[[int], int], n: int) -> bool:
    """Whether n, 4n and 16n take steps in proportion, within a quarter and a constant."""
    small, middle, large = (steps(n * k) for k in (1, 4, SPAN))
    return middle <= 4 * small * 1.25 + 500 and large <= SPAN * small * 1.25 + 500
