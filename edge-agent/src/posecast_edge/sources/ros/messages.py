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
| diagnostic_msgs/DiagnosticArray | `diag`, bits of profile.defaults.DIAG_BITS: names of the statuses |
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from posecast_edge.kit import many, quote
from posecast_edge.profile.defaults import DIAG_BITS
from posecast_edge.sample import NOTHING, TIME_MAX_S, Reading

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
MAX_NAMES = 8192  # joints of one message, of which the agent shows as many as fit; numbers of one list
NAME_MAX = 200  # characters of a name
# Longer ones are cut.
PARTS_MAX = 16  # parts of one message that are named when they are left out
MAX_STATUSES = 64  # of one message; further ones are ignored
TEXT_MAX = 200  # characters of a text that is shown

# what reading a message of an unexpected shape may raise
MALFORMED = (TypeError, ValueError, ArithmeticError, LookupError, AttributeError, RecursionError)


class RosMessageError(ValueError):
    """A message that does not match its type. One line, without the topic."""


@dataclass(frozen=True)
class Report:
    """The content of one message.

    `stamp_s`: the header's time in seconds; None if it is missing or zero. `values`: field → label → reading;
    None if the message states that there is no reading. `info`: texts. `links`: site → link of the model, if
    the message names it. `lasts`: the content is published once and never expires. `left_out`: part of the
    message that can't be read → why ("effort has 1 value, name 2").
    """

    stamp_s: float | None
    values: Mapping[str, Mapping[str, Reading]]
    info: Mapping[str, str] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    lasts: bool = False
    left_out: Mapping[str, str] = field(default_factory=dict)


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
    """Read one message whose (short) type is in READERS. A part that can't be read is left out, and the rest
    counts. Raises RosMessageError when nothing is left.

    `site`: the sensor's name; "" to use the message's frame. `field_name`: the field of a JointState's
    positions, `pos` or `ref`; with `ref`, velocities are not read.
    """
    reader = READERS[type_name]
    try:
        return reader(message, site, field_name)
    except RosMessageError:
        raise
    except MALFORMED as e:
        raise RosMessageError(_describe(e)) from None


def read_transforms(message: Any) -> tuple[list[Transform], dict[str, str]]:
    """Read a TFMessage. Returns its transforms, and why others are left out, as in Report. Ignores transforms
    that are not finite or whose frames have no names. Raises RosMessageError when none can be read."""
    transforms = _member(message, "transforms")
    if not isinstance(transforms, (list, tuple)) or len(transforms) > MAX_NAMES:
        raise RosMessageError(f"transforms is not a list of at most {MAX_NAMES}")
    found: list[Transform] = []
    left_out: dict[str, str] = {}
    for i, item in enumerate(transforms):
        with _leaving_out(f"transforms[{i}]", left_out):
            one = _transform(item, left_out)
            if one is not None:
                found.append(one)
    if not found:
        _raise_first(left_out)
    return found, left_out


def _transform(item: Any, left_out: dict[str, str]) -> Transform | None:
    parent = _text(_member(_member(item, "header"), "frame_id"), "frame_id").strip("/")
    child = _text(_member(item, "child_frame_id"), "child_frame_id").strip("/")
    pose = _member(item, "transform")
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
    return Transform(parent, child, (x, y, z), wxyz, _stamp(item, left_out))


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
    left_out: dict[str, str] = {}
    names = _names(_member(message, "name"), "name", left_out)
    values: dict[str, Mapping[str, Reading]] = {}
    members = (("position", field_name), ("velocity", "vel"), ("effort", "effort"))
    for member, name in members if field_name == "pos" else members[:1]:
        readings = _by_name(message, member, names, "name", left_out)
        if readings:
            values[name] = readings
    if not values:
        _raise_first(left_out)
        raise RosMessageError("a JointState without positions" if names else "a JointState without joints")
    return Report(_stamp(message, left_out), values, left_out=left_out)


def _controller_state(message: Any, site: str, field_name: str) -> Report:
    """The controller's target is `reference` or, up to ROS 2 Galactic and in ROS 1, `desired`."""
    del site, field_name
    left_out: dict[str, str] = {}
    names = _names(_member(message, "joint_names"), "joint_names", left_out)
    for point in (_optional(message, member) for member in ("reference", "desired")):
        readings = _by_name(point, "positions", names, "joint_names", left_out)
        if readings:
            return Report(_stamp(message, left_out), {"ref": readings}, left_out=left_out)
    _raise_first(left_out)
    raise RosMessageError("a controller state without target positions")


def _imu(message: Any, site: str, field_name: str) -> Report:
    del field_name
    left_out: dict[str, str] = {}
    site, links = _site(message, site, "imu", left_out)
    values: dict[str, Mapping[str, Reading]] = {}
    for name, member, components, read in (
        ("quat", "orientation", "wxyz", _quaternion),
        ("gyro", "angular_velocity", "xyz", _vector),
        ("acc", "linear_acceleration", "xyz", _vector),
    ):
        with _leaving_out(member, left_out):
            values[name] = _labelled(site, components, read(_member(message, member)))
        covariance = f"{member}_covariance"
        with _leaving_out(covariance, left_out):
            numbers = _list(_optional(message, covariance), covariance)
            if name in values and numbers and numbers[0] == -1:  # REP 145: the sensor has no such part
                values[name] = dict.fromkeys(values[name])
    return _filled(message, "an Imu without readings", values, left_out, links)


