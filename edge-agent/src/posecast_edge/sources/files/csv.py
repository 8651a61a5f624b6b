"""Source `csv:PATH`: a table of a robot's readings, one row per instant; playback.py plays it.

The first row names the columns; one of them is the robot's clock. A profile's [csv] renames columns; "-"
leaves one out. A second row may hold their units. Lines that begin with `#` are comments, unless one is the
first row. Separators are commas, semicolons, tabs or, without any of these, spaces; all but commas also with
decimal commas. The text is UTF-8, Windows-1252 where it is no UTF-8, or UTF-16 with a byte order mark.

Where rows hold the readings of one topic each, the other cells are empty: an empty cell repeats its column's
reading for STREAM_S, as long as a live topic's counts. In tables that Posecast wrote, it is no reading.
`nan`, `NA`, `null` and the like are none anywhere, nor is a missing cell. Flags are masks, or names separated
by spaces or, as Posecast writes them, by `|`. A column of texts is left out, and one of a unit that is
unknown or none of its field's. What is invalid is named once: a cell counts as no reading, a row is skipped.
If the clock stands still, rows are played at ROWS_HZ."""

from __future__ import annotations

import codecs
import csv
import itertools
import logging
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TextIO

from posecast_wire.command_line.installation import name_edge_command

from posecast_edge.kit import PartLog, kind_of, make_visible, many
from posecast_edge.profile.defaults import SLIDING, UNITS, WELL_KNOWN
from posecast_edge.sample import TIME_MAX_S, Reading, Sample, SourceError
from posecast_edge.sources.base import Source
from posecast_edge.sources.clock import guess_time_unit
from posecast_edge.sources.files.playback import EndlessLine, Playback, Player, parse_playback, skip_line
from posecast_edge.sources.merge import STREAM_S
from posecast_edge.sources.ros.messages import SHARE_MOST, make_site_name
from posecast_edge.sources.ros.topics import COMMAND

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.csv")

MAX_LINE = 256 * 1024  # characters
MAX_TEXT = 200  # of an info
SEPARATORS = ",;\t"
COMMENT = "#"
CODE_PAGE = "cp1252"  # of a text that is no UTF-8
SNIFFED = 1 << 16  # bytes, to see whether it is
ROWS_HZ = 20.0  # of a table whose clock stands still
EXPORTED = ["time", "seconds", "robot_time"]  # the first columns of a table that Posecast wrote
NAME_OF_BIT = re.compile(r"(?:[^\\|]|\\.)+")  # in such a table
MASK_DIGITS = 18  # of a mask: the widest has 28 bits
FLAGS = "flags"
LOOK_ROWS = 50  # read at the start, to see what the columns hold
LOOK_CHARS = 1 << 20  # of them in all, about
SKIP = "-"
# what pandas, R, SQL, spreadsheets and Windows write where there is no reading, in lower case
ABSENT = frozenset(
    (
        "",
        *[
            "-",
            "--",
            "nan",
            "na",
            "n/a",
            "#n/a",
            "#na",
            "<na>",
            "nat",
            "null",
            "nil",
            "none",
            "-1.#ind",
            "1.#qnan",
        ],
    )
)
NAME_SHOWN = 80  # characters
COLUMNS_SHOWN = 100


Line = tuple[int, str]  # its number, from 1, and its text


class CellError(ValueError):
    """A row that can't be turned into a sample; the text gives the reason."""


@dataclass(frozen=True)
class Column:
    """A column that is read. `index` counts from 0."""

    index: int
    meaning: ColumnMeaning
    bits: bool = False


def open_source(address: str, profile: Profile | None) -> Source:
    """Open a file. Raises SourceError without a path, a time column, or at least one known column."""
    playback = parse_playback("csv", address)
    return TablePlayer(Table(playback.path, profile), playback)


class TablePlayer(Player):
    """Plays a table and reports how its columns are read (see Tabular)."""

    def __init__(self, table: Table, playback: Playback) -> None:
        super().__init__(table, playback)
        self._table = table

    @property
    def columns(self) -> list[str]:
        """Lines for `probe`: what each column is."""
        return self._table.describe_columns()


