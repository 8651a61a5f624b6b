"""Recordings that once ended an agent, held it up, or filled its memory: told, and left out."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from bag_stage import BEGAN_NS, Bag, joint_state
from mcap.writer import CompressionType
from parser_stage import held_bytes
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.csv import MAX_LINE, Table
from posecast_edge.sources.files.playback import Playback, Player, parse_playback
from posecast_edge.sources.files.ros_recording import RosRecording
from posecast_edge.sources.files.trajectory import TrajectorySource
from posecast_edge.sources.registry import open_source
from recording_parsers import MAGIC, WALKER, channel, chunk, record, schema, text


def table(folder: Path, data: bytes) -> Table:
    (folder / "a.csv").write_bytes(data)
    return Table(folder / "a.csv", None)


def rows(folder: Path, data: bytes) -> list[Sample]:
    return list(table(folder, data).read_samples(0.0, True))


@pytest.mark.parametrize("time", ["1e300", "-1e13", "1e999", "nan"])
def test_a_time_that_no_frame_can_carry_is_a_bad_row(time: str, tmp_path: Path) -> None:
    assert [s.t_s for s in rows(tmp_path, f"t,A\n{time},1\n5,2\n".encode())] == [5.0]


def test_a_clock_that_runs_backwards_leaves_nothing_out(tmp_path: Path) -> None:
    file = table(tmp_path, b"t,A\n3,1\n2,2\n5,3\n1,4\n")
    assert [s.t_s for s in file.read_samples(0.0, True)] == [3.0, 2.0, 5.0, 1.0]
    assert [s.t_s for s in file.read_samples(2.0, True)] == [5.0, 1.0]


@pytest.mark.parametrize("end", ["\n", "\r", "\r\n"])
def test_lines_end_as_they_may(end: str, tmp_path: Path) -> None:
    long = "0," + "1" * MAX_LINE
    found = rows(tmp_path, end.join(["t,A", "0,1", long, "1,2", ""]).encode())
    assert [s.t_s for s in found] == [0.0, 1.0]


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no /dev/zero here")
@pytest.mark.parametrize("kind", ["csv", "trajectory"])
def test_a_line_without_end_is_given_up(kind: str) -> None:
    with pytest.raises(SourceError, match=r"^/dev/zero:1: no end of line within 64 MiB$"):
        open_source(f"{kind}:/dev/zero", WALKER)


def test_a_column_twice_is_named_in_one_line(tmp_path: Path) -> None:
    name = "x" * 5000
    lines = table(tmp_path, f"t,{name},{name}\n".encode()).describe_columns()
    assert max(map(len, lines)) < 300


@pytest.mark.parametrize(
    ("name", "field", "gain"),
    [("a [deg]", "a", 0.017), ("a[b] [mm]", "a[b]", 0.001), ("a [b", "a [b", 1), ("a] [mm]", "a]", 0.001)],
)
def test_units_stand_in_the_last_brackets(name: str, field: str, gain: float, tmp_path: Path) -> None:
    [sample] = rows(tmp_path, f"t,{name}\n0,1\n".encode())
    values = sample.values["pos"]
    assert isinstance(values, dict)
    assert values == {field: pytest.approx(gain, rel=0.03)}


def test_a_loop_takes_time_whatever_its_clock(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(b"t,A\n0,1\n1e-320,2\n")
    player = Player(Table(tmp_path / "a.csv", None), Playback(tmp_path / "a.csv", loop=True))
    due = [due_s for _, (due_s, _) in zip(range(200), player.schedule_samples(), strict=False)]
    assert due[-1] > 0.09


def test_a_path_that_is_none() -> None:
    with pytest.raises(SourceError, match="give a path"):
        parse_playback("csv", "a\0b")


def test_a_trajectory_that_is_emptied_while_it_plays_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.traj"
    path.write_text("1 2 3\n")
    assert WALKER.trajectory is not None
    source = TrajectorySource(path, WALKER, WALKER.trajectory)
    source.advance(0.0)
    path.write_text("")
    with pytest.raises(SourceError, match="the file has no more rows"):
        source.advance(1.0)


# --- MCAP


def played(folder: Path, data: bytes) -> list[Sample]:
    (folder / "a.mcap").write_bytes(data)
    return list(RosRecording(folder / "a.mcap", WALKER).read_samples(0.0, True))


def good(count: int = 3) -> bytes:
    bag = Bag(CompressionType.NONE, 1 << 20)
    for k in range(count):
        t_ns = BEGAN_NS + k * 10**7
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, A=k))
    return bag.finish()


@pytest.mark.parametrize("size", [1 << 28, 1 << 40, (1 << 64) - 1])
@pytest.mark.parametrize("opcode", [3, 4, 5, 6, 9, 0x80])
def test_a_record_that_claims_more_than_there_is(
    size: int, opcode: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    data = MAGIC + struct.pack("<BQ", opcode, size) + bytes(100)
    assert held_bytes(lambda: played(tmp_path, data)) < 8 << 20
    assert "is cut off in the record at byte 8" in caplog.text


def test_a_record_that_is_spoiled_costs_itself(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bad = [record(4, b"\x01\x00\x01\x00\xff\xff\xff\xff"), record(3, b"\0"), record(5, b"\0" * 21)]
    for spoiled in bad:
        caplog.clear()
        found = played(tmp_path, MAGIC + spoiled + good()[len(MAGIC) :])
        assert [s.values["pos"] for s in found] == [{"A": k} for k in range(3)]
        assert "the record at byte 8" in caplog.text


def test_an_attachment_is_passed_over(tmp_path: Path) -> None:
    data = MAGIC + record(9, bytes(60 << 20)) + good()[len(MAGIC) :]
    (tmp_path / "a.mcap").write_bytes(data)
    file = RosRecording(tmp_path / "a.mcap", WALKER)
    assert held_bytes(lambda: list(file.read_samples(0.0, True))) < 4 << 20


def packed_chunk(compression: str, size: int, data: bytes) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, 0) + text(compression)
    return MAGIC + record(6, head + struct.pack("<Q", len(data)) + data)


def zstd_claiming(size: int) -> bytes:
    """A frame of one raw block of a byte that says it holds so many."""
    return b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", size) + b"\x09\0\0x"


CHUNKS = {
    "a claim": (packed_chunk("", 1 << 62, b""), "at most 67108864"),
    "a bomb": (packed_chunk("zstd", 1 << 27, b""), "at most 67108864"),
    "a frame's claim": (packed_chunk("zstd", 1000, zstd_claiming(1 << 40)), "more than 1000 bytes unpacked"),
    "another frame's": (packed_chunk("zstd", 1 << 20, zstd_claiming(1 << 31)), "bytes unpacked"),
    "no frame": (packed_chunk("lz4", 1000, b"x" * 50), "left out"),
    "a record in it": (MAGIC + chunk(struct.pack("<BQ", 5, 1 << 60)), "is incomplete"),
    "nothing in it": (MAGIC + chunk(bytes(9000)), "is incomplete"),
}  # fmt: skip


@pytest.mark.parametrize("case", CHUNKS)
def test_chunks_that_claim(case: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    data, reason = CHUNKS[case]
    assert held_bytes(lambda: played(tmp_path, data + good()[len(MAGIC) :])) < 8 << 20
    assert reason in caplog.text


def test_thousands_of_topics_are_a_few_lines(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    topics = b"".join(channel(i, f"/t{i}/" + "x" * 1000) for i in range(100, 3000))
    (tmp_path / "a.mcap").write_bytes(MAGIC + schema(1) + topics + good()[len(MAGIC) :])
    file = RosRecording(tmp_path / "a.mcap", WALKER)
    assert len(list(file.read_samples(0.0, True))) == 3
    assert len(caplog.messages) == 8
    assert caplog.messages[7].endswith("further ones are not logged")
    assert all(len(line) < 500 for line in caplog.messages)
    assert len(file.topics) <= 2000
