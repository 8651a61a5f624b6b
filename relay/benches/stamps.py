"""When each seq was published, and when to begin in earnest; stamps.h, the C side, explains it."""

from __future__ import annotations

import mmap
import struct
import time
from pathlib import Path

SLOTS = 65536
SLOT = struct.Struct("<Q")
ALL_CONNECTED = SLOTS * SLOT.size  # offset
FILE_SIZE = ALL_CONNECTED + SLOT.size


def make_stamps(path: Path) -> None:
    """An empty file of stamps, in place of an older one."""
    path.unlink(missing_ok=True)
    path.write_bytes(bytes(FILE_SIZE))


class Stamps:
    def __init__(self, path: str) -> None:
        with open(path, "r+b") as file:
            self._slots = mmap.mmap(file.fileno(), FILE_SIZE)

    def note(self, seq: int) -> None:
        """This seq is handed over now (CLOCK_MONOTONIC, ns)."""
        SLOT.pack_into(self._slots, seq % SLOTS * SLOT.size, time.monotonic_ns())

    def period_s(self, hz: float) -> float:
        """To the next frame: by `hz` once all viewers are connected, until then a second."""
        return 1 / hz if SLOT.unpack_from(self._slots, ALL_CONNECTED)[0] else 1.0
