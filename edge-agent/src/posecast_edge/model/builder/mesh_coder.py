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

from posecast_edge.model.meshes.mesh import Faces, Surface

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


# --- increasingly coarse versions of a surface

LARGEST = 0.02  # of the mesh's size: no surface moves further, however small the level must be,
LAST_RUNGS = 2  # except on this many extra rungs, for a phone that would have too many triangles to draw
FINEST = 1e-5  # of the robot's size: the first rung
STEP = math.sqrt(2)
BELOW = 6  # rungs: an eighth of the error


class LodChain:
    """Simplified versions of one welded surface. Version k is within `robot_size · FINEST · STEP**k` of the
    original, as `simplify` estimates it, and within LARGEST of the mesh's own size. After the last of these,
    number `rungs` - 1, the error of each version is STEP times that of the one before."""

    def __init__(self, surface: Surface, mesh_size: float, robot_size: float, rungs: int) -> None:
        self.surface = surface
        self._rungs_count = rungs
        crowded = _crowded(surface)
        self._kept = surface.faces[crowded]  # as they are, on every rung
        self._loose = surface.faces[~crowded]
        # where some stay, the others keep their border with them
        self._keeps_border = len(self._kept) > 0
        self._first = robot_size * FINEST
        self._most = mesh_size * LARGEST
        self._rungs: dict[int, tuple[float, Faces]] = {}

    def get_rung(self, k: int) -> tuple[float, Faces]:
        """Version k: its error bound in metres, and its triangles as indices of the surface's vertices.
        Negative k: the original."""
        if k < 0:
            return 0.0, self.surface.faces
        bound, faces = self._rung(k)
        return bound, np.concatenate([faces, self._kept]) if len(self._kept) else faces

    def _rung(self, k: int) -> tuple[float, Faces]:
        if k < 0:
            return 0.0, self._loose
        if k >= self._rungs_count and k not in self._rungs:
            # In one pass: a second pass may not join what the first leaves of shells with many holes.
            bound, before = self._most * STEP ** (k - self._rungs_count + 1), self._rung(k - 1)[1]
            self._rungs[k] = (bound, min(self._simplified(self._loose, bound), before, key=len))
        if k not in self._rungs:
            # From a rung far below: fast, and the sum of both errors is still within the bound.
            below, faces = self._rung(k - BELOW)
            bound = min(self._first * STEP**k, self._most)
            self._rungs[k] = (bound, self._simplified(faces, bound - below) if bound > below else faces)
        return self._rungs[k]

    def _simplified(self, faces: Faces, error: float) -> Faces:
        if len(faces) <= 4:
            return faces
        return simplify(faces, self.surface.positions, self.surface.uv, error, self._keeps_border)


def _crowded(surface: Surface) -> NDArray[np.bool_]:
    if surface.uv is None:  # welded: one vertex per position
        return find_crowded_faces(surface.faces)
    _, place = np.unique(surface.positions, axis=0, return_inverse=True)
    return find_crowded_faces(surface.faces, place.reshape(-1))


def count_rungs(mesh_sizes: list[float], robot_size: float) -> int:
    """The number of versions after which nothing changes any more."""
    largest = max(mesh_sizes, default=0.0) * LARGEST
    if largest <= robot_size * FINEST:
        return 1
    return math.ceil(math.log(largest / (robot_size * FINEST), STEP)) + 1


# --- vertices: STL, for one, stores about six copies of each

CELLS = 1 << 20  # along the longest side: corners within one cell are one vertex
CROWD_MAX = 1000  # triangles at one vertex; real robots have up to a few hundred


def weld_vertices(surface: Surface) -> Surface:
    """The surface with one vertex per position (and texture coordinate), without duplicate triangles and
    triangles of no area."""
    positions = surface.positions
    low = positions.min(0)
    cell = max(float((positions.max(0) - low).max()), 1e-12) / CELLS
    grid = np.round((positions.astype(np.float64) - low) / cell).astype(np.int64)
    key = (grid[:, 0] << 42) | (grid[:, 1] << 21) | grid[:, 2]
    uv = surface.uv
    if uv is None:
        _, first, number = np.unique(key, return_index=True, return_inverse=True)
    else:
        rows = np.column_stack([key, np.round(np.clip(uv, -1e6, 1e6) * 65536).astype(np.int64)])
        _, first, number = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    faces = drop_duplicate_faces(number.reshape(-1)[surface.faces], len(first))
    return Surface(positions[first], faces, None if uv is None else uv[first], surface.paint)


def drop_duplicate_faces(faces: NDArray[np.int64], vertices: int) -> Faces:
    """Triangles with three different corners, each once and in order; the reverse side counts as a different
    triangle."""
    a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
    faces = faces[(a != b) & (b != c) & (c != a)]
    turn = np.argmin(faces, axis=1)[:, None]
    turned = np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1)
    if vertices < 1 << 21:
        key = (turned[:, 0] << 42) | (turned[:, 1] << 21) | turned[:, 2]
        _, first = np.unique(key, return_index=True)
    else:
        _, first = np.unique(turned, axis=0, return_index=True)
    kept: Faces = faces[np.sort(first)].astype(np.int32)
    return kept


def find_crowded_faces(
    faces: NDArray[np.int64] | Faces, place: NDArray[np.int64] | None = None
) -> NDArray[np.bool_]:
    """Which triangles touch a vertex shared by more than CROWD_MAX of them; simplification takes quadratic
    time in that number. `place`: the position number of each vertex, if several vertices are at one
    position."""
    corners = faces if place is None else place[faces]
    crowded = np.bincount(corners.reshape(-1))[corners] > CROWD_MAX
    return np.asarray(crowded.any(axis=1), np.bool_)


def drop_unused_vertices(faces: Faces) -> tuple[NDArray[np.int64], Faces]:
    """Return the numbers of the used vertices in order of first use, and the faces renumbered to index
    these."""
    flat = faces.reshape(-1)
    used, first, number = np.unique(flat, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    place = np.empty(len(used), np.int32)
    place[order] = np.arange(len(used), dtype=np.int32)
    return used[order].astype(np.int64), place[number].reshape(-1, 3)
