"""The messages of ROS 2 that an export has: their definitions, as MCAP wants them, and their layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from posecast_relay.export.cdr import CdrMessage

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
