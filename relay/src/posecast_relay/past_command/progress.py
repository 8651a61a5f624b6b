"""Shows how far a command has come: on a terminal, when it takes more than a second."""

from __future__ import annotations

import sys
import time
from types import TracebackType

AFTER_S = 1.0
EVERY_S = 0.2


class CommandProgress:
    """A line on stderr that is overwritten, and erased when the context ends; only on a terminal."""

    def __init__(self) -> None:
        self._shows = sys.stderr.isatty()
        self._next_s = time.monotonic() + AFTER_S
        self._shown = False

    def show(self, text: str) -> None:
        """Show how far it has come, unless the last line is newer than EVERY_S."""
        now_s = time.monotonic()
        if self._shows and now_s >= self._next_s:
            self._next_s, self._shown = now_s + EVERY_S, True
            sys.stderr.write(f"\r\x1b[K{text}")
            sys.stderr.flush()

    def __enter__(self) -> CommandProgress:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
