"""Counts the problems with published values, and logs each kind once."""

from __future__ import annotations

import logging
import threading

from posecast_edge.kit import make_visible

log = logging.getLogger("posecast_edge.robot")

PROBLEMS_MAX = 50  # kinds that are counted separately
MORE = "further kinds of problems are only counted"


class ProblemList:
    """May be used from any thread. `add` never writes; `log_new` writes the log, in a thread that may
    block."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[str, int] = {}
        self._new: list[str] = []
        self._firsts: dict[str, str] = {}  # the text of a part's first problem

    def add(self, text: str, part: str = "") -> None:
        """Count one more problem of this kind. `text`: one line, the same for each problem of a kind. If it
        shows a value that changes, `part` is what stays the same, and the first text is kept."""
        text = make_visible(text)
        with self._lock:
            if part:
                text = self._firsts.setdefault(part, text)
            if text not in self._counts and len(self._counts) >= PROBLEMS_MAX:
                text = MORE
            if text not in self._counts:
                self._new.append(text)
            self._counts[text] = self._counts.get(text, 0) + 1

    def get_counts(self) -> dict[str, int]:
        """Text of each problem → how often it has occurred, the oldest first."""
        with self._lock:
            return dict(self._counts)

    def log_new(self) -> None:
        """Log the problems that have not been logged yet."""
        if not self._new:
            return
        with self._lock:
            new, self._new = self._new, []
        for text in new:
            log.warning("%s", text)
