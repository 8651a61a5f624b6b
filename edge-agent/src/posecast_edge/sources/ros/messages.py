"""Converts ROS messages to values of fields. Pure: independent of transport and encoding.

A message is any object with the members of its definition: an object from a CDR decoder, or a mapping from
JSON or CBOR. ROS 1 and 2 name types and the two numbers of a timestamp differently; both are read.

| type | field: labels |
|---|---|
| sensor_msgs/JointState | `pos` (or `ref`), `vel`, `effort`: joint names |
| control_msgs/JointTrajectoryControllerState | `ref`: joint names |
| sensor_msgs/Imu | `quat` SITE.w x y z, `gyro` and `acc` SITE.x y z |
| geometry_msgs/WrenchStamped | `ftf` SITE.fx fy fz, `ftm` SITE.mx my mz |
| sensor_msgs/BatteryState | `volt`, `amp`, `charge`: SITE |
| nav_msgs/Odometry | `base` base.x y z, `baseq` base.w x y z |
| tf2_msgs/TFMessage | `base`, `baseq`, `pos`, through robot_frames.py |
| diagnostic_msgs/DiagnosticArray | `diag`, bits of field_defaults.DIAG_BITS: names of the statuses |
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from posecast_edge.profile.field_defaults import DIAG_BITS
from posecast_edge.sample import TIME_MAX_S, Reading

JOINT_STATE = "sensor_msgs/JointState"
CONTROLLER_STATE = "control_msgs/JointTrajectoryControllerState"
IMU = "sensor_msgs/Imu"
WRENCH = "geometry_msgs/WrenchStamped"
BATTERY = "sensor_msgs/BatteryState"
ODOMETRY = "nav_msgs/Odometry"
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
TF = "tf2_msgs/TFMessage"
STRING = "std_msgs/String"  # robot_description

BATTERY_STATES = ("unknown", "charging", "discharging", "not charging", "full")
# Longer messages are refused.
PAYLOAD_MAX = 1 << 18  # bytes of a message other than a robot description
DESCRIPTION_MAX = 8 << 20  # characters of a robot description
MAX_NAMES = 4096  # joints of one message; numbers of one list
NAME_MAX = 200  # characters of a name
# Longer ones are cut.
MAX_STATUSES = 64  # of one message; further ones are ignored
TEXT_MAX = 200  # characters of a text that is shown


class RosMessageError(ValueError):
    """A message that does not match its type. One line, without the topic."""


@dataclass(frozen=True)
class Report:
    """The content of one message.

    `stamp_s`: the header's time in seconds; None if it is missing or zero. `values`: field → label → reading;
    None if the message states that there is no reading. `info`: texts. `links`: site → link of the model, if
    the message names it. `lasts`: the content is published once and never expires.
    """

    stamp_s: float | None
    values: Mapping[str, Mapping[str, Reading]]
    info: Mapping[str, str] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    lasts: bool = False


@dataclass(frozen=True)
class Transform:
    """The pose of the frame `child` in the frame `parent`: metres, unit quaternion w x y z. `stamp_s`: as in
    Report."""

    parent: str
    child: str
    xyz: tuple[float, float, float]
    wxyz: tuple[float, float, float, float]
    stamp_s: float | None


def shorten_type(name: str) -> str:
    """Convert `sensor_msgs/msg/JointState` or `sensor_msgs::msg::dds_::JointState_` to
    `sensor_msgs/JointState`."""
    parts = name.replace("::", "/").split("/")
    parts = [p for p in parts if p not in ("msg", "dds_", "")]
    short = "/".join(p.rstrip("_") if i == len(parts) - 1 else p for i, p in enumerate(parts))
    return TF if short == "tf/tfMessage" else short  # its name in early ROS 1


def read_message(type_name: str, message: Any, site: str = "", field_name: str = "pos") -> Report:
    """Read one message whose (short) type is in READERS. Raises RosMessageError when it does not match its
    type.

    `site`: the sensor's name; "" to use the message's frame. `field_name`: the field of a JointState's
    positions, `pos` or `ref`; with `ref`, velocities are not read.
    """
    reader = READERS[type_name]
    try:
        return reader(message, site, field_name)
    except RosMessageError:
        raise
    except (TypeError, ValueError, ArithmeticError, LookupError, AttributeError, RecursionError) as e:
        raise RosMessageError(f"{type(e).__name__}: {str(e)[:200]}") from None


def read_transforms(message: Any) -> list[Transform]:
    """Read a TFMessage. Leaves out transforms that are not finite or whose frames have no names. Raises
    RosMessageError when the message does not match its type."""
    transforms = _member(message, "transforms")
    if not isinstance(transforms, (list, tuple)) or len(transforms) > MAX_NAMES:
        raise RosMessageError(f"transforms is not a list of at most {MAX_NAMES}")
    try:
        return [found for said in transforms if (found := _transform(said)) is not None]
    except (TypeError, ValueError, ArithmeticError) as e:
        raise RosMessageError(" ".join(str(e).split())[:200]) from None


def _transform(said: Any) -> Transform | None:
    parent = _text(_member(_member(said, "header"), "frame_id"), "frame_id").strip("/")
    child = _text(_member(said, "child_frame_id"), "child_frame_id").strip("/")
    pose = _member(said, "transform")
    x, y, z = _vector(_member(pose, "translation"))
    parts = _quaternion(_member(pose, "rotation"))
    if x is None or y is None or z is None or any(part is None for part in parts):
        return None
    w, qx, qy, qz = (part or 0.0 for part in parts)
    norm = math.hypot(w, qx, qy, qz)
    if not (math.isfinite(x + y + z) and math.isfinite(norm) and norm > 0):
        return None
    if not (0 < len(parent) <= NAME_MAX and 0 < len(child) <= NAME_MAX) or parent == child:
        return None
    wxyz = (w / norm, qx / norm, qy / norm, qz / norm)
    return Transform(parent, child, (x, y, z), wxyz, _stamp(said))


def get_text(message: Any) -> str:
    """The text of a std_msgs/String. Raises RosMessageError if it is too long for a robot description."""
    return validate_description(_member(message, "data"))


def validate_description(urdf: Any) -> str:
    """Return the robot description if it is a text of acceptable length. Raises RosMessageError otherwise."""
    text = _text(urdf, "data")
    if len(text) > DESCRIPTION_MAX:
        raise RosMessageError(f"a robot description of {len(text)} characters, at most {DESCRIPTION_MAX}")
    return text


def make_site_name(name: str) -> str:
    """Turn a frame's or topic's name into a site name. Replaces dots, which separate site and component."""
    return name.strip("/").replace(".", "_").replace("/", "_")


# --- types


def _joint_state(message: Any, site: str, field_name: str) -> Report:
    del site
    names = _names(_member(message, "name"), "name")
    values: dict[str, Mapping[str, Reading]] = {}
    members = (("position", field_name), ("velocity", "vel"), ("effort", "effort"))
    for member, name in members if field_name == "pos" else members[:1]:
        numbers = _numbers(_member(message, member), member)
        if not numbers:
            continue  # by convention a robot leaves empty what it does not measure
        if len(numbers) != len(names):
            raise RosMessageError(f"{member} has {len(numbers)} values, name {len(names)}")
        values[name] = dict(zip(names, numbers, strict=True))
    if not values:
        raise RosMessageError("a JointState without positions" if names else "a JointState without joints")
    return Report(_stamp(message), values)


def _controller_state(message: Any, site: str, field_name: str) -> Report:
    """The controller's target is `reference` or, up to ROS 2 Galactic and in ROS 1, `desired`."""
    del site, field_name
    names = _names(_member(message, "joint_names"), "joint_names")
    points = [_optional(message, member) for member in ("reference", "desired")]
    for point in points:
        numbers = [] if point is None else _numbers(_member(point, "positions"), "positions")
        if numbers:
            if len(numbers) != len(names):
                raise RosMessageError(f"positions has {len(numbers)} values, joint_names {len(names)}")
            return Report(_stamp(message), {"ref": dict(zip(names, numbers, strict=True))})
    raise RosMessageError("a controller state without target positions")


