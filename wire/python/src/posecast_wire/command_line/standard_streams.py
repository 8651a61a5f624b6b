"""stdin, stdout and stderr of a program that was started without some of them."""

from __future__ import annotations

import os
import sys


def open_closed_streams() -> None:
    """Let what is closed lead to /dev/null: else the next file or socket that is opened becomes our stderr,
    and sys.stderr is None."""
    while (number := os.open(os.devnull, os.O_RDWR)) < 3:  # the lowest that is free
        pass
    os.close(number)
    sys.stdin = sys.stdin or os.fdopen(0, closefd=False)
    sys.stdout = sys.stdout or os.fdopen(1, "w", closefd=False)
    sys.stderr = sys.stderr or os.fdopen(2, "w", closefd=False)