class Table:
    """A CSV file that is read while it plays and never held in memory."""

    def __init__(self, path: Path, profile: Profile | None) -> None:
        self.description = f"csv {path.name}"
        self._path = path
        self._bits = {f.name for f in profile.fields if f.bits} if profile else {FLAGS}
        self._known = {(f.name, label) for f in profile.fields for label in f.labels} if profile else set()
        self._units = {f.name: f.unit for f in profile.fields} if profile else {}
        self._renamed = profile.csv if profile else {}
        self._bad = PartLog(log.warning, "bad rows and cells")
        self._left_out: dict[int, str] = {}  # why, by column
        self._read_head()

    def _read_head(self) -> None:
        """Read the first rows. Raises SourceError when they are not a table."""
        with self._open() as file:
            lines = self._lines(file)
            head, first = self._find_head(lines)
            self._head = head[0]  # the number of the last line before the first row
            self._where = f"{self._path}:{head[0]}"
            try:
                self._written = self._cells(head[1])
                units = self._read_units(first)
            except CellError as e:
                raise SourceError(f"{self._where}: {e}") from None
            if units and first is not None:
                pairs = zip(self._written, units, strict=True)
                self._written = [f"{name} [{unit}]" if unit else name for name, unit in pairs]
                self._head, first = first[0], None
            _refuse_plot(self._written, self._where)
            self._names = [self._renamed.get(name, name) for name in self._written]
            self._exported = self._written[: len(EXPORTED)] == EXPORTED
            rows = self._first_rows(itertools.chain([first] if first else [], lines))
        missing = [name for name in self._renamed if name not in self._written]
        if missing:
            shown = make_visible(missing[0], NAME_SHOWN)
            log.warning("%s: no column %s, which the profile's [csv] names", self._where, shown)
        self._clock = self._find_clock(rows)
        self._columns = self._find_columns(rows)
        meanings = [column.meaning for column in self._columns]
        self._sliding = frozenset(each.label for each in meanings if each.is_sliding)
        self._still = self._stands_still(rows)
        if self._still:
            log.warning(
                "%s: clock %s stands still: rows are played at %g a second",
                *(self._where, make_visible(self._written[self._clock.index], NAME_SHOWN), ROWS_HZ),
            )
        if self._left_out:
            named = ", ".join(
                make_visible(self._written[i], NAME_SHOWN) or "''" for i in [*self._left_out][:6]
            )
            more = ", …" if len(self._left_out) > 6 else ""
            probe = name_edge_command("probe")
            log.info("%s: columns left out: %s%s; `%s` tells why", self._where, named, more, probe)

    def _find_head(self, lines: Iterator[tuple[int, str]]) -> tuple[Line, Line | None]:
        """The line with the columns' names, and the next one. Raises SourceError for an empty file."""
        above: Line | None = None  # a comment, which may be the head: numpy writes `# t a b`
        head = next(lines, None)
        self._separator = ""
        if head is not None and head[1].rstrip()[:-1] == "sep=":  # written by Excel
            self._separator = head[1].rstrip()[-1]
            head = next(lines, None)
        while head is not None and head[1].startswith(COMMENT):
            above, head = head, next(lines, None)
        if head is None:
            raise SourceError(f"{self._path}: empty")
        first: Line | None = None
        if above is not None and NUMBER.match(head[1].lstrip(" \"'")):
            head, first = (above[0], above[1].lstrip(COMMENT + " ")), head
        self._separator = self._separator or max(SEPARATORS, key=head[1].count)
        if self._separator not in head[1] and " " in head[1].strip():
            self._separator = " "
        return head, first or next(lines, None)

    def _read_units(self, line: Line | None) -> list[str]:
        """The units of the columns if this line, the one below their names, holds nothing else."""
        if line is None:
            return []
        cells = self._fit_to(self._cells(line[1]), len(self._written))
        units = []
        for cell in cells:
            unit = cell[1:-1].strip() if cell[:1] + cell[-1:] in ("[]", "()") else cell
            # a unit in brackets may be one that nobody knows; a bare word must be known
            if cell not in ("", "-") and unit == cell and find_unit(unit) is None and unit not in SECONDS:
                return []
            units.append("" if unit == "-" else unit)
        return units if any(units) else []

    def _first_rows(self, lines: Iterator[tuple[int, str]]) -> list[list[str]]:
        rows, chars = [], 0
        for _, line in itertools.islice((each for each in lines if each[1][0] != COMMENT), LOOK_ROWS):
            chars += len(line)
            if chars > LOOK_CHARS:
                break
            with suppress(CellError):
                rows.append(self._fit(self._cells(line)))
        return rows

    def _fit(self, cells: list[str]) -> list[str]:
        """As many cells as there are columns: missing ones are empty."""
        return self._fit_to(cells, len(self._names))

    @staticmethod
    def _fit_to(cells: list[str], count: int) -> list[str]:
        return [*cells[:count], *[""] * (count - len(cells))]

    def _stands_still(self, rows: Sequence[Sequence[str]]) -> bool:
        """Whether no time passes in the whole table."""
        times = {row[self._clock.index] for row in rows}
        if len(rows) < 2 or len(times) > 1:
            return False
        with self._open() as file:
            for _, line in self._rows(file):
                with suppress(CellError):
                    times.add(self._fit(self._cells(line))[self._clock.index])
                if len(times) > 1:
                    return False
        return True

    def describe_columns(self) -> list[str]:
        """Say what each column is read as, or why it is left out, a line each."""
        read = {column.index: column.meaning for column in self._columns}
        lines = []
        for i, name in enumerate(self._written[:COLUMNS_SHOWN]):
            if i == self._clock.nanos:
                use = "→ the clock, its nanoseconds"
            elif i == self._clock.index:
                unit = "ISO 8601" if self._clock.unit == "iso" else self._clock.unit
                why = f", because {self._clock.guessed}" if self._clock.guessed else ""
                use = f"→ the clock, {unit}{why}"
            elif i in read:
                meaning = read[i]
                unit = f", converted from {meaning.unit}" if meaning.gain != 1 and meaning.unit else ""
                use = f"→ {meaning.field} of {make_visible(meaning.label, NAME_SHOWN)}{unit}"
            else:
                use = f"left out: {self._left_out.get(i, '')}"
            lines.append(f"{make_visible(name, NAME_SHOWN) or '(no name)'}  {use}")
        if len(self._written) > COLUMNS_SHOWN:
            lines.append(f"and {len(self._written) - COLUMNS_SHOWN} more")
        example = make_visible(
            next((name for i, name in enumerate(self._written) if i in read), ""), NAME_SHOWN
        )
        lines.append(f'or, in a profile: [csv] "{example}" = "vel.JOINT [deg/s]", or "-" to leave it out')
        return lines

    def read_samples(self, start_s: float, first_pass: bool) -> Iterator[Sample]:
        """Read the file once; see Recording."""
        began_s: float | None = None
        begun = start_s == 0
        self._held: dict[int, tuple[float, Reading]] = {}  # time and reading, by column
        self._texts: dict[str, str] = {}
        with self._open() as file:
            for row, (number, line) in enumerate(self._rows(file)):
                where = f"{self._path}:{number}"
                try:
                    sample, bad = self._sample(line, where)
                except CellError as e:
                    if first_pass:
                        self._bad.add(kind_of(str(e)), f"{where}: {e}; row skipped")
                    continue
                for part, why in bad.items() if first_pass else ():
                    self._bad.add(part, f"{where}: {why}")
                if sample is None:
                    continue
                if self._still:
                    sample = sample._replace(t_s=sample.t_s + row / ROWS_HZ)
                if began_s is None:
                    began_s = sample.t_s
                begun = begun or sample.t_s - began_s >= start_s
                if begun:
                    yield sample
        self._bad.flush()

    def _open(self) -> TextIO:
        try:
            with open(self._path, "rb") as file:
                start = file.read(SNIFFED)
            # spreadsheets and PowerShell write UTF-16, always with a byte order mark
            encoding = "utf-16" if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
            if encoding != "utf-16":
                try:
                    codecs.getincrementaldecoder("utf-8")().decode(start)
                except UnicodeDecodeError:
                    encoding = CODE_PAGE
            return open(self._path, encoding=encoding, errors="replace", newline="")
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None

    def _rows(self, file: TextIO) -> Iterator[tuple[int, str]]:
        """The lines below the head, without comments."""
        return (line for line in self._lines(file) if line[0] > self._head and line[1][0] != COMMENT)

    def _lines(self, file: TextIO) -> Iterator[tuple[int, str]]:
        """Non-blank lines, with their number."""
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
            text = line.strip() if self._separator == " " else line.rstrip("\r\n")
            (cells,) = csv.reader([text], delimiter=self._separator, skipinitialspace=True)
        except csv.Error as e:
            raise CellError(str(e)) from None
        return [cell.strip() for cell in cells]

    def _find_clock(self, rows: Sequence[Sequence[str]]) -> TableClock:
        clock = find_clock(self._names, rows)
        if clock is None:
            if not all(name.isprintable() for name in self._names):
                raise SourceError(f"{self._where}: not a table of text: unpack it, or export it as CSV")
            if all(NUMBER.match(name) for name in self._names):
                raise SourceError(
                    f"{self._where}: the first row holds numbers: "
                    "write the columns' names above, such as t,knee"
                )
            shown = ", ".join(repr(name[:40]) for name in self._names[:6])
            raise SourceError(f"{self._where}: no column `t` (or time, timestamp, t_ms, …) among {shown}")
        if clock.guessed:
            name = make_visible(self._written[clock.index], NAME_SHOWN)
            log.warning(
                '%s: clock %s seems to be in %s, because %s; to change it, in a profile: [csv] "%s" = "t_s"',
                *(self._where, name, clock.unit, clock.guessed, name),
            )
        return clock

    def _find_columns(self, rows: Sequence[Sequence[str]]) -> list[Column]:
        joints: dict[tuple[str, int], str] = {}
        for i, name in enumerate(self._names):
            key = match_joint_name(name)
            if key is not None and rows and rows[0][i]:
                joints[key] = rows[0][i]
        columns: list[Column] = []
        taken: set[tuple[str, str]] = set()
        for i, name in enumerate(self._names):
            if i in (self._clock.index, self._clock.nanos):
                continue
            meaning = self._interpret(i, joints, rows)
            if name == SKIP:
                meaning = "the profile says so"
            elif self._exported and i < len(EXPORTED):
                meaning = "it is another clock"
            elif isinstance(meaning, str) and meaning.startswith(UNKNOWN_UNIT):
                self._bad.add(f"unit {i}", f"{self._where}: {self._column(i)}: {meaning}; column left out")
            if isinstance(meaning, ColumnMeaning):
                bits = meaning.field in self._bits
                if (meaning.field, meaning.label) in taken:
                    shown = make_visible(f"{meaning.field}.{meaning.label}", NAME_SHOWN)
                    meaning = f"another column is {shown}"
                elif meaning.field != INFO and not bits and (text := self._find_text(rows, i)):
                    meaning = f"it holds texts such as {text[:40]!r}; rename it info.NAME to show them"
            if isinstance(meaning, str):
                self._left_out[i] = meaning
                continue
            taken.add((meaning.field, meaning.label))
            columns.append(Column(i, meaning, bits))
        if not any(column.meaning.field != INFO for column in columns):
            first = next(((self._names[i], why) for i, why in self._left_out.items() if self._names[i]), None)
            why = f"; {make_visible(first[0], NAME_SHOWN)}: {first[1]}" if first else ""
            raise SourceError(f"{self._where}: no column can be read except the clock{why}")
        return columns

    def _interpret(
        self, i: int, joints: Mapping[tuple[str, int], str], rows: Sequence[Sequence[str]]
    ) -> ColumnMeaning | str:
        meaning = interpret_column(self._names[i], joints, self._known, self._units)
        if isinstance(meaning, str) or meaning.field != "charge" or meaning.unit:
            return meaning
        # some drivers write percent where ROS says 0 to 1
        is_percent = any(_is_over(row[i], SHARE_MOST) for row in rows)
        return replace(meaning, gain=1.0) if is_percent else meaning

    def _find_text(self, rows: Sequence[Sequence[str]], i: int) -> str:
        """A text from a column that holds only texts; "" if it has a number or no cells."""
        texts = [row[i] for row in rows if row[i] and not self._is_number(row, i)]
        return texts[0] if texts and len(texts) == sum(bool(row[i]) for row in rows) else ""

    def _is_number(self, row: Sequence[str], i: int) -> bool:
        try:
            self._number(row, i)
        except CellError:
            return False
        return True

    def _sample(self, line: str, where: str) -> tuple[Sample | None, dict[str, str]]:
        """A row's sample, None if no cell can be read, and what is wrong with some of its parts. Raises
        CellError for a row without a time."""
        bad: dict[str, str] = {}
        given = self._cells(line)
        cells = self._fit(given)
        if len(given) < len(cells):
            bad["short"] = f"{many(len(given), 'cell')}, {len(cells)} expected; the others are no reading"
        elif any(given[len(cells) :]):
            bad["long"] = f"{many(len(given), 'cell')}, {len(cells)} expected; the last are ignored"
        at, clock = self._clock.index, self._clock
        t_s = clock.convert_cell(cells[at], None if clock.unit == "iso" else self._number(cells, at))
        if t_s is not None and clock.nanos is not None:
            t_s += (self._number(cells, clock.nanos) or 0.0) * 1e-9
        if t_s is None or abs(t_s) > TIME_MAX_S:
            raise CellError(f"{self._column(at)}: no time")
        values: dict[str, dict[str, Reading]] = {}
        info: dict[str, str] = {}
        unread = 0
        for column in self._columns:
            meaning = column.meaning
            cell = cells[column.index]
            if meaning.field == INFO:
                text = cell if cell or self._exported else self._texts.get(meaning.label, "")
                self._texts[meaning.label] = info[meaning.label] = text[:MAX_TEXT]
                continue
            value: Reading = None
            held_s, held = self._held.get(column.index, (math.inf, None))
            if not cell and column.index < len(given) and 0 <= t_s - held_s <= STREAM_S:
                values.setdefault(meaning.field, {})[meaning.label] = held
                continue
            try:
                if column.bits:
                    value = self._read_bits(cells, column.index)
                else:
                    value = self._number(cells, column.index, meaning.gain)
            except CellError as e:
                bad[str(column.index)] = f"{e}; no reading"
                unread += 1
            if cell and not self._exported:
                self._held[column.index] = (t_s, value)
            values.setdefault(meaning.field, {})[meaning.label] = value
        if unread == len(self._columns) - len(info):
            return None, bad
        return Sample(t_s, values, info, where, sliding=self._sliding), bad

    def _number(self, cells: Sequence[str], i: int, gain: float = 1.0) -> float | None:
        """A finite number times `gain`; None for an empty cell and the like, nan and inf. CellError for
        anything else."""
        cell = cells[i]
        if cell.lower() in ABSENT:
            return None
        try:
            value = float(cell)
        except ValueError:
            try:
                # a decimal comma, as spreadsheets write it in many countries
                value = float(cell.replace(",", ".")) if self._separator != "," else math.nan
            except ValueError:
                value = math.nan
            if math.isnan(value):
                raise CellError(f"{self._column(i)}: {cell[:40]!r} is not a number") from None
        return value * gain if math.isfinite(value) else None

    def _read_bits(self, cells: Sequence[str], i: int) -> Reading:
        """A mask, names, or None for an empty cell and the like. CellError for a number that is no mask."""
        cell = cells[i]
        if cell.lower() in ABSENT:
            return None
        if cell.isascii() and cell.isdigit() and len(cell) <= MASK_DIGITS:
            return int(cell)
        if self._is_number(cells, i):
            raise CellError(f"{self._column(i)}: {cell[:40]!r} is not a mask")
        if self._exported or "|" in cell:
            return [re.sub(r"\\(.)", r"\1", name.strip()) for name in NAME_OF_BIT.findall(cell)]
        return cell.split()

    def _column(self, i: int) -> str:
        return f"column {i + 1}, {make_visible(self._written[i], NAME_SHOWN)}"


