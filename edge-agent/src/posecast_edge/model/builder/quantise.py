"""Converts a simplified surface to GPU vertices: positions on a grid, normals in bytes, ordered to compress
well."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.mesh_coder import order_for_cache
from posecast_edge.model.meshes.mesh import Faces, Floats, Surface
from posecast_edge.model.meshes.normals import compute_crease_normals, compute_face_normals
from posecast_edge.model.meshes.weld import drop_duplicate_faces, drop_unused_vertices, find_crowded_faces

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
