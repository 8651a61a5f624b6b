"""Finds the meaning of a table's column from its name, as common programs write it. Does no I/O.

    LABEL, FIELD.LABEL, info.NAME           our own names
    LABEL.velocity, LABEL_velocity          a joint and its quantity; also position, effort
    /joint_states/LABEL/velocity            PlotJuggler
    /joint_states/velocity[3]               PlotJuggler, rqt; the joint's name from /joint_states/name[3]
    field.velocity3                         `rostopic echo -p`; the name from field.name3
    velocity_3, wrench.force.x              bagpy
    /imu/orientation/w, field.wrench.force.x, /odom/pose/pose/position/x, …   other messages

A unit in brackets may follow. A channel of the profile with exactly this name has priority.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from posecast_edge.profile.defaults import UNITS, WELL_KNOWN
from posecast_edge.sources.ros.messages import make_site_name
from posecast_edge.sources.ros.topics import COMMAND

TO_OURS = {"deg": math.pi / 180, "deg/s": math.pi / 180, "mm": 1e-3, "mA": 1e-3, "mV": 1e-3}
INFO = "info"
UNKNOWN_UNIT = "unknown unit"
JOINTS = "pos"
MEMBERS = {"position": "pos", "velocity": "vel", "effort": "effort"}
ARRAY = re.compile(r"(name|position|velocity|effort)(?:\[(\d{1,4})\]|[._]?(\d{1,4}))")
ENDING = re.compile(r"(.+)[._](position|velocity|effort)")
COUNTER = re.compile(r"index|unnamed: \d+|(?:.*[/.])?header[/.]seq", re.IGNORECASE)
HEADER = re.compile(r"(?:.*[/.])?header[/.](?:stamp|frame_id).*")
# the last parts of a name → field, prefix of the component's letter
VECTORS: Mapping[tuple[str, ...], tuple[str, str]] = {
    ("pose", "position"): ("base", ""),
    ("pose", "orientation"): ("baseq", ""),
    ("orientation",): ("quat", ""),
    ("angular_velocity",): ("gyro", ""),
    ("linear_acceleration",): ("acc", ""),
    ("wrench", "force"): ("ftf", "f"),
    ("wrench", "torque"): ("ftm", "m"),
}
BATTERY = {"voltage": ("volt", 1.0), "current": ("amp", 1.0), "percentage": ("charge", 100.0)}
KIND_OF = {"quat": "imu", "gyro": "imu", "acc": "imu", "ftf": "wrench", "ftm": "wrench"}


@dataclass(frozen=True)
class ColumnMeaning:
    """The field and label that a column belongs to. `gain`: factor from the column's unit to the field's;
    `unit`: as written in the name."""

    field: str
    label: str
    gain: float = 1.0
    unit: str = ""


def split_unit(name: str) -> tuple[str, str | None]:
    """Split `name [unit]` into name and unit; None without a unit. The index in `name[3]` is not a unit."""
    at = name.find("[", name.rfind("]", 0, len(name) - 1) + 1)
    unit = name[at + 1 : -1].strip()
    if at < 0 or not name.endswith("]") or unit.isdigit():
        return name, None
    return name[:at].rstrip(), unit


def match_joint_name(name: str) -> tuple[str, int] | None:
    """The message and index of a column that holds a joint's name, such as /joint_states/name[3]."""
    parts, _ = _parted(name)
    found = ARRAY.fullmatch(parts[-1])
    return ("/".join(parts[:-1]), _index(found)) if found and found[1] == "name" else None


def interpret_column(
    name: str, joints: Mapping[tuple[str, int], str], known: Collection[tuple[str, str]]
) -> ColumnMeaning | str:
    """The meaning of the column with this name, or the reason why it is left out. `joints`: names by message
    and index; `known`: the (field, label) pairs of a profile."""
    if not name:
        return "it has no name"
    said, unit = split_unit(name)
    if unit is not None and unit not in TO_OURS and unit not in UNITS:
        return f"{UNKNOWN_UNIT} {unit[:40]!r}; known: {', '.join(u for u in (*UNITS, *TO_OURS) if u)}"
    if COUNTER.fullmatch(said):
        return "it counts rows"
    if HEADER.fullmatch(said):
        return "it belongs to the message's header"
    field, _, label = said.partition(".")
    if not label:
        field, label = JOINTS, said
    gain, unit = TO_OURS.get(unit or "", 1.0), unit or ""
    found = None if (field, label) in known or (JOINTS, said) in known else _nested(said, joints)
    if isinstance(found, str):
        return found
    field, label, of_message = found or (field, label, 1.0)
    return ColumnMeaning(field, label, gain * of_message, unit)


def _nested(said: str, joints: Mapping[tuple[str, int], str]) -> tuple[str, str, float] | str | None:
    """Field, label, gain; or the reason to leave it out; None when it is not a nested name."""
    parts, is_path = _parted(said)
    found = ARRAY.fullmatch(parts[-1]) if is_path or len(parts) == 1 else None
    if found:
        above = parts[:-1]
        if found[1] == "name":
            return "it names a joint"
        label = joints.get(("/".join(above), _index(found))) or f"joint{_index(found)}"
        return _field(found[1], above), label, 1.0
    if is_path and len(parts) > 1 and parts[-1] in MEMBERS:
        return _field(parts[-1], parts[:-2]), parts[-2], 1.0
    message = parts if is_path else said.split(".")
    of_message = _member(message, is_path)
    if of_message is not None or said.startswith(("/", "field.")):
        return of_message or "this kind of column is not supported"
    ending = ENDING.fullmatch(said)
    if ending and not is_path and ending[1] not in WELL_KNOWN:
        return MEMBERS[ending[2]], ending[1], 1.0
    return None


def _member(parts: Sequence[str], is_path: bool) -> tuple[str, str, float] | None:
    """A component of a sensor's message."""
    if len(parts) > 1 and parts[-1] in ("x", "y", "z", "w"):
        for ending, (field, letter) in VECTORS.items():
            above = parts[: -1 - len(ending)]
            if tuple(parts[-1 - len(ending) : -1]) == ending:
                site = make_site_name("/".join(above)) or KIND_OF.get(field, "")
                return field, f"{'base' if field.startswith('base') else site}.{letter}{parts[-1]}", 1.0
    if is_path and parts[-1] in BATTERY and len(parts) < 4:
        field, gain = BATTERY[parts[-1]]
        return field, "main", gain
    return None


def _parted(said: str) -> tuple[list[str], bool]:
    """The parts of a nested name, and whether it is written as one."""
    if said.startswith("field."):
        return said.removeprefix("field.").split("."), True
    return (said.strip("/").split("/"), True) if "/" in said.strip("/") else ([said], said.startswith("/"))


def _index(found: re.Match[str]) -> int:
    return int(found[2] or found[3])


def _field(member: str, topic: Sequence[str]) -> str:
    commanded = bool(topic) and COMMAND.fullmatch(topic[-1]) is not None
    return "ref" if commanded and member == "position" else MEMBERS[member]
