"""Reads a channel on this machine by polling its file in step with the writer."""

from __future__ import annotations

import math
import os
import struct
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from posecast_edge.sources.hubo.reconnecting import FRAME_MAX, KEPT_MAX, WAIT_S, PersistentReader, ReaderError

# A channel can't wake a reader that takes no lock. So: look when the wanted frame should have been written,
# and before that save the frames that the channel is about to overwrite. If there is no frame yet, look again
# at growing intervals.
LOOK_S = (0.0004, 0.005)
FORGET = 0.99  # decay of the measured lateness per look
LATE_S = 0.015  # how long to wait for a late frame if others have arrived; then use those


def find_channel_path(name: str) -> Path:
    """The path under which libach stores the channel of this name."""
    return Path(f"/dev/shm/achshm-{name}")


class ShmReader(PersistentReader):
    """Reads one channel file."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path))
        self._path = path
        self._channel: AchChannel | None = None
        self._beat = WriterClock()
        self._holds = 1  # frames of the newest's size
        self._late_s = 0.0  # how late looks are on this machine

    def close(self) -> None:
        """Close the file."""
        super().close()
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _open(self) -> None:
        self._channel = AchChannel(self._path)
        self._beat = WriterClock()

    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        channel = self._channel
        assert channel is not None
        now_s = time.monotonic()
        end_s = now_s + WAIT_S
        aim = self._beat.plan_look(wanted_s, end_s - LATE_S, self._holds, self._late_s)
        for keep_s in aim.keep_s:
            self._sleep(now_s, keep_s)
            if stop.is_set():
                return []
            channel.save_frames()
            now_s = time.monotonic()
        frames = self._look(channel, aim, now_s, end_s)
        if not frames and channel.is_replaced(self._path):
            raise ChannelError("the channel was created again")
        return frames

    def _look(self, channel: AchChannel, aim: Aim, now_s: float, end_s: float) -> list[bytes]:
        """The new frames once the wanted frame has arrived or is overdue, at the latest at `end_s`."""
        look_s, pause_s = aim.look_s, LOOK_S[0]
        late_s = max(look_s, now_s) + LATE_S
        frames: list[bytes] = []
        written, enough = 0, aim.frames
        too_early_s: float | None = None  # the newest look that was
        while True:
            self._sleep(now_s, min(look_s, end_s))
            before = channel.seq
            new = channel.read_new_frames()
            now_s = time.monotonic()
            if new:
                frames += new
                written += channel.seq - before if 0 < before < channel.seq else 1
                self._holds = channel.count_slots(len(new[-1]))
            if written >= enough:
                self._beat.record_look(written, now_s, 0.0 if too_early_s is None else now_s - too_early_s)
                return frames
            if frames and now_s >= late_s:
                self._beat = WriterClock()
                return frames
            if now_s >= end_s:
                return frames
            if now_s >= look_s:
                enough = min(enough, written + 1)  # the writer is delayed: one more frame is late enough
                too_early_s, look_s = now_s, now_s + pause_s
                pause_s = min(2 * pause_s, LOOK_S[1])

    def _sleep(self, now_s: float, until_s: float) -> None:
        if until_s > now_s:
            time.sleep(until_s - now_s)
            self._late_s = max(self._late_s * FORGET, time.monotonic() - until_s)


# --- the channel

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
SPAN_MAX = 1 << 18  # bytes: frames within such a span are read at once, with the data between them
Entry = tuple[int, int, int, int]  # its place in the index; size, offset and seq of its frame
TRIES = 8  # looks at one frame; then the writer is too fast to follow


class ChannelError(ReaderError):
    """A file that is not an ACH channel of the known layout. One line, without the file's name."""


