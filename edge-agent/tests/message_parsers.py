"""Parsers of what a robot says by the message, with the worst input that is known. (The extra ros.)"""

from __future__ import annotations

import json
import struct
import tempfile
from pathlib import Path

import ach_stage
import cbor2
import ros_stage
import rosbridge_stage
from hubo_structs import state
from parser_stage import Input, Parser, Work, Worst, in_one_line, written
from posecast_edge.sources.hubo.ach_shm import AchChannel, ChannelError
from posecast_edge.sources.hubo.achd import AchdParser, AchdProtocolError
from posecast_edge.sources.hubo.state import HuboDecoder, UnknownFrame
from posecast_edge.sources.ros.cdr import CdrReader, Ros1Reader
from posecast_edge.sources.ros.merge import MessageMerger
from posecast_edge.sources.ros.messages import (
    READERS,
    STRING,
    TF,
    RosMessageError,
    get_text,
    read_message,
    read_transforms,
)
from posecast_edge.sources.ros.rosbridge_protocol import MessageAssembler, Publish, RosbridgeProtocolError


def pieces(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


def achd_work(given: Input, folder: Path) -> Work:
    """A server's bytes, a few at a time."""

    def work() -> None:
        conversation = AchdParser()
        for piece in pieces(given.data, 7):
            conversation.feed(piece)

    return work


def ach_work(given: Input, folder: Path) -> Work:
    """Looks at a channel's file."""
    path = written(given, folder, "channel")

    def work() -> None:
        channel = AchChannel(path)
        try:
            for _ in range(2):
                channel.save_frames()
                channel.read_new_frames()
        finally:
            channel.close()

    return work


def rosbridge_work(given: Input, folder: Path) -> Work:
    """What one connection brings, a line a message."""
    texts = given.data.decode("utf-8", "replace").split("\n")

    def work() -> None:
        ear = MessageAssembler()
        for text in texts:
            hear(ear, text)

    return work


def hear(ear: MessageAssembler, data: str | bytes) -> None:
    """A message of a server's, and what it says of a robot. A refusal of one is no refusal of the others."""
    heard = None
    with in_one_line(RosbridgeProtocolError):
        heard = ear.feed(data)
    if isinstance(heard, Publish):
        report(heard.message)


def report(message: object) -> None:
    """A message, as of each type it can be."""
    merge = MessageMerger(True, lambda text: None)
    for type_name in READERS:
        with in_one_line(RosMessageError):
            merge.take_report("/x", "pos", type_name, read_message(type_name, message), 1.0)
    merge.make_sample(2.0)
    with in_one_line(RosMessageError):
        get_text(message).encode()


def cbor_work(given: Input, folder: Path) -> Work:
    return lambda: hear(MessageAssembler(), given.data)


CDR, ROS1 = CdrReader(), Ros1Reader()


def many_transforms(n: int) -> bytes:
    chain = [(f"f{i}", f"f{i + 1}", (1, 2, 3), (1, 0, 0, 0)) for i in range(n)]
    return ros_stage.transforms(5, *chain)


def cdr_work(given: Input, folder: Path) -> Work:
    """As of each type."""

    def work() -> None:
        for type_name in (*READERS, STRING):
            with in_one_line(RosMessageError):
                report(CDR.read(type_name, given.data))
            with in_one_line(RosMessageError):
                read_transforms(CDR.read(TF, given.data))
            with in_one_line(RosMessageError):
                report(ROS1.read(type_name, given.data))

    return work


MESSAGE = {
    "header": {"stamp": {"sec": 5, "nanosec": 7}, "frame_id": "f"},
    "name": ["A", "B"],
    "position": [1.0, 2.0],
    "velocity": [],
    "effort": [3.5, 0.5],
    "joint_names": ["A"],
    "reference": {"positions": [1.0]},
    "orientation": {"w": 1, "x": 0, "y": 0, "z": 0},
    "angular_velocity": {"x": 0, "y": 1, "z": 2},
    "linear_acceleration": {"x": 0, "y": 1, "z": 2},
    **{f"{n}_covariance": [-1.0] for n in ("orientation", "angular_velocity", "linear_acceleration")},
    "wrench": {"force": {"x": 0, "y": 1, "z": 2}, "torque": {"x": 0, "y": 1, "z": 2}},
    "present": True,
    "percentage": 0.5,
    "voltage": 48,
    "current": 1,
    "power_supply_status": 2,
    "pose": {"pose": {"position": {"x": 0, "y": 1, "z": 2}, "orientation": {"w": 1, "x": 0, "y": 0, "z": 0}}},
    "status": [{"name": "n", "level": 1, "message": "m"}, {"name": "k", "level": "AQ==", "message": ""}],
    "data": "<robot/>",
}


def publish(said: object) -> str:
    return json.dumps({"op": "publish", "topic": "/joint_states", "msg": said})


def interleaved(n: int) -> bytes:
    """The parts of many messages by turns, of which none is ever whole."""
    part = '{{"op":"fragment","id":"{}","data":"x","num":{},"total":4000}}'
    return "\n".join(part.format(k, i) for i in range(n) for k in range(20)).encode()


def as_cbor(said: bytes) -> bytes:
    """A message around a value that is written already."""
    head = b"\xa3" + cbor2.dumps("op") + cbor2.dumps("publish") + cbor2.dumps("topic") + cbor2.dumps("/x")
    return head + cbor2.dumps("msg") + said


def doubling(n: int) -> bytes:
    """A JointState of which a position is a list that holds a list twice, and so on: by reference."""
    inner = b"\x80"
    for i in range(n):
        inner = b"\x82\xd8\x1c" + inner + b"\xd8\x1d" + cbor2.dumps(n - 1 - i)
    named = {**MESSAGE, "position": [0, 0]}
    whole = cbor2.dumps(named)
    return as_cbor(whole.replace(b"\x82\x00\x00", b"\x81" + inner, 1))


ANSWER = json.dumps(
    {"op": "service_response", "id": "topics", "values": {"topics": ["/a"], "types": ["b"]}, "result": True}
)
STATUS = json.dumps({"op": "status", "level": "error", "msg": "x"})
ROSBRIDGE = (
    publish(MESSAGE).encode(),
    "\n".join(rosbridge_stage.fragments(publish(MESSAGE), 300)).encode(),
    f"{ANSWER}\n{STATUS}".encode(),
)
TAGS = (
    *("c11a514b67b0", "c249010000000000000000", "c48221196ab3", "c5822003", "d81e820103", "d81e820100"),
    *("d823635b612d", "d81cd81d00", "d81c81d81d00", "d9010283010203", "d90100826161d81900", "d9d9f7f6"),
    *("c074323031332d30332d32315432303a30343a30305a", "d856480000000000000000", "f97e00", "f97c00"),
)


def many_names(n: int) -> bytes:
    names = [f"j{i}" for i in range(n)]
    return ros_stage.joint_state(5.5, names, [0.0] * n, [0.0] * n, [0.0] * n)


def achd_frames(n: int, size: int) -> bytes:
    frames = (b"achpipe\0" + struct.pack("<Q", size) + bytes(size) for _ in range(n))
    return b"status: 0\n.\n" + b"".join(frames)


def ach_file(frames: int, folder: Path | None = None) -> bytes:
    """A channel that has been written into."""
    with tempfile.TemporaryDirectory() as name:
        path = Path(name, "channel")
        writer = ach_stage.Writer(path, frames=frames, frame_size=64)
        for k in range(min(frames, 50)):
            writer.put(ach_stage.patterned(k + 1, 48))
        writer.map.flush()
        return path.read_bytes()


PARSERS = (
    Parser(
        "achd",
        ("sources.hubo.achd.AchdParser.feed",),
        achd_work,
        (AchdProtocolError,),
        (achd_frames(3, 300), b"status: 0\nmessage: fine\n.\n" + achd_frames(1, 1)[12:]),
        {
            "frames in parts": Worst(lambda n: achd_frames(n, 4000), 8),
            "small frames": Worst(lambda n: achd_frames(n, 1), 500),
        },
    ),
    Parser(
        "ach",
        ("sources.hubo.ach_shm.AchChannel.read_new_frames",),
        ach_work,
        (ChannelError,),
        (ach_file(4), ach_file(60)),
        {"entries": Worst(ach_file, 200)},
    ),
    Parser(
        "hubo_state",
        ("sources.hubo.state.HuboDecoder.decode",),
        lambda given, folder: lambda: HuboDecoder(None).decode(given.data),
        (UnknownFrame,),
        (bytes(state()),),
        {"a foreign frame": Worst(lambda n: bytes(state()) * n, 100)},
    ),
    Parser(
        "rosbridge",
        ("sources.ros.rosbridge_protocol.MessageAssembler.feed", "sources.ros.rosbridge_protocol.parse_json"),
        rosbridge_work,
        (),
        ROSBRIDGE,
        {
            "fragments": Worst(lambda n: "\n".join(rosbridge_stage.fragments("x" * n, 1)).encode(), 150),
            "fragments by turns": Worst(interleaved, 10),
            "a long name": Worst(lambda n: publish({**MESSAGE, "name": ["x" * n]}).encode(), 100_000),
            "names": Worst(lambda n: publish({**MESSAGE, "name": ["x"] * n}).encode(), 2000),
            "brackets": Worst(lambda n: b"[" * n, 20_000),
            "no names": Worst(lambda n: publish({**MESSAGE, "name": [[]] * n}).encode(), 2000),
            "statuses": Worst(lambda n: publish({**MESSAGE, "status": MESSAGE["status"] * n}).encode(), 200),  # type: ignore[operator]
        },
    ),
    Parser(
        "cbor",
        (),
        cbor_work,
        (),
        (
            cbor2.dumps(rosbridge_stage.packed(json.loads(publish(MESSAGE)))),
            *(as_cbor(bytes.fromhex(tag)) for tag in TAGS),
        ),
        {
            "empty maps": Worst(lambda n: as_cbor(b"\x9a" + struct.pack(">I", n) + b"\xa0" * n), 5000),
            "a number": Worst(lambda n: as_cbor(b"\xc2\x5a" + struct.pack(">I", n) + b"\xff" * n), 5000),
            "typed arrays": Worst(lambda n: as_cbor(b"\xd8\x40\x5a" + struct.pack(">I", n) + bytes(n)), 4000),
            "lists that hold a list twice": Worst(doubling, 1),
        },
    ),
    Parser(
        "cdr",
        (
            "sources.ros.cdr.CdrReader.read",
            "sources.ros.cdr.Ros1Reader.read",
            "sources.ros.messages.read_message",
            "sources.ros.messages.read_transforms",
            "sources.ros.messages.validate_description",
        ),
        cdr_work,
        (),
        (
            ros_stage.joint_state(5.5, ["A", "B"], [1, 2], [3, 4]),
            ros_stage.controller_state(5, ["A"], [1.0]),
            ros_stage.imu(5, "f"),
            ros_stage.wrench(1, "f", [1, 2, 3], [4, 5, 6]),
            ros_stage.battery(5, 48, 1, 0.5),
            ros_stage.diagnostics(5, (1, "n", "m"), (0, "k", "")),
            ros_stage.odometry(5, [1, 2, 3], [1, 0, 0, 0]),
            ros_stage.text_message("<robot/>"),
            ros_stage.transforms(5, ("odom", "base_link", (1, 2, 3), (1, 0, 0, 0))),
        ),
        {
            "names": Worst(many_names, 200),
            "statuses": Worst(lambda n: ros_stage.diagnostics(5, *[(1, "n", "m")] * n), 50),
            "transforms": Worst(many_transforms, 200),
            "a text": Worst(lambda n: ros_stage.text_message("x" * n), 50_000),
        },
    ),
)
