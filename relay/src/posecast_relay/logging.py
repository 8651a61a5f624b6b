"""Logs to stderr: plain lines on a terminal, otherwise JSON lines for log collectors.

Strangers can cause log lines. So their number is limited: repeated lines are written a few times, then
counted, and at most LINES_PER_S lines a second are written. A summary line counts the others: `… and 1,234
more in 10 s`. Their length is limited, too, and invisible characters are escaped. Tracebacks appear only at
level debug. Other levels show what failed and where.
"""

from __future__ import annotations

import asyncio
import json
import logging
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from types import TracebackType
from typing import Any

from posecast_wire.checked import escape_unseen

log = logging.getLogger("posecast_relay")

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
    written: int = 0
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
        if window.written < OF_A_KIND and self._has_room(now_s):
            window.written += 1
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
    text = f"{window.first} … and {window.more:,} more in {passed_s:.0f} s"
    return logging.LogRecord(*window.of, text, None, None)


MEMBERS = (
    "conn",
    "robot",
    "code",
    "reason",
)  # besides ts, level and event; nothing else from a viewer
LINE_MAX = 1000  # characters of an event
NAME_MAX = 80  # characters of a name from outside
OURS = "posecast_"


def visible(text: str, most: int = NAME_MAX) -> str:
    """Return a text from outside as one line of at most `most` characters. Characters that are invisible or
    change the text direction are escaped, except where a script uses them.
    """
    escaped = escape_unseen(text if len(text) <= most else text[: most - 1] + "…")
    return escaped if len(escaped) <= most else escaped[: most - 1] + "…"


def describe_error(error: BaseException) -> str:
    """Describe an error in one line: its type, its message, and the last place in our code."""
    places = [(f.f_code.co_filename, line) for f, line in traceback.walk_tb(error.__traceback__)]
    ours = [place for place in places if OURS in place[0]]
    where = "".join(f" ({path.rpartition('/')[2]}:{line})" for path, line in (ours or places)[-1:])
    message = str(error)
    return visible(type(error).__name__ + (f": {message}" if message else ""), 300) + where


def _event(record: logging.LogRecord) -> str:
    """Return a record's message as one line."""
    text = record.getMessage()
    error = record.exc_info[1] if record.exc_info else None
    if error is not None:
        text = f"{text.rstrip()}: {describe_error(error)}"
    return visible(text, LINE_MAX)


def _shows_tracebacks() -> bool:
    return logging.getLogger().level <= logging.DEBUG


class JsonLines(logging.Formatter):
    """Formats records as `{"ts": …, "level": …, "event": …}` plus what is known of the connection."""

    def format(self, record: logging.LogRecord) -> str:
        """Format a record as one line."""
        doc: dict[str, object] = {
            "ts": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "event": _event(record),
        }
        for name in MEMBERS:
            if hasattr(record, name):
                value = getattr(record, name)
                doc[name] = visible(value) if isinstance(value, str) else value
        if record.exc_info and _shows_tracebacks():
            doc["exception"] = self.formatException(record.exc_info)
        return json.dumps(doc, ensure_ascii=False).encode(errors="backslashreplace").decode()


class _Plain(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        at = self.formatTime(record)
        known = " ".join(f"{m}={visible(str(getattr(record, m)))}" for m in MEMBERS if hasattr(record, m))
        line = f"{at} {record.levelname} {record.name}: {_event(record)} {known}".rstrip()
        if record.exc_info and _shows_tracebacks():
            line += "\n" + self.formatException(record.exc_info)
        return line


class _Stderr(logging.StreamHandler[Any]):
    """Writes to stderr. Limits repeated lines and counts the rest."""

    def __init__(self) -> None:
        super().__init__(sys.stderr)
        self._repeats = RepeatFilter(_event)
        self._timer: threading.Timer | None = None

    def handle(self, record: logging.LogRecord) -> bool:
        """Handle a record; may be called from any thread."""
        self.acquire()
        try:
            now_s = time.monotonic()
            self._sum_up(now_s)
            is_written = self._repeats.allow_record(record, now_s)
            if is_written:
                self.emit(record)
            elif self._timer is None:
                self._start_timer()
            return is_written
        finally:
            self.release()

    def _sum_up(self, now_s: float) -> None:
        for record in self._repeats.take_summaries(now_s):
            self.emit(record)

    def _start_timer(self) -> None:
        """Make sure that the summary is written even if no further line follows."""
        self._timer = threading.Timer(WINDOW_S, self._later)
        self._timer.daemon = True
        self._timer.start()

    def _later(self) -> None:
        self.acquire()
        try:
            self._timer = None
            self._sum_up(time.monotonic())
            if self._repeats.owes:
                self._start_timer()
        finally:
            self.release()


def start_logging(level: str) -> None:
    """Log to stderr at `level` and above, including errors in threads and library callbacks."""
    handler = _Stderr()
    handler.setFormatter(_Plain() if sys.stderr.isatty() else JsonLines())
    logging.basicConfig(level=level.upper(), handlers=[handler])
    logging.captureWarnings(True)

    def uncaught(kind: type[BaseException], error: BaseException | None, trace: TracebackType | None) -> None:
        if error is not None and isinstance(error, Exception):
            log.error("uncaught exception", exc_info=(kind, error, trace))
        elif not issubclass(kind, (KeyboardInterrupt, SystemExit)):
            sys.__excepthook__(kind, error or kind(), trace)

    sys.excepthook = uncaught
    threading.excepthook = lambda about: uncaught(about.exc_type, about.exc_value, about.exc_traceback)
    sys.unraisablehook = lambda about: uncaught(about.exc_type, about.exc_value, about.exc_traceback)


class LoopExceptionHandler:
    """The event loop's exception handler. It logs one line with what failed and where.

    A connection that was given up because it was too slow (to Redis) may fail again later. The same reason is
    then not logged twice in a row.
    """

    def __init__(self) -> None:
        self._reported = ""

    def __call__(self, _loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Handle an exception; asyncio calls this."""
        why = context.get("exception")
        transport = context.get("transport")
        # TLS answers late data into a transport that is already closed
        is_late = isinstance(why, RuntimeError) and transport is not None and transport.is_closing()
        if not is_late and not (isinstance(why, OSError) and "future" in context):
            log.error("%s", context.get("message") or "uncaught exception", exc_info=why)
        elif str(why) != self._reported:
            self._reported = str(why)
            log.warning("a connection timed out: %s", why)