# --- what a column means

DEGREE = math.pi / 180
STANDARD_G = 9.80665  # m/s²
# spelling in lower case → unit, and how many of it one is
WORDS_OF_UNITS: Mapping[str, tuple[str, float]] = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°", "º"), ("rad", DEGREE)),
    **dict.fromkeys(("radian", "radians", "rads"), ("rad", 1.0)),
    "mrad": ("rad", 1e-3),
    **dict.fromkeys(
        ("deg/s", "°/s", "degrees/s", "deg/sec", "dps", "deg/second", "degrees/second"), ("rad/s", DEGREE)
    ),
    **dict.fromkeys(("rad/sec", "rad/second", "radians/s", "rads/s"), ("rad/s", 1.0)),
    **dict.fromkeys(("rpm", "rev/min", "r/min", "1/min"), ("rad/s", math.tau / 60)),
    **dict.fromkeys(("rev/s", "rps"), ("rad/s", math.tau)),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), ("m", 1.0)),
    "cm": ("m", 1e-2),
    "m/sec": ("m/s", 1.0),
    "cm/s": ("m/s", 1e-2),
    "mm/s": ("m/s", 1e-3),
    "g": ("m/s²", STANDARD_G),
    **dict.fromkeys(("n-m", "n.m", "newton meter"), ("N·m", 1.0)),
    **dict.fromkeys(("volt", "volts"), ("V", 1.0)),
    **dict.fromkeys(("amp", "amps", "ampere"), ("A", 1.0)),
    **dict.fromkeys(("celsius", "deg c", "deg.c"), ("°C", 1.0)),
    **dict.fromkeys(("percent", "pct"), ("%", 1.0)),
}
# the same, where capitals matter: mN is no MN
SYMBOLS_OF_UNITS: Mapping[str, tuple[str, float]] = {
    **{spelling: (unit, 1.0) for spelling, unit in UNITS.items() if unit},
    "mm": ("m", 1e-3),
    "mA": ("A", 1e-3),
    "mV": ("V", 1e-3),
    "mW": ("W", 1e-3),
    "mN": ("N", 1e-3),
    "kN": ("N", 1e3),
    **dict.fromkeys(("mNm", "mN·m", "mN*m", "Nmm", "N·mm", "N*mm"), ("N·m", 1e-3)),
    **dict.fromkeys(("cNm", "Ncm", "N·cm"), ("N·m", 1e-2)),
}
OFFERED = (
    "rad",
    "deg",
    "m",
    "cm",
    "mm",
    "rad/s",
    "deg/s",
    "rpm",
    "m/s",
    "N·m",
    "N",
    "A",
    "mA",
    "V",
    "mV",
    "W",
    "°C",
    "%",
)
INFO = "info"
UNKNOWN_UNIT = "unknown unit"
JOINTS = "pos"
MEMBERS = {"position": "pos", "velocity": "vel", "effort": "effort"}
# the last part of `JOINT.pos`, as LeRobot, Unitree and others name what a motor reports
MOTOR_PARTS = {
    **dict.fromkeys(("pos", "q"), "pos"),
    **dict.fromkeys(("vel", "dq"), "vel"),
    **dict.fromkeys(("eff", "tau", "torque"), "effort"),
    **dict.fromkeys(("cur", "current"), "cur"),
    **dict.fromkeys(("temp", "temperature"), "temp"),
}
MOTOR_PART = re.compile(rf"(?:(observation|action)\.)?(?:state\.)?(.+)\.({'|'.join(MOTOR_PARTS)})")
ARRAY = re.compile(r"(name|position|velocity|effort)(?:\[(\d{1,4})\]|[._]?(\d{1,4}))")
ENDING = re.compile(r"(.+)[._](position|velocity|effort)")
COUNTER = re.compile(r"index|unnamed: \d+|(?:.*[/.])?header[/.]seq", re.IGNORECASE)
HEADER = re.compile(r"(?:.*[/.])?header[/.](?:stamp|frame_id).*")
# the last parts of a name → field, prefix of the component's letter
VECTORS: Mapping[tuple[str, ...], tuple[str, str]] = {
    ("pose", "position"): ("base", ""),
    ("pose", "orientation"): ("baseq", ""),
    ("orientation",): ("quat", ""),
    ("angular_velocity",): ("gyro", ""),
    ("linear_acceleration",): ("acc", ""),
    ("wrench", "force"): ("ftf", "f"),
    ("wrench", "torque"): ("ftm", "m"),
}
PERCENT = 100.0
BATTERY = {"voltage": ("volt", 1.0), "current": ("amp", 1.0), "percentage": ("charge", PERCENT)}
KIND_OF = {"quat": "imu", "gyro": "imu", "acc": "imu", "ftf": "wrench", "ftm": "wrench"}


