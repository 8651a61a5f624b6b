"""Handles programs that were started without stdin, stdout or stderr."""

from __future__ import annotations

import os
import sys


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
