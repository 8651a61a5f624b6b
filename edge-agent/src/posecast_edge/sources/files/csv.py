"""Source `csv:PATH`: a table of a robot's readings, one row per instant; playback.py plays it.

The first row names the columns; one of them is the robot's clock. A profile's [csv] renames columns; "-"
leaves one out. Separators are commas, semicolons or tabs, the last two also with decimal commas. The text is
UTF-8, or UTF-16 with a byte order mark. An empty or missing cell is no reading, as are `nan`, `NA`, `null`
and the like. Flags are masks, or names separated by spaces or, as Posecast writes them, by `|`. A column of
texts or of an unknown unit is left out. What is invalid is named once: a cell counts as no reading, a row is
skipped. If the clock stands still, rows are played at ROWS_HZ."""

from __future__ import annotations

import codecs
import csv
import itertools
import logging
import math
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from posecast_wire.command_line.installation import name_edge_command

from posecast_edge.kit import PartLog, kind_of, make_visible, many
from posecast_edge.profile.defaults import UNITS, WELL_KNOWN
from posecast_edge.sample import TIME_MAX_S, Reading, Sample, SourceError
from posecast_edge.sources.base import Source
from posecast_edge.sources.files.playback import EndlessLine, Playback, Player, parse_playback, skip_line
from posecast_edge.sources.ros.messages import make_site_name
from posecast_edge.sources.ros.topics import COMMAND

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

log = logging.getLogger("posecast_edge.csv")

MAX_LINE = 256 * 1024  # characters
MAX_TEXT = 200  # of an info
SEPARATORS = ",;\t"
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
        self._renamed = profile.csv if profile else {}
        self._bad = PartLog(log.warning, "bad rows and cells")
        self._left_out: dict[int, str] = {}  # why, by column
        self._read_head()

    def _read_head(self) -> None:
        """Read the first rows. Raises SourceError when they are not a table."""
        with self._open() as file:
            lines = self._lines(file)
            head = next(lines, None)
            self._above = 1  # lines before the first row
            self._separator = ""
            if head is not None and head[1].rstrip()[:-1] == "sep=":  # written by Excel
                self._separator = head[1].rstrip()[-1]
                self._above, head = 2, next(lines, None)
            if head is None:
                raise SourceError(f"{self._path}: empty")
            self._separator = self._separator or max(SEPARATORS, key=head[1].count)
            self._where = f"{self._path}:{head[0]}"
            try:
                self._written = self._cells(head[1])
            except CellError as e:
                raise SourceError(f"{self._where}: {e}") from None
            self._names = [self._renamed.get(name, name) for name in self._written]
            self._exported = self._written[: len(EXPORTED)] == EXPORTED
            rows = self._first_rows(lines)
        missing = [name for name in self._renamed if name not in self._written]
        if missing:
            shown = make_visible(missing[0], NAME_SHOWN)
            log.warning("%s: no column %s, which the profile's [csv] names", self._where, shown)
        self._clock = self._find_clock(rows)
        self._columns = self._find_columns(rows)
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

    def _first_rows(self, lines: Iterator[tuple[int, str]]) -> list[list[str]]:
        rows, chars = [], 0
        for _, line in itertools.islice(lines, LOOK_ROWS):
            chars += len(line)
            if chars > LOOK_CHARS:
                break
            with suppress(CellError):
                rows.append(self._fit(self._cells(line)))
        return rows

    def _fit(self, cells: list[str]) -> list[str]:
        """As many cells as there are columns: missing ones are empty."""
        count = len(self._names)
        return [*cells[:count], *[""] * (count - len(cells))]

    def _stands_still(self, rows: Sequence[Sequence[str]]) -> bool:
        """Whether no time passes in the whole table."""
        times = {row[self._clock.index] for row in rows}
        if len(rows) < 2 or len(times) > 1:
            return False
        with self._open() as file:
            for _, line in itertools.islice(self._lines(file), self._above, None):
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
            if i == self._clock.index:
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
        with self._open() as file:
            lines = self._lines(file)
            for _ in range(self._above):
                next(lines, None)
            for row, (number, line) in enumerate(lines):
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
                # spreadsheets and PowerShell write UTF-16, always with a byte order mark
                utf16 = file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
            encoding = "utf-16" if utf16 else "utf-8-sig"
            return open(self._path, encoding=encoding, errors="replace", newline="")
        except OSError as e:
            raise SourceError(f"{self._path}: {e.strerror or e}") from None

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
            (cells,) = csv.reader([line.rstrip("\r\n")], delimiter=self._separator, skipinitialspace=True)
        except csv.Error as e:
            raise CellError(str(e)) from None
        return [cell.strip() for cell in cells]

    def _find_clock(self, rows: Sequence[Sequence[str]]) -> TableClock:
        clock = find_clock(self._names, rows)
        if clock is None:
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
            if i == self._clock.index:
                continue
            meaning = interpret_column(name, joints, self._known)
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
        if t_s is None or abs(t_s) > TIME_MAX_S:
            raise CellError(f"{self._column(at)}: no time")
        values: dict[str, dict[str, Reading]] = {}
        info: dict[str, str] = {}
        unread = 0
        for column in self._columns:
            meaning = column.meaning
            if meaning.field == INFO:
                info[meaning.label] = cells[column.index][:MAX_TEXT]
                continue
            value: Reading = None
            try:
                if column.bits:
                    value = self._read_bits(cells, column.index)
                else:
                    value = self._number(cells, column.index, meaning.gain)
            except CellError as e:
                bad[str(column.index)] = f"{e}; no reading"
                unread += 1
            values.setdefault(meaning.field, {})[meaning.label] = value
        if unread == len(self._columns) - len(info):
            return None, bad
        return Sample(t_s, values, info, where), bad

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

