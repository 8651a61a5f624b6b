"""What reading costs: time of this process, peak of memory, and lines of Python run."""

from __future__ import annotations

import contextlib
import gc
import sys
import time
import tracemalloc
from collections.abc import Callable
from types import FrameType
from typing import Any, TypeVar

T = TypeVar("T")


def assert_no_faster_than_input(make: Callable[[int], T], read: Callable[[T], object], n: int) -> None:
    """Reading inputs of n, 4n and 16n takes time and memory in proportion, as far as a busy machine can tell.

    The quickest of seven counts, and what is refused counts like what is read. Quadratic work would be 256
    times as much for the largest.
    """
    small, middle, large = (make(size) for size in (n, 4 * n, 16 * n))
    of_small = _cpu_s(read, small)
    assert _cpu_s(read, middle) < 4 * 3 * of_small + 0.001
    assert _cpu_s(read, large) < 16 * 3 * of_small + 0.004
    assert _peak_bytes(read, large) < 16 * 2 * _peak_bytes(read, small) + 100_000


def lines_run(read: Callable[[T], object], given: T) -> int:
    """How many lines of Python reading takes, each turn of a loop counted: the same on any machine."""
    count = 0

    def trace(frame: FrameType, event: str, argument: Any) -> Any:
        nonlocal count
        count += event == "line"
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        _read(read, given)
    finally:
        sys.settrace(before)
    return count


def _read(read: Callable[[T], object], given: T) -> None:
    with contextlib.suppress(ValueError):  # SchemaError, MessageError and FrameError are such
        read(given)


def _cpu_s(read: Callable[[T], object], given: T) -> float:
    best = float("inf")
    gc.disable()  # it walks everything that pytest holds
    try:
        for _ in range(7):
            start = time.process_time()
            _read(read, given)
            best = min(best, time.process_time() - start)
    finally:
        gc.enable()
    return best


def _peak_bytes(read: Callable[[T], object], given: T) -> int:
    tracemalloc.start()
    try:
        _read(read, given)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
