"""CSV of the past: read back it is what the wire said."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.export import csv_file
from posecast_relay.export.csv_file import (
    TooManyColumnsError,
    count_decimals,
    join_bits,
    quote_cell,
    write_time,
)
from posecast_relay.export.table import TableReader, TableRow
from posecast_wire import MISSING, build_schema_text

from .export_cases import VECTORS, make_rows, make_schema
from .export_stage import FROM_MS, Named, Take, csv_of, schemas_of

CASES = json.loads(VECTORS.read_text())["cases"]
ROOT = Path(__file__).resolve().parents[2]
UV = ROOT / ".tools" / "bin" / "uv"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_it_is_written_as_the_page_writes_it(case: Mapping[str, Any]) -> None:
    """But for the columns of balance, the last ones, which only the page has."""
    segments = [(str(i), bytes.fromhex(raw)) for i, raw in enumerate(case["segments"])]
    text, table = csv_of(segments, *case["schemas"], from_ms=case["from_ms"], to_ms=case["to_ms"])
    lines = case["csv"].split("\r\n")
    balance = lines[0].count(",balance.")
    wanted = [line.rsplit(",", balance)[0] if balance else line for line in lines]
    assert text.split("\r\n") == wanted
    assert table.losses.describe() == []


@pytest.mark.parametrize(
    ("step", "decimals"),
    [
        *[(1, 0), (0.001, 3), (0.0005, 4), (0.05, 2), (0.25, 2), (2.5, 1), (1e-12, 12), (1e12, 0), (100, 0)],
        *[
            (1 / 3, 6),
            (2 * math.pi / 4096, 8),
            (123456.789, 0),
            (12.5, 1),
            (1e-5, 5),
            (2.5e-7, 8),
            (1.5e22, 0),
        ],
    ],
)
def test_a_number_has_the_digits_of_its_step(step: float, decimals: int) -> None:
    assert count_decimals(step) == decimals


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        *[("", ""), ("jam", "jam"), ("a b", "a b"), ("a,b", '"a,b"'), ('say "x"', '"say ""x"""')],
        *[("=1+1", "'=1+1"), ("+", "'+"), ("-a", "'-a"), ("@x", "'@x"), ("a=1", "a=1")],
        *[("=a,b", '"\'=a,b"'), ("a\nb", '"a\nb"'), ("a\rb", '"a\rb"'), ("＝1", "'＝1"), ("'=1", "''=1")],
        *[("left-knee", "left-knee"), ("무릎-왼쪽", "무릎-왼쪽"), ("s⁻1", "s⁻1"), ("torso.-x", "torso.-x")],
        *[("ratio [-]", "ratio [-]"), ("I<=0", "I<=0"), ("--x", "'--x"), ("a;=-1", "a;'=-1")],
    ],
)
def test_a_cell_is_text_to_every_reader(text: str, cell: str) -> None:
    assert quote_cell(text) == cell
    assert next(csv.reader(io.StringIO(f"{cell},0", newline="")))[0].replace("'", "") == text.replace("'", "")


@pytest.mark.parametrize("separator", [*',;|\t\r\n :^~!#&/\\$%*"', "\x1f", "\xa0", "\u3000", *"，；؛、｜"])
def test_no_separator_makes_a_formula_of_a_text(separator: str) -> None:
    behind = ("{}1", '"{}1,"', " {}1" + separator)
    for sign, text in (
        (sign, f"x{separator}{each.format(sign)}") for sign in "=+-@＝＋－＠" for each in behind
    ):
        cell = quote_cell(text)
        pieces = re.split(r"[\r\n]|" + re.escape(separator), cell)
        assert not [piece for piece in pieces if re.match(rf"[\s\"]*{re.escape(sign)}", piece)], cell
        assert next(csv.reader(io.StringIO(cell, newline="")))[0].replace("'", "") == text.replace("'", "")


def test_bits_can_be_told_apart() -> None:
    assert join_bits(["homed", "jam"]) == "homed|jam"
    assert join_bits(["a|b", "c\\"]) == "a\\|b|c\\\\"
    assert join_bits([]) == "0"


def test_a_moment_is_iso_8601() -> None:
    assert write_time(FROM_MS) == "2026-11-22T14:21:00.112Z"
    assert write_time(0) == "1970-01-01T00:00:00.000Z"


def robot() -> tuple[list[Named], str, list[TableRow]]:
    """A robot's segments, its schema, and its frames as they were decoded."""
    take = Take(make_schema(), segment_frames=20)
    segments = take.record(take.encode(make_rows(take.schema, 60, "csv")))
    read = TableReader(segments, schemas_of(take.schema_text)).read()
    return segments, take.schema_text, [row for row in read if isinstance(row, TableRow)]