@dataclass(frozen=True)
class ColumnMeaning:
    """The field and label that a column belongs to. `gain`: factor from the column's unit to the field's;
    `unit`: as written in the name; `is_sliding`: it is one that only a sliding joint's reading has."""

    field: str
    label: str
    gain: float = 1.0
    unit: str = ""
    is_sliding: bool = False


def find_unit(text: str) -> tuple[str, float] | None:
    """The unit that a text names, in the profile's spelling, and how many of it one is; None if unknown."""
    return SYMBOLS_OF_UNITS.get(text) or WORDS_OF_UNITS.get(text.lower())


def split_unit(name: str) -> tuple[str, str | None]:
    """Split `name [unit]`, `name (unit)` or `name_deg` into name and unit; None without a unit. What stands
    in parentheses must be a known unit; the index in `name[3]` is none."""
    for opening, closing in ("[]", "()"):
        at = name.rfind(opening)
        unit = name[at + 1 : -1].strip()
        if at > 0 and name.endswith(closing) and (find_unit(unit) or (opening == "[" and not unit.isdigit())):
            return name[:at].rstrip(), unit
    behind = re.fullmatch(r"(.+)_(deg|degrees|rad|radians|rpm)", name, re.IGNORECASE)
    return (behind[1], behind[2]) if behind else (name, None)


