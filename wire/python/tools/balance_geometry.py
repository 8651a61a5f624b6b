"""Geometry in the plainest way, for what `make_balance_vectors` expects of the page: whole transforms,
a convex hull that tries every pair of points, a margin that tries every edge."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

SLIVER_M2 = 1e-9  # corners that span less with their neighbours are none

Document = dict[str, Any]
Array = Any  # of numpy


def rotation(axis: Sequence[float], angle: float) -> Array:
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def rotation_of_rpy(rpy: Sequence[float]) -> Array:
    """About the fixed axes X, Y, Z."""
    turns = [rotation(np.eye(3)[i], angle) for i, angle in enumerate(rpy)]
    whole: Array = turns[2] @ turns[1] @ turns[0]
    return whole


def twist_of(turn: Array) -> Array:
    """The part of a rotation that is about the vertical (its swing-twist decomposition)."""
    return rotation([0, 0, 1], math.atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))


def homogeneous(turn: Array, place: Sequence[float]) -> Array:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = turn, place
    return whole


def quat_rotation(quat: Sequence[float]) -> Array:
    w, *v = quat
    length = math.hypot(*v)
    return np.eye(3) if length == 0 else rotation([c / length for c in v], 2 * math.atan2(length, w))


def place_links(model: Document, readings: Mapping[str, float], world_from_root: Array) -> list[Array]:
    """world_from_link of every link."""
    poses = [world_from_root]
    for joint in model["joints"]:
        at_rest = homogeneous(quat_rotation(joint.get("quat", [1, 0, 0, 0])), joint["xyz"])
        angle = readings.get(joint["name"], 0.0) if joint["type"] == "revolute" else 0.0
        moved = homogeneous(rotation(joint.get("axis", [1, 0, 0]), angle), [0, 0, 0])
        poses.append(poses[joint["parent"]] @ at_rest @ moved)
    return poses


def hull_of(points: Sequence[Array]) -> list[list[float]]:
    """The convex hull, counter-clockwise from its least corner on: an ordered pair of points is an edge when
    no other point lies to its right, or beyond it on its line."""
    flat = [np.array([float(p[0]), float(p[1])]) for p in points]
    follows: dict[int, int] = {}
    for i, a in enumerate(flat):
        for j, b in enumerate(flat):
            along = b - a
            if i != j and all(_is_left_or_between(a, along, c) for c in flat):
                follows[i] = j
    start = min(follows, key=lambda i: (flat[i][0], flat[i][1]))
    corners, at = [start], follows[start]
    while at != start:
        corners.append(at)
        at = follows[at]
    return [flat[i].tolist() for i in corners]


def _is_left_or_between(a: Array, along: Array, c: Array) -> bool:
    away = c - a
    turn = along[0] * away[1] - along[1] * away[0]
    if abs(turn) > SLIVER_M2:
        return bool(turn > 0)
    part = float(along @ away) / float(along @ along)
    return -1e-9 <= part <= 1 + 1e-9


def margin_in(polygon: Sequence[Sequence[float]], point: Array) -> tuple[float, int]:
    """Signed distance to the nearest edge, and its index. Inside by the sum of angles."""
    distances, angles = [], 0.0
    for i, corner in enumerate(polygon):
        a, b = np.array(corner), np.array(polygon[(i + 1) % len(polygon)])
        part = min(1.0, max(0.0, float((point - a) @ (b - a)) / float((b - a) @ (b - a))))
        distances.append(float(np.linalg.norm(point - a - part * (b - a))))
        u, v = a - point, b - point
        angles += math.atan2(u[0] * v[1] - u[1] * v[0], float(u @ v))
    nearest = min(range(len(distances)), key=distances.__getitem__)
    return distances[nearest] * (1 if angles > math.pi else -1), nearest
