"""Finds the Python threads in which Zenoh runs callbacks, so that a program can wait for their end."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

NAME = "pyo3-closure"  # Zenoh starts a thread of this name for each declared callback


class CallbackThreads:
    """The threads of callbacks that were declared within `collect`. Each ends soon after its session is
    closed. If the interpreter ends first, the thread's return into Python aborts the process."""

    def __init__(self) -> None:
        self._threads: list[threading.Thread] = []

    @contextmanager
    def collect(self) -> Iterator[None]:
        """Remember the threads of the callbacks that are declared in this block."""
        before = set(threading.enumerate())
        try:
            yield
        finally:
            new = [t for t in threading.enumerate() if t not in before and NAME in t.name]
            self._threads = [t for t in self._threads if t.is_alive()] + new

    def join(self, until_s: float) -> None:
        """Wait until all have ended, at most until `until_s` (monotonic seconds)."""
        for thread in self._threads:
            thread.join(max(0.0, until_s - time.monotonic()))
