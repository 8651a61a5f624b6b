"""Computes corner normals: smooth over small angles, sharp over creases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Faces, Floats

Vectors = NDArray[np.float64]


def compute_face_normals(positions: Floats, faces: Faces) -> tuple[Vectors, NDArray[np.float64]]:
    """Unit normals (m, 3), 0 for a triangle without area, and areas (m) in m²."""
    p = positions.astype(np.float64)
    cross = np.cross(p[faces[:, 1]] - p[faces[:, 0]], p[faces[:, 2]] - p[faces[:, 0]])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.where(length > 0, length, 1)[:, None], length / 2


def compute_crease_normals(
    positions: Floats, faces: Faces, crease_deg: float
) -> tuple[NDArray[np.int64], Vectors]:
    """Return the group of each corner (3m), and the unit normals of the groups.

    Corners at one vertex belong to one group when a chain of edges less sharp than `crease_deg` (degrees)
    connects their triangles. Each triangle is weighted by its area times its angle at the corner: large flat
    faces stay flat, and a chamfer beside them takes the turn.
    """
    normals, areas = compute_face_normals(positions, faces)
    group = _groups(faces, normals, float(np.cos(np.radians(crease_deg))))
    weights = (_angles(positions, faces) * areas[:, None]).reshape(-1)
    per_corner = np.repeat(normals, 3, axis=0) * weights[:, None]
    count = int(group.max()) + 1 if len(group) else 0
    total = np.stack([np.bincount(group, per_corner[:, k], count) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1)
    total[length == 0] = (0.0, 0.0, 1.0)
    return group, total / np.where(length > 0, length, 1)[:, None]


def _angles(positions: Floats, faces: Faces) -> NDArray[np.float64]:
    """(m, 3), radians, at each corner."""
    p = positions.astype(np.float64)[faces]
    sides = np.roll(p, -1, axis=1) - p
    length = np.linalg.norm(sides, axis=2, keepdims=True)
    unit = sides / np.where(length > 0, length, 1)
    cosine = -(unit * np.roll(unit, 1, axis=1)).sum(axis=2)
    angles: NDArray[np.float64] = np.arccos(np.clip(cosine, -1, 1))
    return angles


def _groups(faces: Faces, normals: Vectors, least_cosine: float) -> NDArray[np.int64]:
    """A number for each corner (3m), the same for corners at one vertex that smooth edges join."""
    corner = np.arange(faces.size, dtype=np.int64).reshape(-1, 3)
    start, end = corner.reshape(-1), np.roll(corner, -1, axis=1).reshape(-1)
    flat = faces.reshape(-1).astype(np.int64)
    a, b = flat[start], flat[end]
    order = np.argsort((np.minimum(a, b) << 32) | np.maximum(a, b), kind="stable")
    one, two = order[:-1], order[1:]
    same = (np.minimum(a, b)[one] == np.minimum(a, b)[two]) & (np.maximum(a, b)[one] == np.maximum(a, b)[two])
    one, two = one[same], two[same]
    smooth = (normals[one // 3] * normals[two // 3]).sum(axis=1) >= least_cosine
    one, two = one[smooth], two[smooth]
    turned = a[one] != a[two]  # neighbours of one orientation run along the edge in opposite ways
    left = np.concatenate([start[one], end[one]])
    right = np.concatenate([np.where(turned, end[two], start[two]), np.where(turned, start[two], end[two])])
    return np.unique(label_connected(faces.size, left, right), return_inverse=True)[1].reshape(-1)


def label_connected(count: int, left: NDArray[np.int64], right: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each of the numbers 0 … count - 1, the lowest number it is connected with by the pairs (left,
    right).

    Each round attaches every set's lowest number to a lower one that a pair leads to, and drops the pairs
    within a set. This ends after a logarithmic number of rounds (Liu and Tarjan 2019), whatever the order of
    the pairs.
    """
    lowest = np.arange(count, dtype=np.int64)
    while True:
        one, two = lowest[left], lowest[right]
        apart = one != two
        if not apart.any():
            return lowest
        left, right, one, two = left[apart], right[apart], one[apart], two[apart]
        np.minimum.at(lowest, np.maximum(one, two), np.minimum(one, two))
        while (lowest[lowest] != lowest).any():
            lowest = lowest[lowest]