def _find_gain(unit: str, field: str, own: str | None) -> tuple[float, bool] | None:
    """What turns readings of this unit into the field's, and whether only a sliding joint has it; None when
    it can't be the field's. `own`: the field's unit in a profile."""
    found = find_unit(unit)
    if found is None:
        return None
    usual = WELL_KNOWN.get(field)
    if own is None and usual is None:
        return found[1], False
    target = find_unit(own) if own else None
    if own is not None and target is None:
        return (1.0, False) if own == unit else None
    base, per = target or (usual.unit if usual else "", 1.0)
    if found[0] == base:
        return found[1] / per, False
    sliding = SLIDING.get(field)
    return (found[1], True) if own is None and sliding is not None and found[0] == sliding.unit else None


def _refuse_plot(names: Sequence[str], where: str) -> None:
    """Raises SourceError for what a plot exports: a row for each value, not one for each instant."""
    if "value" in names and {"topic", "series", "label", "path"} & set(names):
        raise SourceError(
            f"{where}: a plot's values, one in each row, not a table with a column for each joint: save the "
            "recording as MCAP"
        )


def _is_over(cell: str, most: float) -> bool:
    return NUMBER.fullmatch(cell) is not None and float(cell.replace(",", ".")) > most


def match_joint_name(name: str) -> tuple[str, int] | None:
    """The message and index of a column that holds a joint's name, such as /joint_states/name[3]."""
    parts, _ = _parted(name)
    found = ARRAY.fullmatch(parts[-1])
    return ("/".join(parts[:-1]), _index(found)) if found and found[1] == "name" else None


