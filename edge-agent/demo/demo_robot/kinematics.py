"""Forward and inverse kinematics, for a whole motion at once: the first index of every array is time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from demo_robot.robot import AXES, JOINTS, ROOT, SHIN, THIGH, Xyz
from demo_robot.shapes import Floats


def rotation(axis: str, angle: Floats) -> Floats:
    """(n, 3, 3): turns by `angle` (n,) about a coordinate axis."""
    x, y, z = AXES[axis]
    c, s = np.cos(angle), np.sin(angle)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=np.float64)
    return np.asarray(np.eye(3) + s[:, None, None] * k + (1 - c)[:, None, None] * (k @ k))


def rpy_matrix(rpy: Xyz) -> Floats:
    """(3, 3): URDF's fixed axes, roll then pitch then yaw."""
    r, p, y = (np.array([a]) for a in rpy)
    return np.asarray((rotation("z", y) @ rotation("y", p) @ rotation("x", r))[0])


def transform(turn: Floats, shift: Floats) -> Floats:
    """(n, 4, 4) of (n, 3, 3) and (n, 3)."""
    result = np.zeros((len(turn), 4, 4))
    result[:, :3, :3] = turn
    result[:, :3, 3] = shift
    result[:, 3, 3] = 1
    return result


def inverse(pose: Floats) -> Floats:
    """(n, 4, 4) of a rigid motion, inverted."""
    turn = np.swapaxes(pose[:, :3, :3], 1, 2)
    return transform(turn, -np.einsum("nij,nj->ni", turn, pose[:, :3, 3]))


def forward(
    joints: Mapping[str, Floats], world_from_root: Floats, links: frozenset[str]
) -> dict[str, Floats]:
    """world_from_link (n, 4, 4) of some links. Joint angles (n,) by URDF joint; absent ones are 0."""
    n = len(world_from_root)
    zero = np.zeros(n)
    poses = {ROOT: world_from_root}
    wanted = set(links)
    for j in reversed(JOINTS):  # children come after parents
        if j.child in wanted:
            wanted.add(j.parent)
    for j in JOINTS:
        if j.child in wanted:
            fixed = transform(rpy_matrix(j.rpy)[None], np.array([j.xyz]))
            turn = transform(rotation(j.axis, joints.get(j.name, zero)), np.zeros((n, 3)))
            poses[j.child] = poses[j.parent] @ fixed @ turn
    return {link: poses[link] for link in links}


def leg(hip_from_ankle: Floats) -> dict[str, Floats]:
    """Angles HY HR HP KN AP AR (n,) that put the ankle at a pose (n, 4, 4) in the frame of the hip centre.

    Closed form for axes that meet in a point (Kajita et al., Introduction to Humanoid Robotics, 2.5.2). Out
    of reach is a ValueError.
    """
    turn, at = hip_from_ankle[:, :3, :3], hip_from_ankle[:, :3, 3]
    r = -np.einsum("nji,nj->ni", turn, at)  # ankle to hip, in the foot's frame
    c = np.linalg.norm(r, axis=1)
    cosine = (THIGH**2 + SHIN**2 - c**2) / (2 * THIGH * SHIN)
    if np.any(np.abs(cosine) > 1):
        raise ValueError(f"ankle out of reach: {c.max():.4f} m at sample {int(np.argmax(c))}")
    knee = np.pi - np.arccos(cosine)
    within = np.arcsin(np.clip(THIGH * np.sin(np.pi - knee) / c, -1, 1))
    ankle_roll = np.arctan2(r[:, 1], r[:, 2])
    ankle_pitch = -np.arctan2(r[:, 0], np.hypot(r[:, 1], r[:, 2])) - within
    hip = turn @ rotation("x", -ankle_roll) @ rotation("y", -knee - ankle_pitch)
    yaw = np.arctan2(-hip[:, 0, 1], hip[:, 1, 1])
    roll = np.arctan2(hip[:, 2, 1], -hip[:, 0, 1] * np.sin(yaw) + hip[:, 1, 1] * np.cos(yaw))
    pitch = np.arctan2(-hip[:, 2, 0], hip[:, 2, 2])
    return {"HY": yaw, "HR": roll, "HP": pitch, "KN": knee, "AP": ankle_pitch, "AR": ankle_roll}


def quaternion(turn: Floats) -> Floats:
    """(n, 3, 3) → (n, 4) w x y z with w ≥ 0 at the first sample and no jump of sign after it."""
    m = turn
    trace = np.stack(
        [
            m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2],
            m[:, 0, 0] - m[:, 1, 1] - m[:, 2, 2],
            m[:, 1, 1] - m[:, 0, 0] - m[:, 2, 2],
            m[:, 2, 2] - m[:, 0, 0] - m[:, 1, 1],
        ],
        axis=1,
    )
    w = np.sqrt(np.maximum(0, 1 + trace)) / 2
    x = np.copysign(w[:, 1], m[:, 2, 1] - m[:, 1, 2])
    y = np.copysign(w[:, 2], m[:, 0, 2] - m[:, 2, 0])
    z = np.copysign(w[:, 3], m[:, 1, 0] - m[:, 0, 1])
    q = np.stack([w[:, 0], x, y, z], axis=1)
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    flips = np.sign((q[1:] * q[:-1]).sum(1))
    q[1:] *= np.cumprod(np.where(flips == 0, 1, flips))[:, None]
    return q


def matrix(q: Floats) -> Floats:
    """(n, 4) w x y z, any length but 0 → (n, 3, 3)."""
    w, x, y, z = (q / np.linalg.norm(q, axis=1, keepdims=True)).T
    return np.moveaxis(
        np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        ),
        2,
        0,
    )
