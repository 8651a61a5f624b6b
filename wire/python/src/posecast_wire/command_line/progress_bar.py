"""Shows the progress of a command on a terminal, if it takes more than a second."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import TracebackType
from typing import TextIO

WIDTH = 24
AFTER_S = 1.0
TICK_S = 0.25
COLUMNS = 79  # a wrapped line can't be erased
ERASE = "\r\x1b[K"


class ProgressBar:
    """A line that is redrawn every TICK_S after the first AFTER_S, and erased when the context ends. It
    writes nothing if `out` is not a terminal.

    `with ProgressBar(sys.stderr) as bar: bar.show_progress(3, 10, "arm.stl")`.
    """

    def __init__(self, out: TextIO, now_s: Callable[[], float] = time.monotonic) -> None:
        self._out, self._now_s = out, now_s
        self._draw: Callable[[float], str] = lambda _: ""
        self._ended = threading.Event()
        self._ticking = threading.Thread(target=self._tick, name="progress bar", daemon=True)

    def show_progress(self, done: int, total: int, what: str) -> None:
        """Show that `done` of `total` steps are complete, and what is in progress."""
        self._draw = lambda _: _draw_bar(done, total, what)

    def show_text(self, text: str) -> None:
        """Show progress as text if the total is unknown."""
        self._draw = lambda _: text

    def show_countdown(self, duration_s: float, what: str) -> None:
        """Show how much of `duration_s` has passed."""
        whole_s = int(duration_s)
        self._draw = lambda passed_s: _draw_bar(min(int(passed_s), whole_s), whole_s, what)

    def __enter__(self) -> ProgressBar:
        if self._out.isatty():
            self._ticking.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        if self._ticking.ident is not None:
            self._ticking.join()

    def _tick(self) -> None:
        begun_s, shown = self._now_s(), ""
        with suppress(OSError, ValueError):  # the terminal may be gone
            while not self._ended.wait(TICK_S):
                passed_s = self._now_s() - begun_s
                line = "".join(c if c.isprintable() else "�" for c in self._draw(passed_s)[:COLUMNS])
                if passed_s >= AFTER_S and line != shown:
                    shown = line
                    self._write(ERASE + line)
            if shown:
                self._write(ERASE)

    def _write(self, text: str) -> None:
        self._out.write(text)
        self._out.flush()


@contextmanager
def show_countdown(
    out: TextIO, duration_s: float, what: str, now_s: Callable[[], float] = time.monotonic
) -> Iterator[None]:
    """Show how much of `duration_s` has passed, until the block ends."""
    with ProgressBar(out, now_s) as bar:
        bar.show_countdown(duration_s, what)
        yield


def _draw_bar(done: int, total: int, what: str) -> str:
    full = WIDTH * done // max(total, 1)
    bar = f"[{'#' * full}{'.' * (WIDTH - full)}] {done:,}/{total:,} "
    left = COLUMNS - len(bar)
    return bar + (what if len(what) <= left else f"…{what[1 - left :]}")  # for a path, its end
