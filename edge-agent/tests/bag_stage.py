"""Bags of ROS 1 and ROS 2, written by the library's own writers."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from ros_stage import Cdr
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGAN_NS = 1_700_000_000_000_000_000
STEP_NS = 10_000_000
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
JOINTS = "sensor_msgs/msg/JointState"

Said = tuple[str, str, int, Any]  # topic, type, ns, message


class Words:
    """Makes messages for one of the two systems."""

    def __init__(self, ros1: bool) -> None:
        self.store = ROS1 if ros1 else ROS2
        self._seq = {"seq": 7} if ros1 else {}

    def make(self, name: str, /, **members: Any) -> Any:
        return self.store.types[name](**members)

    def header(self, t_ns: int, frame: str = "") -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=t_ns // 10**9, nanosec=t_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **self._seq)

    def joints(self, t_ns: int, **position: float) -> Any:
        numbers, none = np.array(list(position.values()), np.float64), np.array([], np.float64)
        return self.make(
            JOINTS,
            header=self.header(t_ns),
            name=list(position),
            position=numbers,
            velocity=numbers * 2,
            effort=none,
        )

    def transforms(self, t_ns: int, *chain: tuple[str, str, Sequence[float], Sequence[float]]) -> Any:
        """(parent, child, xyz, wxyz) of each."""
        found = []
        for parent, child, xyz, (w, x, y, z) in chain:
            pose = self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", xyz, strict=True))),
                rotation=self.make("geometry_msgs/msg/Quaternion", w=w, x=x, y=y, z=z),
            )
            found.append(
                self.make(
                    "geometry_msgs/msg/TransformStamped",
                    header=self.header(t_ns, parent),
                    child_frame_id=child,
                    transform=pose,
                )
            )
        return self.make("tf2_msgs/msg/TFMessage", transforms=found)


def walk(ros1: bool, count: int = 100) -> list[Said]:
    """Two joints at 100 Hz."""
    words, times = Words(ros1), [BEGAN_NS + k * STEP_NS for k in range(count)]
    return [
        ("/joint_states", JOINTS, t_ns, words.joints(t_ns, A=k / 100, B=-k / 100))
        for k, t_ns in enumerate(times)
    ]


def write_ros1(path: Path, said: Sequence[Said], compression: str = "NONE", chunk_bytes: int = 4096) -> Path:
    writer = Writer1(path)
    writer.chunk_threshold = chunk_bytes
    if compression != "NONE":
        writer.set_compression(Writer1.CompressionFormat[compression])
    with writer:
        known: dict[str, Any] = {}
        for topic, name, t_ns, message in said:
            if topic not in known:
                known[topic] = writer.add_connection(topic, name, typestore=ROS1)
            writer.write(known[topic], t_ns, ROS1.serialize_ros1(message, name))
    return path


def write_ros2(
    folder: Path, said: Sequence[Said], plugin: StoragePlugin, mode: CompressionMode | None = None
) -> Path:
    writer = Writer2(folder, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        known: dict[str, Any] = {}
        for topic, name, t_ns, message in said:
            if topic not in known:
                known[topic] = writer.add_connection(topic, name, typestore=ROS2)
            writer.write(known[topic], t_ns, ROS2.serialize_cdr(message, name))
    return folder


# --- MCAP files of the library's own writer, with CDR packed by hand: the decoder had no part in either


def header(t_ns: int, frame: str = "") -> Cdr:
    return Cdr().put("i", t_ns // 10**9).put("I", t_ns % 10**9).text(frame)


def joint_state(t_ns: int, **position: float) -> bytes:
    cdr = header(t_ns).texts(list(position)).doubles(list(position.values()))
    return cdr.doubles([]).doubles([]).done()


def wrench(t_ns: int, frame: str, *six: float) -> bytes:
    return header(t_ns, frame).put("d", *six).done()


class Bag:
    """A file in the making."""

    def __init__(self, compression: CompressionType = CompressionType.ZSTD, chunk_bytes: int = 4096) -> None:
        self._file = io.BytesIO()
        self._writer = Writer(self._file, compression=compression, chunk_size=chunk_bytes)
        self._writer.start(profile="ros2")
        self._channels: dict[str, int] = {}

    def add(self, topic: str, type_name: str, t_ns: int, data: bytes, encoding: str = "cdr") -> None:
        if topic not in self._channels:
            schema = self._writer.register_schema(type_name, "ros2msg", b"")
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        self._writer.add_message(self._channels[topic], t_ns, data, t_ns)

    def finish(self) -> bytes:
        self._writer.finish()  # type: ignore[no-untyped-call]
        return self._file.getvalue()
