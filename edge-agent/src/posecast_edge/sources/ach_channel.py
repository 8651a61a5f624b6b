"""An ACH channel in shared memory, read without disturbing the robot: no lock is taken, nothing is written.

ACH's own readers hold a mutex while they copy, and so delay the real-time loop that writes. The writer clears
the index entries of the frames it is about to overwrite *before* it copies, so a reader that finds its entry
unchanged after copying has copied a whole frame. The file is read with pread(2): a mapping would kill this
process when somebody shrinks the file. Three reads are a look, however many frames it brings: the index, the
frames, the index again.

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
INDEX_HEAD = struct.Struct("<Q")
INDEX_HEAD_AT = 120
ENTRY = struct.Struct("<QQQ")  # size, offset, seq; all zero: free
GUARDS = (
    0x1A2A3A4A5A6A7A8A,
    0x1B2B3B4B5B6B7B8B,
    0x1C2C3C4C5C6C7C8C,
)  # before the index, before and after the data
GUARD = struct.Struct("<Q")
FRAMES_MAX = 1 << 12
DATA_MAX = 1 << 30
SPAN_MAX = 1 << 18  # frames that lie so close together are read at once, with what is between them
TRIES = 8  # looks at one frame; a writer that laps us more often is not followed


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

    def fresh(self) -> list[bytes]:
        """The frames since the last call that are still there, oldest first, at most KEPT_MAX; of the first
        call the newest only. [] also when the writer is too quick just now.

        ChannelError when the channel's own numbers contradict each other and go on doing so.
        """
        outside = ""
        for _ in range(TRIES):
            head = self._head()
            last = (INDEX_HEAD.unpack_from(head, INDEX_HEAD_AT)[0] - 1) % self._count
            size, offset, seq = ENTRY.unpack_from(head, self._index + last * ENTRY.size)
            # A look across a lap may have met a frame before its publication, whose elder is the newest now.
            # A sequence that fell further was begun anew.
            if seq == 0 or size == 0 or self.seq - self._count < seq <= self.seq:
                return []
            if self._inside(size, offset):
                frames = self._whole(head, self._entries(head, last, seq))
                if frames:
                    self.seq = seq
                    return frames
                outside = ""
            else:
                outside = f"its index points at byte {offset}, {size} long, of {self._data_size}"
            self.torn += 1
        if outside:
            raise ChannelError(outside)
        return []

    def holds(self, size: int) -> int:
        """How many frames of that size the channel keeps."""
        return max(1, min(self._count, self._data_size // size))

    def _entries(self, head: bytes, last: int, newest: int) -> list[tuple[int, int, int]]:
        """Place of the index entry, size and offset of the newest frame and those before it that are news,
        newest first."""
        found = []
        wanted = min(newest - self.seq, self._count, KEPT_MAX) if 0 < self.seq < newest else 1
        for back in range(wanted):
            place = self._index + (last - back) % self._count * ENTRY.size
            size, offset, seq = ENTRY.unpack_from(head, place)
            if seq != newest - back or size == 0 or not self._inside(size, offset):
                break  # the writer is there by now; what is older went before
            found.append((place, size, offset))
        return found

    def _inside(self, size: int, offset: int) -> bool:
        return offset <= self._data_size - size

    def _whole(self, head: bytes, entries: list[tuple[int, int, int]]) -> list[bytes]:
        """The frames of these entries (newest first) that the writer did not touch meanwhile, oldest first;
        [] when he touched the newest."""
        low = min([offset for _, _, offset in entries])
        span = max([offset + size for _, size, offset in entries]) - low
        if span <= SPAN_MAX:
            data = os.pread(self._fd, span, self._data + low)
            frames = [data[offset - low : offset - low + size] for _, size, offset in entries]
        else:
            frames = [os.pread(self._fd, size, self._data + offset) for _, size, offset in entries]
        now = self._head()
        whole = 0
        for (place, size, _), frame in zip(entries, frames, strict=True):
            end = place + ENTRY.size
            if now[place:end] != head[place:end] or len(frame) < size:
                break
            whole += 1
        return frames[:whole][::-1]

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
        self._head_size = self._index + frames * ENTRY.size
        self._data = self._head_size + GUARD.size
        whole = self._data + data_size + GUARD.size
        here = os.fstat(self._fd).st_size
        if length != whole or here < whole:
            raise ChannelError(f"an ACH channel of another layout: {here} bytes where {whole} are expected")
        places = (HEADER_SIZE, self._data - GUARD.size, whole - GUARD.size)
        for place, guard in zip(places, GUARDS, strict=True):
            if os.pread(self._fd, GUARD.size, place) != GUARD.pack(guard):
                raise ChannelError(f"an ACH channel of another layout: no guard at byte {place}")

    def _head(self) -> bytes:
        """Header and index as they are now, perhaps half written."""
        head = os.pread(self._fd, self._head_size, 0)
        if len(head) < self._head_size:
            raise ChannelError("the channel has shrunk")
        return head
