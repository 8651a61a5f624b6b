"""Source `trajectory`: rows of angles, played at their rate for ever."""

from __future__ import annotations

import logging
import math
import threading
import time
from pathlib import Path

import pytest
from posecast_edge.profile.reader import ProfileError, parse_profile
from posecast_edge.profile.types import Columns, FieldSpec, Profile, find_column
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.trajectory import MAX_LINE, RowError, TrajectorySource, parse_row
from posecast_edge.sources.registry import open_source

PROFILE = """
[labels]
joint = ["A", "B", "C"]
[[fields]]
name = "ref"
[[fields]]
name = "pos"
[[fields]]
name = "base"
labels = ["base.x", "base.y", "base.z"]
[[fields]]
name = "baseq"
labels = ["base.w", "base.x", "base.y", "base.z"]
[trajectory]
columns = ["B", "-", "A"]
rate_hz = 10
"""


def profile(more: str = "", text: str = PROFILE) -> Profile:
    return parse_profile(text + more)


def source(tmp_path: Path, rows: str, p: Profile | None = None) -> TrajectorySource:
    path = tmp_path / "walk.traj"
    path.write_text(rows)
    opened = open_source(f"trajectory:{path}", p or profile())
    assert isinstance(opened, TrajectorySource)
    return opened


def advance(s: TrajectorySource, elapsed_s: float) -> Sample:
    sample = s.advance(elapsed_s)
    assert sample is not None
    return sample


@pytest.mark.parametrize("line", ["1 -2 3e-1\n", "1,-2,3e-1", " 1;-2;3e-1 ", "1, -2,\t3e-1\r\n"])
def test_separators(line: str) -> None:
    assert parse_row(line, 3) == [1, -2, 0.3]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("1 2", "2 columns, 3 expected"),
        ("1 2 3 4", "4 columns, 3 expected"),
        ("1 nan 3", "column 2: 'nan' is not an angle"),
        ("1 2 -inf", "column 3: '-inf' is not an angle"),
        ("A B C", "column 1: 'A' is not a number"),
        ("1 2 3" + " " * MAX_LINE, f"over {MAX_LINE} characters"),
    ],
)
def test_bad_rows(line: str, reason: str) -> None:
    with pytest.raises(RowError) as e:
        parse_row(line, 3)
    assert str(e.value) == reason


def test_columns_go_to_their_channels_and_an_unnamed_one_nowhere(tmp_path: Path) -> None:
    sample = advance(source(tmp_path, "0.1 9 0.2\n"), 0)
    assert sample.t_s == 0
    assert sample.values == {"ref": [0.2, 0.1, None], "pos": [0.2, 0.1, None]}


def test_rows_come_at_their_instants_the_newest_wins_and_it_loops(tmp_path: Path) -> None:
    s = source(tmp_path, "0 0 0\n0 0 1\n0 0 2\n")
    assert advance(s, 0).values["ref"] == [0, 0, None]
    assert s.advance(0.05) is None
    late = advance(s, 0.25)
    assert (late.t_s, late.values["ref"]) == (0.2, [2, 0, None])
    around = advance(s, 0.4)
    assert (around.t_s, around.values["ref"]) == (0.4, [1, 0, None])
    assert late.values["ref"] == [2, 0, None], "a sample outlives the next row"


def test_pos_lags_as_first_order(tmp_path: Path) -> None:
    s = source(tmp_path, "0 0 0\n" + "0 0 1\n" * 9, profile("lag_s = 0.2"))
    advance(s, 0)
    for k in range(1, 8):
        pos = advance(s, k / 10).values["pos"]
        assert isinstance(pos, list)
        assert pos[0] == pytest.approx(1 - math.exp(-k * 0.1 / 0.2))


def test_degrees_become_radians_metres_stay(tmp_path: Path) -> None:
    text = PROFILE.replace('["B", "-", "A"]', '["A", "base.x", "baseq.w"]')
    sample = advance(source(tmp_path, "180 2 1\n", profile('unit = "deg"', text)), 0)
    assert sample.values["ref"] == [pytest.approx(math.pi), None, None]
    assert sample.values["base"] == [2, None, None]
    assert sample.values["baseq"] == [1, None, None, None]


