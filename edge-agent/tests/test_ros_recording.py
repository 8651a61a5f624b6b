"""Sources `bag` and `mcap`: bags of ROS 1 and ROS 2 as the library's writers make them, and hostile ones."""

from __future__ import annotations

import bz2
import itertools
import logging
import random
import shutil
import sqlite3
import struct
from pathlib import Path

import pytest
from parser_stage import held_bytes
from posecast_edge.cli.probe import run_probe
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.files.playback import Player
from posecast_edge.sources.registry import open_source
from recording_parsers import ros1_part as part

pytest.importorskip("mcap", reason="the extra [mcap] is not installed")

import bag_stage
from bag_stage import BEGAN_NS, STEP_NS, Words, walk, write_ros1, write_ros2
from posecast_edge.sources.files.ros_recording import RosRecording
from rosbags.rosbag2 import CompressionMode, StoragePlugin

PROFILE = parse_profile(
    '[labels]\njoint = ["A", "B"]\n'
    '[[fields]]\nname = "ref"\n[[fields]]\nname = "pos"\n[[fields]]\nname = "vel"\n'
)


def samples(path: Path, start_s: float = 0.0) -> list[Sample]:
    return list(RosRecording(path, PROFILE).read_samples(start_s, first_pass=True))


def check_walk(found: list[Sample], count: int = 100) -> None:
    assert len(found) == count
    for k, sample in enumerate(found):
        assert sample.t_s == pytest.approx((BEGAN_NS + k * STEP_NS) * 1e-9)
        assert sample.values["pos"] == {"A": k / 100, "B": -k / 100}
        assert sample.values["vel"] == {"A": k / 50, "B": -k / 50}


@pytest.mark.parametrize("compression", ["NONE", "BZ2", "LZ4"])
def test_a_bag_of_ros_1(tmp_path: Path, compression: str) -> None:
    check_walk(samples(write_ros1(tmp_path / "walk.bag", walk(True), compression)))


@pytest.mark.parametrize("kind", ["bag", "mcap"])
@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_the_folder_that_ros2_bag_record_writes(tmp_path: Path, kind: str, plugin: StoragePlugin) -> None:
    folder = write_ros2(tmp_path / "rosbag2_2026", walk(False), plugin)
    assert (folder / "metadata.yaml").exists()
    source = open_source(f"{kind}:{folder}?start=0.5", PROFILE)
    assert isinstance(source, Player)
    assert [s.values["pos"] for _, s in source.schedule_samples()] == [
        {"A": k / 100, "B": -k / 100} for k in range(50, 100)
    ]
    (file,) = (path for path in folder.iterdir() if path.suffix != ".yaml")
    check_walk(samples(file))


def test_files_of_a_folder_play_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    said = walk(False, 120)
    for n in range(12):
        part = write_ros2(tmp_path / f"part{n}", said[10 * n : 10 * n + 10], StoragePlugin.SQLITE3)
        (tmp_path / "all").mkdir(exist_ok=True)
        shutil.copy(next(part.glob("*.db3")), tmp_path / "all" / f"walk_{n}.db3")
    check_walk(samples(tmp_path / "all"), 120)  # without metadata.yaml, as after a power cut


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_messages_that_are_compressed_one_by_one(tmp_path: Path, plugin: StoragePlugin) -> None:
    check_walk(samples(write_ros2(tmp_path / "bag", walk(False), plugin, CompressionMode.MESSAGE)))


def test_files_compressed_as_a_whole_are_refused_with_the_command(tmp_path: Path) -> None:
    folder = write_ros2(tmp_path / "bag", walk(False, 3), StoragePlugin.SQLITE3, CompressionMode.FILE)
    with pytest.raises(SourceError) as e:
        RosRecording(folder, None)
    assert (
        str(e.value) == f"{folder}/bag.db3.zstd: compressed as a whole: unpack it with `zstd -d bag.db3.zstd`"
    )


