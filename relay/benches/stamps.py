"""When each seq was published; the Python side of stamps.h, where it is explained."""

from __future__ import annotations

import mmap
import struct
import time
from pathlib import Path

SLOTS = 65536
SLOT = struct.Struct("<Q")


def make_stamps(path: Path) -> None:
    """An empty file of stamps, in place of an older one."""
    path.unlink(missing_ok=True)
    path.write_bytes(bytes(SLOTS * SLOT.size))


class Stamps:
    def __init__(self, path: str) -> None:
        with open(path, "r+b") as file:
            self._slots = mmap.mmap(file.fileno(), SLOTS * SLOT.size)

    def note(self, seq: int) -> None:
        """This seq is handed over now (CLOCK_MONOTONIC, ns)."""
        SLOT.pack_into(self._slots, seq % SLOTS * SLOT.size, time.monotonic_ns())
