"""Joins the corners of separate triangles into shared vertices; STL, for one, stores about six copies of
each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.meshes.mesh import Faces, Surface

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