def check_cells(names: Sequence[str], table: Sequence[Sequence[str]], rows: Sequence[TableRow]) -> None:
    """Every cell is what the frame says, to a thousandth of its step."""
    assert len(table) == len(rows)
    assert [*names[:3]] == ["time", "seconds", "robot_time"]
    for cells, row in zip(table, rows, strict=True):
        assert float(cells[1]) == pytest.approx((row.unix_us - rows[0].unix_us) / 1e6, abs=1.001e-3)
        assert float(cells[2]) == pytest.approx(row.robot_s, abs=5.01e-4)
        at = 3
        for f in row.parsed.fields:
            for label, code in zip(f.labels, row.codes[f.start : f.start + f.size], strict=True):
                assert names[at].replace("'", "").startswith(f"{f.name}.{label}")
                cell, at = cells[at], at + 1
                if code == MISSING:
                    assert cell in ("", "nan"), names[at - 1]
                elif f.bits:
                    assert cell.replace("'", "") == join_bits(f.bits_set(code))
                else:
                    assert float(cell) == pytest.approx(code * f.scale, abs=f.scale / 1000)


def test_read_back_it_is_what_the_wire_said() -> None:
    segments, text, rows = robot()
    written, _ = csv_of(segments, text)
    assert written.endswith("\r\n")
    names, *table = csv.reader(io.StringIO(written, newline=""))
    check_cells(names, table, rows)


def test_what_a_later_schema_lacks_is_empty() -> None:
    one = build_schema_text("r", {"joint": ["a"]}, [{"name": "pos", "labels": "joint", "unit": "rad"}])
    two = build_schema_text(
        "r",
        {"joint": ["b", "a"]},
        [{"name": "pos", "labels": "joint", "unit": "rad"}, {"name": "cur", "labels": "joint", "unit": "A"}],
    )
    first, second = Take(one), Take(two, take=3, run_id=4, from_ms=FROM_MS + 5000)
    segments = [*first.record(first.encode([[1]])), *second.record(second.encode([[2, 3, 4, 5]]))]
    text, _ = csv_of(segments, one, two)
    assert [line.split(",")[3:] for line in text.split("\r\n")[:-1]] == [
        ["pos.a [rad]", "pos.b [rad]", "cur.b [A]", "cur.a [A]"],
        ["1", "", "", ""],
        ["3", "2", "4", "5"],
    ]


def test_schemas_without_end_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(csv_file, "COLUMNS_MAX", 50)
    segments, text, _ = robot()
    with pytest.raises(TooManyColumnsError) as caught:
        csv_of(segments, text)
    assert str(caught.value) == "1 schemas with 78 columns, 50 allowed: take a shorter span"


def test_nothing_is_a_header() -> None:
    text, _ = csv_of([], build_schema_text("r", {"joint": ["a"]}, [{"name": "pos", "labels": "joint"}]))
    assert text == "time,seconds,robot_time,pos.a\r\n"


PANDAS = """
import sys, pandas
table = pandas.read_csv(sys.argv[1], keep_default_na=False, na_values=[""], parse_dates=["time"])
assert str(table["time"].dtype).startswith("datetime64[") and str(table["time"].dt.tz) == "UTC"
assert (table["time"] - table["time"][0]).dt.total_seconds().sub(table["seconds"]).abs().max() < 1e-6
assert table["pos.lift [rad]"].dtype == float and table["flags.lift"].dtype != float
table.drop(columns="time").to_csv(sys.argv[2], index=False, na_rep="")
"""


@pytest.mark.full
def test_pandas_reads_the_same(tmp_path: Path) -> None:
    segments, text, rows = robot()
    file, back = tmp_path / "past.csv", tmp_path / "back.csv"
    file.write_bytes(("\ufeff" + csv_of(segments, text)[0]).encode())
    uv = str(UV if UV.exists() else shutil.which("uv"))
    made = (uv, "run", "--no-project", "--python", sys.executable, "--with", "pandas==3.1.1", "python", "-c")
    if subprocess.run([*made, "import pandas"], capture_output=True, check=False).returncode:
        pytest.skip("pandas can't be installed here")
    done = subprocess.run([*made, PANDAS, file, back], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names, *table = csv.reader(io.StringIO(back.read_text(), newline=""))
    check_cells(["time", *names], [["", *cells] for cells in table], rows)


@pytest.mark.full
def test_libreoffice_reads_the_same(tmp_path: Path) -> None:
    office = shutil.which("soffice")
    if office is None:
        pytest.skip("LibreOffice is not installed here")
    segments, text, rows = robot()
    (tmp_path / "past.csv").write_bytes(("\ufeff" + csv_of(segments, text)[0]).encode())
    profile = f"-env:UserInstallation={(tmp_path / 'profile').as_uri()}"
    # comma, double quote, UTF-8, first line, and back with every cell as it is stored rather than shown
    read, write = "CSV:44,34,76,1", "csv:Text - txt - csv (StarCalc):44,34,76,1,,0,false,false"
    convert = (office, profile, "--headless", f"--infilter={read}", "--convert-to", write)
    done = subprocess.run(
        [*convert, "--outdir", tmp_path / "back", tmp_path / "past.csv"],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    names, *table = csv.reader(io.StringIO((tmp_path / "back" / "past.csv").read_text(), newline=""))
    check_cells(names, table, rows)
