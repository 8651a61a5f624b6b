"""Parsers of recordings and lines, with the worst input that is known. (The extras mcap and mujoco.)"""

from __future__ import annotations

import json
import sqlite3
import struct
import tempfile
from contextlib import closing
from pathlib import Path

import bag_stage
import ros_stage
import rosbridge_stage
from mcap.writer import CompressionType
from parser_stage import Input, Parser, Work, Worst, written
from posecast_edge.model.finding import ModelRefused
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import SourceError
from posecast_edge.sources.files.csv import Table
from posecast_edge.sources.files.playback import parse_playback
from posecast_edge.sources.files.ros_recording import RosRecording
from posecast_edge.sources.files.trajectory import TrajectorySource
from posecast_edge.sources.jsonl import parse_line
from posecast_edge.sources.lines import LineError
from posecast_edge.sources.mujoco.model import strip_visuals
from posecast_edge.sources.mujoco.source import ARM
from rosbags.rosbag2 import StoragePlugin

PROFILE = """
[labels]
joint = ["A", "B", "C"]
[[fields]]
name = "ref"
[[fields]]
name = "pos"
[trajectory]
columns = ["A", "-", "B"]
rate_hz = 10
"""
WALKER = parse_profile(PROFILE)


def csv_work(given: Input, folder: Path) -> Work:
    """One pass."""
    path = written(given, folder, "a.csv")
    return lambda: sum(1 for _ in Table(path, None).read_samples(0.0, True))


def trajectory_work(given: Input, folder: Path) -> Work:
    """As many instants as it may have rows."""
    path = written(given, folder, "a.traj")
    rows = given.data.count(b"\n") + 3
    assert WALKER.trajectory is not None
    trajectory = WALKER.trajectory

    def work() -> None:
        source = TrajectorySource(path, WALKER, trajectory)
        try:
            source.advance(rows / 10)
        finally:
            source._file.close()

    return work


def mcap_work(given: Input, folder: Path) -> Work:
    """One pass."""
    path = written(given, folder, "a.mcap")

    def work() -> None:
        file = RosRecording(path, WALKER)
        file.on_urdf = lambda urdf: None
        for _ in file.read_samples(0.0, True):
            pass

    return work


def jsonl_work(given: Input, folder: Path) -> Work:
    return lambda: parse_line(given.data, 0.0)


def mujoco_work(given: Input, folder: Path) -> Work:
    """What MuJoCo is given of a URDF. How MuJoCo itself reads is bounded by a trial (mujoco_trial.py)."""
    return lambda: strip_visuals(given.data)


def bag(compression: CompressionType = CompressionType.NONE, encoding: str = "cdr", count: int = 5) -> bytes:
    made = bag_stage.Bag(compression, 400)
    for k in range(count):
        t_ns = bag_stage.BEGAN_NS + k * bag_stage.STEP_NS
        data = bag_stage.joint_state(t_ns, A=k / 10, B=0.2)
        if encoding == "json":
            data = json.dumps(rosbridge_stage.joint_state(t_ns * 1e-9, ["A"], [1.0])).encode()
        made.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, data, encoding)
        made.add("/foot", "geometry_msgs/msg/WrenchStamped", t_ns, bag_stage.wrench(t_ns, "f", *range(6)))
    made.add("/robot_description", "std_msgs/msg/String", t_ns, ros_stage.text_message("<robot/>"))
    return made.finish()


MAGIC = b"\x89MCAP0\r\n"


def record(opcode: int, data: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(data)) + data


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def schema(number: int, name: str = "sensor_msgs/msg/Image") -> bytes:
    return record(3, struct.pack("<H", number) + text(name) + text("ros2msg") + struct.pack("<I", 1) + b"x")


def channel(number: int, topic: str, metadata: str = "") -> bytes:
    head = struct.pack("<HH", number, 1) + text(topic) + text("cdr")
    return record(4, head + struct.pack("<I", len(metadata)) + metadata.encode())


def message(channel_number: int, data: bytes = b"") -> bytes:
    return record(5, struct.pack("<HIQQ", channel_number, 0, 1, 1) + data)


def chunk(data: bytes) -> bytes:
    """Stored as it is."""
    head = struct.pack("<QQQI", 0, 0, len(data), 0) + text("")
    return record(6, head + struct.pack("<Q", len(data)) + data)


