"""Decides whether to apply the up axis of a robot's Collada and glTF files.

Exporters write Y_UP into Collada whether or not they have already turned the vertices; RViz ignores it. In
glTF, y is up by definition, and RViz turns it; but some exporters leave z up. The assembled robot shows which
is right: the shells of joined links touch, unless they are turned wrongly. If that does not tell, Collada is
taken as written and glTF is turned.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.manifest import compute_home, is_within_reach, make_skeleton
from posecast_edge.model.builder.model_files import Files
from posecast_edge.model.finding import Finding
from posecast_edge.model.kinematics import compute_link_poses
from posecast_edge.model.meshes.mesh import UPRIGHT, Mesh
from posecast_edge.model.meshes.primitives import tessellate
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import APPLY, IGNORE, SHAPES_MAX, Geometry, Urdf

SAMPLES = 1500  # points on a mesh
NEAR = 0.007  # of the robot's size: points in cells of that width, the same or next to each other, touch
# a sequence that covers a square evenly, by its two steps (the plastic number's powers)
STEPS = (0.7548776662466927, 0.5698402909980532)
NEIGHBOURS = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])

Points = NDArray[np.float64]
NOTHING: Points = np.zeros((0, 3))


@dataclass(frozen=True)
class Fit:
    """How many of `pairs` joined links touch: with the files as written, and turned upright."""

    pairs: int
    ignored: int
    applied: int


def settle_up_axis(urdf: Urdf, tree: Tree, files: Files, mode: str) -> None:
    """Turn the meshes in `files` upright if their up axis applies, glTF and Collada each for itself, and add
    that to the URDF's findings. `mode`: one of UP_AXIS_MODES."""
    if mode == IGNORE:
        return
    for is_gltf in (True, False):
        meshes = (f.mesh for f in files if f.mesh is not None and f.mesh.is_up_certain == is_gltf)
        named = sorted({mesh.up for mesh in meshes if mesh.up})
        if not named:
            continue
        if mode == APPLY:
            applied, why = True, " because of --up-axis"
        else:
            fit = measure_fit(urdf, tree, files, is_gltf)
            applied = fit.applied >= fit.ignored if is_gltf else fit.applied > fit.ignored
            best, other = max(fit.applied, fit.ignored), min(fit.applied, fit.ignored)
            touch = f"{best} of {fit.pairs} pairs of neighbouring links touch, otherwise {other}"
            why = f", because then {touch}" if fit.pairs else ""
        if applied:
            files.turn_upright(is_gltf)
        if why and not (is_gltf and applied):  # that needs no reason
            says = (
                "the y axis of glTF is up" if is_gltf else f"the Collada files declare {' and '.join(named)}"
            )
            how = "turned upright" if applied else "taken as written"
            urdf.findings.append(Finding("hint", "up-axis", f"{says}; {how}{why}"))


def measure_fit(urdf: Urdf, tree: Tree, files: Files, is_gltf: bool) -> Fit:
    """Count the joined links that touch at home, among those that the up axis of this format affects."""
    skeleton = make_skeleton(urdf, tree)
    poses = [np.array(p) for p in compute_link_poses(skeleton, compute_home(skeleton)).values()]
    sampler = _Sampler(files, is_gltf)
    clouds: list[tuple[Points, Points]] = []  # of each link: as written, upright
    turned: list[bool] = []
    left = SHAPES_MAX
    for link, pose in zip(tree.links, poses, strict=True):
        parts: list[tuple[Points, Points]] = []
        moved = False
        for shape in link.visuals:
            if shape.geometry is None or not is_within_reach(shape.pose) or left <= 0:
                continue
            left -= 1
            at = pose @ np.array(shape.pose.to_matrix())
            found = sampler.sample_geometry(shape.geometry)
            moved = moved or found[0] is not found[1]
            parts.append((_placed(found[0], at), _placed(found[1], at)))
        empty = np.zeros((0, 3))
        clouds.append(
            (np.concatenate([empty, *(p[0] for p in parts)]), np.concatenate([empty, *(p[1] for p in parts)]))
        )
        turned.append(moved)
    pairs = [p for p in _neighbours(tree, clouds) if turned[p[0]] or turned[p[1]]]
    counts = [_count_touching([c[i] for c in clouds], pairs) for i in (0, 1)]
    return Fit(len(pairs), counts[0], counts[1])