def _wrench(message: Any, site: str, field_name: str) -> Report:
    del field_name
    left_out: dict[str, str] = {}
    site, links = _site(message, site, "wrench", left_out)
    wrench = _member(message, "wrench")
    values: dict[str, Mapping[str, Reading]] = {}
    for name, member, letter in (("ftf", "force", "f"), ("ftm", "torque", "m")):
        with _leaving_out(member, left_out):
            components = [f"{letter}{c}" for c in "xyz"]
            values[name] = _labelled(site, components, _vector(_member(wrench, member)))
    return _filled(message, "a Wrench without readings", values, left_out, links)


SHARE_MOST = 1.5  # of a charge from 0 to 1: more is percent


def _battery(message: Any, site: str, field_name: str) -> Report:
    del field_name
    site = site or "main"
    left_out: dict[str, str] = {}
    present = bool(_member(message, "present")) if _optional(message, "present") is not None else True
    values: dict[str, Mapping[str, Reading]] = {}
    for name, member, factor in (
        ("volt", "voltage", 1),
        ("amp", "current", 1),
        ("charge", "percentage", 100),
    ):
        with _leaving_out(member, left_out):
            number = _number(_member(message, member), member)
            # the definition says 0 to 1; some drivers write percent
            gain = 1 if member == "percentage" and number is not None and number > SHARE_MOST else factor
            values[name] = {site: number * gain if present and number is not None else None}
            if not present and name == "volt" and number:
                left_out["present"] = f"voltage is {number:.3g}, but present is false: no battery"
    status = _optional(message, "power_supply_status")
    known = isinstance(status, int) and 0 <= status < len(BATTERY_STATES)
    word = (BATTERY_STATES[status] if known else "unknown") if present else "not present"
    info = {f"battery {site}" if site != "main" else "battery": word}
    return _filled(message, "a BatteryState without readings", values, left_out, info=info)


def _odometry(message: Any, site: str, field_name: str) -> Report:
    del site, field_name
    pose = _member(_member(message, "pose"), "pose")
    left_out: dict[str, str] = {}
    values: dict[str, Mapping[str, Reading]] = {}
    with _leaving_out("position", left_out):
        values["base"] = _labelled("base", "xyz", _vector(_member(pose, "position")))
    with _leaving_out("orientation", left_out):
        values["baseq"] = _labelled("base", "wxyz", _quaternion(_member(pose, "orientation")))
    return _filled(message, "an Odometry without a pose", values, left_out)


def _diagnostics(message: Any, site: str, field_name: str) -> Report:
    del site, field_name
    statuses = _member(message, "status")
    if not isinstance(statuses, (list, tuple)):
        raise RosMessageError(f"status is {type(statuses).__name__}, not a list")
    bits: dict[str, Reading] = {}
    info: dict[str, str] = {}
    left_out: dict[str, str] = {}
    for i, status in enumerate(statuses[:MAX_STATUSES]):
        with _leaving_out(f"status[{i}]", left_out):
            name = _text(_member(status, "name"), "name")[:NAME_MAX].strip()
            level = _level(_member(status, "level"))
            if name:
                bits[name] = [DIAG_BITS[level - 1]] if level else []
                info[name] = _text(_member(status, "message"), "message")[:TEXT_MAX]
    if not bits:
        _raise_first(left_out)
    return Report(_stamp(message, left_out), {"diag": bits} if bits else {}, info, left_out=left_out)


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


def _names(value: Any, what: str, left_out: dict[str, str]) -> list[str | None]:
    """The names of joints; None for one that is no text, is too long, or came before."""
    if not isinstance(value, (list, tuple)):
        raise RosMessageError(f"{what} is not a list of names")
    if len(value) > MAX_NAMES:
        raise RosMessageError(f"{what} has {len(value)} names, at most {MAX_NAMES}")
    if all(isinstance(v, str) and len(v) <= NAME_MAX for v in value) and len(set(value)) == len(value):
        return list(value)
    names: dict[str, None] = {}
    found: list[str | None] = []
    for i, name in enumerate(value):
        if not isinstance(name, str):
            why = f"is {_shown(name)}, not a text"
        elif len(name) > NAME_MAX:
            why = f"has {len(name)} characters, at most {NAME_MAX}"
        elif name in names:
            why = f"is {quote(name)} again"
        else:
            names[name] = None
            found.append(name)
            continue
        found.append(None)
        if len(left_out) < PARTS_MAX:
            left_out[f"{what}[{i}]"] = f"{what}[{i}] {why}"
    return found


