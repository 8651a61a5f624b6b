"""Forward kinematics from a bundle's manifest, in plain Python: a reference for what every viewer computes.

Matrices are 4 × 4, row by row, parent_from_child; lengths in metres, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

Matrix = list[list[float]]

# Suffixes of a joint's readings and their values at rest: MoveIt's variable names.
SCALAR = (("", 0.0),)
VARIABLES = {
    "revolute": SCALAR,
    "continuous": SCALAR,
    "prismatic": SCALAR,
    "fixed": (),
    "planar": (("x", 0.0), ("y", 0.0), ("theta", 0.0)),
    "floating": (*((f"trans_{c}", 0.0) for c in "xyz"), *((f"rot_{c}", float(c == "w")) for c in "xyzw")),
}


def identity() -> Matrix:
    """The identity matrix."""
    return [[float(i == j) for j in range(4)] for i in range(4)]


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """The matrix product a · b."""
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def matrix_from_quaternion(xyz: Sequence[float], quat: Sequence[float]) -> Matrix:
    """The matrix of a translation (metres) and a unit quaternion (w, x, y, z)."""
    w, x, y, z = quat
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), xyz[0]],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), xyz[1]],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), xyz[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]


def quaternion_from_rpy(rpy: Sequence[float]) -> tuple[float, float, float, float]:
    """The unit quaternion (w, x, y, z), w ≥ 0, of Rz(yaw) · Ry(pitch) · Rx(roll); angles in radians."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in rpy)
    w = cr * cp * cy + sr * sp * sy
    x = sr * cp * cy - cr * sp * sy
    y = cr * sp * cy + sr * cp * sy
    z = cr * cp * sy - sr * sp * cy
    return (w, x, y, z) if w >= 0 else (-w, -x, -y, -z)


def rpy_from_quaternion(quat: Sequence[float]) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a quaternion (w, x, y, z) of any length above 0: the inverse of
    quaternion_from_rpy, exact at a pitch of ±90° too, where only the sum or difference of roll and yaw
    counts."""
    w, x, y, z = quat
    half_sum, half_difference = math.atan2(x + z, w - y), math.atan2(x - z, w + y)
    pitch = 2 * math.atan2(math.hypot(w + y, x - z), math.hypot(w - y, x + z)) - math.pi / 2
    return (half_sum + half_difference, pitch, half_sum - half_difference)


def normalise_axis(axis: Sequence[float] | None) -> tuple[float, float, float]:
    """The axis scaled to length 1; the x axis if there is none."""
    longest = max(map(abs, axis)) if axis is not None else 0.0
    if axis is None or longest < 1e-9:
        return (1.0, 0.0, 0.0)
    x, y, z = (v / longest for v in axis)  # scale first: the square of a large number overflows
    length = math.hypot(x, y, z)
    return (x / length, y / length, z / length)


def compute_plane_axes(
    axis: Sequence[float],
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """The x and y axes of the plane perpendicular to a unit axis: the frame's x and y, turned by the shortest
    rotation that takes z to the axis."""
    a, b, c = axis
    if c < -1 + 1e-9:  # all turns by 180° are equally short: take x
        return (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
    d = 1 / (1 + c)
    return (1 - a * a * d, -a * b * d, -a), (-a * b * d, 1 - b * b * d, -b)


def list_variables(name: str, kind: str) -> list[tuple[str, float]]:
    """The names of the readings that move a joint, each with the value used when there is no reading."""
    return [(f"{name}/{part}" if part else name, rest) for part, rest in VARIABLES[kind]]


def compute_motion(joint: Mapping[str, Any], q: Sequence[float]) -> Matrix:
    """The transform that a joint adds at `q`, the values of its variables (rad or m)."""
    kind, axis = joint["type"], joint["axis"]
    if kind in ("revolute", "continuous"):
        return turn_about((0.0, 0.0, 0.0), axis, q[0])
    if kind == "prismatic":
        return matrix_from_quaternion([q[0] * a for a in axis], (1.0, 0.0, 0.0, 0.0))
    if kind == "planar":
        u, v = joint["plane"]
        return turn_about([q[0] * u[i] + q[1] * v[i] for i in range(3)], axis, q[2])
    if kind == "floating":
        x, y, z, w = q[3:]
        length = math.hypot(w, x, y, z)
        quat = (w / length, x / length, y / length, z / length) if length > 1e-6 else (1.0, 0.0, 0.0, 0.0)
        return matrix_from_quaternion(q[:3], quat)
    return identity()


def turn_about(xyz: Sequence[float], axis: Sequence[float], angle: float) -> Matrix:
    """A translation (metres), then a rotation by `angle` (radians) about a unit axis."""
    s = math.sin(angle / 2)
    return matrix_from_quaternion(xyz, (math.cos(angle / 2), *(s * a for a in axis)))


def compute_joint_values(manifest: Mapping[str, Any], readings: Mapping[str, float]) -> list[list[float]]:
    """The values of every joint's variables: the reading, otherwise the mimicked value, otherwise the
    default."""
    joints = manifest["joints"]

    def values(joint: Mapping[str, Any]) -> list[float]:
        name, mimic = joint["name"], joint.get("mimic")
        if mimic and name not in readings:
            leader = readings.get(joints[mimic["joint"]]["name"], 0.0)
            return [mimic["multiplier"] * leader + mimic["offset"]]
        return [readings.get(variable, rest) for variable, rest in list_variables(name, joint["type"])]

    return [values(joint) for joint in joints]


def compute_link_poses(manifest: Mapping[str, Any], readings: Mapping[str, float]) -> dict[str, Matrix]:
    """root_from_link of every link, by name."""
    poses = [identity()]
    for joint, q in zip(manifest["joints"], compute_joint_values(manifest, readings), strict=True):
        parent_from_joint = matrix_from_quaternion(joint["xyz"], joint["quat"])
        moved = multiply(parent_from_joint, compute_motion(joint, q))
        poses.append(multiply(poses[joint["parent"]], moved))
    return dict(zip(manifest["links"], poses, strict=True))
