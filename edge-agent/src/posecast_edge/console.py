"""The agent's stderr: lines for people, and one progress line that a terminal keeps in place."""

from __future__ import annotations

import logging
import sys
from typing import TextIO

TTY_EVERY_S = 0.5
PLAIN_EVERY_S = 5.0
CLEAR = "\r\x1b[K"


class Console(logging.Handler):
    """A log handler that shares the terminal with the progress line."""

    def __init__(self, out: TextIO | None = None) -> None:
        super().__init__()
        self._out = out or sys.stderr
        self._in_place = self._out.isatty()
        self._shown = ""
        self._next_s = 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """A line of its own, above the progress line."""
        clear = CLEAR if self._shown else ""
        self._write(f"{clear}posecast-edge: {_printable(record.getMessage())}\n{self._shown}")

    def due(self, now_s: float) -> bool:
        """Whether it is time for the next progress line (monotonic seconds)."""
        return now_s >= self._next_s

    def progress(self, text: str, now_s: float) -> None:
        """Show the progress line."""
        self._next_s = now_s + (TTY_EVERY_S if self._in_place else PLAIN_EVERY_S)
        if self._in_place:
            self._shown = text
            self._write(f"{CLEAR}{text}")
        else:
            self._write(f"{text}\n")

    def finish(self) -> None:
        """Leave the last progress line standing."""
        if self._shown:
            self._shown = ""
            self._write("\n")

    def _write(self, text: str) -> None:
        try:
            self._out.write(text)
            self._out.flush()
        except (OSError, ValueError):
            pass  # nobody reads stderr any more; the robot stays on air


def _printable(text: str) -> str:
    """Input quoted in a message must not move the cursor or start a line."""
    return "".join(c if c.isprintable() else "�" for c in text)