def interpret_column(
    name: str,
    joints: Mapping[tuple[str, int], str],
    known: Collection[tuple[str, str]],
    units: Mapping[str, str] = MappingProxyType({}),
) -> ColumnMeaning | str:
    """The meaning of the column with this name, as common programs write it; or the reason why it is left
    out.

        LABEL, FIELD.LABEL, info.NAME           our own names
        LABEL.velocity, LABEL_velocity          a joint and its quantity; also position, effort
        LABEL.pos, observation.state.LABEL.pos  LeRobot and others; see MOTOR_PARTS; action.LABEL.pos is a ref
        /joint_states/LABEL/velocity            PlotJuggler
        /joint_states/velocity[3]               PlotJuggler, rqt; the joint's name from /joint_states/name[3]
        field.velocity3                         `rostopic echo -p`; the name from field.name3
        velocity_3, wrench.force.x              bagpy
        /imu/orientation/w, field.wrench.force.x, /odom/pose/pose/position/x, …   other messages

    A unit may follow, in brackets, in parentheses, or as `_deg`. A channel of the profile with exactly this
    name has priority.

    `joints`: names by message and index; `known`: a profile's pairs of field and label; `units`: its fields'.
    """
    if not name:
        return "it has no name"
    bare, unit = split_unit(name)
    if (JOINTS, name) in known or tuple(name.split(".", 1)) in known:
        bare, unit = name, None
    if COUNTER.fullmatch(bare) or HEADER.fullmatch(bare):
        return "it counts rows" if COUNTER.fullmatch(bare) else "it belongs to the message's header"
    field, _, label = bare.partition(".")
    if not label:
        field, label = JOINTS, bare
    found = None if (field, label) in known or (JOINTS, bare) in known else _nested(bare, joints)
    if isinstance(found, str):
        return found
    field, label, of_message = found or (field, label, 1.0)
    if not unit:
        return ColumnMeaning(field, label, of_message)
    gain = _find_gain(unit, field, units.get(field))
    if gain is None:
        of = f" for {field}" if find_unit(unit) else ""
        return f"{UNKNOWN_UNIT} {unit[:40]!r}{of}; known: {', '.join(OFFERED)}"
    return ColumnMeaning(field, label, gain[0], unit, gain[1])


