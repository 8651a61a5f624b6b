"""Source `csv`: a table with named columns."""

from __future__ import annotations

import csv
import logging
import math
import os
from pathlib import Path

import pytest
from posecast_edge.cli.probe import run_probe
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.csv import MAX_LINE, ROWS_HZ, Table
from posecast_edge.sources.files.playback import Player
from posecast_edge.sources.registry import open_source
from posecast_wire.command_line.installation import name_edge_command


def table(tmp_path: Path, text: str, profile: str = "") -> Table:
    path = tmp_path / "walk.csv"
    path.write_bytes(text.encode())
    return Table(path, parse_profile(profile) if profile else None)


def samples(tmp_path: Path, text: str, start_s: float = 0, profile: str = "") -> list[Sample]:
    return list(table(tmp_path, text, profile).read_samples(start_s, first_pass=True))


def near(values: dict[str, dict[str, float]]) -> object:
    """Equal to values as they come of a conversion."""
    return {field: pytest.approx(readings) for field, readings in values.items()}


def test_columns_go_where_their_names_say(tmp_path: Path) -> None:
    (sample,) = samples(
        tmp_path, "t,RKN,ref.RKN,ftf.RF.fz,flags.RKN,info.mode\n1.5,0.1,0.2,310,jam hot,walking\n"
    )
    assert sample == Sample(
        1.5,
        {"pos": {"RKN": 0.1}, "ref": {"RKN": 0.2}, "ftf": {"RF.fz": 310.0}, "flags": {"RKN": ["jam", "hot"]}},
        {"mode": "walking"},
        f"{tmp_path}/walk.csv:2",
    )


def test_no_reading_and_masks(tmp_path: Path) -> None:
    found = samples(tmp_path, "t,A,B,flags.A\n0,,nan,3\n1,inf,2,NA\n")
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


RAD_S = math.pi / 180


@pytest.mark.parametrize(
    ("column", "field", "cell", "value"),
    [
        ("A (deg)", "pos", "180", math.pi),
        ("A (degrees)", "pos", "90", math.pi / 2),
        ("A [°]", "pos", "180", math.pi),
        ("A_deg", "pos", "180", math.pi),
        ("A_DEG", "pos", "180", math.pi),
        ("A_rad", "pos", "1.5", 1.5),
        ("A (radians)", "pos", "1.5", 1.5),
        ("A [mrad]", "pos", "1500", 1.5),
        ("A [cm]", "pos", "25", 0.25),
        ("A (mm)", "pos", "25", 0.025),
        ("A.velocity (deg/s)", "vel", "10", 10 * RAD_S),
        ("A_velocity [°/s]", "vel", "10", 10 * RAD_S),
        ("vel.A (rpm)", "vel", "60", math.tau),
        ("A.dq [dps]", "vel", "10", 10 * RAD_S),
        ("A.tau (mNm)", "effort", "1500", 1.5),
        ("effort.A [N]", "effort", "7", 7),
        ("A.current [mA]", "cur", "1500", 1.5),
        ("A.temperature (°C)", "temp", "40", 40),
    ],
)
def test_units_are_known_however_they_are_written(
    tmp_path: Path, column: str, field: str, cell: str, value: float
) -> None:
    (sample,) = samples(tmp_path, f"t,{column}\n0,{cell}\n")
    assert sample.values == near({field: {"A": value}})


def test_sliding_joints_are_known_by_their_unit(tmp_path: Path) -> None:
    (sample,) = samples(tmp_path, "t,lift [cm],knee [deg],rail.velocity [mm/s]\n0,25,180,5\n")
    assert sample.values == near({"pos": {"lift": 0.25, "knee": math.pi}, "vel": {"rail": 0.005}})
    assert sample.sliding == {"lift", "rail"}


@pytest.mark.parametrize("name", ["hand (left)", "link (2)", "(deg)", "A[1]", "foot_m", "deg", "_deg"])
def test_what_only_looks_like_a_unit_stays_in_the_name(tmp_path: Path, name: str) -> None:
    (sample,) = samples(tmp_path, f"t,{name}\n0,1\n")
    assert sample.values == {"pos": {name: 1}}


