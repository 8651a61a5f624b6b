"""URDF's shapes as meshes, about their own centre, z along the length. Fine; the levels simplify them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.mesh import Mesh, Surface

AROUND = 48
RINGS = 24  # of a sphere, pole to pole


def tessellate(kind: str, dims: Sequence[float]) -> Mesh:
    """box (x, y, z), cylinder or capsule (radius, length), sphere (radius); metres."""
    if kind == "box":
        return box(np.zeros(3), np.array(dims))
    if kind == "cylinder":
        radius, length = dims
        return _turned([(0, -length / 2), (radius, -length / 2), (radius, length / 2), (0, length / 2)])
    radius = dims[0]
    half = dims[1] / 2 if kind == "capsule" else 0.0
    angles = np.linspace(-np.pi / 2, np.pi / 2, RINGS + 1)
    profile = [(radius * np.cos(a), radius * np.sin(a) + np.copysign(half, a)) for a in angles]
    if half:
        profile.insert(RINGS // 2, (radius, -half))
    return _turned(profile)


def box(centre: NDArray[np.float64], size: NDArray[np.float64]) -> Mesh:
    """A box of that size (x, y, z) about a centre."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2 + centre
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh((Surface(corners.astype(np.float32), faces.astype(np.int32)),))


def _turned(profile: Sequence[tuple[float, float]]) -> Mesh:
    """The body of (radius, z) turned about z, from below to above."""
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    rings = [np.stack([r * np.cos(turn), r * np.sin(turn), np.full(AROUND, z)], axis=1) for r, z in profile]
    i = np.arange(AROUND)
    j = (i + 1) % AROUND
    faces = []
    for k in range(len(profile) - 1):
        a, b = k * AROUND, (k + 1) * AROUND
        faces += [np.stack([a + i, a + j, b + j], axis=1), np.stack([a + i, b + j, b + i], axis=1)]
    positions, triangles = np.concatenate(rings), np.concatenate(faces)
    return Mesh((Surface(positions.astype(np.float32), triangles.astype(np.int32)),))
