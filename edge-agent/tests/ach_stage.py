"""An ACH channel file (ach 2.0, x86-64, glibc) and a writer that does what libach's does, in its order.

As a program it writes as fast as it can: `python ach_stage.py PATH SIZE`, until its stdin ends.
"""

from __future__ import annotations

import mmap
import select
import struct
import sys
from pathlib import Path

HEADER = 320


class Writer:
    """Creates the channel and puts frames into it."""

    def __init__(self, path: Path, frames: int = 10, frame_size: int = 3000) -> None:
        self.count, self.data_size = frames, frames * frame_size
        self.index = HEADER + 8
        self.data = self.index + 24 * frames + 8
        self.size = self.data + self.data_size + 8
        path.write_bytes(bytes(self.size))
        with path.open("r+b") as f:
            self.map = mmap.mmap(f.fileno(), self.size)
        m = self.map
        struct.pack_into("<I", m, 0, 0xB07511F3)
        struct.pack_into("<Q", m, 8, self.size)
        m[16:26] = b"hubo-state"
        struct.pack_into("<QQ", m, 88, frames, self.data_size)
        struct.pack_into("<Q", m, 112, self.data_size)  # data_free
        struct.pack_into("<Q", m, 128, frames)  # index_free
        struct.pack_into("<Q", m, HEADER, 0x1A2A3A4A5A6A7A8A)
        struct.pack_into("<Q", m, self.data - 8, 0x1B2B3B4B5B6B7B8B)
        struct.pack_into("<Q", m, self.size - 8, 0x1C2C3C4C5C6C7C8C)
        self.seq = 0
        self.head = 0  # index_head
        self.data_head = 0

    def put(self, frame: bytes) -> None:
        m, size = self.map, len(frame)
        offset = self.data_head if self.data_head + size <= self.data_size else 0
        # first free what is about to be overwritten, then copy, then publish
        for i in range(self.count):
            entry = self.index + 24 * i
            its_size, its_offset, seq = struct.unpack_from("<QQQ", m, entry)
            overlaps = its_offset < offset + size and offset < its_offset + its_size
            if seq and (i == self.head or overlaps):
                m[entry : entry + 24] = bytes(24)
        m[self.data + offset : self.data + offset + size] = frame
        self.seq += 1
        struct.pack_into("<QQQ", m, self.index + 24 * self.head, size, offset, self.seq)
        self.head = (self.head + 1) % self.count
        self.data_head = offset + size
        struct.pack_into("<Q", m, 104, self.data_head)
        struct.pack_into("<Q", m, 120, self.head)
        struct.pack_into("<Q", m, 312, self.seq)


def patterned(number: int, size: int) -> bytes:
    """A frame in which every eight bytes say the same."""
    return struct.pack("<Q", number) * (size // 8)


def main() -> None:
    path, size = Path(sys.argv[1]), int(sys.argv[2])
    writer = Writer(path, frames=3, frame_size=size)
    print("ready", flush=True)
    number = 0
    while number % 64 or not select.select([sys.stdin], [], [], 0)[0]:
        number += 1
        writer.put(patterned(number, size))
    print(number, flush=True)


if __name__ == "__main__":
    main()
