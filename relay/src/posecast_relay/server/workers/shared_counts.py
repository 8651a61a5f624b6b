"""Counts shared by the workers of one relay: viewers, streams per address, and which workers serve.

All workers map the same memory. Each writes its own part and reads the others', so nobody has to wait. A part
has a head and a table of counts by name. A name's hash selects a row of 8 places. A place with the count 0 is
free. If a row is full, other workers don't see that name's count, and its limit then applies per worker
(16,384 places; a relay with 5,000 viewers fills at most a third).
"""

from __future__ import annotations

import mmap
import os
import tempfile
import time
from collections import Counter
from hashlib import blake2b

ROWS, PLACES = 2048, 8
HEAD = 2  # words: state, time of the last sign of life in ns
WORDS = HEAD + 2 * ROWS * PLACES  # of a worker's part; a word has 8 bytes
DOWN, SERVING = 0, 1
BEAT_S = 1.0  # between two signs of life
FRESH_NS = 5_000_000_000  # a worker without a sign of life for this long does not serve


def open_shared_memory(workers: int) -> int:
    """Return the descriptor of a shared memory for this many workers. Raises OSError."""
    if hasattr(os, "memfd_create"):
        memory = os.memfd_create("posecast", os.MFD_CLOEXEC)
    else:  # not on macOS
        with tempfile.TemporaryFile(prefix="posecast-") as file:
            memory = os.dup(file.fileno())
    os.ftruncate(memory, workers * WORDS * 8)
    return memory


class SharedCounts:
    """The counts of worker `number` (of `workers`), and access to the others' counts."""

    def __init__(self, descriptor: int, workers: int, number: int) -> None:
        self.workers = workers
        self._number = number
        self._words = memoryview(mmap.mmap(descriptor, workers * WORDS * 8)).cast("Q")
        self._own: Counter[str] = Counter()

    def add(self, name: str, change: int) -> None:
        """Change this worker's count of a name."""
        self._own[name] += change
        count = self._own[name]
        if count <= 0:
            del self._own[name]
        hashed, row = _place(name)
        at = self._find(self._number, hashed, row)
        if at is None and count > 0 and (at := self._find_free(row)) is not None:
            self._words[at] = hashed  # its count is 0 until the next line
        if at is not None:
            self._words[at + 1] = max(0, count)

    def count_elsewhere(self, name: str) -> int:
        """Return the other workers' total count of a name."""
        hashed, row = _place(name)
        found = 0
        for number in range(self.workers):
            at = None if number == self._number else self._find(number, hashed, row)
            found += 0 if at is None else self._words[at + 1]
        return found

    def set_state(self, state: int) -> None:
        """Report whether this worker serves, and that it is alive."""
        self.beat()
        self._words[self._number * WORDS] = state

    def beat(self) -> None:
        """Report that this worker is alive."""
        self._words[self._number * WORDS + 1] = time.monotonic_ns()

    def list_missing(self) -> list[int]:
        """Return the numbers of the workers that don't serve now."""
        now_ns, missing = time.monotonic_ns(), []
        for number in range(self.workers):
            state, at_ns = self._words[number * WORDS], self._words[number * WORDS + 1]
            if state != SERVING or now_ns - at_ns > FRESH_NS:
                missing.append(number)
        return missing

    def get_beat(self, number: int) -> int | None:
        """Return the newest sign of life of a worker that serves; None before it does."""
        at = number * WORDS
        return self._words[at + 1] if self._words[at] == SERVING else None

    def clear(self, number: int) -> None:
        """Clear a worker's counts, because its process has ended."""
        base = number * WORDS
        self._words[base : base + WORDS] = memoryview(bytes(8 * WORDS)).cast("Q")

    def _find(self, number: int, hashed: int, row: int) -> int | None:
        first = number * WORDS + row
        for at in range(first, first + 2 * PLACES, 2):
            if self._words[at] == hashed:
                return at
        return None

    def _find_free(self, row: int) -> int | None:
        first = self._number * WORDS + row
        for at in range(first, first + 2 * PLACES, 2):
            if self._words[at + 1] == 0:
                return at
        return None


def _place(name: str) -> tuple[int, int]:
    """Return the hash of a name, never 0, and where in a part its row begins."""
    hashed = int.from_bytes(blake2b(name.encode(), digest_size=8).digest(), "little") or 1
    return hashed, HEAD + 2 * PLACES * (hashed % ROWS)
