"""What a program writes to: its standard streams, and colours and errors on a terminal."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from typing import TextIO

STYLES = {"bold": "1", "red": "31", "yellow": "33"}


def open_closed_streams() -> None:
    """Open /dev/null for each closed stream.

    Otherwise the next file or socket to be opened would become stderr, and sys.stderr would be None.
    """
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:  # the lowest that is free
        pass
    os.close(number)
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)


def wants_color(out: TextIO | None) -> bool:
    """Whether text written to `out` should be coloured: on a terminal, unless NO_COLOR (https://no-color.org)
    or FORCE_COLOR says otherwise. False if `out` is None, like a closed sys.stderr."""
    if out is None:
        return False
    if os.environ.get("NO_COLOR"):
        return False
    if os.environ.get("FORCE_COLOR"):
        return True
    try:
        return out.isatty() and os.environ.get("TERM") != "dumb"
    except ValueError:  # closed
        return False


def paint(text: str, style: str, out: TextIO | None) -> str:
    """Return `text` in one of STYLES if `out` should be coloured, otherwise unchanged."""
    return f"\x1b[{STYLES[style]}m{text}\x1b[0m" if wants_color(out) else text


def print_error(program: str, text: str) -> None:
    """Print a line that begins with the program's name to stderr, if stderr is writable."""
    with suppress(OSError, ValueError):
        print(paint(f"{program}:", "red", sys.stderr), text, file=sys.stderr, flush=True)
