"""Simplifies and packs meshes with meshoptimizer, with a fallback where it is missing: installing it needs a
C++ compiler, which not every machine has.

Without it, surfaces are simplified by joining vertices, which leaves more triangles for the same error, and
nothing is packed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Faces

try:
    import meshoptimizer
except ImportError:
    meshoptimizer = None

DOUBLINGS = 6
ALIKE = 0.9  # length of the mean of a flat cell's normals
HEIGHT = 0.25  # of the error: how far a flat cell's vertices may lie from its plane
UV_CELLS = 64  # along a texture: vertices at one position but far apart in the texture stay separate


def can_pack() -> bool:
    """Whether meshoptimizer is installed."""
    return meshoptimizer is not None


def simplify(
    faces: Faces, positions: NDArray[Any], uv: NDArray[Any] | None, error: float, keeps_border: bool
) -> Faces:
    """Fewer triangles, whose surface is within `error` of the given one, in the units of `positions`. With
    `keeps_border`, vertices on the edge of the surface stay."""
    if meshoptimizer is None:
        return _join_vertices(faces, positions, uv, error, keeps_border)
    indices = np.ascontiguousarray(faces.reshape(-1), np.uint32)
    result = np.empty_like(indices)
    border = meshoptimizer.SIMPLIFY_LOCK_BORDER if keeps_border else 0
    count = meshoptimizer.simplify(
        result,
        indices,
        np.ascontiguousarray(positions, np.float32),
        target_index_count=0,
        target_error=error,
        options=meshoptimizer.SIMPLIFY_ERROR_ABSOLUTE | border,
    )
    return result[:count].reshape(-1, 3).astype(np.int32) if count else faces


def order_for_cache(faces: Faces, vertices: int) -> Faces:
    """The triangles in an order that packs well and lets a GPU compute few vertices twice."""
    if meshoptimizer is None:
        return faces
    indices = np.ascontiguousarray(faces.reshape(-1), np.uint32)
    result = np.empty_like(indices)
    meshoptimizer.optimize_vertex_cache(result, indices, len(indices), vertices)
    return result.reshape(-1, 3).astype(np.int32)


def pack_attributes(values: NDArray[Any]) -> bytes:
    """Rows of vertices, packed for EXT_meshopt_compression. Requires `can_pack()`."""
    meshoptimizer.encode_vertex_version(0)
    return bytes(meshoptimizer.encode_vertex_buffer(values))


def pack_indices(indices: NDArray[np.uint32], vertices: int) -> bytes:
    """Corners of triangles, packed for EXT_meshopt_compression. Requires `can_pack()`."""
    meshoptimizer.encode_index_version(1)
    return bytes(meshoptimizer.encode_index_buffer(indices, len(indices), vertices))


def _join_vertices(
    faces: Faces, positions: NDArray[Any], uv: NDArray[Any] | None, error: float, keeps_border: bool
) -> Faces:
    """Join the vertices of each cell of a grid into the one nearest to their middle. A cell's diagonal is
    `error`, or up to 2**DOUBLINGS times as long where the surface is flat."""
    used, local = np.unique(faces, return_inverse=True)
    corners = local.reshape(-1, 3)
    place = positions[used].astype(np.float64)
    normals = _compute_normals(place, corners)
    becomes = np.arange(len(used))
    left = np.ones(len(used), np.bool_)
    if keeps_border:
        left[_find_border(corners)] = False
    for doubling in range(DOUBLINGS, -1, -1):
        own = np.flatnonzero(left)
        if not len(own):
            break
        cells = np.floor(place[own] / (error * 2**doubling / math.sqrt(3)))
        if uv is not None:
            cells = np.concatenate([cells, np.floor(uv[used[own]] * UV_CELLS)], axis=1)
        _, cell, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
        cell = cell.reshape(-1)
        away = place[own] - _average(place[own], cell, counts)[cell]
        facing = _average(normals[own], cell, counts)
        height = np.zeros(len(counts))
        np.maximum.at(height, cell, np.abs(np.sum(away * facing[cell], axis=1)))
        flat = (np.linalg.norm(facing, axis=1) > ALIKE) & (height < error * HEIGHT)
        joins = flat[cell] if doubling else np.ones(len(own), np.bool_)
        order = np.lexsort((np.linalg.norm(away, axis=1), cell))
        nearest = own[order[np.searchsorted(cell[order], np.arange(len(counts)))]]
        becomes[own[joins]] = nearest[cell[joins]]
        left[own[joins]] = False
    joined = used[becomes[corners]]
    a, b, c = joined.T
    joined = joined[(a != b) & (b != c) & (c != a)]
    _, first = np.unique(np.sort(joined, axis=1), axis=0, return_index=True)
    return joined[np.sort(first)].astype(np.int32) if len(joined) else faces


def _average(rows: NDArray[Any], group: NDArray[Any], counts: NDArray[Any]) -> NDArray[Any]:
    """The mean of each group's rows (n, 3)."""
    sums = [np.bincount(group, rows[:, axis], len(counts)) for axis in range(3)]
    means: NDArray[Any] = np.stack(sums, axis=1) / counts[:, None]
    return means


def _compute_normals(place: NDArray[Any], faces: NDArray[Any]) -> NDArray[Any]:
    """The unit normal of each vertex; 0 if its triangles have no area."""
    a, b, c = (place[faces[:, corner]] for corner in range(3))
    of_faces = np.cross(b - a, c - a)
    normals = np.zeros_like(place)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], of_faces)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: NDArray[Any] = normals / np.where(length > 0, length, 1)
    return unit


def _find_border(faces: NDArray[Any]) -> NDArray[Any]:
    """The vertices of edges that belong to only one triangle."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    single, counts = np.unique(edges, axis=0, return_counts=True)
    return np.unique(single[counts == 1])
