"""Finds channels by name, with an index built in time proportional to the schema."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from posecast_wire import Schema, compute_joint_values
from posecast_wire.schema import JOINT, MISSING, Xyz

from posecast_relay.export.model_tree import VARIABLES, Box, ModelTree, Quat, TreeJoint
from posecast_relay.export.rotation import (
    SHORTEST,
    UPRIGHT,
    invert_quat,
    multiply_quats,
    normalise_quat,
    quat_of_rpy,
    remove_heading,
    rotate_vector,
)


class ChannelPlaces:
    """The positions of a schema's channels in the code vector."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._fields: dict[str, Mapping[str, int]] = {}

    def find(self, name: str, label: str) -> int | None:
        """Return the position of a field's channel; None if the frames have no channel of this name."""
        if name not in self._fields:
            field = self._schema.find_field(name)
            labels = () if field is None else field.labels
            start = 0 if field is None else field.start
            self._fields[name] = {each: start + i for i, each in enumerate(labels)}
        return self._fields[name].get(label)


class LinkPose(NamedTuple):
    """parent_from_link: metres, and a unit quaternion w, x, y, z."""

    xyz: Xyz
    quat: Quat


AT_ORIGIN = LinkPose((0.0, 0.0, 0.0), UPRIGHT)


def compose_poses(a: LinkPose, b: LinkPose) -> LinkPose:
    """a_from_c = a_from_b · b_from_c."""
    dx, dy, dz = rotate_vector(a.quat, b.xyz)
    x, y, z = a.xyz
    return LinkPose((x + dx, y + dy, z + dz), multiply_quats(a.quat, b.quat))


class FrameReadings:
    """What the frames of one schema say of the body, each reading the last that there was."""

    def __init__(self, schema: Schema) -> None:
        self.joints: dict[str, float] = {}  # by URDF name (or JOINT/variable), rad or m
        self.base: LinkPose | None = None  # world_from_root
        places = ChannelPlaces(schema)
        self.imu = _find_body_imu(schema, places)
        self.world_from_imu: Quat | None = None
        self._schema = schema
        self._base = _find_channels(schema, places, "base", "base", "xyz")
        self._base_turn = _find_channels(schema, places, "baseq", "base", "wxyz")

    def take(self, codes: Sequence[int]) -> None:
        """Take a frame's codes, all channels in the schema's order."""
        for joint, value in compute_joint_values(self._schema, codes, "pos").items():
            if math.isfinite(value):
                self.joints[joint] = value
        xyz, turn = _read(codes, self._base), _read(codes, self._base_turn)
        quat = None if turn is None else normalise_quat(turn)
        if xyz is not None and quat is not None:
            self.base = LinkPose((xyz[0], xyz[1], xyz[2]), quat)
        if self.imu is not None:
            self.world_from_imu = self.imu.read(codes) or self.world_from_imu


class LinkPoses:
    """The poses of one model's links. `poses`: parent_from_link of each, of the root world_from_root."""

    def __init__(self, tree: ModelTree) -> None:
        self.poses = [AT_ORIGIN] * len(tree.links)
        self._tree = tree
        self._link_of = {name: i for i, name in enumerate(tree.links)}
        self._names = [tuple(joint.name + part for part, _ in VARIABLES[joint.type]) for joint in tree.joints]
        self._read: list[list[float | None]] = [[None] * len(names) for names in self._names]
        self._values: list[tuple[float, ...] | None] = [None] * len(tree.joints)
        self._leaned: Quat | None = None

    def update(self, readings: FrameReadings) -> None:
        """Pose the model by the newest readings."""
        for read, names in zip(self._read, self._names, strict=True):
            for at, name in enumerate(names):
                read[at] = readings.joints.get(name, read[at])
        for i, joint in enumerate(self._tree.joints):
            values = self._find_values(i, joint)
            if values != self._values[i]:
                self._values[i] = values
                self.poses[i + 1] = _move(joint, values)
        self.poses[0] = readings.base or self._stand(readings)

    def _find_values(self, i: int, joint: TreeJoint) -> tuple[float, ...]:
        """A mimic joint's own reading wins over the one that it copies."""
        read = self._read[i]
        if joint.mimic is not None and len(read) == 1 and read[0] is None:
            led = self._read[joint.mimic.joint]
            leader = led[0] if led and led[0] is not None else 0.0
            return (joint.mimic.multiplier * leader + joint.mimic.offset,)
        rests = VARIABLES[joint.type]
        return tuple(rests[at][1] if value is None else value for at, value in enumerate(read))

    def _stand(self, readings: FrameReadings) -> LinkPose:
        """world_from_root of a robot without odometry."""
        root_from_link = [AT_ORIGIN]
        for joint, pose in zip(self._tree.joints, self.poses[1:], strict=True):
            root_from_link.append(compose_poses(root_from_link[joint.parent], pose))
        quat = self._lean(readings, root_from_link)
        lowest = math.inf
        for link, box in self._tree.boxes.items():
            lowest = min(lowest, _find_lowest(box, quat, root_from_link[link]))
        if not self._tree.boxes:
            lowest = min(rotate_vector(quat, pose.xyz)[2] for pose in root_from_link)
        return LinkPose((0.0, 0.0, -lowest), quat)

    def _lean(self, readings: FrameReadings, root_from_link: Sequence[LinkPose]) -> Quat:
        """The root's attitude by the body's IMU; upright without one, or on a link that is not there."""
        imu = readings.imu
        if imu is None:
            return UPRIGHT
        link = 0 if imu.link is None else self._link_of.get(imu.link)
        if link is None:
            return UPRIGHT
        if readings.world_from_imu is not None:
            root_from_sensor = multiply_quats(root_from_link[link].quat, imu.link_from_sensor)
            turned = multiply_quats(readings.world_from_imu, invert_quat(root_from_sensor))
            world_from_root = normalise_quat(turned)
            if world_from_root is not None:
                self._leaned = world_from_root if imu.knows_heading else remove_heading(world_from_root)
        return self._leaned or UPRIGHT


