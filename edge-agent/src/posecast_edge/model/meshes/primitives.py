"""Makes meshes of URDF's shapes, centred, with z along the length. They are fine; the levels simplify
them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Mesh, Surface

AROUND = 48
RINGS = 24  # of a sphere, pole to pole


def tessellate(kind: str, dims: Sequence[float]) -> Mesh:
    """Make a mesh of a box (x, y, z), cylinder or capsule (radius, length) or sphere (radius); metres.
    Textures cover each side of a box, the side and ends of a cylinder, and a sphere like a world map."""
    if kind == "box":
        return make_box(np.zeros(3), np.array(dims))
    if kind == "cylinder":
        radius, length = dims
        side = _turned([(radius, -length / 2), (radius, length / 2)])
        return Mesh((side, _end(radius, -length / 2), _end(radius, length / 2)))
    radius = dims[0]
    half = dims[1] / 2 if kind == "capsule" else 0.0
    angles = np.linspace(-np.pi / 2, np.pi / 2, RINGS + 1)
    profile = [(radius * np.cos(a), radius * np.sin(a) + np.copysign(half, a)) for a in angles]
    if half:
        profile.insert(RINGS // 2, (radius, -half))
    return Mesh((_turned(profile),))


def make_box(centre: NDArray[np.float64], size: NDArray[np.float64]) -> Mesh:
    """A box of this size (x, y, z) around a centre, metres."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2 + centre
    # each side from its lower left, against the clock
    quads = np.array([[4, 6, 7, 5], [2, 0, 1, 3], [6, 2, 3, 7], [0, 4, 5, 1], [1, 5, 7, 3], [2, 6, 4, 0]])
    first = np.arange(0, 24, 4)[:, None]
    faces = np.concatenate([first + np.array(half) for half in ([0, 1, 2], [0, 2, 3])])
    uv = np.tile([[0, 1], [1, 1], [1, 0], [0, 0]], (6, 1))
    return Mesh((_surface(corners[quads.reshape(-1)], faces, uv),))


def _end(radius: float, z: float) -> Surface:
    """A disc that looks up or down, away from 0."""
    turn = 2 * np.pi * np.arange(AROUND) / AROUND
    rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(AROUND)], axis=1)
    points = np.concatenate([np.zeros((1, 3)), rim]) * radius + (0, 0, z)
    i = np.arange(AROUND)
    faces = np.stack([np.zeros_like(i), 1 + i, 1 + (i + 1) % AROUND], axis=1)
    uv = np.concatenate([np.zeros((1, 2)), rim[:, :2]]) * (0.5, -0.5) + 0.5
    return _surface(points, faces if z > 0 else faces[:, ::-1], uv)


def _turned(profile: Sequence[tuple[float, float]]) -> Surface:
    """(radius, z) turned about z, from bottom to top; two rows at the seam, for the picture's ends."""
    turn = 2 * np.pi * np.arange(AROUND + 1) / AROUND
    turn[-1] = 0.0
    rings = [
        np.stack([r * np.cos(turn), r * np.sin(turn), np.full(turn.shape, z)], axis=1) for r, z in profile
    ]
    columns = len(turn)
    i = np.arange(AROUND)
    j = i + 1
    faces = []
    for k in range(len(profile) - 1):
        a, b = k * columns, (k + 1) * columns
        faces += [np.stack([a + i, a + j, b + j], axis=1), np.stack([a + i, b + j, b + i], axis=1)]
    steps = np.hypot(*np.diff(np.array(profile), axis=0).T)
    up = np.concatenate([[0], np.cumsum(steps)]) / max(float(steps.sum()), 1e-12)
    around = np.linspace(0, 1, columns)
    uv = np.stack([np.tile(around, len(profile)), np.repeat(1 - up, columns)], axis=1)
    return _surface(np.concatenate(rings), np.concatenate(faces), uv)


def _surface(positions: NDArray[np.float64], faces: NDArray[np.int64], uv: NDArray[np.float64]) -> Surface:
    with np.errstate(over="ignore"):  # overflows to infinity, which is refused later
        return Surface(positions.astype(np.float32), faces.astype(np.int32), uv.astype(np.float32))