def _imu(message: Any, site: str, field_name: str) -> Report:
    del field_name
    site, links = _site(message, site, "imu")
    values = {
        "quat": _labelled(site, "wxyz", _quaternion(_member(message, "orientation"))),
        "gyro": _labelled(site, "xyz", _vector(_member(message, "angular_velocity"))),
        "acc": _labelled(site, "xyz", _vector(_member(message, "linear_acceleration"))),
    }
    covariances = ("orientation_covariance", "angular_velocity_covariance", "linear_acceleration_covariance")
    for name, covariance in zip(("quat", "gyro", "acc"), covariances, strict=True):
        numbers = _numbers(_member(message, covariance), covariance)
        if numbers and numbers[0] == -1:  # REP 145: the sensor has no such part
            values[name] = dict.fromkeys(values[name])
    return Report(_stamp(message), values, links=links)


def _wrench(message: Any, site: str, field_name: str) -> Report:
    del field_name
    site, links = _site(message, site, "wrench")
    wrench = _member(message, "wrench")
    values = {
        "ftf": _labelled(site, ("fx", "fy", "fz"), _vector(_member(wrench, "force"))),
        "ftm": _labelled(site, ("mx", "my", "mz"), _vector(_member(wrench, "torque"))),
    }
    return Report(_stamp(message), values, links=links)


