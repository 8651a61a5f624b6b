"""Samples from lines of text, from stdin, a file or a FIFO, for kinds of sources such as `jsonl`.

A kind gives the function that parses one line. An invalid line is logged and skipped. A regular file plays at
the pace of its samples' times. A pipe is read at once: only the newest line is sent as state, earlier lines
only cause events. With a FIFO you can restart your program.
"""

from __future__ import annotations

import logging
import math
import os
import select
import stat
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence

from posecast_edge import kit
from posecast_edge.kit import OnceLog, PartLog, kind_of
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Deliver
from posecast_edge.sources.clock import UNITS_OF_TIME, ClockCheck, explain_step_back, guess_time_unit

MAX_LINE = 1 << 20  # bytes; 4096 channels in full precision, with their names, are 200 kB
TOO_LARGE = "robot's samples are too large"  # shown to viewers
TROUBLE_S = 10.0  # for this long after the last such line
MAX_READ = 64 * 1024  # a full pipe
MAX_PAUSE_S = 10.0  # between two lines of a file; a longer gap is skipped
CLOCK_LINES = 200  # of a file, from which the unit of its clock is guessed
POLL_S = 0.1
QUIET_S = 0.005
STALL_S = 0.25  # after this long without reading, the next data may be old
BACKLOG_S = 0.5  # a writer ahead of its reader for this long is always ahead

UNIT = "unit of t"  # a part of a line that is said, not left out

# Parses a line, given its time of arrival (kit.now_s), where it was read ("stdin line 7") and the unit of its
# clock (see `UNITS_OF_TIME`), into a sample and complaints about parts that were left out: the part, which is
# the same each time, → the text. UNIT is no such part: its text says that the time is in another unit. Raises
# LineError when there is no sample at all.
ParseLine = Callable[[bytes, float, str, str], tuple[Sample, Mapping[str, str]]]
# The time in a line, as it is written; NaN if there is none.
ReadTime = Callable[[bytes], float]


class LineError(ValueError):
    """A line that can't be turned into a sample; the text gives the reason. `parts`: part of the line → what
    is wrong with it, as of `ParseLine`."""

    def __init__(self, reason: str, parts: Mapping[str, str] | None = None) -> None:
        super().__init__(reason)
        self.parts = parts or {kind_of(reason): reason}


def open_lines(kind: str, address: str, parse: ParseLine, read_time: ReadTime) -> LineSource:
    """Open stdin ("") or a path. Raises SourceError when the path can't be opened."""
    if not address:
        return LineSource(kind, sys.stdin.fileno(), "stdin", parse, read_time)
    try:
        # opened for writing too, a FIFO does not end when its writer ends
        flags = os.O_RDWR if stat.S_ISFIFO(os.stat(address).st_mode) else os.O_RDONLY
        return LineSource(kind, os.open(address, flags), address, parse, read_time)
    except OSError as e:
        raise SourceError(f"{address}: {e.strerror or e}") from None


