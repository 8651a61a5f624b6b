"""What a parser's work costs, measured so that a busy machine can't spoil it."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

Work = Callable[[], object]
SPAN = 16  # from the smallest input to the largest
SLACK = 3  # sorting and caches; what grows with the square takes 16 times as much
SECONDS = 0.01  # whatever the input
TRIES = 8  # one of them is calm


def cost(work: Work) -> int:
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


def grows_linearly(steps: Callable[[int], int], n: int) -> bool:
    """Whether n and 16n take steps in proportion, within a quarter and a constant."""
    return steps(n * SPAN) <= SPAN * steps(n) * 1.25 + 500


def took_s(work: Work) -> float:
    """Seconds of this thread: what C does is not counted in steps. Without the garbage collector, which looks
    at what other tests have left."""
    gc.disable()
    try:
        began_s = time.thread_time()
        work()
        return time.thread_time() - began_s
    finally:
        gc.enable()


def assert_time_in_proportion(work_of: Callable[[int], Work], n: int) -> None:
    """16n take no longer than n in proportion. The best of some runs of n is taken for it; of the others one
    that is fast enough will do."""
    small = work_of(n)
    small()  # so that what is made once is there
    small_s = min(took_s(small) for _ in range(2))
    large, enough_s = work_of(n * SPAN), SPAN * SLACK * small_s + SECONDS
    runs_s: list[float] = []
    while not any(s < enough_s for s in runs_s):
        assert len(runs_s) < TRIES, f"{small_s:.4f} s for {n}, {min(runs_s):.4f} s for {n * SPAN}"
        runs_s.append(took_s(large))