def test_a_unit_is_that_of_the_profile(tmp_path: Path) -> None:
    profile = """
        [labels]
        joint = ["A", "B_deg"]
        [[fields]]
        name = "pos"
        labels = "joint"
        [[fields]]
        name = "reach"
        labels = "joint"
        unit = "mm"
        scale = 1
    """
    text = "t,A [deg],B_deg,reach.A [m],reach.B_deg\n0,180,3,2,40\n"
    (sample,) = samples(tmp_path, text, profile=profile)
    assert sample.values == near({"pos": {"A": math.pi, "B_deg": 3}, "reach": {"A": 2000, "B_deg": 40}})


@pytest.mark.parametrize(
    ("units", "angle"),
    [
        ("[s],[deg],[N·m]", math.pi),
        ("s,deg,Nm", math.pi),
        ("(s),(deg),(N·m)", math.pi),
        ("sec,degrees,", math.pi),
        (",deg,-", math.pi),
        ("[s],[rad],[Nm]", 180),
    ],
)
def test_a_second_row_may_hold_the_units(tmp_path: Path, units: str, angle: float) -> None:
    first, second = samples(tmp_path, f"t,knee,effort.knee\n{units}\n0,180,1\n1,180,2\n")
    assert first.values == near({"pos": {"knee": angle}, "effort": {"knee": 1}})
    assert second.values["effort"] == {"knee": 2}


@pytest.mark.parametrize("units", ["[ms],[deg]", "ms,deg"])
def test_the_row_of_units_holds_the_clocks_too(tmp_path: Path, units: str) -> None:
    (sample,) = samples(tmp_path, f"time,knee\n{units}\n1500,180\n")
    assert sample.t_s == 1.5


@pytest.mark.parametrize(
    ("head", "row", "t_s"),
    [
        ("sec,nanosec,A", "5,250000000,1", 5.25),
        ("secs,nsecs,A", "5,250000000,1", 5.25),
        ("stamp.sec,stamp.nanosec,A", "5,250000000,1", 5.25),
        ("header.stamp.sec,header.stamp.nanosec,A", "5,250000000,1", 5.25),
        ("/js/header/stamp/sec,/js/header/stamp/nanosec,A", "5,250000000,1", 5.25),
        ("A,Sec,Nanosec", "1,5,250000000", 5.25),
        ("sim_time,A", "5.25,1", 5.25),
        ("elapsed_s,A", "5.25,1", 5.25),
        ("elapsed,A", "5.25,1", 5.25),
        ("time_msec,A", "5250,1", 5.25),
        ("Elapsed Time [ms],A", "5250,1", 5.25),
        ("uptime_ms,A", "5250,1", 5.25),
        ("timestamp_seconds,A", "5.25,1", 5.25),
        ("robot_time,A", "5.25,1", 5.25),
        ("unix_time_ns,A", "5250000000,1", 5.25),
    ],
)
def test_clocks_of_other_programs(tmp_path: Path, head: str, row: str, t_s: float) -> None:
    (sample,) = samples(tmp_path, f"{head}\n{row}\n")
    assert sample.t_s == pytest.approx(t_s)
    assert sample.values == {"pos": {"A": 1}}


@pytest.mark.parametrize(
    "text",
    [
        "t A B\n0 1 2\n1 3 4\n",
        "t  A   B\n0  1   2\n 1  3   4\n",
        "# recorded by hand\nt,A,B\n0,1,2\n# a stop\n1,3,4\n",
        "# t A B\n0 1 2\n1 3 4\n",
        "#t,A,B\n0,1,2\n1,3,4\n",
        "# made by numpy\n# t,A,B\n0,1,2\n1,3,4\n",
        "t,A,B\n# units are radians\n0,1,2\n1,3,4\n",
        "sep=;\nt;A;B\n0;1;2\n1;3;4\n",
        "# t\tA\tB\n0\t1\t2\n1\t3\t4\n",
        "t A B\n-0 1,0 2\n1 3 4\n",
    ],
)
def test_tables_of_other_programs(tmp_path: Path, text: str) -> None:
    found = [(s.t_s, s.values) for s in samples(tmp_path, text)]
    assert found == [(0, {"pos": {"A": 1, "B": 2}}), (1, {"pos": {"A": 3, "B": 4}})]


