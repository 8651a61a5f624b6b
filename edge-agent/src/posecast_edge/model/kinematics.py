"""Where each link is, from nothing but a bundle's manifest: what a viewer must compute, in plain Python.

Matrices are 4 × 4, row by row, parent_from_child; lengths in metres, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

Matrix = list[list[float]]


def identity() -> Matrix:
    """No motion."""
    return [[float(i == j) for j in range(4)] for i in range(4)]


def product(a: Matrix, b: Matrix) -> Matrix:
    """a · b."""
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def from_quaternion(xyz: Sequence[float], quat: Sequence[float]) -> Matrix:
    """Translation and unit quaternion (w, x, y, z)."""
    w, x, y, z = quat
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), xyz[0]],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), xyz[1]],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), xyz[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]


def quaternion_from_rpy(rpy: Sequence[float]) -> tuple[float, float, float, float]:
    """(w, x, y, z) of Rz(yaw) · Ry(pitch) · Rx(roll), w ≥ 0."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in rpy)
    w = cr * cp * cy + sr * sp * sy
    x = sr * cp * cy - cr * sp * sy
    y = cr * sp * cy + sr * cp * sy
    z = cr * cp * sy - sr * sp * cy
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)


def motion(kind: str, axis: Sequence[float], q: float) -> Matrix:
    """What a joint adds at q: turns about, or slides along, its unit axis."""
    if kind in ("revolute", "continuous"):
        s = math.sin(q / 2)
        return from_quaternion((0.0, 0.0, 0.0), (math.cos(q / 2), *(s * a for a in axis)))
    if kind == "prismatic":
        return from_quaternion([q * a for a in axis], (1.0, 0.0, 0.0, 0.0))
    return identity()


def joint_values(manifest: Mapping[str, Any], readings: Mapping[str, float]) -> list[float]:
    """q of every joint: its reading, else what it mimics, else 0."""
    joints = manifest["joints"]
    values = [readings.get(joint["name"]) for joint in joints]

    def of(joint: Mapping[str, Any], value: float | None) -> float:
        mimic = joint.get("mimic")
        if value is None and mimic:
            return float(mimic["multiplier"] * (values[mimic["joint"]] or 0.0) + mimic["offset"])
        return value or 0.0

    return [of(joint, value) for joint, value in zip(joints, values, strict=True)]


def link_poses(manifest: Mapping[str, Any], readings: Mapping[str, float]) -> dict[str, Matrix]:
    """root_from_link of every link, by name."""
    poses = [identity()]
    for joint, q in zip(manifest["joints"], joint_values(manifest, readings), strict=True):
        parent_from_joint = from_quaternion(joint["xyz"], joint["quat"])
        moved = product(parent_from_joint, motion(joint["type"], joint["axis"], q))
        poses.append(product(poses[joint["parent"]], moved))
    return dict(zip(manifest["links"], poses, strict=True))