def topics(n: int) -> bytes:
    return MAGIC + schema(1) + b"".join(channel(i, f"/topic{i}") for i in range(n))


def ros1_bag(compression: str, count: int = 5) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        said = bag_stage.walk(True, count)
        return bag_stage.write_ros1(Path(folder) / "a.bag", said, compression, 400).read_bytes()


ROS1 = b"#ROSBAG V2.0\n"


def ros1_part(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def ros1_record(data: bytes, **fields: bytes) -> bytes:
    head = b"".join(ros1_part(name.encode() + b"=" + value) for name, value in fields.items())
    return ros1_part(head) + ros1_part(data)


def ros1_topic(number: int, topic: str) -> bytes:
    data = ros1_part(b"type=sensor_msgs/Image")
    return ros1_record(data, op=b"\7", conn=struct.pack("<I", number), topic=topic.encode())


def ros1_chunk(data: bytes) -> bytes:
    return ros1_record(data, op=b"\5", compression=b"none", size=struct.pack("<I", len(data)))


def ros2_bag(count: int, topics: int = 0) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        said = bag_stage.walk(False, count)
        made = bag_stage.write_ros2(Path(folder) / "bag", said, StoragePlugin.SQLITE3)
        path = made / "bag.db3"
        with closing(sqlite3.connect(path)) as database:
            rows = [(i + 9, f"/t{i}", "sensor_msgs/msg/Image", "cdr", "", "") for i in range(topics)]
            database.executemany("INSERT INTO topics VALUES(?, ?, ?, ?, ?, ?)", rows)
            database.commit()
        return path.read_bytes()


ROWS = b"t,A,ref.B [deg],flags.A,info.mode,\n1.5,0.1,0.2,jam hot,walk,x\n2,1,2,3,,\n"
PARSERS = (
    Parser(
        "csv",
        ("sources.files.csv.Table.read_samples", "sources.files.csv.parse_iso_time"),
        csv_work,
        (SourceError,),
        (ROWS, b"\xef\xbb\xbftime_ms;A;B\r\n1;2;3\r\n4;5;6\r\n"),
        {
            "columns": Worst(lambda n: ("t," + ",".join(f"c{i}" for i in range(n)) + "\n").encode(), 500),
            "a name of blanks": Worst(lambda n: b"t,a" + b" " * n + b"b\n0,1\n", 2000),
            "a name of slashes": Worst(lambda n: b"t," + b"/a" * n + b"\n0,1\n", 2000),
            "a name of dots": Worst(lambda n: b"t,field" + b".a" * n + b"\n0,1\n", 2000),
            "names of joints": Worst(
                lambda n: ("t," + ",".join(f"name{i},position{i}" for i in range(n)) + "\n").encode(), 300
            ),
            "a name of brackets": Worst(lambda n: b"t,a" + b"[" * n + b"\n0,1\n", 2000),
            "rows": Worst(lambda n: b"t,A\n" + b"1,2\n" * n, 400),
            "bad rows": Worst(lambda n: b"t,A\n" + b"x\n" * n, 400),
            "a long row": Worst(lambda n: b"t,A\n0," + b"1" * n + b"\n", 100_000),
            "quotes": Worst(lambda n: b"t,A\n0," + b'"' * n + b"\n", 5000),
            "names of bits": Worst(lambda n: b"t,flags.A\n0," + b"x " * n + b"\n", 3000),
            "old ends of lines": Worst(lambda n: b"t,A\r" + b"1,2\r" * n, 400),
        },
    ),
    Parser(
        "trajectory",
        ("sources.files.trajectory.parse_row",),
        trajectory_work,
        (SourceError,),
        (b"1 2 3\n4 5 6\n1,2,3\n",),
        {
            "rows": Worst(lambda n: b"1 2 3\n" * n, 300),
            "bad rows": Worst(lambda n: b"1 2 3\n" + b"x\n" * n, 300),
            "a long row": Worst(lambda n: b"1 2 3\n" + b"1 " * n + b"\n", 30_000),
        },
    ),
    Parser(
        "playback",
        ("sources.files.playback.parse_playback", "sources.files.playback.Recording.read_samples"),
        lambda given, folder: lambda: parse_playback("csv", given.data.decode("utf-8", "replace")),
        (SourceError,),
        (b"walk.csv?start=1.5&loop",),
        {"words": Worst(lambda n: b"a?" + b"loop&" * n + b"loop", 3000)},
    ),
    Parser(
        "mcap",
        (
            "sources.files.ros_recording.RosRecording.read_samples",
            "sources.files.records.RecordedFile.read_messages",
            "sources.files.records.read_blocks",
            "sources.files.records.BlockFile.read_messages",
            "sources.files.mcap_records.unpack_chunk",
        ),
        mcap_work,
        (SourceError,),
        (*(bag(c) for c in CompressionType), bag(encoding="json")),
        {
            "messages": Worst(lambda n: bag(count=n), 60),
            "topics": Worst(topics, 1000),
            "chunks": Worst(lambda n: MAGIC + chunk(message(1)) * n, 300),
            "a chunk": Worst(lambda n: MAGIC + chunk(message(1) * n), 500),
            "empty records": Worst(lambda n: MAGIC + record(0x80, b"") * n, 2000),
            "metadata": Worst(lambda n: MAGIC + schema(1) + channel(1, "/x", "\0" * 8 * n), 1000),
            "an attachment": Worst(lambda n: MAGIC + record(9, bytes(n)), 1_000_000),
        },
    ),
    Parser(
        "bag of ROS 1",
        (
            "sources.files.records.BlockFile.read_messages",
            "sources.files.rosbag1_records.unpack_rosbag1_chunk",
        ),
        mcap_work,
        (SourceError,),
        (ros1_bag("NONE"), ros1_bag("BZ2"), ros1_bag("LZ4")),
        {
            "messages": Worst(lambda n: ros1_bag("NONE", n), 60),
            "topics": Worst(lambda n: ROS1 + b"".join(ros1_topic(i, f"/t{i}") for i in range(n)), 1000),
            "empty records": Worst(lambda n: ROS1 + bytes(8 * n), 2000),
            "a chunk of empty records": Worst(lambda n: ROS1 + ros1_chunk(bytes(8 * n)), 2000),
            "fields": Worst(lambda n: ROS1 + ros1_part(ros1_part(b"a=") * n) + ros1_part(b""), 2000),
        },
    ),
    Parser(
        "bag of ROS 2",
        ("sources.files.sqlite_records.SqliteFile.read_messages",),
        mcap_work,
        (SourceError,),
        (ros2_bag(3),),
        {"messages": Worst(ros2_bag, 60), "topics": Worst(lambda n: ros2_bag(1, n), 500)},
    ),
    Parser(
        "jsonl",
        ("sources.jsonl.parse_line", "sources.lines.LineSplitter.feed"),
        jsonl_work,
        (LineError,),
        (b'{"t": 12.3, "pos": {"RKN": 0.5}, "cur": [0.1, 0.2], "info": {"mode": "x"}}',),
        {
            "fields": Worst(lambda n: json.dumps({f"f{i}": [0] for i in range(n)}).encode(), 400),
            "labels": Worst(lambda n: json.dumps({"pos": {f"j{i}": 0 for i in range(n)}}).encode(), 400),
            "brackets": Worst(lambda n: b"[" * n, 1000),
            "brackets in a field": Worst(lambda n: b'{"pos":[' + b"[" * n, 2000),
            "digits": Worst(lambda n: b'{"pos":[' + b"9" * n + b"]}", 2000),
            "a label again": Worst(lambda n: b'{"pos":{' + b'"a":1,' * n + b'"b":1}}', 2000),
            "texts": Worst(lambda n: json.dumps({"info": {str(i): "x" for i in range(n)}}).encode(), 2000),
            "halves of characters": Worst(lambda n: b'{"' + b"\\ud800" * n + b'":1}', 2000),
            "blanks": Worst(lambda n: b'{"t":' + b"[" * 900 + b"]" * 900 + b"}" + b" " * n, 2000),
        },
    ),
    Parser(
        "mujoco",
        ("sources.mujoco.model.load_simulation",),
        mujoco_work,
        (ModelRefused,),
        (ARM.read_bytes(),),
        {"links": Worst(lambda n: b"<robot>" + b"<link name='a'><inertial/></link>" * n + b"</robot>", 300)},
    ),
)