@pytest.mark.parametrize(
    ("column", "field"),
    [
        ("A.pos", "pos"),
        ("A.q", "pos"),
        ("observation.state.A.pos", "pos"),
        ("action.A.pos", "ref"),
        ("A.vel", "vel"),
        ("A.dq", "vel"),
        ("A.tau", "effort"),
        ("A.torque", "effort"),
        ("A.eff", "effort"),
        ("A.cur", "cur"),
        ("A.temp", "temp"),
    ],
)
def test_motors_as_other_programs_name_them(tmp_path: Path, column: str, field: str) -> None:
    (sample,) = samples(tmp_path, f"t,{column}\n0,1\n")
    assert sample.values == {field: {"A": 1}}


def test_a_reading_counts_for_as_long_as_a_live_topics(tmp_path: Path) -> None:
    text = "t,A,flags.A,info.mode\n0,1,jam,walk\n1,,,\n1.5,,,\n1.6,,,\n2,NA,0,\n2.5,,,stand\n1,,,\n"
    found = samples(tmp_path, text)
    assert [s.values["pos"] for s in found] == [{"A": a} for a in (1, 1, 1, None, None, None, None)]
    jam = ["jam"]
    assert [s.values["flags"] for s in found] == [{"A": a} for a in (jam, jam, jam, None, 0, 0, None)]
    assert [s.info["mode"] for s in found] == [*["walk"] * 5, "stand", "stand"]


def test_in_a_table_of_ours_an_empty_cell_is_no_reading(tmp_path: Path) -> None:
    found = samples(
        tmp_path, "time,seconds,robot_time,A\n2026-11-23T10:00:00Z,0,0,1\n2026-11-23T10:00:01Z,1,1,\n"
    )
    assert [s.values["pos"] for s in found] == [{"A": 1}, {"A": None}]


@pytest.mark.parametrize(
    ("cells", "charges"),
    [("0.8,0.79", [80, 79]), ("80,79", [80, 79]), ("1,0.99", [100, 99]), ("0,98", [0, 98])],
)
def test_a_battery_may_count_to_100(tmp_path: Path, cells: str, charges: list[float]) -> None:
    rows = "".join(f"{t},{cell}\n" for t, cell in enumerate(cells.split(",")))
    found = samples(tmp_path, f"t,/battery/percentage\n{rows}")
    assert [s.values for s in found] == [near({"charge": {"main": charge}}) for charge in charges]


def test_windows_writes_degrees_in_its_own_code_page(tmp_path: Path) -> None:
    path = tmp_path / "walk.csv"
    path.write_bytes("t,Hüfte [°]\n0,180\n".encode("cp1252"))
    (sample,) = Table(path, None).read_samples(0, first_pass=True)
    assert sample.values == near({"pos": {"Hüfte": math.pi}})


def test_a_plots_values_are_no_table_of_joints(tmp_path: Path) -> None:
    head = "elapsed time,receive time,header.stamp,topic,value"
    with pytest.raises(SourceError, match="1: a plot's values, one in each row"):
        table(tmp_path, f"{head}\n0,1,1,/joint_states.position[0],0.5\n")


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
    assert first == second == [0, 2, 4]
    assert caplog.messages == said
    assert said == [
        f"{tmp_path}/walk.csv:3: column 1, t: 'x' is not a number; row skipped",
        f"{tmp_path}/walk.csv:4: column 2, A: 'x' is not a number; no reading",
        f"{tmp_path}/walk.csv:5: 1 cell, 2 expected; the others are no reading",
        f"{tmp_path}/walk.csv:6: column 1, t: no time; row skipped",
        f"{tmp_path}/walk.csv:7: over {MAX_LINE} characters; row skipped",
    ]


