"""Makes increasingly coarse versions of a surface, each within a known distance of the original."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.mesh_coder import simplify
from posecast_edge.model.meshes.mesh import Faces, Surface
from posecast_edge.model.meshes.weld import find_crowded_faces

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
