"""Source `jsonl`: one JSON object a line, the way any program in any language joins.

    {"t": 12.3, "pos": {"RKN": 0.5}, "cur": [0.1, 0.2], "flags": {"RKN": ["jam"]}, "info": {"mode": "x"}}

`jsonl` reads stdin, `jsonl:PATH` a file or FIFO. `t` is the robot's clock in seconds; without it the
arrival on the monotonic clock counts. A line that is wrong is named on stderr and skipped. A regular file
plays at the pace of its `t`; a pipe is read as fast as it comes, so the newest line is the newest state. A
FIFO outlives its writer.
"""

from __future__ import annotations

import json
import logging
import os
import select
import stat
import sys
import threading
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from posecast_edge.complaints import Complaints
from posecast_edge.sources import Deliver, Sample, Source, SourceError

if TYPE_CHECKING:
    from posecast_edge.profile import Profile

log = logging.getLogger("posecast_edge.jsonl")

MAX_LINE = 64 * 1024
MAX_INFO = 32  # entries of one line
MAX_INFO_CHARS = 200
MAX_PAUSE_S = 10.0  # between two lines of a file; a longer gap is skipped
MAX_T_S = 1e12  # beyond it milliseconds are lost in a double
POLL_S = 0.2


class LineError(ValueError):
    """A line that is no sample; the text says why."""


def open_source(address: str, profile: Profile | None) -> Source:
    """Open stdin ("") or a path. SourceError when the path cannot be opened."""
    del profile  # labels are matched later, where samples of every source meet the schema
    if not address:
        return JsonlSource(sys.stdin.fileno(), "stdin")
    try:
        # a FIFO opened for writing too does not end when its writer does
        flags = os.O_RDWR if stat.S_ISFIFO(os.stat(address).st_mode) else os.O_RDONLY
        return JsonlSource(os.open(address, flags), address)
    except OSError as e:
        raise SourceError(f"{address}: {e.strerror or e}") from None


class JsonlSource:
    """Reads lines from a file descriptor."""

    def __init__(self, fd: int, name: str) -> None:
        self.description = f"jsonl {name}"
        self._fd = fd
        self._name = name
        self._paced = stat.S_ISREG(os.fstat(fd).st_mode)
        self._started = False
        self._start_s = 0.0  # monotonic time at which the file's clock stood at 0
        self._bad = Complaints(log.warning, "bad lines")

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every good line until the end or `stop`. SourceError when reading fails."""
        for number, line in enumerate(self._lines(stop), start=1):
            if not line.strip():
                continue
            where = f"{self._name} line {number}"
            try:
                sample = parse_line(line, time.monotonic(), where)
            except LineError as e:
                self._bad.add(f"{where}: {e}", time.monotonic())
                continue
            if self._paced:
                self._wait(sample.t_s, stop)
            deliver(sample)
        self._bad.flush(time.monotonic())

    def _lines(self, stop: threading.Event) -> Iterator[bytes]:
        """Lines without their end. Of an overlong line MAX_LINE + 1 bytes come: enough to be refused."""
        rest = b""
        overlong = False
        while not stop.is_set():
            self._bad.tick(time.monotonic())
            chunk = self._read()
            if chunk is None:
                continue
            if not chunk:
                break
            *lines, rest = (rest + chunk).split(b"\n")
            for line in lines:
                if not overlong:
                    yield line[: MAX_LINE + 1]
                overlong = False
            if overlong:
                rest = b""
            elif len(rest) > MAX_LINE:
                yield rest[: MAX_LINE + 1]
                rest, overlong = b"", True
        if rest and not stop.is_set():
            yield rest

    def _read(self) -> bytes | None:
        """Some bytes, b"" at the end, None when nothing came for a while. Raw reads, because a thread that
        waits inside sys.stdin holds a lock the interpreter wants when it ends."""
        try:
            if not select.select([self._fd], [], [], POLL_S)[0]:
                return None
            return os.read(self._fd, MAX_LINE)
        except OSError as e:
            raise SourceError(f"{self._name}: {e.strerror or e}") from None

    def _wait(self, t_s: float, stop: threading.Event) -> None:
        """Until the instant of `t_s` on the file's clock. A clock that jumps is followed from there on."""
        now_s = time.monotonic()
        ahead_s = self._start_s + t_s - now_s
        if not self._started or not -MAX_PAUSE_S <= ahead_s <= MAX_PAUSE_S:
            self._started, self._start_s, ahead_s = True, now_s - t_s, 0.0
        stop.wait(max(0.0, ahead_s))


def parse_line(line: bytes, arrival_s: float, where: str = "") -> Sample:
    """One line → Sample. LineError says what is wrong. NaN and Infinity are "no reading"."""
    if len(line) > MAX_LINE:
        raise LineError(f"over {MAX_LINE} bytes")
    try:
        value = json.loads(line, parse_constant=_no_reading)
    except UnicodeDecodeError:
        raise LineError("not UTF-8") from None
    except RecursionError:
        raise LineError("nested too deep") from None
    except ValueError as e:
        raise LineError(f"not JSON: {e}") from None
    if not isinstance(value, dict):
        raise LineError("not a JSON object")
    t_s = value.pop("t", arrival_s)
    if isinstance(t_s, bool) or not isinstance(t_s, (int, float)) or not abs(t_s) < MAX_T_S:
        raise LineError(f"t is {json.dumps(t_s)[:40]}, not a number of seconds")
    info = _info(value.pop("info", {}))
    for name, values in value.items():
        if not isinstance(values, (list, dict)):
            raise LineError(f"{name} is {json.dumps(values)[:40]}, not a list or an object")
    if not value and not info:
        raise LineError("no field")
    return Sample(float(t_s), value, info, where)


def _no_reading(_token: str) -> None:
    return None


def _info(value: Any) -> dict[str, str]:
    if not isinstance(value, dict):
        raise LineError("info is not an object")
    if len(value) > MAX_INFO:
        raise LineError(f"info has {len(value)} entries; at most {MAX_INFO}")
    info = {}
    for key, text in value.items():
        if not isinstance(text, (str, int, float)):
            raise LineError(f"info.{key} is not a text")
        info[str(key)[:MAX_INFO_CHARS]] = str(text)[:MAX_INFO_CHARS]
    return info
