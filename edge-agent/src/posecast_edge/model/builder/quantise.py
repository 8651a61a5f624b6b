"""Converts a simplified surface to GPU vertices: positions on a grid, normals in bytes, ordered to compress
well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.mesh_coder import (
    drop_duplicate_faces,
    drop_unused_vertices,
    find_crowded_faces,
    order_for_cache,
)
from posecast_edge.model.meshes.mesh import Faces, Floats, Surface

CREASE_DEG = 40.0


@dataclass(frozen=True)
class Grid:
    """The grid to which positions are rounded: metres = centre + step · grid value."""

    centre: NDArray[np.float64]
    step: float
    bits: int

    def to_metres(self, grid: NDArray[np.int16]) -> NDArray[np.float64]:
        """Convert the first three columns of grid values to positions (n, 3) in metres."""
        return self.centre + self.step * grid[:, :3]


@dataclass(frozen=True)
class Part:
    """Vertices and faces. Positions (n, 4) in grid units and normals (n, 4) · 127, each with a padding
    column; uv (n, 2) or None; faces (m, 3)."""

    positions: NDArray[np.int16]
    normals: NDArray[np.int8]
    uv: Floats | None
    faces: Faces


def make_grid(low: Floats, high: Floats, bits: int) -> Grid:
    """A grid with `bits` bits along the longest side of the box from `low` to `high` (metres)."""
    a, b = low.astype(np.float64), high.astype(np.float64)
    half = max(float((b - a).max()) / 2, 1e-9)
    return Grid((a + b) / 2, half / ((1 << (bits - 1)) - 1), bits)


def pack_part(surface: Surface, faces: Faces, grid: Grid) -> Part:
    """Quantise the vertices that `faces` use. A surface smaller than the grid's step keeps no faces."""
    used, faces = drop_unused_vertices(faces)
    at = np.round((surface.positions[used] - grid.centre) / grid.step).astype(np.int64)
    uv = surface.uv[used] if surface.uv is not None else None
    # Corners at one grid point become one vertex,
    key = ((at[:, 0] + 32768) << 42) | ((at[:, 1] + 32768) << 21) | (at[:, 2] + 32768)
    if uv is None:
        _, first, place = np.unique(key, return_index=True, return_inverse=True)
    else:
        rows = np.column_stack([key, np.round(uv * 65536).astype(np.int64)])
        _, first, place = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    faces = drop_duplicate_faces(place.reshape(-1)[faces], len(first))
    at, uv = at[first], uv[first] if uv is not None else None
    faces = faces[compute_face_normals(at.astype(np.float32), faces)[1] > 0]
    # but one for each side of a crease.
    group, normals = compute_crease_normals(at.astype(np.float32), faces, CREASE_DEG)
    groups = max(len(normals), 1)
    pair = faces.reshape(-1).astype(np.int64) * groups + group
    pairs, corner = np.unique(pair, return_inverse=True)
    order, faces = drop_unused_vertices(_in_cache_order(corner.reshape(-1, 3).astype(np.int32), len(pairs)))
    pairs = pairs[order]
    positions = np.zeros((len(order), 4), np.int16)
    positions[:, :3] = at[pairs // groups]
    directions = np.zeros((len(order), 4), np.int8)
    directions[:, :3] = np.round(normals[pairs % groups] * 127)
    return Part(positions, directions, uv[pairs // groups] if uv is not None else None, faces)


def _in_cache_order(faces: Faces, vertices: int) -> Faces:
    crowded = find_crowded_faces(faces)
    if crowded.any():
        return np.concatenate([_in_cache_order(faces[~crowded], vertices), faces[crowded]])
    if not len(faces):
        return faces
    return order_for_cache(faces, vertices)


# --- corner normals: smooth over small angles, sharp over creases

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
