"""Writes the same bytes to many viewers, directly to their sockets.

With Linux's io_uring, hundreds of sockets are written in one system call, through ctypes. A send() per
viewer enters the kernel each time; a batch enters it once. That saves a fifth of a message's cost (`make
bench`), so it is used if the kernel allows it. Container platforms often don't: then `IoUring.open` returns
None, and the function `write_each` does the same with one write() per socket.

Only one thread uses the ring, and the kernel reads it only during that thread's calls: no kernel thread
polls it, and no request waits (MSG_DONTWAIT). So no memory barriers are needed, and when a call returns,
all its requests are done. The layouts are those of <linux/io_uring.h>.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import socket
import struct
import sys
from array import array
from collections.abc import Sequence

from posecast_relay.core.viewer import Viewer

BATCH = 512  # sends in one call; a power of two
SYS_SETUP, SYS_ENTER = 425, 426  # the same on every architecture that Python runs on
OP_SEND, ENTER_GETEVENTS = 26, 1
FEAT_NATIVE_WORKERS = 1 << 9  # Linux 5.12: MSG_DONTWAIT requests return at once
OFF_CQ_RING, OFF_SQES = 0x8000000, 0x10000000
PARAMS = struct.Struct("=10I 8IQ 8IQ")
U32 = 0xFFFFFFFF

Short = list[tuple[int, int]]  # index, and the number of bytes sent; or −errno


def write_each(descriptors: Sequence[int], data: bytes) -> Short:
    """Send `data` to each socket, without waiting. Return those that did not take all of it: see Short."""
    short: Short = []
    size, write = len(data), os.write
    for index, descriptor in enumerate(descriptors):
        try:
            taken = write(descriptor, data)
        except OSError as e:
            taken = -(e.errno or 0)
        if taken != size:
            short.append((index, taken))
    return short


class IoUring:
    """One io_uring, for use by one thread."""

    def __init__(self) -> None:
        """Raises OSError if the kernel has no io_uring, forbids it, or is too old."""
        if sys.platform != "linux":
            raise OSError("no io_uring here")
        self._syscall = ctypes.CDLL(None, use_errno=True).syscall
        self._syscall.restype = ctypes.c_long
        params = ctypes.create_string_buffer(PARAMS.size)
        self._fd = self._call(SYS_SETUP, BATCH, params)
        found = PARAMS.unpack(params.raw)
        self._completions, features = found[1], found[5]
        sq_tail, sq_array, cq_head, cqes = found[11], found[16], found[19], found[24]
        if not features & FEAT_NATIVE_WORKERS:
            self.close()
            raise OSError("io_uring is too old here")
        words = self._map(sq_array + 4 * BATCH, 0)
        self._sq_tail = words[sq_tail // 4 :][:1]
        self._array = words[sq_array // 4 :][:BATCH]
        words = self._map(cqes + 16 * self._completions, OFF_CQ_RING)
        self._cq_head = words[cq_head // 4 :][:1]
        entries = words[cqes // 4 :]
        self._whose, self._taken = entries[0::4], _signed(entries)[2::4]
        entries = self._map(64 * BATCH, OFF_SQES)
        self._descriptor, self._size = _signed(entries)[1::16], entries[6::16]
        self._address = entries.cast("B").cast("Q")[2::8]
        entries[0::16] = array("I", [OP_SEND]) * BATCH
        entries[7::16] = array("I", [socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL]) * BATCH
        entries[8::16] = array("I", range(BATCH))  # the kernel returns it with the result
        self._turned = memoryview(array("I", range(BATCH)) * 2)  # any rotation of the indexes is a slice

    @classmethod
    def open(cls) -> IoUring | None:
        """Return a tested ring; None if none works."""
        try:
            ring = cls()
        except (OSError, AttributeError):  # AttributeError: a C library without syscall()
            return None
        if ring._proves_itself():
            return ring
        ring.close()
        return None

    def close(self) -> None:
        """Close the ring."""
        os.close(self._fd)

    def write_each(self, descriptors: Sequence[int], data: bytes) -> Short:
        """Do the same as the function `write_each`, in one system call, for at most BATCH sockets."""
        count, size = len(descriptors), len(data)
        tail, head = self._sq_tail[0], self._cq_head[0]
        turn = -tail % BATCH
        self._array[:] = self._turned[turn : turn + BATCH]  # slot of `tail` → entry 0, and so on
        self._descriptor[:count] = array("i", descriptors)
        self._address[:count] = array("Q", [_address(data)]) * count
        self._size[:count] = array("I", [size]) * count
        self._sq_tail[0] = tail + count & U32
        try:
            begun = self._call(SYS_ENTER, self._fd, count, count, ENTER_GETEVENTS, None, 0)
        except OSError:
            begun = 0
        self._sq_tail[0] = tail + begun & U32
        self._cq_head[0] = head + begun & U32
        taken = self._answers(self._taken, head, begun)
        if taken.count(size) == count:
            return []
        short = [
            (index, n)
            for index, n in zip(self._answers(self._whose, head, begun), taken, strict=True)
            if n != size
        ]
        return sorted(short) + [(index, 0) for index in range(begun, count)]

    def _answers(self, of: memoryview[int], head: int, count: int) -> list[int]:
        first = head % self._completions
        return of[first : first + count].tolist() + of[: max(0, first + count - self._completions)].tolist()

    def _call(self, number: int, *arguments: object) -> int:
        done = self._syscall(ctypes.c_long(number), *arguments)
        if done < 0:
            raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
        return int(done)

    def _map(self, size: int, offset: int) -> memoryview[int]:
        return memoryview(mmap.mmap(self._fd, size, offset=offset)).cast("I")

    def _proves_itself(self) -> bool:
        """Test the ring: a sandbox may accept its calls without carrying them out."""
        near, far = socket.socketpair()
        with near, far:
            closed = os.dup(near.fileno())
            os.close(closed)
            if [i for i, _ in self.write_each([near.fileno(), closed], b"abc")] != [1] or far.recv(
                9
            ) != b"abc":
                return False
            near.setblocking(False)
            for _ in range(10_000):
                if self.write_each([near.fileno()], bytes(65536)):
                    return True  # the full socket was reported at once
        return False


def _signed(words: memoryview[int]) -> memoryview[int]:
    return words.cast("B").cast("i")


def _address(data: bytes) -> int:
    return ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p).value or 0


SLICE = BATCH  # viewers in one turn of the event loop: about 4 ms
FEW = 8  # up to this many viewers are written one by one, because a batch has a fixed cost


class FanOut:
    """Writes with io_uring if a ring is available, else with one write() per viewer."""

    def __init__(self, ring: IoUring | None) -> None:
        self._ring = ring

    @property
    def has_ring(self) -> bool:
        """Whether it writes with io_uring."""
        return self._ring is not None

    def write(self, data: bytes, viewers: Sequence[Viewer]) -> list[tuple[Viewer, Exception]]:
        """Write to at most SLICE viewers. Return those for which that failed, with the error.

        If a socket does not take everything at once, its transport sends the rest later.
        """
        failed: list[tuple[Viewer, Exception]] = []
        descriptors = [viewer.outlet.descriptor for viewer in viewers]
        if -1 in descriptors:
            for viewer in viewers:
                if viewer.outlet.descriptor == -1:
                    _write(viewer, data, failed)
            viewers = [viewer for viewer in viewers if viewer.outlet.descriptor != -1]
            descriptors = [viewer.outlet.descriptor for viewer in viewers]
        batch = self._ring.write_each if self._ring is not None and len(viewers) > FEW else write_each
        for index, taken in batch(descriptors, data):  # also after an error: the transport will meet it too
            _write(viewers[index], data[max(0, taken) :], failed)
        return failed


def _write(viewer: Viewer, data: bytes, failed: list[tuple[Viewer, Exception]]) -> None:
    try:
        viewer.outlet.write(data)
    except Exception as error:
        failed.append((viewer, error))
