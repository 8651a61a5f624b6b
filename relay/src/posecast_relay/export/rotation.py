"""Rotations as unit quaternions w, x, y, z. `a_from_b` turns a vector of b's axes into a's."""

from __future__ import annotations

import math
from collections.abc import Sequence

from posecast_wire.schema import Xyz

from posecast_relay.export.model_tree import Quat

UPRIGHT: Quat = (1.0, 0.0, 0.0, 0.0)
SHORTEST = 1e-6  # a shorter quaternion has no direction


def normalise_quat(quat: Sequence[float]) -> Quat | None:
    """The quaternion scaled to length 1; None when it has no direction."""
    w, x, y, z = quat
    length = math.hypot(w, x, y, z)
    if not (length > SHORTEST and math.isfinite(length)):
        return None
    return (w / length, x / length, y / length, z / length)


def multiply_quats(a: Quat, b: Quat) -> Quat:
    """a_from_c = a_from_b · b_from_c."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def invert_quat(quat: Quat) -> Quat:
    """b_from_a of a_from_b."""
    w, x, y, z = quat
    return (w, -x, -y, -z)


def rotate_vector(quat: Quat, vector: Xyz) -> Xyz:
    """The vector in the outer axes."""
    w, x, y, z = quat
    a, b, c = vector
    # t = 2 (q × v); v + w t + q × t
    s, t, u = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s)


def quat_of_rpy(rpy: Xyz) -> Quat:
    """Of roll, pitch and yaw (rad) about fixed axes, as in URDF."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle / 2), math.sin(angle / 2)) for angle in rpy)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def remove_heading(world_from_body: Quat) -> Quat:
    """The same attitude, turned about the vertical so that it faces along x; as it is when upside down."""
    w, _, _, z = world_from_body
    twist = normalise_quat((w, 0.0, 0.0, z))
    return world_from_body if twist is None else multiply_quats(invert_quat(twist), world_from_body)