TO_OURS = {"deg": math.pi / 180, "deg/s": math.pi / 180, "mm": 1e-3, "mA": 1e-3, "mV": 1e-3}
INFO = "info"
UNKNOWN_UNIT = "unknown unit"
JOINTS = "pos"
MEMBERS = {"position": "pos", "velocity": "vel", "effort": "effort"}
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
BATTERY = {"voltage": ("volt", 1.0), "current": ("amp", 1.0), "percentage": ("charge", 100.0)}
KIND_OF = {"quat": "imu", "gyro": "imu", "acc": "imu", "ftf": "wrench", "ftm": "wrench"}


@dataclass(frozen=True)
class ColumnMeaning:
    """The field and label that a column belongs to. `gain`: factor from the column's unit to the field's;
    `unit`: as written in the name."""

    field: str
    label: str
    gain: float = 1.0
    unit: str = ""


def split_unit(name: str) -> tuple[str, str | None]:
    """Split `name [unit]` into name and unit; None without a unit. The index in `name[3]` is not a unit."""
    at = name.find("[", name.rfind("]", 0, len(name) - 1) + 1)
    unit = name[at + 1 : -1].strip()
    if at < 0 or not name.endswith("]") or unit.isdigit():
        return name, None
    return name[:at].rstrip(), unit


def match_joint_name(name: str) -> tuple[str, int] | None:
    """The message and index of a column that holds a joint's name, such as /joint_states/name[3]."""
    parts, _ = _parted(name)
    found = ARRAY.fullmatch(parts[-1])
    return ("/".join(parts[:-1]), _index(found)) if found and found[1] == "name" else None


def interpret_column(
    name: str, joints: Mapping[tuple[str, int], str], known: Collection[tuple[str, str]]
) -> ColumnMeaning | str:
    """The meaning of the column with this name, as common programs write it; or the reason why it is left
    out.

        LABEL, FIELD.LABEL, info.NAME           our own names
        LABEL.velocity, LABEL_velocity          a joint and its quantity; also position, effort
        /joint_states/LABEL/velocity            PlotJuggler
        /joint_states/velocity[3]               PlotJuggler, rqt; the joint's name from /joint_states/name[3]
        field.velocity3                         `rostopic echo -p`; the name from field.name3
        velocity_3, wrench.force.x              bagpy
        /imu/orientation/w, field.wrench.force.x, /odom/pose/pose/position/x, …   other messages

    A unit in brackets may follow. A channel of the profile with exactly this name has priority.

    `joints`: names by message and index; `known`: the (field, label) pairs of a profile.
    """
    if not name:
        return "it has no name"
    bare, unit = split_unit(name)
    if unit is not None and unit not in TO_OURS and unit not in UNITS:
        return f"{UNKNOWN_UNIT} {unit[:40]!r}; known: {', '.join(u for u in (*UNITS, *TO_OURS) if u)}"
    if COUNTER.fullmatch(bare):
        return "it counts rows"
    if HEADER.fullmatch(bare):
        return "it belongs to the message's header"
    field, _, label = bare.partition(".")
    if not label:
        field, label = JOINTS, bare
    gain, unit = TO_OURS.get(unit or "", 1.0), unit or ""
    found = None if (field, label) in known or (JOINTS, bare) in known else _nested(bare, joints)
    if isinstance(found, str):
        return found
    field, label, of_message = found or (field, label, 1.0)
    return ColumnMeaning(field, label, gain * of_message, unit)


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
    ending = ENDING.fullmatch(bare)
    if ending and not is_path and ending[1] not in WELL_KNOWN:
        return MEMBERS[ending[2]], ending[1], 1.0
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

