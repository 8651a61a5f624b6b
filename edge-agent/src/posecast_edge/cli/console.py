"""The agent's stderr: log lines, and one progress line that a terminal updates in place.

At most LINES_MAX lines are written a second. WAITING_MAX others wait for the next seconds, and one line
counts the rest. Writing never blocks: output that does not fit into the terminal or pipe is dropped and
counted.
"""

from __future__ import annotations

import logging
import select
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO

from posecast_wire.command_line.color import paint

from posecast_edge.kit import make_visible

TTY_EVERY_S = 0.5
PLAIN_EVERY_S = 5.0
LINES_MAX = 8  # a second; an error, which ends the agent, is always written
WAITING_MAX = 100  # lines; each names something else that is wrong
OURS = "posecast_edge"  # loggers
CLEAR = "\r\x1b[K"
STYLES = ((logging.ERROR, "red"), (logging.WARNING, "yellow"))  # of a line's prefix, with colours on


class Console(logging.Handler):
    """A log handler that shares the terminal with the progress line."""

    def __init__(
        self,
        out: TextIO | None = None,
        now_s: Callable[[], float] = time.monotonic,
        program: str = "posecast-edge",
    ) -> None:
        super().__init__()
        self._program = program
        self._now_s = now_s
        self._second_s = float("-inf")
        self._lines = 0  # since then
        self._left_out = 0
        self._waiting: deque[tuple[str, int]] = deque()  # lines and their levels
        self._out = out or sys.stderr
        self._in_place = self._out.isatty()
        self._shown = ""
        self._next_s = 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """Write a log record on its own line, above the progress line."""
        self._begin_second(self._now_s())
        ours = record.name.partition(".")[0] == OURS
        text = record.getMessage() if ours else _of_library(record)
        if ours and record.levelno >= logging.ERROR:
            self._write_waiting(self._lines + WAITING_MAX)
        elif self._lines >= LINES_MAX or self._waiting:
            if len(self._waiting) < WAITING_MAX:
                self._waiting.append((make_visible(text), record.levelno))
            else:
                self._left_out += 1
            return
        self._lines += 1
        self._line(text, record.levelno)

    def _begin_second(self, now_s: float) -> None:
        if now_s - self._second_s < 1.0:
            return
        self.acquire()  # the agent's clock calls this too
        try:
            self._second_s, self._lines = now_s, 0
            if self._left_out and self._has_room():
                left_out, self._left_out = self._left_out, 0
                self._lines = 1
                self._line(f"{left_out} more lines dropped")
            self._write_waiting(LINES_MAX)
        finally:
            self.release()

    def _write_waiting(self, most: int) -> None:
        while self._waiting and self._lines < most:
            self._lines += 1
            self._line(*self._waiting.popleft())

    def close(self) -> None:
        """Write what waits: the program ends."""
        self._write_waiting(self._lines + WAITING_MAX)
        super().close()

    def _line(self, text: str, level: int = logging.INFO) -> None:
        if not self._has_room():
            self._left_out += 1
            return
        clear = CLEAR if self._shown else ""
        head = f"{self._program}:"
        for least, style in STYLES:
            if level >= least:
                head = paint(head, style, self._out)
                break
        self._write(f"{clear}{head} {make_visible(text)}\n{self._shown}")

    def is_due(self, now_s: float) -> bool:
        """Whether it is time for the next progress line (monotonic seconds). Call it often: it also writes
        lines that wait."""
        self._begin_second(self._now_s())
        return now_s >= self._next_s

    def show_progress(self, text: str, now_s: float) -> None:
        """Show the progress line."""
        self._begin_second(self._now_s())
        text = make_visible(text)
        self._next_s = now_s + (TTY_EVERY_S if self._in_place else PLAIN_EVERY_S)
        if not self._has_room():
            return
        if self._in_place:
            self._shown = text
            self._write(f"{CLEAR}{text}")
        else:
            self._write(f"{text}\n")

    def finish(self) -> None:
        """Leave the last progress line on the screen and end it."""
        if self._shown and self._has_room():
            self._shown = ""
            self._write("\n")

    def _has_room(self) -> bool:
        """Whether a line can be written without blocking. Not so for a full pipe or a stopped terminal."""
        try:
            return bool(select.select([], [self._out], [], 0)[1])
        except (OSError, ValueError, TypeError):  # not a pipe or terminal, so it can't be full
            return True

    def _write(self, text: str) -> None:
        try:
            self._out.write(text)
            self._out.flush()
        except (OSError, ValueError):
            pass  # stderr is closed; the robot stays on air


def _of_library(record: logging.LogRecord) -> str:
    """In one line, without the traceback."""
    try:
        text = f"{record.name}: {record.getMessage()}"
    except Exception:  # its format doesn't match its arguments
        text = f"{record.name}: {record.msg}"
    error = record.exc_info[1] if record.exc_info else None
    return text if error is None else f"{text}: {type(error).__name__}: {error}"
