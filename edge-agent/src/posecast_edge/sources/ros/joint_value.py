"""Computes a joint's value from the pose of its child link in its parent link. Pure."""

from __future__ import annotations

import math
from typing import NamedTuple

from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.sources.ros.transforms import Pose, invert_pose, multiply_poses

TURN = 2 * math.pi
SLACK = 1e-3  # rad: a joint may be this far beyond its limit before a full turn is added


class JointValue(NamedTuple):
    """`value`: rad, or m for a joint that slides. `off_m`, `off_rad`: the part of the transform that the
    joint can't produce."""

    value: float
    off_m: float
    off_rad: float


def compute_joint_value(joint: MovingJoint, parent_from_child: Pose) -> JointValue:
    """The value at which the child link has this pose. An angle is in -π … π, or one turn away if only that
    is within the joint's limits. `parent_from_child`: metres, unit quaternion w x y z."""
    (x, y, z), (w, qx, qy, qz) = multiply_poses(invert_pose((joint.xyz, joint.quat)), parent_from_child)
    a, b, c = joint.axis
    if joint.slides:
        value = x * a + y * b + z * c
        off_m = math.hypot(x - value * a, y - value * b, z - value * c)
        return JointValue(value, off_m, 2 * math.atan2(math.hypot(qx, qy, qz), abs(w)))
    along = qx * a + qy * b + qz * c
    across = math.hypot(qx - along * a, qy - along * b, qz - along * c)
    angle = math.remainder(2 * math.atan2(along, w), TURN)
    off_rad = 2 * math.atan2(across, math.hypot(w, along))
    return JointValue(_turn_into_limits(angle, joint), math.hypot(x, y, z), off_rad)


def _turn_into_limits(angle: float, joint: MovingJoint) -> float:
    low = -math.inf if joint.lower is None else joint.lower - SLACK
    high = math.inf if joint.upper is None else joint.upper + SLACK
    within = (turned for turned in (angle, angle + TURN, angle - TURN) if low <= turned <= high)
    return next(within, angle)