class LineSource:
    """Reads lines from a file descriptor."""

    def __init__(self, kind: str, fd: int, name: str, parse: ParseLine, read_time: ReadTime) -> None:
        self.description = f"{kind} {name}"
        self._parse = parse
        self._read_time = read_time
        self._fd = fd
        self._name = name
        self._paced = stat.S_ISREG(os.fstat(fd).st_mode)
        self._started = False
        self._start_s = 0.0  # kit.now_s() when the file's clock was 0
        self._before_s = 0.0  # the newest time in the file
        log = logging.getLogger(f"posecast_edge.{kind}")
        self._bad = PartLog(log.warning, "bad lines")
        self._unit = ""  # of a file's clock, once it is known
        self._clock = OnceLog(lambda text: log.warning("%s: %s", name, text))
        self._check = ClockCheck(self._clock.add)
        self._lines = LineSplitter(MAX_LINE)
        self._too_large_s = -math.inf  # when a line was too large
        self._number = 0  # of the newest line
        self._waiting: Sample | None = None  # the newest, unless another follows at once
        self._looked_s: float | None = None
        self._behind_s: float | None = None  # since when there has been more to read
        self._stalled = False  # the data being read may be old

    @property
    def trouble(self) -> str:
        """The text shown to viewers while lines are too long."""
        return TOO_LARGE if kit.now_s() - self._too_large_s < TROUBLE_S else ""

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every valid line until the end or `stop`. Raises SourceError when reading fails."""
        chunk: bytes | None = None
        while not stop.is_set() and chunk != b"":
            chunk = self._read()
            lines = list(self._lines.flush() if chunk == b"" else self._lines.feed(chunk or b""))
            if self._paced and not self._unit and lines:
                self._guess_unit(lines)
            for line in lines:
                self._number += 1
                self._take(line, deliver, stop)
                if stop.is_set():
                    return
            if self._waiting is not None and (chunk == b"" or self._is_newest()):
                self._deliver_waiting(deliver, newest=True)
        self._bad.flush()

    def _take(self, line: bytes, deliver: Deliver, stop: threading.Event) -> None:
        if not line or line.isspace():
            return
        where, now_s = f"{self._name} line {self._number}", kit.now_s()
        try:
            if len(line) > MAX_LINE:
                self._too_large_s = now_s
                raise LineError(f"longer than {MAX_LINE} bytes; it is dropped")
            sample, wrong = self._parse(line, now_s, where, self._unit or "s")
        except LineError as e:
            for part, text in e.parts.items():
                self._bad.add(part, f"{where}: {text}")
            return
        for part, text in wrong.items():
            if part == UNIT:
                self._clock.add(text, UNIT)
            else:
                self._bad.add(part, f"{where}: {text}")
        if not self._paced:
            self._check.check_time(sample.t_s, now_s)
        if self._waiting is not None:
            self._deliver_waiting(deliver, newest=False)
        if self._paced:
            self._wait(sample.t_s, stop)
            deliver(sample)
        else:
            self._waiting = sample

    def _guess_unit(self, lines: Sequence[bytes]) -> None:
        """Find the unit of a file's clock from its first lines, as for tables."""
        times = [t for line in lines[:CLOCK_LINES] if not math.isnan(t := self._read_time(line))]
        self._unit, why = guess_time_unit(times, "lines")
        if why:
            self._clock.add(f"t is read as {UNITS_OF_TIME[self._unit][1]}, because {why}", UNIT)

    def _deliver_waiting(self, deliver: Deliver, newest: bool) -> None:
        sample, self._waiting = self._waiting, None
        if sample is not None:
            deliver(sample if newest else sample._replace(newest=False))

    def _is_newest(self) -> bool:
        """Whether the waiting sample is the newest. A writer that was blocked because nobody read continues
        with old lines; so after a stall, a moment of silence must show that it has caught up."""
        now_s = kit.now_s()
        if not self._readable(QUIET_S if self._stalled else 0.0):
            self._behind_s, self._stalled = None, False
            return True
        if self._behind_s is None:
            self._behind_s = now_s
        if now_s - self._behind_s < BACKLOG_S:
            return False
        self._stalled = False
        return True

    def _read(self) -> bytes | None:
        """Some bytes; b"" at the end; None when nothing arrived for a while. Uses raw reads, because a thread
        that waits in sys.stdin holds a lock that the interpreter needs to exit."""
        readable = self._readable(POLL_S)
        before_s, self._looked_s = self._looked_s, kit.now_s()
        if before_s is not None and self._looked_s - before_s > STALL_S:
            self._stalled = True
        if not readable:
            self._stalled = False
            return None
        try:
            return os.read(self._fd, MAX_READ)
        except OSError as e:
            raise SourceError(f"{self._name}: {e.strerror or e}") from None

    def _readable(self, within_s: float) -> bool:
        try:
            return bool(select.select([self._fd], [], [], within_s)[0])
        except OSError as e:
            raise SourceError(f"{self._name}: {e.strerror or e}") from None

    def _wait(self, t_s: float, stop: threading.Event) -> None:
        """Wait until `t_s` on the file's clock. If that clock jumps, continue from its new time."""
        now_s = kit.now_s()
        ahead_s = self._start_s + t_s - now_s
        if self._started and t_s < self._before_s:
            self._clock.add(explain_step_back(self._before_s, t_s), "step back")
        self._before_s = t_s
        if not self._started or not -MAX_PAUSE_S <= ahead_s <= MAX_PAUSE_S:
            self._started, self._start_s, ahead_s = True, now_s - t_s, 0.0
        stop.wait(max(0.0, ahead_s))


class LineSplitter:
    """Splits bytes into lines without line ends. Of a line longer than `most` bytes it yields the first
    `most` + 1, enough to recognise it as too long."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._rest = bytearray()
        self._overlong = False  # skipping the rest of a refused line

    def feed(self, chunk: bytes) -> Iterator[bytes]:
        """Yield the lines that end in `chunk`, and the beginning of one that is already too long."""
        first, *others = chunk.split(b"\n")
        self._keep(first)
        for part in others:
            yield from self._complete()
            self._keep(part)
        if len(self._rest) > self._most:
            yield from self._complete()
            self._overlong = True

    def flush(self) -> Iterator[bytes]:
        """Yield the last line if the data did not end with a line end."""
        if self._rest:
            yield from self._complete()

    def _keep(self, part: bytes) -> None:
        if not self._overlong:
            self._rest += part[: self._most + 1 - len(self._rest)]

    def _complete(self) -> Iterator[bytes]:
        if not self._overlong:
            yield bytes(self._rest)
        self._rest.clear()
        self._overlong = False