def _battery(message: Any, site: str, field_name: str) -> Report:
    del field_name
    site = site or "main"
    present = bool(_member(message, "present"))
    share = _number(_member(message, "percentage"), "percentage")  # 0 to 1, despite its name
    readings: dict[str, Reading] = {
        "volt": _number(_member(message, "voltage"), "voltage"),
        "amp": _number(_member(message, "current"), "current"),
        "charge": None if share is None else share * 100,
    }
    values = {name: {site: reading if present else None} for name, reading in readings.items()}
    status = _member(message, "power_supply_status")
    word = (
        BATTERY_STATES[status] if isinstance(status, int) and 0 <= status < len(BATTERY_STATES) else "unknown"
    )
    word = word if present else "not present"
    return Report(_stamp(message), values, {f"battery {site}" if site != "main" else "battery": word})


def _odometry(message: Any, site: str, field_name: str) -> Report:
    del site, field_name
    pose = _member(_member(message, "pose"), "pose")
    values = {
        "base": _labelled("base", "xyz", _vector(_member(pose, "position"))),
        "baseq": _labelled("base", "wxyz", _quaternion(_member(pose, "orientation"))),
    }
    return Report(_stamp(message), values)


def _diagnostics(message: Any, site: str, field_name: str) -> Report:
    del site, field_name
    statuses = _member(message, "status")
    if not isinstance(statuses, (list, tuple)):
        raise RosMessageError(f"status is {type(statuses).__name__}, not a list")
    bits: dict[str, Reading] = {}
    info = {}
    for status in statuses[:MAX_STATUSES]:
        name = _text(_member(status, "name"), "name")[:NAME_MAX].strip()
        level = _level(_member(status, "level"))
        if name:
            bits[name] = [DIAG_BITS[level - 1]] if level else []
            info[name] = _text(_member(status, "message"), "message")[:TEXT_MAX]
    return Report(_stamp(message), {"diag": bits} if bits else {}, info)


READERS: dict[str, Callable[[Any, str, str], Report]] = {
    JOINT_STATE: _joint_state,
    CONTROLLER_STATE: _controller_state,
    IMU: _imu,
    WRENCH: _wrench,
    BATTERY: _battery,
    ODOMETRY: _odometry,
    DIAGNOSTICS: _diagnostics,
}


# --- members


def _optional(message: Any, name: str) -> Any:
    return message.get(name) if isinstance(message, Mapping) else getattr(message, name, None)


def _member(message: Any, name: str) -> Any:
    value = _optional(message, name)
    if value is None and not (isinstance(message, Mapping) and name in message):
        raise RosMessageError(f"no member {name!r}")
    return value