def _by_name(
    message: Any, member: str, names: Sequence[str | None], of_names: str, left_out: dict[str, str]
) -> dict[str, Reading]:
    """The numbers of a member by name. Empty if the member is empty or missing, by which a robot leaves out
    what it does not measure, and if it can't be read."""
    with _leaving_out(member, left_out):
        numbers = _list(_optional(message, member), member)
        if numbers and len(numbers) != len(names):
            raise RosMessageError(f"{member} has {many(len(numbers), 'value')}, {of_names} {len(names)}")
        if any(type(v) is not float for v in numbers):
            numbers = _read_each(numbers, member, names, left_out)
        return {n: v for n, v in zip(names, numbers, strict=False) if n is not None}
    return {}


def _read_each(
    numbers: Sequence[Any], member: str, names: Sequence[str | None], left_out: dict[str, str]
) -> list[float | None]:
    """Read a list of which some may be no numbers; those become None. Raises RosMessageError if all are."""
    found: list[float | None] = []
    bad: dict[str, str] = {}
    good = 0
    for name, value in zip(names, numbers, strict=True):
        part = f"{member} of {quote(name)}"
        try:
            found.append(_number(value, part))
            good += 1
        except RosMessageError as e:
            found.append(None)
            if len(bad) + len(left_out) < PARTS_MAX:
                bad[part] = str(e)
    if not good:
        raise RosMessageError(next(iter(bad.values()), f"{member} has no numbers"))
    left_out.update(bad)
    return found


def _list(value: Any, what: str) -> Sequence[Any]:
    listed = value.tolist() if hasattr(value, "tolist") else value
    if listed is None:
        return []
    if not isinstance(listed, Sequence) or isinstance(listed, (str, bytes)):
        raise RosMessageError(f"{what} is {type(value).__name__}, not a list of numbers")
    if len(listed) > MAX_NAMES:
        raise RosMessageError(f"{what} has {len(listed)} numbers, at most {MAX_NAMES}")
    return listed


def _number(value: Any, what: str) -> float | None:
    """The number; None for null, which JSON has instead of NaN."""
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise RosMessageError(f"{what} is {_shown(value)}, not a number")
    try:
        return float(value)
    except OverflowError:
        raise RosMessageError(f"{what} is too large") from None


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


def _site(message: Any, site: str, otherwise: str, left_out: dict[str, str]) -> tuple[str, dict[str, str]]:
    """The site, and site → link if the site is named after the message's frame."""
    if site:
        return site, {}
    frame = ""
    with _leaving_out("frame_id", left_out):
        frame = _text(_optional(_optional(message, "header"), "frame_id") or "", "frame_id").strip("/")
        if len(frame) > NAME_MAX:
            raise RosMessageError(f"frame_id has {len(frame)} characters, at most {NAME_MAX}")
        return (make_site_name(frame), {make_site_name(frame): frame}) if frame else (otherwise, {})
    return otherwise, {}


def _stamp(message: Any, left_out: dict[str, str]) -> float | None:
    """The header's time; None without one, so that the time of arrival counts. ROS 2, ROS 1 and the JSON of
    Foxglove name its two numbers differently."""
    stamp = _optional(_optional(message, "header"), "stamp")
    if stamp is None:
        return None
    with _leaving_out("header.stamp", left_out):
        parts = [
            next((n for name in names if (n := _optional(stamp, name)) is not None), None)
            for names in (("sec", "secs"), ("nanosec", "nsec", "nsecs"))
        ]
        numbers = [n for n in parts if isinstance(n, (int, float)) and not isinstance(n, bool)]
        stamp_s = numbers[0] + numbers[1] * 1e-9 if len(numbers) == len(parts) else math.nan
        if not abs(stamp_s) <= TIME_MAX_S:
            raise RosMessageError("header.stamp is no time (the time of arrival counts)")
        return stamp_s or None
    return None


@contextmanager
def _leaving_out(part: str, left_out: dict[str, str]) -> Iterator[None]:
    """Leave out a part that can't be read inside."""
    try:
        yield
    except (RosMessageError, *MALFORMED) as e:
        why = _describe(e)
        if len(left_out) < PARTS_MAX:
            left_out[part] = why if why.startswith(part) else f"{part}: {why}"


def _raise_first(left_out: Mapping[str, str]) -> None:
    """Raise RosMessageError for the first part that was left out, if any, because nothing else is left."""
    for why in left_out.values():
        raise RosMessageError(why)


def _filled(
    message: Any,
    otherwise: str,
    values: Mapping[str, Mapping[str, Reading]],
    left_out: dict[str, str],
    links: Mapping[str, str] = NOTHING,
    info: Mapping[str, str] = NOTHING,
) -> Report:
    """The report. Raises RosMessageError when it has no values: `otherwise`, if no part was left out."""
    if not values:
        _raise_first(left_out)
        raise RosMessageError(otherwise)
    return Report(_stamp(message, left_out), values, info, links, left_out=left_out)


def _describe(e: Exception) -> str:
    text = " ".join(str(e).split())[:200]
    return text if isinstance(e, RosMessageError) else f"{type(e).__name__}: {text}"


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
