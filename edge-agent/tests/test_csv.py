"""Source `csv`: a table with named columns."""

from __future__ import annotations

import csv
import logging
import math
import os
from pathlib import Path

import pytest
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.csv import MAX_LINE, Table
from posecast_edge.sources.files.playback import Player
from posecast_edge.sources.registry import open_source


def table(tmp_path: Path, text: str, profile: str = "") -> Table:
    path = tmp_path / "walk.csv"
    path.write_bytes(text.encode())
    return Table(path, parse_profile(profile) if profile else None)


def samples(tmp_path: Path, text: str, start_s: float = 0, profile: str = "") -> list[Sample]:
    return list(table(tmp_path, text, profile).read_samples(start_s, first_pass=True))


def test_columns_go_where_their_names_say(tmp_path: Path) -> None:
    (sample,) = samples(
        tmp_path,
        "t,RKN,ref.RKN,ftf.RF.fz,flags.RKN,info.mode\n1.5,0.1,0.2,310,jam hot,walking\n",
    )
    assert sample == Sample(
        1.5,
        {
            "pos": {"RKN": 0.1},
            "ref": {"RKN": 0.2},
            "ftf": {"RF.fz": 310.0},
            "flags": {"RKN": ["jam", "hot"]},
        },
        {"mode": "walking"},
        f"{tmp_path}/walk.csv:2",
    )


def test_no_reading_and_masks(tmp_path: Path) -> None:
    found = samples(tmp_path, "t,A,B,flags.A\n0,,nan,3\n1,inf,2,\n")
    assert [s.values for s in found] == [
        {"pos": {"A": None, "B": None}, "flags": {"A": 3}},
        {"pos": {"A": None, "B": 2.0}, "flags": {"A": None}},
    ]


def test_a_profile_says_which_fields_are_bits(tmp_path: Path) -> None:
    profile = """
        [labels]
        joint = ["A"]
        [[fields]]
        name = "status"
        labels = "joint"
        bits = ["on"]
    """
    (sample,) = samples(tmp_path, "t,status.A\n0,on\n", profile=profile)
    assert sample.values["status"] == {"A": ["on"]}


@pytest.mark.parametrize(
    ("head", "cell", "t_s"),
    [
        ("t", "2", 2),
        ("time_ms", "2000", 2),
        ("Timestamp_ns", "2e9", 2),
        ("__time", "2", 2),
        ("stamp_us", "5e5", 0.5),
    ],
)
def test_clocks(tmp_path: Path, head: str, cell: str, t_s: float) -> None:
    (sample,) = samples(tmp_path, f"A,{head}\n1,{cell}\n")
    assert sample.t_s == pytest.approx(t_s)
    assert sample.values == {"pos": {"A": 1}}


def test_units_are_converted(tmp_path: Path) -> None:
    (sample,) = samples(tmp_path, "t,A [deg],vel.A[deg/s],cur.A [mA],temp.A [degC]\n0,180,-90,1500,40\n")
    assert sample.values == {
        "pos": {"A": pytest.approx(math.pi)},
        "vel": {"A": pytest.approx(-math.pi / 2)},
        "cur": {"A": 1.5},
        "temp": {"A": 40},
    }


@pytest.mark.parametrize("separator", [",", ";", "\t", "; "])
def test_separators_and_what_spreadsheets_write(tmp_path: Path, separator: str) -> None:
    rows = [["", "t", '"A"'], ["0", "1", "2"], ["1", "2", "3"]]
    text = "\ufeff" + "\r\n".join(separator.join(row) for row in rows)
    assert [(s.t_s, s.values) for s in samples(tmp_path, text)] == [
        (1, {"pos": {"A": 2}}),
        (2, {"pos": {"A": 3}}),
    ]


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_a_byte_order_mark_tells_utf16(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "excel.csv"
    path.write_bytes("\ufefft\tA\r\n1\t2\r\n".encode(encoding))
    (sample,) = Table(path, None).read_samples(0, first_pass=True)
    assert (sample.t_s, sample.values) == (1, {"pos": {"A": 2}})


def test_what_the_standard_library_writes(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, quoting=csv.QUOTE_ALL)
        writer.writerow(["t", "left, hip", "info.mode"])
        writer.writerow([0, 0.25, "up; down"])
    (sample,) = Table(path, None).read_samples(0, first_pass=True)
    assert (sample.values, sample.info) == ({"pos": {"left, hip": 0.25}}, {"mode": "up; down"})


def test_from_a_start(tmp_path: Path) -> None:
    assert [s.t_s for s in samples(tmp_path, "t,A\n10,1\n11,1\n12,1\n", start_s=1)] == [11, 12]


def test_a_bad_row_is_named_in_the_first_pass_and_skipped(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = table(tmp_path, f"t,A\n0,1\nx,2\n1,x\n2\n,5\n3,{'7' * MAX_LINE}\n4,8\n")
    with caplog.at_level(logging.WARNING):
        first = [s.t_s for s in file.read_samples(0, first_pass=True)]
        said = list(caplog.messages)
        second = [s.t_s for s in file.read_samples(0, first_pass=False)]
    assert first == second == [0, 4]
    assert caplog.messages == said
    assert said == [
        f"{tmp_path}/walk.csv:3: column 1: 'x' is not a number; row skipped",
        f"4 more bad rows, the newest: {tmp_path}/walk.csv:7: over {MAX_LINE} characters; row skipped",
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "walk.csv: empty"),
        ("\n\n", "walk.csv: empty"),
        ("A,B\n1,2\n", "walk.csv:1: no column `t` (or time, timestamp, t_ms, …) among 'A', 'B'"),
        ("t\n1\n", "walk.csv:1: nothing but a clock"),
        ("t,info.mode\n1,x\n", "walk.csv:1: nothing but a clock"),
        ("t,A,pos.A\n", "walk.csv:1: column 3: pos.A stands there twice"),
        ("t,A [furlong]\n", "walk.csv:1: column 2: unknown unit 'furlong'"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(SourceError) as e:
        table(tmp_path, text)
    assert str(e.value) == f"{tmp_path}/{reason}"


def test_junk_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_bytes(os.urandom(100_000))
    with pytest.raises(SourceError) as e:
        Table(path, None)
    assert "\n" not in str(e.value)
    with pytest.raises(SourceError, match=r"^.*none\.csv: No such file or directory$"):
        open_source(f"csv:{tmp_path}/none.csv", None)


def test_it_opens_as_a_source(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,A\n0,1\n1,2\n")
    source = open_source(f"csv:{tmp_path}/a.csv?start=1", None)
    assert isinstance(source, Player)
    assert source.description == "csv a.csv"
    assert [s.values for _, s in source.schedule_samples()] == [{"pos": {"A": 2}}]