def test_a_bad_row_is_named_once_skipped_and_its_instant_passes(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    s = source(tmp_path, "0 0 1\n\n0 x 2\n0 0 3\n")
    with caplog.at_level(logging.WARNING):
        samples = [s.advance(k / 10) for k in range(6)]
    values = [None if sample is None else sample.values["ref"][0] for sample in samples]  # type: ignore[index]
    assert values == [1, None, 3, 1, None, 3]
    assert caplog.messages == [f"{tmp_path}/walk.traj:3: column 2: 'x' is not a number; row skipped"]


def test_a_file_may_stop_early_where_the_profile_says_so_and_keeps_to_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    p = profile("fewest = 2", PROFILE.replace('"-"', '"C"'))
    s = source(tmp_path, "1 2\n3 4 5\n", p)
    assert advance(s, 0).values["ref"] == [None, 1, 2]
    with caplog.at_level(logging.WARNING):
        assert s.advance(0.1) is None
    assert "walk.traj:2: 3 columns, 2 expected" in caplog.text
    assert advance(source(tmp_path, "1 2 3\n", p), 0).values["ref"] == [3, 1, 2]


def test_header_lines_are_skipped(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    s = source(tmp_path, "B x A\n1 0 2\n", profile("header = 1"))
    assert advance(s, 0).values["ref"] == [2, 1, None]
    assert caplog.messages == []


def test_an_overlong_line_is_one_bad_row(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    s = source(tmp_path, "1 1 1\n" + "7 " * MAX_LINE + "\n2 2 2\n")
    with caplog.at_level(logging.WARNING):
        assert advance(s, 0.2).values["ref"] == [2, 2, None]
    assert caplog.messages == [f"{tmp_path}/walk.traj:2: over {MAX_LINE} characters; row skipped"]


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ("1 2\n1 2\n", r"no row fits the profile: .*walk\.traj:1: 2 columns, 3 expected"),
        ("a b c\n", r"no row fits the profile: .*walk\.traj:1: column 1: 'a' is not a number"),
        ("", r"walk\.traj: no rows"),
        ("\x00\x01\x02\n" * 5, r"no row fits the profile: .*walk\.traj:1: "),
    ],
)
def test_a_file_without_a_row_that_fits_is_refused(tmp_path: Path, rows: str, reason: str) -> None:
    with pytest.raises(SourceError, match=reason) as e:
        source(tmp_path, rows)
    assert "\n" not in str(e.value)


def test_wrong_configuration_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="give a path"):
        open_source("trajectory", profile())
    with pytest.raises(SourceError, match="No such file"):
        open_source(f"trajectory:{tmp_path}/none", profile())
    with pytest.raises(SourceError, match=r"\[trajectory\] table"):
        open_source(f"trajectory:{tmp_path}/none", None)
    with pytest.raises(ProfileError, match=r"trajectory.columns\[1\]: unknown channel 'base.w'"):
        profile(text=PROFILE.replace('"-"', '"base.w"'))
    with pytest.raises(ProfileError, match=r"trajectory\.fewest: must be an integer from 1 to 3, not 4"):
        profile("fewest = 4")


def test_200_hz_in_real_time(tmp_path: Path) -> None:
    rows = "".join(f"0 0 {k}\n" for k in range(2000))
    s = source(tmp_path, rows, profile(text=PROFILE.replace("rate_hz = 10", "rate_hz = 200")))
    samples: list[tuple[float, Sample]] = []
    stop = threading.Event()
    start_s = time.monotonic()

    def deliver(sample: Sample) -> None:
        samples.append((time.monotonic() - start_s, sample))
        if sample.t_s >= 0.5:
            stop.set()

    thread = threading.Thread(target=s.run, args=(deliver, stop))
    thread.start()
    thread.join(20)
    assert not thread.is_alive()
    times = [sample.t_s for _, sample in samples]
    assert times == sorted(set(times))
    for _, sample in samples:
        ref = sample.values["ref"]
        assert isinstance(ref, list)
        assert ref[0] == pytest.approx(sample.t_s * 200), "the row of its instant"
    assert all(at_s >= sample.t_s - 0.001 for at_s, sample in samples), "never early"


def test_a_byte_order_mark_is_passed_over(tmp_path: Path) -> None:
    marked = advance(source(tmp_path, "\ufeff1 2 3\n"), 0.5)
    assert marked == advance(source(tmp_path, "1 2 3\n"), 0.5)


# --- columns

FIELDS = (
    FieldSpec("pos", "joint", ("A", "B")),
    FieldSpec("ref", "joint", ("A", "C")),
    FieldSpec("baseq", "baseq", ("base.w", "base.x")),
    FieldSpec("ftf", "ftf", ("LF.fz", "RF.fz")),
    FieldSpec("volt", "volt", ("main",)),
)


@pytest.mark.parametrize(
    ("column", "where"),
    [
        ("A", ("ref", 0)),
        ("C", ("ref", 1)),
        ("B", None),  # ref goes before pos
        ("pos.B", ("pos", 1)),
        ("baseq.w", ("baseq", 0)),
        ("baseq.base.x", ("baseq", 1)),
        ("ftf.fz", None),  # of which foot?
        ("ftf.RF.fz", ("ftf", 1)),
        ("volt.main", ("volt", 0)),
        ("volt", ("volt", 0)),
        ("amp.main", None),
        ("", None),
    ],
)
def test_where_a_column_goes(column: str, where: tuple[str, int] | None) -> None:
    assert Columns(FIELDS).find(column) == where
    assert find_column(FIELDS, column) == where