class _Sampler:
    """Points on each geometry, taken once for each mesh."""

    def __init__(self, files: Files, is_gltf: bool) -> None:
        """`is_gltf`: the format that may be turned, else Collada."""
        self._files = files
        self._is_gltf = is_gltf
        self._known: dict[str, tuple[Points, Points]] = {}

    def sample_geometry(self, geometry: Geometry) -> tuple[Points, Points]:
        """As written and upright; the same object where that is the same."""
        scale = np.array(geometry.scale)
        if geometry.kind != "mesh":
            written = _sample_mesh(tessellate(geometry.kind, geometry.dims)) * scale
            return written, written
        if geometry.uri not in self._known:
            self._known[geometry.uri] = self._of_mesh(self._files[geometry.uri].mesh)
        written, upright = self._known[geometry.uri]
        scaled = written * scale
        return scaled, scaled if upright is written else upright * scale

    def _of_mesh(self, mesh: Mesh | None) -> tuple[Points, Points]:
        if mesh is None:
            return NOTHING, NOTHING
        points = _sample_mesh(mesh)
        turns = mesh.is_up_certain == self._is_gltf and mesh.up in UPRIGHT
        return points, points @ UPRIGHT[mesh.up].T if turns else points


def _sample_mesh(mesh: Mesh) -> Points:
    """SAMPLES points, evenly over its area."""
    corners = np.concatenate([s.positions[s.faces].astype(np.float64) for s in mesh.surfaces])
    a, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.cumsum(np.linalg.norm(np.cross(along, across), axis=1))
    numbers = np.arange(SAMPLES)
    which = np.searchsorted(areas, (numbers + 0.5) / SAMPLES * areas[-1]).clip(0, len(areas) - 1)
    u, v = ((numbers * step) % 1 for step in STEPS)
    beyond = u + v > 1
    u, v = np.where(beyond, 1 - u, u), np.where(beyond, 1 - v, v)
    return np.asarray(a[which] + u[:, None] * along[which] + v[:, None] * across[which])


def _placed(points: Points, at: Points) -> Points:
    return np.asarray(points @ at[:3, :3].T + at[:3, 3])


def _neighbours(tree: Tree, clouds: Sequence[tuple[Points, Points]]) -> Iterator[tuple[int, int]]:
    """Each link with a visual, and the next link above it with one."""
    shown: list[int | None] = []  # for each link: itself, otherwise the next above
    for number, (written, _) in enumerate(clouds):
        above = shown[tree.index[tree.joints[number - 1].parent]] if number else None
        if len(written) and above is not None:
            yield above, number
        shown.append(number if len(written) else above)


def _count_touching(clouds: Sequence[Points], pairs: Sequence[tuple[int, int]]) -> int:
    every = np.concatenate(clouds)
    every = every[np.isfinite(every).all(1)]
    if not len(every):
        return 0
    low = every.min(0)
    cell = max(float(np.linalg.norm(every.max(0) - low)) * NEAR, 1e-9)
    side = int(3 / NEAR)  # cells along an axis, with room for neighbours
    cells = [np.unique(((c - low) // cell).astype(np.int64) + 1, axis=0) for c in clouds]
    keys = [_key(c, side) for c in cells]

    def touch(a: int, b: int) -> bool:
        around = _key((cells[a][:, None] + NEIGHBOURS).reshape(-1, 3), side)
        return bool(np.isin(keys[b], around).any())

    return sum(touch(a, b) for a, b in pairs)


def _key(cells: NDArray[np.int64], side: int) -> NDArray[np.int64]:
    return np.asarray((cells[:, 0] * side + cells[:, 1]) * side + cells[:, 2])
