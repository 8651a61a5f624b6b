"""Finds soles in a profile that can't stand on a floor."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from posecast_wire.schema import Mapping as Meaning

from posecast_edge.model.finding import Finding, quote_name
from posecast_edge.model.kinematics import (
    Matrix,
    compute_motion,
    compute_plane_axes,
    identity,
    list_variables,
    matrix_from_quaternion,
    multiply,
    normalise_axis,
    quaternion_from_rpy,
)
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import SCALAR_TYPES, Joint

TILT_MAX = math.radians(60)


def examine_soles(tree: Tree, meaning: Meaning) -> Iterator[Finding]:
    """Yield a finding about each sole of a profile that is upright when the robot is at home, z up."""
    if not meaning.balance.soles:
        return
    poses = _compute_home_poses(tree)
    for foot, corners in meaning.balance.soles.items():
        mount = meaning.sensors.get(foot)
        link = foot if mount is None else mount.link
        if link not in tree.index:
            continue  # reported elsewhere
        pose, (x, y, z) = poses[tree.index[link]], _compute_normal(corners)
        up = abs(sum(pose[2][i] * v for i, v in enumerate((x, y, z)))) / math.hypot(x, y, z)
        if up < math.cos(TILT_MAX):
            tilt = math.degrees(math.acos(min(up, 1.0)))
            text = (
                f"the profile's [balance] soles.{quote_name(foot)} is tilted by {tilt:.0f}° with all joints "
                f"at home; corners are in the axes of link {quote_name(link)}"
            )
            yield Finding("warning", "profile-sole", text)


def _compute_home_poses(tree: Tree) -> list[Matrix]:
    """root_from_link of each link, the joints at 0 or the limit nearest to it."""
    values = [_find_home(joint) for joint in tree.joints]
    poses = [identity()]
    for number, (joint, follow) in enumerate(zip(tree.joints, tree.follows, strict=True)):
        q = values[number]
        if follow is not None:
            q = [follow.multiplier * (values[follow.joint] or [0.0])[0] + follow.offset]
        axis = normalise_axis(joint.axis)
        entry = {"type": joint.type, "axis": axis, "plane": compute_plane_axes(axis)}
        placed = matrix_from_quaternion(joint.pose.xyz, quaternion_from_rpy(joint.pose.rpy))
        moved = multiply(placed, compute_motion(entry, q))
        poses.append(multiply(poses[tree.index[joint.parent]], moved))
    return poses


def _find_home(joint: Joint) -> list[float]:
    values = [rest for _, rest in list_variables(joint.name, joint.type)]
    limit = joint.limit
    if joint.type in SCALAR_TYPES and joint.type != "continuous" and limit is not None:
        low, high = limit.lower or 0.0, limit.upper or 0.0
        return [min(max(0.0, low), high)] if low <= high else values
    return values


def _compute_normal(corners: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Newell's vector: its length is twice the area. The profile's reader has checked that it is not 0."""
    x = y = z = 0.0
    for a, b in pairwise((*corners, corners[0])):
        x += (a[1] - b[1]) * (a[2] + b[2])
        y += (a[2] - b[2]) * (a[0] + b[0])
        z += (a[0] - b[0]) * (a[1] + b[1])
    return x, y, z