def _nested(bare: str, joints: Mapping[tuple[str, int], str]) -> tuple[str, str, float] | str | None:
    """Field, label, gain; or the reason to leave it out; None when it is not a nested name."""
    parts, is_path = _parted(bare)
    found = ARRAY.fullmatch(parts[-1]) if is_path or len(parts) == 1 else None
    if found:
        above = parts[:-1]
        if found[1] == "name":
            return "it names a joint"
        label = joints.get(("/".join(above), _index(found))) or f"joint{_index(found)}"
        return _field(found[1], above), label, 1.0
    if is_path and len(parts) > 1 and parts[-1] in MEMBERS:
        return _field(parts[-1], parts[:-2]), parts[-2], 1.0
    message = parts if is_path else bare.split(".")
    of_message = _member(message, is_path)
    if of_message is not None or bare.startswith(("/", "field.")):
        return of_message or "this kind of column is not supported"
    return None if is_path else _ended(bare)


def _ended(bare: str) -> tuple[str, str, float] | None:
    """Field, label, gain of a joint's quantity, such as `knee_position` or `knee.q`."""
    if (ending := ENDING.fullmatch(bare)) and ending[1] not in WELL_KNOWN:
        return MEMBERS[ending[2]], ending[1], 1.0
    if (motor := MOTOR_PART.fullmatch(bare)) and motor[2] not in WELL_KNOWN:
        field = MOTOR_PARTS[motor[3]]
        return "ref" if motor[1] == "action" and field == "pos" else field, motor[2], 1.0
    return None


def _member(parts: Sequence[str], is_path: bool) -> tuple[str, str, float] | None:
    """A component of a sensor's message."""
    if len(parts) > 1 and parts[-1] in ("x", "y", "z", "w"):
        for ending, (field, letter) in VECTORS.items():
            above = parts[: -1 - len(ending)]
            if tuple(parts[-1 - len(ending) : -1]) == ending:
                site = make_site_name("/".join(above)) or KIND_OF.get(field, "")
                return field, f"{'base' if field.startswith('base') else site}.{letter}{parts[-1]}", 1.0
    if is_path and parts[-1] in BATTERY and len(parts) < 4:
        field, gain = BATTERY[parts[-1]]
        return field, "main", gain
    return None


def _parted(bare: str) -> tuple[list[str], bool]:
    """The parts of a nested name, and whether it is written as one."""
    if bare.startswith("field."):
        return bare.removeprefix("field.").split("."), True
    return (bare.strip("/").split("/"), True) if "/" in bare.strip("/") else ([bare], bare.startswith("/"))


def _index(found: re.Match[str]) -> int:
    return int(found[2] or found[3])


def _field(member: str, topic: Sequence[str]) -> str:
    commanded = bool(topic) and COMMAND.fullmatch(topic[-1]) is not None
    return "ref" if commanded and member == "position" else MEMBERS[member]


# --- the clock

