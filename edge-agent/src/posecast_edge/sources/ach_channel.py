"""An ACH channel in shared memory, read without disturbing the robot: no lock is taken, nothing is written.

ACH's own readers hold a mutex while they copy, and so delay the real-time loop that writes. The writer clears
the index entries of the frames it is about to overwrite *before* it copies, so a reader that finds its entry
unchanged after copying has copied a whole frame. The file is read with pread(2): a mapping would kill this
process when somebody shrinks the file.

Layout: ach 2.0 on x86-64 with glibc; anything else shows in the guards and is refused.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path

from posecast_edge.sources.persistent import KEPT_MAX, ReaderError

MAGIC = 0xB07511F3
# magic, len, name, index_cnt, data_size, data_head, data_free, index_head
HEADER = struct.Struct("<I4xQ65s7xQQQQQ")
HEADER_SIZE = 320  # with index_free, clock, mutex, condition variable, dirty, last_seq after the above
ENTRY = struct.Struct("<QQQ")  # size, offset, seq; all zero: free
GUARDS = (
    0x1A2A3A4A5A6A7A8A,
    0x1B2B3B4B5B6B7B8B,
    0x1C2C3C4C5C6C7C8C,
)  # before the index, before and after the data
GUARD = struct.Struct("<Q")
FRAMES_MAX = 1 << 16
DATA_MAX = 1 << 30
TRIES = 8  # reads of one frame; a writer that laps us more often is not followed


class ChannelError(ReaderError):
    """A file that is no channel this reader knows. One line, without the file's name."""


class Channel:
    """One open channel. Not thread-safe."""

    def __init__(self, path: Path) -> None:
        """OSError when the file cannot be read, ChannelError when it is no such channel."""
        self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
        try:
            self._check()
        except BaseException:
            os.close(self._fd)
            raise
        self.torn = 0  # reads that the writer crossed
        self.seq = 0  # of the newest frame handed out, by the writer's count; 0: none yet

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)

    def replaced(self, path: Path) -> bool:
        """Another file stands at `path`, or none: the daemon has made its channels anew."""
        try:
            there, here = os.stat(path), os.fstat(self._fd)
        except OSError:
            return True
        return (there.st_dev, there.st_ino) != (here.st_dev, here.st_ino)

    def newest(self) -> bytes | None:
        """The newest frame, None when it has been handed out already or the writer is too quick just now.

        ChannelError when the channel's own numbers contradict each other and go on doing so.
        """
        outside = ""
        for _ in range(TRIES):
            found = self._entry()
            # A read across a lap may have met a frame before its publication, whose elder is the newest now.
            # A sequence that fell further was begun anew.
            if found is None or self.seq - self._count < found[2] <= self.seq:
                return None
            size, offset, seq = found
            if size > self._data_size or offset > self._data_size - size:
                outside = f"its index points at byte {offset}, {size} long, of {self._data_size}"
            else:
                outside = ""
                frame = os.pread(self._fd, size, self._data + offset)
                if self._still(found) and len(frame) == size:
                    self.seq = seq
                    return frame
            self.torn += 1
        if outside:
            raise ChannelError(outside)
        return None

    def fresh(self) -> list[bytes]:
        """The frames since the last call that are still there, oldest first, at most KEPT_MAX; of the first
        call the newest only. ChannelError as `newest`."""
        before = self.seq
        newest = self.newest()
        if newest is None:
            return []
        found = [newest]
        if before:
            place = self._place
            for seq in range(self.seq - 1, max(before, self.seq - KEPT_MAX), -1):
                if place == self._index:
                    place += self._count * ENTRY.size
                place -= ENTRY.size
                frame = self._elder(place, seq)
                if frame is None:
                    break  # the writer is there by now; what is older went before
                found.append(frame)
        return found[::-1]

    def holds(self, size: int) -> int:
        """How many frames of that size the channel keeps."""
        return max(1, min(self._count, self._data_size // size))

    def _elder(self, place: int, seq: int) -> bytes | None:
        """The frame of that sequence whose index entry is at byte `place`; None when it is gone."""
        entry = os.pread(self._fd, ENTRY.size, place)
        if len(entry) < ENTRY.size:
            return None
        size, offset, its_seq = ENTRY.unpack(entry)
        if its_seq != seq or size == 0 or size > self._data_size or offset > self._data_size - size:
            return None
        frame = os.pread(self._fd, size, self._data + offset)
        return frame if len(frame) == size and os.pread(self._fd, ENTRY.size, place) == entry else None

    def _check(self) -> None:
        head = os.pread(self._fd, HEADER_SIZE + GUARD.size, 0)
        if len(head) < HEADER_SIZE + GUARD.size:
            raise ChannelError(f"no ACH channel: only {len(head)} bytes")
        magic, length, _, frames, data_size, *_ = HEADER.unpack_from(head)
        if magic != MAGIC:
            raise ChannelError(f"no ACH channel: it begins with {magic:#010x}")
        if not 0 < frames <= FRAMES_MAX or not 0 < data_size <= DATA_MAX:
            raise ChannelError("an ACH channel of another layout: its counts make no sense")
        self._count: int = frames
        self._data_size: int = data_size
        self._index = HEADER_SIZE + GUARD.size
        self._data = self._index + frames * ENTRY.size + GUARD.size
        whole = self._data + data_size + GUARD.size
        here = os.fstat(self._fd).st_size
        if length != whole or here < whole:
            raise ChannelError(f"an ACH channel of another layout: {here} bytes where {whole} are expected")
        places = (HEADER_SIZE, self._data - GUARD.size, whole - GUARD.size)
        for place, guard in zip(places, GUARDS, strict=True):
            if os.pread(self._fd, GUARD.size, place) != GUARD.pack(guard):
                raise ChannelError(f"an ACH channel of another layout: no guard at byte {place}")

    def _entry(self) -> tuple[int, int, int] | None:
        """The newest frame's index entry (size, offset, seq), itself perhaps half written; None when the
        channel is empty or the writer is at work on it."""
        head = os.pread(self._fd, HEADER.size, 0)
        if len(head) < HEADER.size:
            raise ChannelError("the channel has shrunk")
        index_head = HEADER.unpack(head)[-1]
        self._place = self._index + (index_head - 1) % self._count * ENTRY.size
        entry = os.pread(self._fd, ENTRY.size, self._place)
        if len(entry) < ENTRY.size:
            raise ChannelError("the channel has shrunk")
        size, offset, seq = ENTRY.unpack(entry)
        if seq == 0 or size == 0:
            return None
        return size, offset, seq

    def _still(self, entry: tuple[int, int, int]) -> bool:
        return os.pread(self._fd, ENTRY.size, self._place) == ENTRY.pack(*entry)
