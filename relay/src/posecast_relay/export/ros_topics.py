"""What the channels of a schema are in messages of ROS 2: which topics there are, and how their numbers come
from the codes of a frame, in SI units. docs/how-to/record/mcap.md has the table.

A field that no message carries as a whole is a topic of its own, /posecast/FIELD, so nothing is left out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from posecast_wire import Schema
from posecast_wire.schema import JOINT, MISSING, Field, JointMap

from posecast_relay.export.ros_messages import (
    IMU,
    JOINT_STATE,
    NUMBERS,
    WRENCH,
    CdrMessage,
    lay_imu,
    lay_joint_state,
    lay_numbers,
    lay_wrench,
)
from posecast_relay.export.rotation import quat_of_rpy

Quantity = Literal[
    "position", "velocity", "effort", "rotation rate", "acceleration", "force", "torque", "part"
]

DEGREE = math.pi / 180
TURN = 2 * math.pi
ROTATION = {"rad": 1.0, "deg": DEGREE, "°": DEGREE}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ROTATION_RATE = {"rad/s": 1.0, "deg/s": DEGREE, "°/s": DEGREE, "rpm": TURN / 60}
SPEED = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
TORQUE = {
    **dict.fromkeys(("N·m", "Nm", "N*m", "N.m"), 1.0),
    **dict.fromkeys(("mN·m", "mNm", "N·mm", "Nmm"), 1e-3),
    **dict.fromkeys(("kN·m", "kNm"), 1e3),
}
ACCELERATION = {
    **dict.fromkeys(("m/s²", "m/s2", "m/s^2"), 1.0),
    **dict.fromkeys(("mm/s²", "mm/s2", "mm/s^2"), 1e-3),
    "g": 9.80665,
}
# a field without a unit uses the usual one, which is SI (SPEC §2)
USUAL = {"": 1.0}

FACTORS: Mapping[Quantity, Mapping[str, float]] = {
    "position": USUAL | ROTATION | LENGTH,
    "velocity": USUAL | ROTATION_RATE | SPEED,
    "effort": USUAL | TORQUE | FORCE,
    "rotation rate": USUAL | ROTATION_RATE,
    "acceleration": USUAL | ACCELERATION,
    "force": USUAL | FORCE,
    "torque": USUAL | TORQUE,
    "part": USUAL,  # of a quaternion
}


def find_factor(quantity: Quantity, unit: str) -> float | None:
    """Return the factor that converts a value in `unit` to SI (rad, m, s, N and their products). None if the
    unit is unknown or measures another quantity."""
    return FACTORS[quantity].get(unit)


IMU_PARTS: Mapping[str, tuple[Sequence[str], Quantity]] = {
    "quat": ("xyzw", "part"),
    "gyro": ("xyz", "rotation rate"),
    "acc": ("xyz", "acceleration"),
}
TILT: tuple[Sequence[str], Quantity] = (("roll", "pitch"), "position")  # of a sensor that knows no heading
WRENCH_PARTS: Mapping[str, tuple[Sequence[str], Quantity]] = {
    "ftf": (("fx", "fy", "fz"), "force"),
    "ftm": (("mx", "my", "mz"), "torque"),
}
NOT_IN_TOPIC = re.compile(r"[^A-Za-z0-9_]")


class ChannelTerm(NamedTuple):
    """Gain · channel; `channel`: its place in the code vector, None for one that no frame has."""

    channel: int | None
    gain: float


class RosNumber(NamedTuple):
    """A number of a message: Σ gain · channel + offset; NaN where a channel has no reading, or without
    any."""

    terms: tuple[ChannelTerm, ...] = ()
    offset: float = 0.0


NOTHING = RosNumber((ChannelTerm(None, 1.0),))


@dataclass(frozen=True)
class RosTopic:
    """A topic. `parts`: where numbers begin in the message, and which; `covariances`: places that are -1
    while none of the numbers has a reading, else 0; `attitude`: where a quaternion begins that is made of
    roll and pitch; `units`: of the channels as they are, by what they are of."""

    name: str
    type_name: str
    message: CdrMessage
    parts: Sequence[tuple[int, Sequence[RosNumber]]]
    covariances: Sequence[tuple[int, Sequence[RosNumber]]] = ()
    attitude: tuple[int, Sequence[RosNumber]] | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def fill(self, unix_ns: int, values: Sequence[float]) -> bytes:
        """The message of a frame. `values`: of all channels in the schema's order, NaN where there is no
        reading."""
        self.message.set_stamps(unix_ns)
        for at, numbers in self.parts:
            self.message.set_numbers(at, [_compute(number, values) for number in numbers])
        if self.attitude is not None:
            at, numbers = self.attitude
            roll, pitch = (_compute(number, values) for number in numbers)
            w, x, y, z = quat_of_rpy((roll, pitch, 0.0))
            self.message.set_numbers(at, (x, y, z, w))
        for at, numbers in self.covariances:
            known = any(not math.isnan(_compute(number, values)) for number in numbers)
            self.message.set_numbers(at, [0.0 if known else -1.0])
        return bytes(self.message)

    def list_carried(self) -> set[int]:
        """The channels that can be told from this message: those that are a number of it by themselves."""
        alone = (number.terms[0] for _, numbers in self.parts for number in numbers if len(number.terms) == 1)
        return {term.channel for term in alone if term.channel is not None and term.gain}


def compute_values(schema: Schema, codes: Sequence[int]) -> list[float]:
    """The value of each channel in its own unit; NaN where there is no reading."""
    nan = math.nan
    values: list[float] = []
    for f in schema.fields:
        scale = f.scale
        values += [nan if c == MISSING else c * scale for c in codes[f.start : f.start + f.size]]
    return values


def list_topics(schema: Schema, root_link: str | None = None) -> list[RosTopic]:
    """The topics of a schema's frames, in the order in which their messages are written: /joint_states last,
    since a player that merges topics, as an edge does, tells of all others with it. `root_link`: of the
    model, where a sensor without a link is."""
    topics = [*_list_sensor_topics(schema, root_link), *_list_joint_topics(schema)]
    carried = set[int]().union(*(topic.list_carried() for topic in topics))
    plain = [
        _make_plain_topic(schema, f)
        for f in schema.fields
        if not carried.issuperset(range(f.start, f.start + f.size))
    ]
    return plain + topics


def make_topic_part(site: str, taken: Iterable[str]) -> str:
    """A site's name as a part of a topic's: letters, digits and _, the first no digit; numbered where another
    site has it."""
    name = NOT_IN_TOPIC.sub("_", site) or "_"
    name = f"_{name}" if name[0].isdigit() else name
    taken = set(taken)
    return next(
        each for n in range(1, len(taken) + 2) if (each := name if n == 1 else f"{name}_{n}") not in taken
    )


def _compute(number: RosNumber, values: Sequence[float]) -> float:
    total = number.offset
    for channel, gain in number.terms:
        if channel is None:
            return math.nan
        total += gain * values[channel]
    return total


# --- joints


def _list_joint_topics(schema: Schema) -> list[RosTopic]:
    topics: list[RosTopic] = []
    pos, ref = schema.find_field("pos"), schema.find_field("ref")
    main = pos or ref
    names = () if ref is None else tuple(_list_joints(schema, ref))
    wanted = _list_positions(schema, ref, names)
    if wanted is not None:
        message, places = lay_joint_state(names, True, False, False)
        topics.append(RosTopic("/joint_references", JOINT_STATE, message, [(places.position or 0, wanted)]))
    states = (pos, schema.find_field("vel"), schema.find_field("effort"))
    named = next((f for f in states if f is not None and _list_joints(schema, f)), None)
    if named is None:
        return topics
    names = tuple(_list_joints(schema, named))
    rows = (
        _list_positions(schema, pos, names),
        _list_rates(schema, states[1], main, names),
        _list_efforts(schema, states[2], main, names),
    )
    message, places = lay_joint_state(names, *(row is not None for row in rows))
    parts = [(at, row) for at, row in zip(places, rows, strict=True) if at is not None and row is not None]
    if parts:
        topics.append(RosTopic("/joint_states", JOINT_STATE, message, parts))
    return topics


def _list_joints(schema: Schema, f: Field) -> dict[str, JointMap | None]:
    """The joints that a field moves, as the wire's mapping has them: None for a channel that is the joint of
    its own name."""
    own = dict.fromkeys(f.labels) if f.label_set == JOINT else {}
    return {**own, **schema.mapping.joints}


def _list_positions(schema: Schema, f: Field | None, names: Sequence[str]) -> list[RosNumber] | None:
    if f is None:
        return None

    def make_mapped(how: JointMap) -> RosNumber:
        terms = tuple(ChannelTerm(_place(f, channel), gain) for channel, gain in how.terms)
        return RosNumber(terms, how.offset)

    return _list_joint_numbers(schema, f, names, "position", make_mapped)


def _list_rates(
    schema: Schema, f: Field | None, main: Field | None, names: Sequence[str]
) -> list[RosNumber] | None:
    """Σ ratio · speed of channel: a ratio is a gain without the unit of positions that may be in it."""
    if f is None or f.label_set != JOINT:
        return None

    def make_mapped(how: JointMap) -> RosNumber:
        terms: list[ChannelTerm] = []
        for channel, gain in how.terms:
            factor = _find_factor(schema, f, channel, "velocity")
            ratio = _find_ratio(schema, main, channel, gain)
            known = factor is not None and ratio is not None
            terms.append(ChannelTerm(_place(f, channel) if known else None, (factor or 0.0) * (ratio or 0.0)))
        return RosNumber(tuple(terms))

    return _list_joint_numbers(schema, f, names, "velocity", make_mapped)


def _list_efforts(
    schema: Schema, f: Field | None, main: Field | None, names: Sequence[str]
) -> list[RosNumber] | None:
    """Where one channel moves one joint: effort of the channel / ratio. How several share it nobody knows."""
    if f is None or f.label_set != JOINT:
        return None
    uses = [channel for how in schema.mapping.joints.values() for channel, _ in how.terms]

    def make_mapped(how: JointMap) -> RosNumber:
        channel, gain = how.terms[0] if len(how.terms) == 1 else ("", 0.0)
        factor = _find_factor(schema, f, channel, "effort")
        ratio = _find_ratio(schema, main, channel, gain)
        if factor is None or not ratio or uses.count(channel) != 1:
            return NOTHING
        return RosNumber((ChannelTerm(_place(f, channel), factor / ratio),))

    return _list_joint_numbers(schema, f, names, "effort", make_mapped)


def _list_joint_numbers(
    schema: Schema,
    f: Field,
    names: Sequence[str],
    quantity: Quantity,
    make_mapped: Callable[[JointMap], RosNumber],
) -> list[RosNumber] | None:
    """A number for each joint: by `make_mapped` where the mapping has the joint, else the channel of that
    name. None where no number has a channel."""
    joints = schema.mapping.joints
    numbers = [
        _make_number(schema, f, name, quantity) if (how := joints.get(name)) is None else make_mapped(how)
        for name in names
    ]
    return _unless_empty(numbers)


def _find_ratio(schema: Schema, main: Field | None, channel: str, gain: float) -> float | None:
    factor = 1.0 if main is None else _find_factor(schema, main, channel, "position")
    return None if factor is None else gain / factor


# --- sensors


def _list_sensor_topics(schema: Schema, root_link: str | None) -> list[RosTopic]:
    topics: list[RosTopic] = []
    imus: list[str] = []
    for site in _list_sites(schema, {**IMU_PARTS, "tilt": TILT}):
        groups = [_list_parts(schema, name, site, *of) for name, of in IMU_PARTS.items()]
        quat, tilt = groups[0], _list_parts(schema, *("tilt", site), *TILT)
        tilted = _unless_empty(quat) is None and _unless_empty(tilt) is not None
        message, places = lay_imu(_find_frame(schema, site, root_link))
        parts = [(at, numbers) for (at, _), numbers in zip(places, groups, strict=True)]
        told = [tilt if tilted else quat, *groups[1:]]
        covariances = [(at, numbers) for (_, at), numbers in zip(places, told, strict=True)]
        attitude = (places[0][0], tilt) if tilted else None
        imus.append(make_topic_part(site, imus))
        topics.append(RosTopic(f"/imu/{imus[-1]}", IMU, message, parts, covariances, attitude))
    wrenches: list[str] = []
    for site in _list_sites(schema, WRENCH_PARTS):
        groups = [_list_parts(schema, name, site, *of) for name, of in WRENCH_PARTS.items()]
        wrench, starts = lay_wrench(_find_frame(schema, site, root_link))
        wrenches.append(make_topic_part(site, wrenches))
        topics.append(
            RosTopic(f"/wrench/{wrenches[-1]}", WRENCH, wrench, list(zip(starts, groups, strict=True)))
        )
    return [topic for topic in topics if topic.list_carried() or topic.attitude]


def _list_sites(schema: Schema, parts: Mapping[str, tuple[Sequence[str], Quantity]]) -> list[str]:
    """Sites of these fields in the schema's order, each once."""
    sites: dict[str, None] = {}
    for f in schema.fields:
        if f.name not in parts or f.label_set == JOINT or f.bits:
            continue
        for label in f.labels:
            site, dot, part = label.rpartition(".")
            if dot and site and part in parts[f.name][0]:
                sites[site] = None
    return list(sites)


