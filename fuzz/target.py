"""What is fuzzed: a reader of strangers' bytes, what it may answer, and what that may cost."""

from __future__ import annotations

import contextlib
import json
import re
import resource
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
YARD_S = 0.004  # what `walk_a_yard` takes on the machine whose times the targets allow
YARD = json.dumps([{"name": f"joint {i}", "at": [i / 7, i / 3]} for i in range(500)])
SAID_MAX = 2000  # letters of a refusal; a name of 160 takes 960 where none of them can be seen


@dataclass(frozen=True)
class Target:
    """`call` reads a case; it may raise what is in `refuses`, in one line, and nothing else.

    `longest`: bytes of a case that coverage leads to; `stretched`: of one whose cost is looked at. A case may
    take `ms` + `ms_per_kb` of CPU time, instrumented, and more on a slower machine; its process may grow by
    `mb` + `mb_per_kb`.
    `page`: it asks Node. `corpus`: the folder of its cases, where that is another target's; `seeds`: more.
    """

    name: str
    call: Callable[[bytes], object]
    refuses: tuple[type[Exception], ...] = ()
    longest: int = 8192
    stretched: int = 1 << 16
    ms: float = 60.0
    ms_per_kb: float = 10.0
    mb: float = 64.0
    mb_per_kb: float = 2.0
    page: bool = False
    corpus: str = ""
    seeds: tuple[bytes, ...] = ()

    @property
    def folder(self) -> str:
        """Of its cases."""
        return self.corpus or self.name

    def allowed_s(self, size: int) -> float:
        """CPU time that a case of so many bytes may take."""
        return (self.ms + self.ms_per_kb * size / 1024) / 1000


@dataclass(frozen=True)
class Finding:
    """`kind` is the same for what is probably the same fault. `what`: one line."""

    kind: str
    what: str
    detail: str = ""


class Differs(AssertionError):
    """Two readers of the same format made something else of a case."""


class Refused(ValueError):
    """The page's reader refused it. How that is put to people is the page's business."""


class Gone(Exception):
    """A process that reads has died or hangs."""


class TooDear(Exception):
    """A case cost more than its size allows."""


class _Clock:
    """CPU time of this process and of those that it asks."""

    elsewhere_s = 0.0

    def now_s(self) -> float:
        """Seconds since whenever."""
        return time.process_time() + self.elsewhere_s


CLOCK = _Clock()


def spent_s(target: Target, data: bytes) -> float:
    """CPU time of one reading, whatever comes of it."""
    began_s = CLOCK.now_s()
    with contextlib.suppress(Exception):  # what it says is judged elsewhere
        target.call(data)
    return CLOCK.now_s() - began_s


def slowness() -> float:
    """How many times longer work takes here and now than where the allowances were set; at least 1."""
    return max(1.0, max(walk_a_yard() for _ in range(3)) / YARD_S)


def walk_a_yard() -> float:
    """CPU time of work that is always the same."""
    began_s = time.process_time()
    for _ in range(2):
        json.dumps(json.loads(YARD))
    for number in range(20_000):
        str(number).encode()
    return time.process_time() - began_s


def judge(target: Target, data: bytes) -> Finding | None:
    """Read one case; what is wrong with how it was read."""
    peak_kb = _peak_kb()
    began_s = CLOCK.now_s()
    found: Finding | None = None
    try:
        target.call(data)
    except target.refuses as refusal:
        found = _ill_said(refusal)
    except TooDear as e:
        found = Finding("cost", str(e))
    except Exception as e:
        found = _fault(e)
    took_s, allowed_s = CLOCK.now_s() - began_s, target.allowed_s(len(data))
    grown_mb = (_peak_kb() - peak_kb) / 1024
    if found is None and grown_mb > target.mb + target.mb_per_kb * len(data) / 1024:
        found = Finding("memory", f"{grown_mb:.0f} MB for {len(data)} bytes")
    if found is None and took_s > allowed_s:
        took_s = min(took_s, spent_s(target, data), spent_s(target, data))
        if took_s > allowed_s * slowness():
            found = Finding("cost", f"{took_s * 1000:.0f} ms for {len(data)} bytes")
    return found


def _peak_kb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _fault(error: Exception) -> Finding:
    at = _place(error)
    name = type(error).__name__
    told = _printable(" ".join(str(error).split()))
    where = f" in {at}" if at else ""
    kind = f"{name}{where}" if at else f"{name} {_stem(told.partition(': ')[0])}"
    return Finding(kind, f"{name}{where}: {told[:200]}", _printable(_story(error)))


def _place(error: Exception) -> str | None:
    """The innermost line of ours, else of anybody's; None for what the harness itself raises."""
    places = [(frame.f_code.co_filename, line) for frame, line in traceback.walk_tb(error.__traceback__)]
    read = [(file, line) for file, line in places if Path(file).parent not in (HERE, HERE / "targets")]
    ours = [(file, line) for file, line in read if "posecast_" in file]
    if not read:
        return None
    file, line = (ours or read)[-1]
    return f"{'/'.join(Path(file).parts[-2:])}:{line}"


def _story(error: Exception) -> str:
    try:
        return "".join(traceback.format_exception(error, limit=-20))
    except RecursionError:
        return ""


def _ill_said(refusal: Exception) -> Finding | None:
    """A refusal is one line that can be printed, and not endless."""
    said, name = str(refusal), type(refusal).__name__
    if isinstance(refusal, Refused):
        return None
    if not said or len(said) > SAID_MAX:
        return Finding(f"{name} of odd length", f"{name} of {len(said)} letters: {said[:60]!r}")
    if not said.isprintable():
        return Finding(f"{name} unprintable", f"{name} that can't be printed: {_printable(said)[:200]}")
    return None


def _printable(text: str) -> str:
    return text.encode("ascii", "backslashreplace").decode()


def _stem(text: str) -> str:
    """Without what differs from case to case."""
    return re.sub(r"'[^']*'?|\"[^\"]*\"?|[^A-Za-z <>.]", "", text)[:60]
