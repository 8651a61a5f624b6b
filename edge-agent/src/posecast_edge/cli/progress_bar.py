"""A progress bar on a terminal; prints nothing elsewhere."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import TextIO

WIDTH = 24
TICK_S = 0.25
NAME = 40


class Bar:
    """A progress bar, erased at the end: `with Bar(sys.stderr) as bar: bar.show_progress(3, 10,
    "arm.stl")`."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._shown = False

    def __enter__(self) -> Bar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            self._out.write("\r\x1b[K")
            self._out.flush()

    def show_progress(self, done: int, total: int, what: str) -> None:
        """Show that `done` of `total` steps are complete and `what` is being worked on."""
        if not self._out.isatty():
            return
        full = WIDTH * done // max(total, 1)
        name = "".join(c if c.isprintable() else "�" for c in what[-NAME:])
        self._out.write(f"\r\x1b[K[{'#' * full}{'.' * (WIDTH - full)}] {done}/{total} {name}")
        self._out.flush()
        self._shown = True


@contextmanager
def show_countdown(
    out: TextIO, duration_s: float, what: str, now_s: Callable[[], float] = time.monotonic
) -> Iterator[None]:
    """Show how much of `duration_s` is over, once a second has passed, until the block ends."""
    ended = threading.Event()
    begun_s = now_s()

    def tick(bar: Bar) -> None:
        while not ended.wait(TICK_S):
            passed_s = now_s() - begun_s
            if passed_s >= 1:
                bar.show_progress(min(int(passed_s), int(duration_s)), int(duration_s), what)

    with Bar(out) as bar:
        ticking = threading.Thread(target=tick, args=(bar,), name="countdown", daemon=True)
        ticking.start()
        try:
            yield
        finally:
            ended.set()
            ticking.join()
