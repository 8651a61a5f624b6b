"""Writes the past as CSV: a row a frame, a column a channel, as spreadsheets and pandas read it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from decimal import Decimal
from typing import BinaryIO

from posecast_wire import Schema
from posecast_wire.schema import MISSING, Field

from posecast_relay.export.table import TableReader, TableRow

BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # by which Excel knows UTF-8
FIRST_COLUMNS = ("time", "seconds", "robot_time")
STEP_DIGITS_MAX = 6  # of a step that counts: one like 1/30 has no end
NONE_SET = "0"  # no bit is set; an empty cell is no reading
# Where a formula could begin. Some spreadsheets split lines at `;`, a tab or a sign of the user's choice,
# whatever is quoted, and in East Asia a wide `=` is one too. So every sign counts, except inside a name.
FORMULA = re.compile(r"(?<![\w.()\[\]{}<>=+\-@＝＋－＠])[=+\-@＝＋－＠]")

COLUMNS_MAX = 1 << 16  # of all schemas together; a schema has 4,096 channels at most

Column = tuple[str, str, str]  # field, label, unit


class TooManyColumnsError(ValueError):
    """The schemas of a table differ so much that no header holds the columns of all; one line."""


def write_csv(file: BinaryIO, table: TableReader) -> int:
    """Write the rows of a table and return how many there are; see docs/how-to/record/csv.md.

    Several schemas share one header: the columns of the first, then what each later one adds. A channel
    whose unit changes has a column for each unit. Raises OSError, TooManyColumnsError.
    """
    columns: dict[Column, int] = {}
    for schema in table.schemas.values():
        for column in _list_columns(schema):
            columns.setdefault(column, len(columns))
    if len(columns) > COLUMNS_MAX:
        raise TooManyColumnsError(
            f"{len(table.schemas)} schemas with {len(columns)} columns, {COLUMNS_MAX} allowed: "
            "take a shorter span"
        )
    header = [*FIRST_COLUMNS, *(_name_column(column) for column in columns)]
    file.write(BYTE_ORDER_MARK + _join(map(quote_cell, header)))
    writers: dict[str, _RowWriter] = {}
    began_ms: int | None = None
    count = 0
    for row in table.read():
        if not isinstance(row, TableRow):
            continue
        if row.schema not in writers:
            writers[row.schema] = _RowWriter(row.parsed, columns)
        unix_ms = row.unix_us // 1000
        began_ms = unix_ms if began_ms is None else began_ms
        first = (write_time(unix_ms), f"{(unix_ms - began_ms) / 1000:.3f}", f"{row.robot_s:.3f}")
        file.write(_join(itertools.chain(first, writers[row.schema].write(row.codes))))
        count += 1
    return count


def write_time(unix_ms: int) -> str:
    """ISO 8601 in UTC with milliseconds; up to the year 9999."""
    seconds, ms = divmod(unix_ms, 1000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{ms:03}Z"


def count_decimals(step: float) -> int:
    """How many decimals a number needs whose step this is: those of the step itself, of which six digits
    count."""
    _, digits, exponent = Decimal(repr(step)).normalize().as_tuple()
    first = len(digits) - 1 + int(exponent)  # place of the first digit: 0 is the ones'
    return max(0, min(len(digits) - 1, STEP_DIGITS_MAX - 1) - first)


def quote_cell(text: str) -> str:
    """A text as a cell. What a spreadsheet could take for a formula has a `'` in front of it."""
    text = FORMULA.sub(r"'\g<0>", text)
    if any(sign in text for sign in ',"\r\n'):
        return '"' + text.replace('"', '""') + '"'
    return text


def join_bits(names: Iterable[str]) -> str:
    """The names of set bits, with `|` between; `|` and `\\` in a name have a `\\` before them."""
    return "|".join(name.replace("\\", "\\\\").replace("|", "\\|") for name in names) or NONE_SET


class _RowWriter:
    """Writes rows of one schema. A cell whose code stands still is written once."""

    def __init__(self, schema: Schema, columns: dict[Column, int]) -> None:
        self._places = [columns[column] for column in _list_columns(schema)]
        self._cells = [""] * len(columns)
        self._codes: tuple[int, ...] = (MISSING,) * schema.size
        self._fields: list[tuple[Field, int]] = []
        for f in schema.fields:
            self._fields += [(f, count_decimals(f.scale))] * f.size

    def write(self, codes: tuple[int, ...]) -> list[str]:
        """The cells behind the first columns; always the same list."""
        cells = self._cells
        for i, (code, last) in enumerate(zip(codes, self._codes, strict=True)):
            if code != last:
                cells[self._places[i]] = self._write_cell(i, code)
        self._codes = codes
        return cells

    def _write_cell(self, i: int, code: int) -> str:
        if code == MISSING:
            return ""
        f, decimals = self._fields[i]
        if f.bits:
            return quote_cell(join_bits(f.bits_set(code)))
        return f"{code * f.scale:.{decimals}f}"


def _list_columns(schema: Schema) -> list[Column]:
    find_unit = schema.mapping.find_unit
    return [(f.name, label, find_unit(f.name, label) or f.unit) for f in schema.fields for label in f.labels]


def _name_column(column: Column) -> str:
    field, label, unit = column
    return f"{field}.{label} [{unit}]" if unit else f"{field}.{label}"


def _join(cells: Iterable[str]) -> bytes:
    return (",".join(cells) + "\r\n").encode()