def _text(value: Any, what: str) -> str:
    if not isinstance(value, str):
        raise RosMessageError(f"{what} is {type(value).__name__}, not a text")
    try:
        value.encode()
    except UnicodeEncodeError:  # JSON can contain a lone surrogate, which can't be sent
        raise RosMessageError(f"{what} is not valid Unicode (half of a surrogate pair)") from None
    return value


def _names(value: Any, what: str) -> list[str]:
    if not isinstance(value, (list, tuple)):
        raise RosMessageError(f"{what} is not a list of names")
    if len(value) > MAX_NAMES:
        raise RosMessageError(f"{what} has {len(value)} names, at most {MAX_NAMES}")
    if not all(isinstance(v, str) and 0 < len(v) <= NAME_MAX for v in value):
        raise RosMessageError(f"{what} is not a list of names of 1 to {NAME_MAX} characters")
    _text("".join(value), what)
    return list(value)


def _numbers(value: Any, what: str) -> list[float | None]:
    listed = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(listed, Sequence) or isinstance(listed, (str, bytes)):
        raise RosMessageError(f"{what} is {type(value).__name__}, not a list of numbers")
    if len(listed) > MAX_NAMES:
        raise RosMessageError(f"{what} has {len(listed)} numbers, at most {MAX_NAMES}")
    return [v if type(v) is float else _number(v, what) for v in listed]


def _number(value: Any, what: str) -> float | None:
    """The number; None for null, which JSON has instead of NaN."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise RosMessageError(f"{what} is {_shown(value)}, not a number")
    return float(value)


def _shown(value: Any) -> str:
    """A short description of a wrong value, which may be huge or contain itself."""
    if isinstance(value, bool):
        return repr(str(value))
    return repr(value[:40]) if isinstance(value, (str, bytes)) else f"a {type(value).__name__}"


def _vector(value: Any) -> list[float | None]:
    return [_number(_member(value, c), c) for c in "xyz"]


def _quaternion(value: Any) -> list[float | None]:
    """w x y z; no reading for a quaternion that was left at zero."""
    parts = [_number(_member(value, c), c) for c in "wxyz"]
    return parts if any(parts) else [None] * 4


def _labelled(site: str, components: Sequence[str], numbers: Sequence[float | None]) -> dict[str, Reading]:
    return {f"{site}.{c}": number for c, number in zip(components, numbers, strict=True)}


def _site(message: Any, site: str, otherwise: str) -> tuple[str, dict[str, str]]:
    """The site, and site → link if the site is named after the message's frame."""
    if site:
        return site, {}
    frame = _text(_member(_member(message, "header"), "frame_id"), "frame_id").strip("/")
    if len(frame) > NAME_MAX:
        raise RosMessageError(f"frame_id has {len(frame)} characters, at most {NAME_MAX}")
    return (make_site_name(frame), {make_site_name(frame): frame}) if frame else (otherwise, {})


def _stamp(message: Any) -> float | None:
    stamp = _member(_member(message, "header"), "stamp")
    ros_1 = _optional(stamp, "sec") is None
    seconds = _member(stamp, "secs" if ros_1 else "sec")
    nanoseconds = _member(stamp, "nsecs" if ros_1 else "nanosec")
    if not isinstance(seconds, int) or not isinstance(nanoseconds, int):
        raise RosMessageError("the timestamp is not a time")
    stamp_s = seconds + nanoseconds * 1e-9
    if abs(stamp_s) > TIME_MAX_S:
        raise RosMessageError("the timestamp is not a time")
    return stamp_s or None


def _level(value: Any) -> int:
    """A ROS `byte`: a number, one byte, or that byte in base64, as bridges write it."""
    if isinstance(value, str):
        try:
            value = base64.b64decode(value, validate=True)
        except binascii.Error:
            raise RosMessageError(f"level is {value[:40]!r}") from None
    if isinstance(value, (bytes, bytearray)):
        value = value[0] if len(value) == 1 else -1
    if not isinstance(value, int):
        raise RosMessageError(f"level is {_shown(value)}, not 0 to {len(DIAG_BITS)}")
    if not 0 <= value <= len(DIAG_BITS):
        raise RosMessageError(f"level is {value if abs(value) < 1000 else 'huge'}, not 0 to {len(DIAG_BITS)}")
    return int(value)