def test_a_short_row_and_a_long_one_cost_nothing_else(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = "".join(f"{2 * n},1\n{2 * n + 1},1,2,3,4\n" for n in range(30))
    read = samples(tmp_path, f"t,A,B\n{rows}60,1,2,\n")
    short, long = {"A": 1, "B": None}, {"A": 1, "B": 2}
    assert [s.values["pos"] for s in read] == [short, long] * 30 + [long]
    assert caplog.messages == [
        f"{tmp_path}/walk.csv:2: 2 cells, 3 expected; the others are no reading",
        f"{tmp_path}/walk.csv:3: 5 cells, 3 expected; the last are ignored",
        f"10 more bad rows and cells, the newest: {tmp_path}/walk.csv:13: 5 cells, 3 expected; the last are "
        "ignored",
        f"58 more bad rows and cells, the newest: {tmp_path}/walk.csv:61: 5 cells, 3 expected; the last are "
        "ignored",
    ]


def test_each_bad_column_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    samples(tmp_path, "t,A,B,C\n0,1,2,3\n1,ERR,x,3\n2,1,2,y\n3,ERR,x,y\n")
    assert [text.partition(": ")[2] for text in caplog.messages[:3]] == [
        f"column {i}, {name}: {cell!r} is not a number; no reading"
        for i, name, cell in ((2, "A", "ERR"), (3, "B", "x"), (4, "C", "y"))
    ]


@pytest.mark.parametrize(
    ("column", "of"),
    [
        ("cur.A [foo]", "'foo'"),
        ("B [parsec]", "'parsec'"),
        ("B [A]", "'A' for pos"),
        ("B (rpm)", "'rpm' for pos"),
        ("B [deg/s]", "'deg/s' for pos"),
        ("vel.A [deg]", "'deg' for vel"),
        ("vel.A_deg", "'deg' for vel"),
        ("effort.A [A]", "'A' for effort"),
        ("temp.A [K]", "'K'"),
        ("volt.main [W]", "'W' for volt"),
        ("/joint_states/B/velocity [m]", "'m' for vel"),
    ],
)
def test_a_column_of_a_unit_that_cannot_be_its_own_is_left_out_and_named(
    tmp_path: Path, column: str, of: str, caplog: pytest.LogCaptureFixture
) -> None:
    (sample,) = samples(tmp_path, f"t,A,{column}\n0,1,2\n")
    assert sample.values == {"pos": {"A": 1}}
    assert caplog.messages[0].startswith(
        f"{tmp_path}/walk.csv:1: column 3, {column}: unknown unit {of}; known: rad, deg, m, "
    )
    assert caplog.messages[0].endswith("; column left out")


def test_a_clock_that_stands_still(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    read = samples(tmp_path, "t,A\n" + "5,0.5\n" * 100)
    assert [s.t_s for s in read] == pytest.approx([5 + n / ROWS_HZ for n in range(100)])
    assert caplog.messages == [f"{tmp_path}/walk.csv:1: clock t stands still: rows are played at 20 a second"]
    caplog.clear()
    read = samples(tmp_path, "t,A\n" + "5,0.5\n" * 99 + "6,0.5\n")
    assert [s.t_s for s in read] == [5] * 99 + [6]
    assert samples(tmp_path, "t,A\n5,0.5\n")[0].t_s == 5
    assert caplog.messages == []


def test_flags_as_posecast_exports_them(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "posecast_edge")
    read = samples(tmp_path, "t,flags.A\n0,homed|jam\n1,0\n2,a\\|b|c\\\\\n3,NA\n4,jam hot\n")
    assert [s.values["flags"]["A"] for s in read] == [  # type: ignore[call-overload]
        *(["homed", "jam"], 0, ["a|b", "c\\"], None, ["jam", "hot"])
    ]
    (own,) = samples(
        tmp_path,
        "\ufefftime,seconds,robot_time,pos.A [rad],flags.A\r\n"
        "2026-11-23T10:00:00.000Z,0.000,12.500,0.1,too hot\r\n",
    )
    assert own.values == {"pos": {"A": 0.1}, "flags": {"A": ["too hot"]}}
    assert caplog.messages == []


@pytest.mark.parametrize("cell", ["-1", "1.5", "1e3", "9" * 30])
def test_a_number_that_is_no_mask_names_no_bit(
    tmp_path: Path, cell: str, caplog: pytest.LogCaptureFixture
) -> None:
    (sample,) = samples(tmp_path, f"t,A,flags.A\n0,1,{cell}\n")
    assert sample.values == {"pos": {"A": 1}, "flags": {"A": None}}
    assert caplog.messages == [
        f"{tmp_path}/walk.csv:2: column 3, flags.A: {cell!r} is not a mask; no reading"
    ]


ABSENT = [
    *["NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "-", "--", "nan", "NaN", "inf", "<NA>", "NaT"],
]


@pytest.mark.parametrize("cell", ABSENT)
def test_an_absent_cell_is_no_reading(tmp_path: Path, cell: str, caplog: pytest.LogCaptureFixture) -> None:
    read = samples(
        tmp_path, f"t,A,B,flags.A\n0,1,2,4\n1,{cell},3,{cell if cell != 'inf' else '-'}\n2,4,5,0\n"
    )
    assert [s.values["pos"] for s in read] == [{"A": 1, "B": 2}, {"A": None, "B": 3}, {"A": 4, "B": 5}]
    assert [s.values["flags"]["A"] for s in read] == [4, None, 0]  # type: ignore[call-overload]
    assert caplog.messages == []


@pytest.mark.parametrize("head", ["t,A,B", "t,A [deg],B"])
def test_one_bad_cell_costs_that_cell_only(
    tmp_path: Path, head: str, caplog: pytest.LogCaptureFixture
) -> None:
    read = samples(tmp_path, f"{head}\n0,1,2\n1,ERR,3\n2,\u202e4,5\n3,ERR,ERR\n")
    assert [(s.t_s, s.values["pos"]["B"]) for s in read] == [(0, 2), (1, 3), (2, 5)]  # type: ignore[call-overload]
    assert [s.values["pos"]["A"] for s in read[1:]] == [None, None]  # type: ignore[call-overload]
    name = head.split(",")[1]
    assert caplog.messages == [
        f"{tmp_path}/walk.csv:3: column 2, {name}: 'ERR' is not a number; no reading",
        f"{tmp_path}/walk.csv:5: column 3, B: 'ERR' is not a number; no reading",
        f"2 more bad rows and cells, the newest: {tmp_path}/walk.csv:5: column 2, {name}: "
        "'ERR' is not a number; no reading",
    ]


@pytest.mark.parametrize("cell", ["9" * 30, "9" * 5000])
def test_a_mask_that_is_too_long_costs_its_cell(
    tmp_path: Path, cell: str, caplog: pytest.LogCaptureFixture
) -> None:
    (sample,) = samples(tmp_path, f"t,A,flags.A\n0,1,{cell}\n")
    assert sample.values == {"pos": {"A": 1}, "flags": {"A": None}}
    assert caplog.messages == [
        f"{tmp_path}/walk.csv:2: column 3, flags.A: '{'9' * min(len(cell), 40)}' is not a mask; no reading"
    ]


NO_NAMES = "walk.csv:1: the first row holds numbers: write the columns' names above, such as t,knee"
NO_TEXT = "walk.csv:1: not a table of text: unpack it, or export it as CSV"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "walk.csv: empty"),
        ("\n\n", "walk.csv: empty"),
        ("A,B\n1,2\n", "walk.csv:1: no column `t` (or time, timestamp, t_ms, …) among 'A', 'B'"),
        *((f"{cells}\n{cells}\n", NO_NAMES) for cells in ("1.5,2", "1403636579.7 -0.3 1e-3", "-1;2;5e-3")),
        *(
            (start, NO_TEXT)
            for start in ("PK\x03\x04\x14\0\0,\x08\n", "\x1f\x8b\x08,\0\0\n", "PAR1\x15\x04;\0\n")
        ),
        ("t\n1\n", "walk.csv:1: no column can be read except the clock"),
        ("t,info.mode\n1,x\n", "walk.csv:1: no column can be read except the clock"),
        (
            "t,A [furlong]\n",
            "walk.csv:1: no column can be read except the clock; A [furlong]: unknown unit 'furlong'; "
            "known: rad, deg, m, cm, mm, rad/s, deg/s, rpm, m/s, N·m, N, A, mA, V, mV, W, °C, %",
        ),
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


# --- as programs write them


PLOTJUGGLER = """__time,/joint_states/header/seq,\
/joint_states/left_knee/position,/joint_states/left_knee/velocity,\
/joint_states/left_knee/effort,/joint_states/r_knee/velocity,/joint_commands/left_knee/position,\
/imu/data/orientation/w,/imu/data/angular_velocity/z,/ft/left/wrench/force/z,/odom/pose/pose/position/x,\
/odom/pose/pose/orientation/w,/tf/odom/base/translation/x
1700000000.25,7,0.5,1.5,9,-2,0.75,1,0.25,300,4,1,8
1700000000.26,8,,,,,0.76,,,,,,
"""


def test_what_plotjuggler_exports(tmp_path: Path) -> None:
    first, second = samples(tmp_path, PLOTJUGGLER)
    assert first.t_s == pytest.approx(1700000000.25)
    assert first.values == {
        "pos": {"left_knee": 0.5},
        "vel": {"left_knee": 1.5, "r_knee": -2},
        "effort": {"left_knee": 9},
        "ref": {"left_knee": 0.75},
        "quat": {"imu_data.w": 1},
        "gyro": {"imu_data.z": 0.25},
        "ftf": {"ft_left.fz": 300},
        "base": {"base.x": 4},
        "baseq": {"base.w": 1},
    }
    assert second.values["vel"] == {"left_knee": 1.5, "r_knee": -2}


@pytest.mark.parametrize(
    "head",
    [
        "%time,field.header.seq,field.header.stamp,field.header.frame_id,"
        "field.name0,field.name1,field.position0,field.position1,field.velocity0,field.velocity1",
        "%time,/joint_states/header/seq,/joint_states/header/stamp,/joint_states/header/frame_id,"
        "/joint_states/name[0],/joint_states/name[1],/joint_states/position[0],/joint_states/position[1],"
        "/joint_states/velocity[0],/joint_states/velocity[1]",
        "%time,header.seq,header.stamp.secs,header.frame_id,name_0,name_1,position_0,position_1,velocity_0,velocity_1",
    ],
    ids=["rostopic echo -p", "indices", "bagpy"],
)
def test_arrays_take_their_names_from_the_columns_of_names(tmp_path: Path, head: str) -> None:
    row = "1700000000250000000,7,1700000000250000000,,left_knee,r_knee,0.5,0.25,1,2"
    (sample,) = samples(tmp_path, f"{head}\n{row}\n")
    assert sample.t_s == pytest.approx(1700000000.25, abs=1e-6)
    assert sample.values == {"pos": {"left_knee": 0.5, "r_knee": 0.25}, "vel": {"left_knee": 1, "r_knee": 2}}


def test_arrays_without_names_are_counted(tmp_path: Path) -> None:
    (sample,) = samples(tmp_path, "__time,/joint_states/position[0],/joint_states/position[11]\n5,1,2\n")
    assert sample.values == {"pos": {"joint0": 1, "joint11": 2}}


def test_what_pandas_writes(tmp_path: Path) -> None:
    text = (
        ",left_knee.position,left_knee.velocity,phase\n"
        "2026-11-23 10:00:00.125000+01:00,0.5,1.5,stance\n2026-11-23 10:00:00.250000+01:00,0.6,1.6,swing\n"
    )
    read = table(tmp_path, text)
    found = list(read.read_samples(0, first_pass=True))
    assert [s.t_s for s in found] == [1795424400.125, 1795424400.25]
    assert found[0].values == {"pos": {"left_knee": 0.5}, "vel": {"left_knee": 1.5}}
    assert read.describe_columns() == [
        "(no name)  → the clock, ISO 8601",
        "left_knee.position  → pos of left_knee",
        "left_knee.velocity  → vel of left_knee",
        "phase  left out: it holds texts such as 'stance'; rename it info.NAME to show them",
        'or, in a profile: [csv] "left_knee.position" = "vel.JOINT [deg/s]", or "-" to leave it out',
    ]


def test_what_excel_writes_where_a_comma_is_decimal(tmp_path: Path) -> None:
    text = "\ufeffsep=;\r\nt;RKN [deg];Notiz\r\n0,5;-90,0;\r\n1,5;1e1;\r\n"
    found = samples(tmp_path, text, profile=PROFILE + '[csv]\nNotiz = "-"\n')
    assert [(s.t_s, s.where) for s in found] == [
        (0.5, f"{tmp_path}/walk.csv:3"),
        (1.5, f"{tmp_path}/walk.csv:4"),
    ]
    wanted: object = {"pos": {"RKN": pytest.approx(-math.pi / 2)}}
    assert found[0].values == wanted


PROFILE = '[labels]\njoint = ["RKN", "a_velocity"]\n[[fields]]\nname = "pos"\n[[fields]]\nname = "vel"\n'


def test_a_profile_gives_columns_other_names(tmp_path: Path) -> None:
    profile = PROFILE + '[csv]\nZeit = "t_ms"\n"/x/y" = "vel.RKN [deg/s]"\njunk = "-"\n'
    read = table(tmp_path, "Zeit,/x/y,junk,a_velocity\n1500,180,x,2\n", profile)
    (sample,) = read.read_samples(0, first_pass=True)
    assert sample.t_s == 1.5
    assert sample.values == {"vel": {"RKN": pytest.approx(math.pi)}, "pos": {"a_velocity": 2}}
    assert read.describe_columns()[:4] == [
        "Zeit  → the clock, ms",
        "/x/y  → vel of RKN, converted from deg/s",
        "junk  left out: the profile says so",
        "a_velocity  → pos of a_velocity",
    ]


@pytest.mark.parametrize(
    ("cells", "times_s", "unit"),
    [
        (["1700000000.5", "1700000000.6"], [1700000000.5, 1700000000.6], ""),
        (
            ["1700000000500", "1700000000600"],
            [1700000000.5, 1700000000.6],
            "ms, because it starts at 1.7e+12",
        ),
        (["1700000000500000", "1700000000600000"], [1700000000.5, 1700000000.6], "us"),
        (["1700000000500000000", "1700000000600000000"], [1700000000.5, 1700000000.6], "ns"),
        (["0", "10", "20"], [0, 0.01, 0.02], "ms, because its rows are 10 apart"),
        (["0", "10000", "20000"], [0, 0.01, 0.02], "us"),
        (["0", "1", "2"], [0, 1, 2], ""),
        (["2026-11-23T10:00:00Z", "2026-11-23T10:00:00,5Z"], [1795428000, 1795428000.5], ""),
        (["2026-11-23 10:00", "2026-11-23 10:00:01.123456789"], [1795428000, 1795428001.123456789], ""),
    ],
)
def test_units_of_the_clock_are_guessed_aloud(
    tmp_path: Path, cells: list[str], times_s: list[float], unit: str, caplog: pytest.LogCaptureFixture
) -> None:
    text = "t;A\n" + "".join(f"{cell};1\n" for cell in cells)
    assert [s.t_s for s in samples(tmp_path, text)] == pytest.approx(times_s, abs=1e-6)
    assert [f"clock t seems to be in {unit}" in line for line in caplog.messages] == ([True] if unit else [])


def test_paths_that_nothing_reads_are_left_out_and_said_in_one_line(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO):
        (sample,) = samples(tmp_path, "t,/a/b,/c/data,A,head/trans_x,index\n0,1,2,3,4,5\n")
    assert sample.values == {"pos": {"A": 3, "head/trans_x": 4}}
    assert caplog.messages == [
        f"{tmp_path}/walk.csv:1: columns left out: /a/b, /c/data, index; "
        f"`{name_edge_command('probe')}` tells why"
    ]


def test_a_column_that_only_the_profile_has_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    samples(tmp_path, "t,A\n0,1\n", profile=PROFILE + '[csv]\nB = "RKN"\n')
    assert caplog.messages == [f"{tmp_path}/walk.csv:1: no column B, which the profile's [csv] names"]


def test_two_columns_of_one_channel(tmp_path: Path) -> None:
    read = table(tmp_path, "t,/a/joint_states/A/position,/b/joint_states/A/position\n0,1,2\n")
    assert [s.values for s in read.read_samples(0, first_pass=True)] == [{"pos": {"A": 1}}]
    assert "/b/joint_states/A/position  left out: another column is pos.A" in read.describe_columns()
    read = table(tmp_path, "t,A,pos.A\n0,1,2\n")
    assert [s.values for s in read.read_samples(0, first_pass=True)] == [{"pos": {"A": 1}}]
    assert "pos.A  left out: another column is pos.A" in read.describe_columns()


def test_probe_tells_how_each_column_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text(PLOTJUGGLER)
    assert run_probe([f"csv:{tmp_path}/a.csv"]) == 0
    out = capsys.readouterr().out
    assert "columns:\n  __time  → the clock, s\n" in out
    assert "  /joint_states/header/seq  left out: it counts rows\n" in out
    assert "  /joint_states/left_knee/velocity  → vel of left_knee\n" in out
    assert "  /tf/odom/base/translation/x  left out: this kind of column is not supported\n" in out
