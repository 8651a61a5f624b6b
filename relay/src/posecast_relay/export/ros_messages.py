"""The messages of ROS 2 that an export has: their definitions, as MCAP wants them, and their layout as CDR,
little endian, which is made once; then only times and numbers change.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import NamedTuple

ENCAPSULATION = b"\0\1\0\0"  # plain CDR, little endian; alignment counts from behind it
SECONDS_MAX = (1 << 31) - 1  # of a builtin_interfaces/Time: up to 2038
STAMP = struct.Struct("<iI")


class CdrMessage:
    """A message in the making. What is added stands in the order of the message's definition; a place that is
    returned says where numbers can be written later."""

    def __init__(self) -> None:
        self._data = bytearray(ENCAPSULATION)
        self._stamps: list[int] = []

    def __bytes__(self) -> bytes:
        return bytes(self._data)

    def add_stamp(self) -> None:
        """Add a builtin_interfaces/Time, for `set_stamps`."""
        self._align(4)
        self._stamps.append(len(self._data))
        self._data += bytes(STAMP.size)

    def add_header(self, frame_id: str) -> None:
        """Add a std_msgs/Header."""
        self.add_stamp()
        self.add_text(frame_id)

    def add_byte(self, value: int) -> None:
        """Add a uint8."""
        self._data.append(value)

    def add_count(self, value: int) -> None:
        """Add a uint32, as it also stands before a sequence."""
        self._align(4)
        self._data += struct.pack("<I", value)

    def add_text(self, text: str) -> None:
        """Add a string; a zero byte in it, which would end it, is left out."""
        raw = text.replace("\0", "").encode()
        self.add_count(len(raw) + 1)
        self._data += raw + b"\0"

    def add_texts(self, texts: Sequence[str]) -> None:
        """Add a string[]."""
        self.add_count(len(texts))
        for text in texts:
            self.add_text(text)

    def add_numbers(self, count: int) -> int:
        """Add so many float64 that are members or a fixed array, all 0; return their place."""
        if count:
            self._align(8)
        at = len(self._data)
        self._data += bytes(8 * count)
        return at

    def add_sequence(self, count: int) -> int:
        """Add a float64[] of so many zeros; return their place."""
        self.add_count(count)
        return self.add_numbers(count)

    def set_stamps(self, unix_ns: int) -> None:
        """Set all times of the message. What a Time can't hold becomes the last that it can."""
        seconds, nanoseconds = divmod(unix_ns, 10**9)
        if seconds > SECONDS_MAX:
            seconds, nanoseconds = SECONDS_MAX, 10**9 - 1
        for at in self._stamps:
            STAMP.pack_into(self._data, at, seconds, nanoseconds)

    def set_numbers(self, at: int, numbers: Sequence[float]) -> None:
        """Write float64 from a place on."""
        struct.pack_into(f"<{len(numbers)}d", self._data, at, *numbers)

    def _align(self, size: int) -> None:
        self._data += bytes(-(len(self._data) - len(ENCAPSULATION)) % size)


JOINT_STATE = "sensor_msgs/msg/JointState"
IMU = "sensor_msgs/msg/Imu"
WRENCH = "geometry_msgs/msg/WrenchStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
LOG = "rcl_interfaces/msg/Log"
NUMBERS = "std_msgs/msg/Float64MultiArray"

INFO, WARN, ERROR = 20, 30, 40  # of a Log

_PARTS: Mapping[str, str] = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
}
_WHOLE: Mapping[str, tuple[str, tuple[str, ...]]] = {
    JOINT_STATE: (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
        ("std_msgs/Header", "builtin_interfaces/Time"),
    ),
    IMU: (
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
        ("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"),
    ),
    WRENCH: (
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench",
        ("std_msgs/Header", "builtin_interfaces/Time", "geometry_msgs/Wrench", "geometry_msgs/Vector3"),
    ),
    TRANSFORMS: (
        "geometry_msgs/TransformStamped[] transforms",
        (
            *("geometry_msgs/TransformStamped", "std_msgs/Header", "builtin_interfaces/Time"),
            *("geometry_msgs/Transform", "geometry_msgs/Vector3", "geometry_msgs/Quaternion"),
        ),
    ),
    LOG: (
        "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
        "builtin_interfaces/Time stamp\nuint8 level\n"
        "string name\nstring msg\nstring file\nstring function\nuint32 line",
        ("builtin_interfaces/Time",),
    ),
    NUMBERS: (
        "std_msgs/MultiArrayLayout layout\nfloat64[] data",
        ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension"),
    ),
}


def write_definition(type_name: str) -> bytes:
    """The definition of a type and of all that it is made of, as a schema `ros2msg` holds it."""
    own, parts = _WHOLE[type_name]
    rest = "".join(f"{'=' * 80}\nMSG: {part}\n{_PARTS[part]}\n" for part in parts)
    return f"{own}\n{rest}".encode()


class JointStatePlaces(NamedTuple):
    """Where position, velocity and effort begin; None where the message has none."""

    position: int | None
    velocity: int | None
    effort: int | None


def lay_joint_state(
    names: Sequence[str], position: bool, velocity: bool, effort: bool
) -> tuple[CdrMessage, JointStatePlaces]:
    """A JointState of these joints."""
    message = CdrMessage()
    message.add_header("")
    message.add_texts(names)
    places = [message.add_sequence(len(names) if has else 0) for has in (position, velocity, effort)]
    there = [at if has else None for at, has in zip(places, (position, velocity, effort), strict=True)]
    return message, JointStatePlaces(*there)


def lay_imu(frame_id: str) -> tuple[CdrMessage, tuple[tuple[int, int], ...]]:
    """An Imu; where orientation (x, y, z, w), angular velocity and linear acceleration begin, each with the
    place of its covariance."""
    message = CdrMessage()
    message.add_header(frame_id)
    return message, tuple((message.add_numbers(size), message.add_numbers(9)) for size in (4, 3, 3))


def lay_wrench(frame_id: str) -> tuple[CdrMessage, tuple[int, int]]:
    """A WrenchStamped; where force and torque begin."""
    message = CdrMessage()
    message.add_header(frame_id)
    return message, (message.add_numbers(3), message.add_numbers(3))


def lay_numbers(label: str, count: int) -> tuple[CdrMessage, int]:
    """A Float64MultiArray of one dimension; where its numbers begin."""
    message = CdrMessage()
    message.add_count(1)
    message.add_text(label)
    message.add_count(count)  # size
    message.add_count(count)  # stride
    message.add_count(0)  # data_offset
    return message, message.add_sequence(count)


def lay_transforms(frames: Sequence[tuple[str, str]]) -> tuple[CdrMessage, tuple[int, ...]]:
    """A TFMessage of (parent, child); where each translation begins, before its rotation (x, y, z, w)."""
    message = CdrMessage()
    message.add_count(len(frames))
    places: list[int] = []
    for parent, child in frames:
        message.add_header(parent)
        message.add_text(child)
        places.append(message.add_numbers(7))
    return message, tuple(places)


def make_log(unix_ns: int, level: int, name: str, text: str) -> bytes:
    """A Log."""
    message = CdrMessage()
    message.add_stamp()
    message.add_byte(level)
    for each in (name, text, "", ""):  # file and function say nothing
        message.add_text(each)
    message.add_count(0)
    message.set_stamps(unix_ns)
    return bytes(message)