class AchChannel:
    """Reads an ACH channel in shared memory without disturbing the robot: takes no lock and writes nothing.

    ACH's own readers hold a mutex while they copy, which delays the real-time loop that writes. The writer
    clears the index entries of the frames it is about to overwrite *before* it copies. So if an entry is
    unchanged after copying, the copied frame is whole. The file is read with pread(2): with a memory mapping,
    shrinking the file would kill this process. One look takes three reads for any number of frames: the
    index, the frames, and the index again. `save_frames` reads in the same way; its frames are evaluated
    later.

    Layout: ach 2.0 on x86-64 with glibc; the guards reveal any other layout, which is refused.

    One open channel file. Not thread-safe.
    """

    def __init__(self, path: Path) -> None:
        """Raises OSError when the file can't be read, ChannelError when it is not such a channel."""
        # non-blocking: opening a FIFO would block for ever
        self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        try:
            self._check()
        except BaseException:
            os.close(self._fd)
            raise
        self.torn = 0  # reads that the writer crossed
        self.seq = 0  # of the newest frame handed out, by the writer's count; 0: none yet
        self._kept: list[tuple[bytes, bytes, bytes]] = []  # index, all frames, index again

    def close(self) -> None:
        """Close the file."""
        os.close(self._fd)

    def is_replaced(self, path: Path) -> bool:
        """Whether `path` is now another file or none: the daemon has created its channels again."""
        try:
            there, here = os.stat(path), os.fstat(self._fd)
        except OSError:
            return True
        return (there.st_dev, there.st_ino) != (here.st_dev, here.st_ino)

    def save_frames(self) -> None:
        """Copy the current frames for the next `read_new_frames`, before the writer overwrites them. Takes
        only three reads, because the caller wakes up just for this. Does nothing for a large channel, which
        keeps enough frames."""
        if self._data_size <= SPAN_MAX:
            head = self._head()
            self._kept.append((head, os.pread(self._fd, self._data_size, self._data), self._head()))

    def read_new_frames(self) -> list[bytes]:
        """Frames written since the last call that still exist or were saved, oldest first, at most KEPT_MAX.
        The first call returns only the newest. Leaves out current frames that the writer overwrites too
        quickly.

        Raises ChannelError when the channel's index stays inconsistent.
        """
        found: list[bytes] = []
        kept, self._kept = self._kept, []
        for head, data, after in kept:
            entries = self._news(head)
            if entries and self._inside(entries[0]):
                found += self._whole(head, entries, _cut(data, entries, 0), after)
        for _ in range(TRIES):
            head = self._head()
            entries = self._news(head)
            if not entries:
                return found[-KEPT_MAX:]
            if self._inside(entries[0]):
                frames = self._whole(head, entries, self._copy(entries), self._head())
                if frames:
                    return (found + frames)[-KEPT_MAX:]
            else:
                self.torn += 1
        if not self._inside(entries[0]):
            _, size, offset, _ = entries[0]
            raise ChannelError(f"its index points at byte {offset}, {size} long, of {self._data_size}")
        return found[-KEPT_MAX:]

    def count_slots(self, size: int) -> int:
        """How many frames of `size` bytes the channel can hold."""
        return max(1, min(self._count, self._data_size // size))

    def _news(self, head: bytes) -> list[Entry]:
        """The newest frame and those before it that have not been handed out, newest first."""
        last = (INDEX_HEAD.unpack_from(head, INDEX_HEAD_AT)[0] - 1) % self._count
        place = self._index + last * ENTRY.size
        size, offset, newest = ENTRY.unpack_from(head, place)
        # A look during a lap may have seen a frame before its publication; then its predecessor is the newest
        # now. A sequence number that fell further was restarted.
        if newest == 0 or size == 0 or self.seq - self._count < newest <= self.seq:
            return []
        found = [(place, size, offset, newest)]
        wanted = min(newest - self.seq, self._count, KEPT_MAX) if 0 < self.seq < newest else 1
        for seq in range(newest - 1, newest - wanted, -1):
            last = (last or self._count) - 1
            place = self._index + last * ENTRY.size
            entry = (place, *ENTRY.unpack_from(head, place))
            if entry[3] != seq or entry[1] == 0 or not self._inside(entry):
                break  # the writer has reached this frame; older ones are overwritten
            found.append(entry)
        return found

    def _inside(self, entry: Entry) -> bool:
        _, size, offset, _ = entry
        return size <= FRAME_MAX and offset <= self._data_size - size

    def _copy(self, entries: list[Entry]) -> list[bytes]:
        """The frames of these entries as they are now, perhaps half written."""
        low = min([offset for _, _, offset, _ in entries])
        span = max([offset + size for _, size, offset, _ in entries]) - low
        if span <= SPAN_MAX:
            return _cut(os.pread(self._fd, span, self._data + low), entries, low)
        return [os.pread(self._fd, size, self._data + offset) for _, size, offset, _ in entries]

    def _whole(self, head: bytes, entries: list[Entry], frames: list[bytes], after: bytes) -> list[bytes]:
        """Those of `frames` (newest first) that the writer did not touch between the two reads of the index,
        oldest first; [] when it touched the newest."""
        whole = 0
        for (place, size, _, _), frame in zip(entries, frames, strict=True):
            end = place + ENTRY.size
            if after[place:end] != head[place:end] or len(frame) < size:
                break
            whole += 1
        if whole:
            self.seq = entries[0][3]
        else:
            self.torn += 1
        return frames[:whole][::-1]

    def _check(self) -> None:
        head = os.pread(self._fd, HEADER_SIZE + GUARD.size, 0)
        if len(head) < HEADER_SIZE + GUARD.size:
            raise ChannelError(f"not an ACH channel: only {len(head)} bytes")
        magic, length, _, frames, data_size, *_ = HEADER.unpack_from(head)
        if magic != MAGIC:
            raise ChannelError(f"not an ACH channel: it begins with {magic:#010x}")
        if not 0 < frames <= FRAMES_MAX or not 0 < data_size <= DATA_MAX:
            raise ChannelError("an ACH channel of another layout: its counts are invalid")
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


def _cut(data: bytes, entries: list[Entry], low: int) -> list[bytes]:
    """The frames of these entries, where `data` begins at byte `low`."""
    return [data[offset - low : offset - low + size] for _, size, offset, _ in entries]


# --- when the writer writes next; does no I/O

LEARNED_FRAMES = 32  # until this many, look for every frame,
LEARNING = 0.8  # of a period after the previous one
SPAN_S = 4.0  # the period is the mean over about this time, and over at least twice LEARNED_FRAMES
# Each look in a row that is not too early makes the next one this much earlier, so that about one in fifty is
# too early. With an unknown phase, start as if UNMET looks in a row had been in time;
EARLIER_S = 1e-6
UNMET = 100
LATER = 3 / 4  # a look that was too early makes the next one later by this share of the error,
LATER_MAX_S = 0.5e-3  # but by no more than this: a single delayed frame does not predict the next ones
JUMPS_MAX = 3  # frames in a row that came a period off: the writer's phase has changed
SPARE_S = 0.006  # a look may be this late before the writer overwrites unseen frames,
SPARE_LATE = 3  # plus this many times the recent worst lateness
LOOKS_HZ = 100  # at most this many looks a second; frames of a faster writer with a small channel are lost


class Aim(NamedTuple):
    """A plan: look at `look_s` for the `frames`-th frame from now on; before that, save frames at the times
    `keep_s` so that the writer does not overwrite them unseen. Times are monotonic seconds."""

    frames: int
    look_s: float
    keep_s: Sequence[float] = ()


class WriterClock:
    """Estimates the writer's period and phase. Times are monotonic seconds."""

    def __init__(self) -> None:
        self.period_s = 0.0  # 0: not known
        self._written_s: float | None = None  # about when the newest was written
        self._span_s = 0.0
        self._span_frames = 0.0
        self._in_time = UNMET  # looks in a row
        self._jumps = 0

    def plan_look(self, wanted_s: float, latest_s: float, holds: int, late_s: float) -> Aim:
        """Plan to see the first frame written at `wanted_s` or later, or else the last one before `latest_s`.
        `holds`: how many frames the channel keeps; `late_s`: how late a look may be, seconds."""
        if self._written_s is None:
            return Aim(1, 0.0)
        if not self._learned:
            return Aim(1, self._written_s + LEARNING * self.period_s)
        frames = math.ceil((wanted_s - self._written_s) / self.period_s)
        frames = max(1, min(frames, int((latest_s - self._written_s) / self.period_s)))
        most = max(1, holds + 1 - math.ceil((SPARE_S + SPARE_LATE * late_s) / self.period_s))
        looks = min(math.ceil(frames / most), int(frames * self.period_s * LOOKS_HZ))
        keep_s = [
            self._written_s + (math.ceil(frames * k / looks) + 0.5) * self.period_s for k in range(1, looks)
        ]
        return Aim(frames, self._written_s + frames * self.period_s, keep_s)

    def record_look(self, frames: int, now_s: float, blind_s: float) -> None:
        """Record that `frames` new frames were found, the newest written before `now_s`. `blind_s`: seconds
        since the last look at which it was not yet written; 0 if there was no such look."""
        if self._written_s is None:
            self._written_s = now_s
            return
        at_s = now_s - blind_s / 2
        if self._learned:
            expected_s = self._written_s + frames * self.period_s
            late_s = at_s - expected_s
            if abs(late_s) > self.period_s:  # the writer paused or hurried
                self._jumps += 1
                if self._jumps == JUMPS_MAX:
                    self._span_s = self._span_frames = 0.0
                self._in_time = UNMET
                self._written_s = at_s
                return
            self._in_time = 0 if blind_s else self._in_time + 1
            later_s = min(LATER * late_s, LATER_MAX_S)
            at_s = expected_s + (later_s if blind_s else min(late_s, -EARLIER_S * self._in_time))
        self._jumps = 0
        if self._span_s > SPAN_S and self._span_frames > 2 * LEARNED_FRAMES:
            self._span_s, self._span_frames = self._span_s / 2, self._span_frames / 2
        self._span_s += at_s - self._written_s
        self._span_frames += frames
        self.period_s = self._span_s / self._span_frames
        self._written_s = at_s

    @property
    def _learned(self) -> bool:
        return self._span_frames >= LEARNED_FRAMES and self.period_s > 0