def test_other_topics_of_ros_1(tmp_path: Path) -> None:
    words, said = Words(True), walk(True, 2)
    vector = {c: words.make("geometry_msgs/msg/Vector3", x=1.0, y=2.0, z=3.0) for c in ("force", "torque")}
    for k in range(2):
        t_ns = BEGAN_NS + k * STEP_NS
        wrench = words.make("geometry_msgs/msg/Wrench", **vector)
        name = "geometry_msgs/msg/WrenchStamped"
        said.insert(
            0, ("/foot", name, t_ns - 1, words.make(name, header=words.header(t_ns, "ankle"), wrench=wrench))
        )
        text = words.make("std_msgs/msg/String", data="<robot/>")
        said.insert(0, ("/robot_description", "std_msgs/msg/String", t_ns - 2, text))
    recording = RosRecording(write_ros1(tmp_path / "a.bag", said), PROFILE)
    given: list[str] = []
    recording.on_urdf = given.append
    last = list(recording.read_samples(0, first_pass=True))[-1]
    assert last.values["ftf"] == {"ankle.fx": 1, "ankle.fy": 2, "ankle.fz": 3}
    assert given == ["<robot/>", "<robot/>"]
    assert recording.topics == {
        "/foot": "geometry_msgs/WrenchStamped → wrench",
        "/joint_states": "sensor_msgs/JointState → pos",
        "/robot_description": "std_msgs/String → description",
    }


def test_a_loop(tmp_path: Path) -> None:
    source = open_source(f"bag:{write_ros1(tmp_path / 'a.bag', walk(True, 3))}?loop", PROFILE)
    assert isinstance(source, Player)
    times = [s.t_s for _, s in itertools.islice(source.schedule_samples(), 7)]
    assert times == pytest.approx([BEGAN_NS * 1e-9 + k / 100 for k in range(7)])


# --- what is wrong with them


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "neither an MCAP file nor a ROS 1 or ROS 2 bag"),
        (b"#ROSBAG V1.2\n", "a bag older than version 2.0: convert it with `rosbag fix`"),
        (b"SQLite format 2\0", "neither an MCAP file nor a ROS 1 or ROS 2 bag"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes, reason: str) -> None:
    (tmp_path / "a.bag").write_bytes(content)
    with pytest.raises(SourceError) as e:
        open_source(f"bag:{tmp_path}/a.bag", None)
    assert str(e.value) == f"{tmp_path}/a.bag: {reason}"


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SourceError) as e:
        open_source(f"bag:{tmp_path}", None)
    assert str(e.value) == f"{tmp_path}: no recording in this folder (.mcap, .db3 or .bag)"
    with pytest.raises(SourceError, match=r"^bag: give a path, such as bag:walk\.bag$"):
        open_source("bag", None)


@pytest.mark.parametrize("compression", ["NONE", "BZ2"])
def test_a_bag_that_was_never_closed_plays_as_far_as_it_goes(
    tmp_path: Path, compression: str, caplog: pytest.LogCaptureFixture
) -> None:
    path = write_ros1(tmp_path / "a.bag", walk(True), compression, 1000)
    whole = path.read_bytes()
    path.write_bytes(whole[: whole.rindex(b"op=\x05") + 10])  # in its last chunk
    found = samples(path)
    assert 10 < len(found) < 100
    assert [s.values["pos"] for s in found] == [{"A": k / 100, "B": -k / 100} for k in range(len(found))]
    (line,) = caplog.messages
    assert line.startswith(f"{path}: is cut off in the record at byte ")


def fields(**named: bytes) -> bytes:
    parts = [key.encode() + b"=" + value for key, value in named.items()]
    return b"".join(struct.pack("<I", len(part)) + part for part in parts)


def chunk(compression: bytes, size: int, data: bytes) -> bytes:
    head = fields(op=b"\5", compression=compression, size=struct.pack("<I", size))
    return b"#ROSBAG V2.0\n" + part(head) + part(data)