def _list_parts(
    schema: Schema, name: str, site: str, parts: Sequence[str], quantity: Quantity
) -> list[RosNumber]:
    f = schema.find_field(name)
    if f is None or f.label_set == JOINT or f.bits:
        return [NOTHING] * len(parts)
    return [_make_number(schema, f, f"{site}.{part}", quantity) for part in parts]


def _find_frame(schema: Schema, site: str, root_link: str | None) -> str:
    """The link that carries the sensor; where none is told, the root for an IMU, else the site's own name."""
    mount = schema.mapping.sensors.get(site)
    if mount is not None and mount.link is not None:
        return mount.link
    return root_link if mount is not None and mount.kind == "imu" and root_link is not None else site


# --- what is left


def _make_plain_topic(schema: Schema, f: Field) -> RosTopic:
    message, at = lay_numbers(",".join(f.labels), f.size)
    numbers = [RosNumber((ChannelTerm(f.start + i, 1.0),)) for i in range(f.size)]
    units = {"unit": f.unit} if f.unit else {}
    own = {
        f"unit.{name}": unit for name in f.labels if (unit := schema.mapping.find_unit(f.name, name) or "")
    }
    return RosTopic(f"/posecast/{f.name}", NUMBERS, message, [(at, numbers)], units=units | own)


def _make_number(schema: Schema, f: Field, label: str, quantity: Quantity) -> RosNumber:
    """A channel in SI; nothing when there is none, or when its unit is none of this quantity."""
    factor = _find_factor(schema, f, label, quantity)
    return NOTHING if factor is None else RosNumber((ChannelTerm(_place(f, label), factor),))


def _find_factor(schema: Schema, f: Field, label: str, quantity: Quantity) -> float | None:
    if f.bits or label not in f.labels:
        return None
    return find_factor(quantity, schema.mapping.find_unit(f.name, label) or f.unit)


def _place(f: Field, label: str) -> int | None:
    return f.start + f.labels.index(label) if label in f.labels else None


def _unless_empty(numbers: list[RosNumber]) -> list[RosNumber] | None:
    """None where no number has a channel."""
    return numbers if any(term.channel is not None for each in numbers for term in each.terms) else None