UNITS_OF_TIME = "s|ms|us|ns|sec|secs|seconds|msec|millis|milliseconds|usec|micros|nsec|nanos|nanoseconds"
CLOCK = re.compile(rf"(?:__|%)?(?:t|time|timestamp|stamp|datetime)(?:_({UNITS_OF_TIME}))?", re.IGNORECASE)
OTHER_CLOCK = re.compile(
    r"(?:(?:(?:sim|robot|wall|ros|elapsed|relative|rel|system|unix|epoch|log|receive)[ _]?)"
    rf"(?:t|time|timestamp|stamp)|elapsed|uptime)(?:_({UNITS_OF_TIME}))?",
    re.IGNORECASE,
)
# the seconds' column; the other has the same name before its unit
SECONDS_OF_TWO = re.compile(r"(.*?)(?:secs?|seconds)", re.IGNORECASE)
NANOS_OF_TWO = ("nanosec", "nsec", "nsecs", "nanosecs", "nanoseconds", "nanos")
STAMP = re.compile(r"(?:.*[/.])?header[/.]stamp")
UNNAMED = re.compile(r"|index|date|unnamed: 0", re.IGNORECASE)  # where pandas writes a time
UNIT = re.compile(rf"(.*\S)\s*[\[(]({UNITS_OF_TIME}|µs)[\])]")
SECONDS = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "usec", "micros"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanoseconds"), 1e-9),
}
ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9})\d*)?)?\s?(?:(Z)|([+-])(\d\d):?(\d\d))?"
)
NUMBER = re.compile(r"[-+]?\d{1,30}(?:[.,]\d{0,30})?(?:[eE][-+]?\d{1,3})?")


@dataclass(frozen=True)
class TableClock:
    """The column (counted from 0) and its unit, `iso` for ISO 8601. `guessed`: the reason for a guessed unit,
    "" for one that the name states; `nanos`: the column of its nanoseconds, None if there is none."""

    index: int
    unit: str
    guessed: str = ""
    nanos: int | None = None

    def convert_cell(self, cell: str, number: float | None) -> float | None:
        """The time in a cell, in seconds; None when it has none. `number`: the cell as a number."""
        if self.unit == "iso":
            return parse_iso_time(cell)
        return None if number is None else number * SECONDS[self.unit]


def find_clock(names: Sequence[str], rows: Sequence[Sequence[str]]) -> TableClock | None:
    """The clock column of a table, and its unit; None if there is none. `rows`: the table's first rows.

    The unit comes from the name (`t_ms`, `time [us]`), from the program that wrote it (`%time` of `rostopic
    echo -p` is nanoseconds), or from the values: ISO 8601, or numbers as large as the time since 1970.
    Otherwise it is seconds, unless the rows would then be too far apart. ROS writes seconds and nanoseconds
    as two columns.
    """
    for pattern, only_iso in (
        (CLOCK, False),
        (STAMP, False),
        (None, False),
        (OTHER_CLOCK, False),
        (UNNAMED, True),
    ):
        if pattern is None:
            of_two = _find_two_columns(names)
            if of_two is not None:
                return of_two
            continue
        for i, name in enumerate(names):
            split = UNIT.fullmatch(name)
            found = pattern.fullmatch(split[1] if split else name)
            cells = [row[i] for row in rows if i < len(row) and row[i]]
            is_iso = bool(cells) and parse_iso_time(cells[0]) is not None
            if not found or (only_iso and not is_iso):
                continue
            if is_iso:
                return TableClock(i, "iso")
            unit = split[2] if split else found[1] if pattern in (CLOCK, OTHER_CLOCK) else None
            if unit or name.startswith("%"):
                return TableClock(i, unit.lower() if unit else "ns")
            numbers = [float(cell.replace(",", ".")) for cell in cells if NUMBER.fullmatch(cell)]
            return TableClock(i, *guess_time_unit(numbers, "rows"))
    return None


def _find_two_columns(names: Sequence[str]) -> TableClock | None:
    """The first pair of columns such as `stamp.sec` and `stamp.nanosec`."""
    at = {name.lower(): i for i, name in enumerate(names)}
    for i, name in enumerate(names):
        found = SECONDS_OF_TWO.fullmatch(name.lower())
        pair = [f"{found[1]}{nanos}" for nanos in NANOS_OF_TWO] if found else []
        other = next((at[each] for each in pair if each in at), None)
        if other is not None:
            return TableClock(i, "s", nanos=other)
    return None


def parse_iso_time(cell: str) -> float | None:
    """Parse `2026-11-23T10:00:00.123456789+01:00` to seconds since 1970; None for anything else. Without a
    time zone it is UTC."""
    found = ISO.fullmatch(cell)
    if found is None:
        return None
    year, month, day, hour, minute, second = (int(part or 0) for part in found.groups()[:6])
    try:
        at = datetime(year, month, day, hour, minute, second, tzinfo=timezone.utc)
    except ValueError:
        return None
    if found[9]:
        ahead = timedelta(hours=int(found[10]), minutes=int(found[11]))
        seconds = at.timestamp() - ahead.total_seconds() * (1 if found[9] == "+" else -1)
    else:
        seconds = at.timestamp()
    return seconds + float(f"0.{found[7] or 0}")