HOSTILE = {
    "a claim": (chunk(b"none", (1 << 32) - 1, b""), "4294967295 bytes unpacked, at most 67108864; left out"),
    "a bomb": (chunk(b"bz2", 1000, bz2.compress(bytes(64 << 20))), "more than 1000 bytes unpacked"),
    "less than it says": (chunk(b"bz2", 1000, bz2.compress(b"x")), "1 bytes unpacked instead of 1000"),
    "no stream": (chunk(b"lz4", 1000, b"x" * 50), "left out"),
    "what nobody packs": (chunk(b"rar", 10, b"x"), "compressed as 'rar', which is not supported"),
    "a record in it": (chunk(b"none", 8, struct.pack("<II", 1 << 31, 0)), "a record in it is incomplete"),
    "a header": (b"#ROSBAG V2.0\n" + struct.pack("<I", (1 << 32) - 1), "is cut off in the record at byte 13"),
    "data": (b"#ROSBAG V2.0\n" + part(fields(op=b"\2")) + b"\xff" * 4, "is cut off in the record at byte 13"),
    "no field": (b"#ROSBAG V2.0\n" + part(fields(op=b"\2")) + part(b""), "no field"),
    "a secret": (b"#ROSBAG V2.0\n" + part(fields(op=b"\3", encryptor=b"aes")) + part(b""), "is encrypted"),
}  # fmt: skip


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_bags_of_ros_1(case: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    data, reason = HOSTILE[case]
    (tmp_path / "a.bag").write_bytes(data)
    assert held_bytes(lambda: samples(tmp_path / "a.bag")) < 8 << 20
    assert reason in caplog.text
    assert all(line.startswith(f"{tmp_path}/a.bag: ") and line.isprintable() for line in caplog.messages)


def database(path: Path, *commands: str) -> Path:
    with sqlite3.connect(path) as made:
        for command in commands:
            made.execute(command)
    made.close()
    return path


TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
ENDLESS = """
WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM n
"""
BLOBS = MESSAGES.replace("data BLOB", "data BLOB AS (zeroblob(1000000000))")
MODULE = "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)"
TRICKS = {
    "no tables": (("CREATE TABLE a(b)",), "has no table 'topics': not a ROS 2 bag"),
    "an endless view": ((TOPICS, f"CREATE VIEW messages AS {ENDLESS}"), "has no table 'messages'"),
    "a computed column": (
        (TOPICS, BLOBS, "INSERT INTO messages VALUES(1, 1, 1)"),
        "its table 'messages' has no column 'data'",
    ),
    "a table of a module": ((TOPICS, MODULE), "has no table 'messages'"),
    "texts for numbers": (
        (TOPICS, MESSAGES, "INSERT INTO messages VALUES(1, 'a', 'b', 'c')"),
        "row 1 is not a message",
    ),
}


@pytest.mark.parametrize("case", TRICKS)
def test_databases_with_tricks(case: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    commands, reason = TRICKS[case]
    path = database(tmp_path / "a.db3", *commands)
    assert held_bytes(lambda: samples(path)) < 8 << 20
    (line,) = caplog.messages
    assert line.startswith(f"{path}: ")
    assert reason in line


def test_a_blob_without_end_is_passed_over(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = write_ros2(tmp_path / "bag", walk(False, 3), StoragePlugin.SQLITE3)
    path = database(next(folder.glob("*.db3")), "UPDATE messages SET data = zeroblob(50000000) WHERE id = 2")
    found: list[Sample] = []
    assert held_bytes(lambda: found.extend(samples(path))) < 8 << 20
    assert [s.values["pos"] for s in found] == [{"A": 0, "B": 0}, {"A": 0.02, "B": -0.02}]


@pytest.mark.parametrize("kind", ["ros1", "sqlite3", "mcap"])
def test_garbled_bags_end_in_lines(kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    if kind == "ros1":
        whole = write_ros1(tmp_path / "a.bag", walk(True, 20), "LZ4", 500).read_bytes()
    else:
        folder = write_ros2(tmp_path / "bag", walk(False, 20), StoragePlugin[kind.upper()])
        whole = next(folder.glob("*.[dm]*[3p]")).read_bytes()
    dice = random.Random(7)
    for _ in range(60):
        garbled = bytearray(whole[: dice.choice([len(whole), dice.randrange(20, len(whole))])])
        for _ in range(dice.randrange(1, 20)):
            garbled[dice.randrange(16, len(garbled))] = dice.choice([0, 255, dice.randrange(256)])
        (tmp_path / "garbled").write_bytes(garbled)
        assert len(samples(tmp_path / "garbled")) <= 20
    assert all(len(line) < 600 for line in caplog.messages)
    assert caplog.records
    assert {r.levelno for r in caplog.records} == {logging.WARNING}


# --- transforms


def drive(ros1: bool) -> list[bag_stage.Said]:
    """A base on rails: odom → rail is static, rail → base_link moves; legs of it move too."""
    words, name = Words(ros1), "tf2_msgs/msg/TFMessage"
    level = (1.0, 0.0, 0.0, 0.0)
    rail = words.transforms(BEGAN_NS, ("odom", "rail", (0, 0, 2), level))
    said: list[bag_stage.Said] = [("/tf_static", name, BEGAN_NS, rail)]
    for k in range(200):
        t_ns = BEGAN_NS + k * STEP_NS
        moves = words.transforms(
            t_ns, ("rail", "base_link", (k / 10, 0, 0), level), ("base_link", "leg", (0, 0, -1), level)
        )
        said.append(("/tf", name, t_ns, moves))
    return said


BASE = """
[ros]
base = "odom→base_link"
[labels]
joint = ["A", "B"]
[[fields]]
name = "pos"
[[fields]]
name = "base"
labels = ["base.x", "base.y", "base.z"]
[[fields]]
name = "baseq"
labels = ["base.w", "base.x", "base.y", "base.z"]
"""


@pytest.mark.parametrize("ros1", [True, False])
def test_a_base_by_transforms(ros1: bool, tmp_path: Path) -> None:
    said = sorted([*drive(ros1), *walk(ros1, 200)], key=lambda one: one[2])
    if ros1:
        path = write_ros1(tmp_path / "a.bag", said)
    else:
        path = write_ros2(tmp_path / "bag", said, StoragePlugin.SQLITE3)
    recording = RosRecording(path, parse_profile(BASE))
    found = list(recording.read_samples(1.0, first_pass=True))
    assert len(found) == 100  # also from a later start, which comes after /tf_static
    last = found[-1].values
    assert last["base"] == {"base.x": pytest.approx(19.9), "base.y": 0, "base.z": 2}
    assert last["baseq"] == {"base.w": 1, "base.x": 0, "base.y": 0, "base.z": 0}
    assert last["pos"] == {"A": 1.99, "B": -1.99}


def test_transforms_alone(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_ros1(tmp_path / "a.bag", drive(True))
    found = list(RosRecording(path, parse_profile(BASE)).read_samples(0.0, first_pass=True))
    assert found[-1].values["base"] == {"base.x": pytest.approx(19.9), "base.y": 0, "base.z": 2}
    wrong = parse_profile(BASE.replace("base_link", "base_lunk"))
    assert list(RosRecording(path, wrong).read_samples(0.0, first_pass=True)) == []
    frames = "base_link, leg, odom, rail"
    joints, base = caplog.messages[0], caplog.messages[1]
    assert base == f"{path}: base odom→base_lunk: no transform names base_lunk; frames: {frames}"
    assert caplog.messages == [joints, base, joints]
    assert "no joint states" in joints


def test_probe_lists_frames_and_suggests_the_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_ros1(tmp_path / "a.bag", drive(True)[:20])
    run_probe([f"bag:{path}"])
    out = capsys.readouterr().out
    assert "  /tf         tf2_msgs/TFMessage → tf" in out or "  /tf  tf2_msgs/TFMessage → tf" in out
    assert "  frame rail → base_link\n" in out
    assert '  to show where the robot is, in a profile: [ros] base = "odom→base_link"\n' in out
