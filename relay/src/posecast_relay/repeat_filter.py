"""Limits the log: repeated lines are written a few times, then counted.

At most LINES_PER_S lines a second are written, whatever strangers do. A summary line counts the others:
`… and 1,234 more in 10 s`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

WINDOW_S = 10.0
OF_A_KIND = 10  # lines in a window; further ones are counted
LINES_PER_S = 10  # of all kinds
KINDS_MAX = 64  # beyond, all further ones are one kind

Kind = tuple[object, ...]
OTHERS: Kind = ("others",)


@dataclass
class _Window:
    since_s: float
    first: str  # as text: a record would keep the error's whole traceback in memory
    of: tuple[str, int, str, int]  # logger, level and place
    said: int = 0
    more: int = 0


class RepeatFilter:
    """Decides for each line whether it is written. Lines at level debug always pass."""

    def __init__(self, shown: Callable[[logging.LogRecord], str] = logging.LogRecord.getMessage) -> None:
        """`shown` returns a record's text as one line."""
        self._shown = shown
        self._kinds: dict[Kind, _Window] = {}
        self._second = float("-inf")
        self._lines = 0

    @property
    def owes(self) -> bool:
        """Whether lines were left out that no summary has counted yet."""
        return any(window.more for window in self._kinds.values())

    def allow_record(self, record: logging.LogRecord, now_s: float) -> bool:
        """Return whether to write this line; if not, count it. `now_s` is a clock in seconds."""
        if record.levelno <= logging.DEBUG:
            return True
        kind = _kind(record)
        window = self._kinds.get(kind)
        if window is None:
            if len(self._kinds) >= KINDS_MAX:
                kind = OTHERS
            of = (record.name, record.levelno, record.pathname, record.lineno)
            window = self._kinds.get(kind) or _Window(now_s, self._shown(record), of)
            self._kinds[kind] = window
        if window.said < OF_A_KIND and self._has_room(now_s):
            window.said += 1
            return True
        window.more += 1
        return False

    def take_summaries(self, now_s: float) -> list[logging.LogRecord]:
        """Close the windows that have passed. Return a summary for each one that left lines out."""
        found = []
        for kind, window in list(self._kinds.items()):
            if now_s - window.since_s < WINDOW_S and now_s >= window.since_s:
                continue
            if window.more:
                if not self._has_room(now_s):
                    continue
                found.append(_sum(window, now_s - window.since_s))
            del self._kinds[kind]
        return found

    def _has_room(self, now_s: float) -> bool:
        if not 0 <= now_s - self._second < 1:
            self._second, self._lines = now_s, 0
        self._lines += 1
        return self._lines <= LINES_PER_S


def _kind(record: logging.LogRecord) -> Kind:
    """Return a line's kind, by its place in the code, not its text: strangers choose the names in it."""
    error = record.exc_info[1] if record.exc_info else None
    trace = error.__traceback__ if error is not None else None
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = (trace.tb_frame.f_code.co_filename, trace.tb_lineno) if trace is not None else None
    return record.name, record.levelno, record.pathname, record.lineno, type(error), place


def _sum(window: _Window, passed_s: float) -> logging.LogRecord:
    said = f"{window.first} … and {window.more:,} more in {passed_s:.0f} s"
    return logging.LogRecord(*window.of, said, None, None)