CLOCK = re.compile(r"(?:__|%)?(?:t|time|timestamp|stamp|datetime)(?:_(s|ms|us|ns))?", re.IGNORECASE)
STAMP = re.compile(r"(?:.*[/.])?header[/.]stamp")
UNNAMED = re.compile(r"|index|date|unnamed: 0", re.IGNORECASE)  # where pandas writes a time
UNIT = re.compile(r"(.*\S)\s*[\[(](s|ms|us|µs|ns)[\])]")
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}
ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9})\d*)?)?\s?(?:(Z)|([+-])(\d\d):?(\d\d))?"
)
NUMBER = re.compile(r"[-+]?\d{1,30}(?:[.,]\d{0,30})?(?:[eE][-+]?\d{1,3})?")
# time since 1970 is larger than this: in 1973 for seconds
SINCE_1970 = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
NO_TIME = 1e20  # three thousand years in nanoseconds
STEPS = (("ns", 5e6), ("us", 5e3), ("ms", 5.0))  # from one row to the next, in that unit; a second is 1000 ms


@dataclass(frozen=True)
class TableClock:
    """The column (counted from 0) and its unit, `iso` for ISO 8601. `guessed`: the reason for a guessed unit,
    "" for one that the name states."""

    index: int
    unit: str
    guessed: str = ""

    def convert_cell(self, cell: str, number: float | None) -> float | None:
        """The time in a cell, in seconds; None when it has none. `number`: the cell as a number."""
        if self.unit == "iso":
            return parse_iso_time(cell)
        return None if number is None else number * SECONDS[self.unit]


def find_clock(names: Sequence[str], rows: Sequence[Sequence[str]]) -> TableClock | None:
    """The clock column of a table, and its unit; None if there is none. `rows`: the table's first rows.

    The unit comes from the name (`t_ms`, `time [us]`), from the program that wrote it (`%time` of `rostopic
    echo -p` is nanoseconds), or from the values: ISO 8601, or numbers as large as the time since 1970.
    Otherwise it is seconds, unless the rows would then be too far apart.
    """
    for pattern, only_iso in ((CLOCK, False), (STAMP, False), (UNNAMED, True)):
        for i, name in enumerate(names):
            split = UNIT.fullmatch(name)
            found = pattern.fullmatch(split[1] if split else name)
            cells = [row[i] for row in rows if i < len(row) and row[i]]
            is_iso = bool(cells) and parse_iso_time(cells[0]) is not None
            if not found or (only_iso and not is_iso):
                continue
            if is_iso:
                return TableClock(i, "iso")
            unit = split[2] if split else found[1] if pattern is CLOCK else None
            if unit or name.startswith("%"):
                return TableClock(i, unit.lower() if unit else "ns")
            return TableClock(i, *_guess_unit(cells))
    return None


def _guess_unit(cells: Sequence[str]) -> tuple[str, str]:
    """The unit, and the reason for it; "" for seconds, the default."""
    numbers = (float(cell.replace(",", ".")) for cell in cells if NUMBER.fullmatch(cell))
    times = [number for number in numbers if abs(number) < NO_TIME]
    for unit, least in SINCE_1970:
        if times and min(map(abs, times)) >= least:
            return unit, f"it starts at {times[0]:.4g}"
    steps = sorted(b - a for a, b in itertools.pairwise(times) if b > a)
    for unit, least in STEPS:
        if len(steps) > 1 and steps[len(steps) // 2] >= least:
            return unit, f"its rows are {steps[len(steps) // 2]:.4g} apart"
    return "s", ""


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