class _BodyImu:
    """The sensor that tells how the body is turned. `link`: None is the root."""

    def __init__(
        self, link: str | None, link_from_sensor: Quat, channels: Sequence[tuple[int, float]], heading: bool
    ) -> None:
        self.link = link
        self.link_from_sensor = link_from_sensor
        self.knows_heading = heading
        self._channels = channels

    def read(self, codes: Sequence[int]) -> Quat | None:
        """world_from_sensor; None without a reading."""
        found = _read(codes, self._channels)
        if found is None:
            return None
        return normalise_quat(found) if self.knows_heading else quat_of_rpy((found[0], found[1], 0.0))


def _find_body_imu(schema: Schema, places: ChannelPlaces) -> _BodyImu | None:
    """The first sensor of kind imu in the mapping that the frames have; in a schema without sensors, the only
    one."""
    sites: dict[str, tuple[list[tuple[int, float]], bool]] = {}
    for name, parts, heading in (("quat", ("w", "x", "y", "z"), True), ("tilt", ("roll", "pitch"), False)):
        found = schema.find_field(name)
        if found is None or found.label_set == JOINT:
            continue
        for label in found.labels:
            site, dot, part = label.rpartition(".")
            if not dot or part != parts[0] or site in sites:
                continue
            channels = _find_channels(schema, places, name, site, parts)
            if channels:
                sites[site] = (channels, heading)
    sensors = schema.mapping.sensors
    site = next((each for each, mount in sensors.items() if mount.kind == "imu" and each in sites), "")
    if not sensors and len(sites) == 1:
        site = next(iter(sites))
    if site not in sites:
        return None
    channels, heading = sites[site]
    mount = sensors.get(site)
    if mount is None:
        return _BodyImu(None, UPRIGHT, channels, heading)
    return _BodyImu(mount.link, quat_of_rpy(mount.rpy), channels, heading)


def _find_channels(
    schema: Schema, places: ChannelPlaces, name: str, site: str, parts: Sequence[str]
) -> list[tuple[int, float]]:
    """Places in the code vector of `SITE.part` for each part, with their scale; none when any is lacking."""
    found = schema.find_field(name)
    at = [places.find(name, f"{site}.{part}") for part in parts]
    known = [place for place in at if place is not None]
    return [] if found is None or len(known) < len(at) else [(place, found.scale) for place in known]


def _read(codes: Sequence[int], channels: Sequence[tuple[int, float]]) -> list[float] | None:
    """Their values; None when any of them has no reading, or when there are none."""
    values = [codes[at] * scale for at, scale in channels if codes[at] != MISSING]
    return values if values and len(values) == len(channels) else None


def _move(joint: TreeJoint, values: tuple[float, ...]) -> LinkPose:
    """parent_from_child at these values of its variables."""
    rest = LinkPose(joint.xyz, joint.quat)
    if joint.type == "prismatic":
        motion = LinkPose(_scale(joint.axis, values[0]), UPRIGHT)
    elif joint.type == "planar" and joint.plane is not None:
        (ax, ay, az), (bx, by, bz) = (_scale(way, values[i]) for i, way in enumerate(joint.plane))
        motion = LinkPose((ax + bx, ay + by, az + bz), _turn(joint.axis, values[2]))
    elif joint.type == "floating":
        x, y, z, qx, qy, qz, qw = values
        length = math.hypot(qx, qy, qz, qw)
        turn = (qw / length, qx / length, qy / length, qz / length) if length >= SHORTEST else UPRIGHT
        motion = LinkPose((x, y, z), turn)
    elif joint.type == "fixed":
        return rest
    else:
        motion = LinkPose((0.0, 0.0, 0.0), _turn(joint.axis, values[0]))
    return compose_poses(rest, motion)


def _turn(axis: Xyz, angle: float) -> Quat:
    if not math.isfinite(angle):  # a mimic's factor is whatever a robot wrote
        return (math.nan, math.nan, math.nan, math.nan)
    sine = math.sin(angle / 2)
    return (math.cos(angle / 2), sine * axis[0], sine * axis[1], sine * axis[2])


def _scale(vector: Xyz, by: float) -> Xyz:
    return (vector[0] * by, vector[1] * by, vector[2] * by)


def _find_lowest(box: Box, quat: Quat, root_from_link: LinkPose) -> float:
    """The lowest z of a box whose link is there, from the root's origin, when the root is turned so."""
    z = rotate_vector(quat, root_from_link.xyz)[2]
    qw, qx, qy, qz = multiply_quats(quat, root_from_link.quat)
    down = (2 * (qx * qz - qw * qy), 2 * (qy * qz + qw * qx), 1 - 2 * (qx * qx + qy * qy))
    low, high = box
    for along, a, b in zip(down, low, high, strict=True):
        z += along * (a + b) / 2 - abs(along) * (b - a) / 2
    return z
