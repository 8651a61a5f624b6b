"""Source `csv:PATH`: a table of what a robot reported, one row an instant; playback.py says how it is played.

The first row names the columns:

    t                       the robot's clock in seconds; also time, timestamp, stamp; t_ms, time_ns, …
    FIELD.LABEL             `ref.RKN`, `cur.RKN`, `ftf.RF.fz`
    LABEL                   a joint: `pos.LABEL`
    info.NAME               a text that changes rarely
    … [deg]                 a unit after the name is converted: deg, deg/s, mm, mA, mV

Separators are commas, semicolons or tabs; the text is UTF-8, or UTF-16 with its byte order mark. An empty
cell or `nan` is no reading; flags are masks or names with blanks between them. A column without a name is
left out (pandas writes one). A row that does not fit is named and skipped.
"""

from __future__ import annotations

import codecs
import csv
import logging
import math
import re
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from posecast_edge.profile.field_defaults import UNITS
from posecast_edge.rate_limited_log import RateLimitedLog
from posecast_edge.sample import TIME_MAX_S, Reading, Sample, SourceError
from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import EndlessLine, Player, parse_playback, skip_line
from posecast_edge.visible import make_visible

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.csv")

MAX_LINE = 256 * 1024  # characters
MAX_TEXT = 200  # of an info
SEPARATORS = ",;\t"
CLOCK = re.compile(r"(?:__)?(?:t|time|timestamp|stamp)(?:_(s|ms|us|ns))?", re.IGNORECASE)
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
MASK_DIGITS = 18  # of a mask: the widest has 28 bits
TO_OURS = {"deg": math.pi / 180, "deg/s": math.pi / 180, "mm": 1e-3, "mA": 1e-3, "mV": 1e-3}
JOINTS = "pos"
INFO, FLAGS = "info", "flags"


class CellError(ValueError):
    """A row that can't be turned into a sample; the text gives the reason."""


@dataclass(frozen=True)
class Column:
    """The field and label that a column belongs to. `gain`: factor from the column's unit to the field's."""

    index: int
    field: str
    label: str
    gain: float = 1.0
    bits: bool = False


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a file. Raises SourceError without a path, a time column or at least one column that is known."""
    playback = parse_playback("csv", address)
    return Player(Table(playback.path, profile), playback)


class Table:
    """A CSV file that is read while it plays and never held in memory."""

    def __init__(self, path: Path, profile: Profile | None) -> None:
        self.description = f"csv {path.name}"
        self._path = path
        self._bits = {f.name for f in profile.fields if f.bits} if profile else {FLAGS}
        self._bad = RateLimitedLog(log.warning, "bad rows")
        with self._open() as file:
            head = next(self._lines(file), None)
        if head is None:
            raise SourceError(f"{path}: empty")
        self._separator = max(SEPARATORS, key=head[1].count)
        try:
            self._names = self._cells(head[1])
        except CellError as e:
            raise SourceError(f"{path}:{head[0]}: {e}") from None
        self._clock, self._clock_s = self._find_clock()
        self._columns = self._find_columns()

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Read the file once; see Recording."""
        began_s: float | None = None
        begun = start_s == 0
        with self._open() as file:
            lines = self._lines(file)
            next(lines, None)
            for number, line in lines:
                try:
                    sample = self._sample(line, f"{self._path}:{number}")
                except CellError as e:
                    if first_pass:
                        self._bad.add(f"{self._path}:{number}: {e}; row skipped", time.monotonic())
                    continue
                if began_s is None:
                    began_s = sample.t_s
                begun = begun or sample.t_s - began_s >= start_s
                if begun:
                    yield sample
        self._bad.flush(time.monotonic())

    def _open(self) -> TextIO:
        try:
            with open(self._path, "rb") as file:
                # spreadsheets and PowerShell write UTF-16, and always with its mark
                utf16 = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
            encoding = "utf-16" if utf16 else "utf-8-sig"
            return open(self._path, encoding=encoding, errors="replace", newline="")
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None

    def _lines(self, file: TextIO) -> Iterator[tuple[int, str]]:
        """Lines that say something, with their number."""
        number = 0
        try:
            while line := file.readline(MAX_LINE + 1):
                number += 1
                if len(line) > MAX_LINE and not line.endswith(("\n", "\r")):
                    skip_line(file, MAX_LINE)
                if line.strip():
                    yield number, line
        except OSError as e:
            raise SourceError(f"{self._path}:{number + 1}: {e.strerror or e}") from None
        except EndlessLine as e:
            raise SourceError(f"{self._path}:{number}: {e}") from None

    def _cells(self, line: str) -> list[str]:
        if len(line) > MAX_LINE:
            raise CellError(f"over {MAX_LINE} characters")
        try:
            (cells,) = csv.reader([line.rstrip("\r\n")], delimiter=self._separator, skipinitialspace=True)
        except csv.Error as e:
            raise CellError(str(e)) from None
        return [cell.strip() for cell in cells]

    def _find_clock(self) -> tuple[int, float]:
        for i, name in enumerate(self._names):
            if found := CLOCK.fullmatch(name):
                return i, SECONDS[found[1] or "s"]
        shown = ", ".join(repr(name[:40]) for name in self._names[:6])
        raise SourceError(f"{self._path}:1: no column `t` (or time, timestamp, t_ms, …) among {shown}")

    def _find_columns(self) -> list[Column]:
        columns: list[Column] = []
        taken: set[tuple[str, str]] = set()
        for i, name in enumerate(self._names):
            if not name or CLOCK.fullmatch(name):
                continue
            said, unit = _parted(name)
            if unit is not None and unit not in TO_OURS and unit not in UNITS:
                raise SourceError(f"{self._path}:1: column {i + 1}: unknown unit {unit[:40]!r}")
            field, _, label = said.partition(".")
            if not label:
                field, label = JOINTS, said
            if (field, label) in taken:
                twice = make_visible(f"{field}.{label}", 80)
                raise SourceError(f"{self._path}:1: column {i + 1}: {twice} stands there twice")
            taken.add((field, label))
            columns.append(Column(i, field, label, TO_OURS.get(unit or "", 1.0), field in self._bits))
        if not any(c.field != INFO for c in columns):
            raise SourceError(f"{self._path}:1: nothing but a clock")
        return columns

    def _sample(self, line: str, where: str) -> Sample:
        cells = self._cells(line)
        if len(cells) != len(self._names):
            raise CellError(f"{len(cells)} columns, {len(self._names)} expected")
        t_s = _number(cells, self._clock)
        if t_s is None or abs(t_s * self._clock_s) > TIME_MAX_S:
            raise CellError(f"column {self._clock + 1}: no time")
        values: dict[str, dict[str, Reading]] = {}
        info: dict[str, str] = {}
        for column in self._columns:
            cell = cells[column.index]
            if column.field == INFO:
                info[column.label] = cell[:MAX_TEXT]
            elif column.bits:
                values.setdefault(column.field, {})[column.label] = _bits(cells, column.index)
            else:
                value = _number(cells, column.index)
                values.setdefault(column.field, {})[column.label] = (
                    None if value is None else value * column.gain
                )
        return Sample(t_s * self._clock_s, values, info, where)


def _parted(name: str) -> tuple[str, str | None]:
    """`name [unit]` → name and unit; None without one."""
    at = name.find("[", name.rfind("]", 0, len(name) - 1) + 1)
    if at < 0 or not name.endswith("]"):
        return name, None
    return name[:at].rstrip(), name[at + 1 : -1].strip()


def _number(cells: Sequence[str], i: int) -> float | None:
    """A finite number, or None for an empty cell, nan and inf. CellError for anything else."""
    cell = cells[i]
    if not cell:
        return None
    try:
        value = float(cell)
    except ValueError:
        raise CellError(f"column {i + 1}: {cell[:40]!r} is not a number") from None
    return value if math.isfinite(value) else None


def _bits(cells: Sequence[str], i: int) -> Reading:
    """A mask, names, or None for an empty cell. CellError for a mask without end."""
    cell = cells[i]
    if not cell:
        return None
    if not (cell.isascii() and cell.isdigit()):
        return cell.split()
    if len(cell) > MASK_DIGITS:
        raise CellError(f"column {i + 1}: {cell[:40]!r} is no mask")
    return int(cell)
