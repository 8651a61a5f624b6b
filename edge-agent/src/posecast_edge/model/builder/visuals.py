"""Collects what is drawn of the robot: visuals made from meshes, shapes, placeholders or bones."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.manifest import is_within_reach
from posecast_edge.model.builder.mesh_coder import weld_vertices
from posecast_edge.model.builder.model_files import TRIANGLES_MAX, Files
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.kinematics import matrix_from_quaternion, normalise_axis, quaternion_from_rpy
from posecast_edge.model.meshes.mesh import SHOWN_AGAIN_MAX, Mesh, Paint, Surface, pick_part, validate_mesh
from posecast_edge.model.meshes.primitives import make_box, tessellate
from posecast_edge.model.meshes.texture import compute_mean_colour
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import (
    SCALAR_TYPES,
    SHAPES_MAX,
    ZERO,
    Geometry,
    Joint,
    Pose,
    Shape,
    Urdf,
    Vector,
    find_material,
)

GREY = Paint((0.72, 0.74, 0.77, 1.0))
STAND_IN = Paint((0.93, 0.55, 0.14, 1.0))
AXIS = Paint((0.36, 0.52, 0.78, 1.0))  # of a joint, between the bones of a robot without shells
LITTLE = 0.02  # m, half a side of a placeholder of unknown size


@dataclass(frozen=True)
class Appearance:
    """The welded surfaces of a body with their paints and marks, before simplification."""

    skins: tuple[tuple[Surface, Paint, str | None], ...]

    @property
    def mesh(self) -> Mesh:
        """A mesh of all its surfaces."""
        return Mesh(tuple(s for s, _, _ in self.skins))


@dataclass(frozen=True)
class Visual:
    """One visual. `reason`: why a placeholder, or the link's bones, are drawn instead of it."""

    link: int
    pose: Pose
    looks: int
    source: str
    reason: str | None


@dataclass(frozen=True)
class Figure:
    """All visuals of the robot; several visuals may share an appearance."""

    visuals: tuple[Visual, ...]
    looks: tuple[Appearance, ...]


def build_figure(urdf: Urdf, tree: Tree, files: Files) -> Figure:
    """Collect every visual that has a geometry, of every link in the tree. If most links have none, the robot
    gets bones."""
    maker = _Maker(urdf, tree, files)
    shown = [list(maker.visuals(i)) for i in range(len(tree.links))]
    bones = make_bones(tree, [i for i, visuals in enumerate(shown) if visuals])
    if bones and any(f.code == "collisions-shown" for f in urdf.findings):
        # a few collision shapes, often crude hulls, would hide the skeleton
        maker, shown = _Maker(urdf, tree, files), [[] for _ in tree.links]
        bones = make_bones(tree, ())
    for i in range(len(shown)):
        if i in bones:
            shown[i] += maker.bones(i, bones[i])
        elif not bones:
            shown[i] += maker.box(i)
    return Figure(tuple(v for visuals in shown for v in visuals), tuple(maker.looks))


@dataclass(frozen=True)
class _Lack:
    """A link that can't be shown: where its first visual would be, its source, and the reason."""

    xyz: Vector
    source: str
    reason: str


class _Maker:
    def __init__(self, urdf: Urdf, tree: Tree, files: Files) -> None:
        self._urdf = urdf
        self._tree = tree
        self._files = files
        self._numbers: dict[object, int] = {}
        self._left = SHAPES_MAX
        self._drawn = self._made = 0  # triangles: of all visuals, of all looks
        self._stood_in: set[int] = set()
        self._lacks: dict[int, _Lack] = {}
        self._joints: dict[str, list[Vector]] = {}  # where each link's own joints are
        for joint in tree.joints:
            self._joints.setdefault(joint.parent, []).append(joint.pose.xyz)
        self.looks: list[Appearance] = []

    def visuals(self, link: int) -> Iterator[Visual]:
        """The visuals of a link, or its collision shapes instead."""
        for shape in self._tree.links[link].visuals:
            if shape.geometry is None or self._left <= 0:
                continue
            self._left -= 1
            fallback = self._paint(shape)
            source = shape.geometry.uri or shape.geometry.kind
            try:
                if not is_within_reach(shape.pose):
                    raise ModelRefused("its origin is more than 10,000 km away")
                number = self._drawn_as(shape.geometry, fallback, None)
                yield Visual(link, shape.pose, number, source, None)
            except ModelRefused as e:
                yield from self._stand_ins(link, shape, source, e.reason)

    def _drawn_as(self, geometry: Geometry, paint: Paint | None, mark: str | None) -> int:
        """The appearance of a geometry that is drawn again. Raises ModelRefused when its mesh can't be used,
        or too much is drawn already."""
        number = self._number(geometry, paint, mark)
        drawn = self._drawn + sum(len(s.faces) for s, _, _ in self.looks[number].skins)
        if drawn > TRIANGLES_MAX:
            raise ModelRefused(f"left out: the robot already shows more than {TRIANGLES_MAX:,} triangles")
        self._drawn = drawn
        return number

    def _number(self, geometry: Geometry, paint: Paint | None, mark: str | None) -> int:
        file = self._files[geometry.uri] if geometry.kind == "mesh" else None
        if file is not None and file.mesh is None:
            raise ModelRefused(file.reason or "can't be read")
        source = (file.path or file.uri) if file else geometry.kind
        part = (geometry.part, geometry.is_centred)
        key = (source, geometry.dims, geometry.scale, paint, mark, *part)
        if key not in self._numbers:
            made = pick_part(file.mesh, *part) if file and file.mesh else None
            mesh = made or validate_mesh(tessellate(geometry.kind, geometry.dims))
            self._made += mesh.triangles
            if self._made > SHOWN_AGAIN_MAX + self._files.triangles:  # another scale or paint is another body
                raise ModelRefused("left out: large meshes are shown in too many sizes and colours")
            self._numbers[key] = self._add(_scaled(mesh, geometry.scale), paint, mark)
        return self._numbers[key]

    def _add(self, mesh: Mesh, fallback: Paint | None, mark: str | None) -> int:
        """Surfaces of one paint become one, welded."""
        by_paint: dict[tuple[Paint, str | None], list[Surface]] = {}
        for surface in mesh.surfaces:
            own = STAND_IN if mark else surface.paint or fallback or surface.spare
            painted = (own or GREY, mark or ("default" if own is None else None))
            if painted[0].texture is not None and surface.uv is None:
                painted = (_without_picture(painted[0]), painted[1])
            by_paint.setdefault(painted, []).append(surface)
        skins = []
        for (paint, extra), surfaces in by_paint.items():
            welded = weld_vertices(_joined(surfaces, keep_uv=paint.texture is not None))
            if len(welded.faces):
                skins.append((welded, paint, extra))
        if not skins:
            raise ModelRefused("none of its triangles has an area")
        self.looks.append(Appearance(tuple(skins)))
        return len(self.looks) - 1

    def _stand_ins(self, link: int, shape: Shape, source: str, reason: str) -> Iterator[Visual]:
        """The link's collision shapes, once per link, as placeholders."""
        if link in self._stood_in:
            return
        self._stood_in.add(link)
        found = False
        for other in self._tree.links[link].collisions:
            if other.geometry is None or other.geometry.uri == source:
                continue
            try:
                if not is_within_reach(other.pose):
                    continue
                number = self._drawn_as(other.geometry, None, "placeholder")
            except ModelRefused:
                continue
            found = True
            yield Visual(link, other.pose, number, source, reason)
        if not found:
            at = shape.pose.xyz if is_within_reach(shape.pose) else ZERO
            self._lacks[link] = _Lack(at, source, reason)

    def box(self, link: int) -> Iterator[Visual]:
        """A box from a link without visuals to its children."""
        if lack := self._lacks.get(link):
            looks = self._add(self._box(link, lack.xyz), None, "placeholder")
            yield Visual(link, Pose(), looks, lack.source, lack.reason)

    def bones(self, link: int, bones: tuple[Bone, ...]) -> Iterator[Visual]:
        """The bones of a link, as one visual."""
        if bones not in self._numbers:
            surfaces = tuple(s for bone in bones for s in _surfaces(bone))
            try:
                self._numbers[bones] = self._add(validate_mesh(Mesh(surfaces)), None, None)
            except ModelRefused:  # too long or too thin to be drawn
                yield from self.box(link)
                return
        lack = self._lacks.get(link)
        source, reason = (lack.source, lack.reason) if lack else ("bones", None)
        yield Visual(link, Pose(), self._numbers[bones], source, reason)

    def _box(self, link: int, xyz: Vector) -> Mesh:
        points = [xyz, *self._joints.get(self._tree.links[link].name, [])]
        low, high = np.min(points, axis=0) - LITTLE, np.max(points, axis=0) + LITTLE
        return make_box((low + high) / 2, high - low)

    def _paint(self, shape: Shape) -> Paint | None:
        material = find_material(shape, self._urdf.materials)
        if material is None:
            return None
        picture = self._files.find_picture(material.texture) if material.texture else None
        if picture is not None:  # the picture alone, as RViz does
            return Paint((1.0, 1.0, 1.0, material.rgba[3] if material.rgba else 1.0), picture)
        return Paint(material.rgba) if material.rgba is not None else None


def _without_picture(paint: Paint) -> Paint:
    if paint.texture is None:
        return paint
    try:
        r, g, b = compute_mean_colour(paint.texture)
    except ModelRefused:
        return Paint(paint.rgba)
    return Paint((r * paint.rgba[0], g * paint.rgba[1], b * paint.rgba[2], paint.rgba[3]))


def _scaled(mesh: Mesh, scale: Vector) -> Mesh:
    if scale == (1.0, 1.0, 1.0):
        return mesh
    mirrored = scale[0] * scale[1] * scale[2] < 0
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
        factor = np.array(scale, np.float32)
        scaled = tuple(
            replace(s, positions=s.positions * factor, faces=s.faces[:, ::-1] if mirrored else s.faces)
            for s in mesh.surfaces
        )
    return validate_mesh(Mesh(scaled))


def _joined(surfaces: Sequence[Surface], keep_uv: bool) -> Surface:
    starts = np.cumsum([0, *(len(s.positions) for s in surfaces)])
    faces = [s.faces + np.int32(start) for s, start in zip(surfaces, starts, strict=False)]
    uv = [s.uv for s in surfaces if s.uv is not None]
    whole = keep_uv and len(uv) == len(surfaces)
    return Surface(
        np.concatenate([s.positions for s in surfaces]),
        np.concatenate(faces),
        np.concatenate(uv) if whole else None,
    )


def _surfaces(bone: Bone) -> Iterator[Surface]:
    turn = np.array(bone.pose.to_matrix(), np.float32)
    dims = bone.dims if bone.kind == "box" else bone.dims[:2]
    for surface in tessellate(bone.kind, dims).surfaces:
        positions = surface.positions @ turn[:3, :3].T + turn[:3, 3]
        yield Surface(positions, surface.faces, paint=AXIS if bone.is_axis else None)


# --- bones; the page does the same for a URDF that it reads itself (spa/src/urdf/bones.ts)

LEAST = 1e-6  # m; shorter bones are left out
# shares of a bone's length, and of the longest way from the root to a tip
THICK, THICK_MAX = 0.09, 0.016  # half a bone's thickness
WIDE, WIDE_MAX = 0.16, 0.024  # the radius of a joint's disc
THIN = 0.003  # minimum of both, as a share of the longest way: thinner would be invisible
STUB = 0.4  # length of the stub that shows how a last link turns, as a share of the bone before it


@dataclass(frozen=True)
class Bone:
    """A cylinder or box in its link's frame, metres. `is_axis`: it shows a joint's axis."""

    pose: Pose
    kind: str
    dims: Vector
    is_axis: bool


def make_bones(tree: Tree, dressed: Collection[int]) -> dict[int, tuple[Bone, ...]]:
    """The bones and axes of the links without shells, by the link's index, if most links have none;
    otherwise {}.

    `dressed`: the indices of links with shells. Links connected by fixed joints count as one.
    """
    rigid = [0]  # for each link, the first of the links that it is rigidly connected to
    for i, joint in enumerate(tree.joints):
        rigid.append(rigid[tree.index[joint.parent]] if joint.type == "fixed" else i + 1)
    clothed = {rigid[link] for link in dressed}
    with_bone = {rigid[tree.index[j.parent]] for j in tree.joints if _length(j.pose.xyz) > LEAST}
    if 2 * len(with_bone - clothed) <= len(with_bone | clothed):
        return {}
    bare = {i for i, first in enumerate(rigid) if first not in clothed}
    skeleton = _Skeleton(tree)
    made = {link: tuple(skeleton.make(link)) for link in sorted(bare)}
    return {link: bones for link, bones in made.items() if bones}


class _Skeleton:
    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._parents = [tree.index[joint.parent] for joint in tree.joints]
        self._below: list[list[Joint]] = [[] for _ in tree.links]
        ways = [0.0]
        for joint, parent in zip(tree.joints, self._parents, strict=True):
            self._below[parent].append(joint)
            ways.append(ways[parent] + _length(joint.pose.xyz))
        self._longest = max(ways)
        self._scales = self._measure()
        self._ways = self._follow()

    def _measure(self) -> list[float]:
        """For each link the length of the bones around it, m; at least half of that of the link before it."""
        scales: list[float] = []
        for i, below in enumerate(self._below):
            own = _length(self._tree.joints[i - 1].pose.xyz) if i > 0 else 0.0
            near = max([own, *(_length(joint.pose.xyz) for joint in below)])
            before = scales[self._parents[i - 1]] if i > 0 else 0.0
            scales.append(max(near, before / 2))
        return scales

    def _follow(self) -> list[NDArray[np.float64] | None]:
        """For each link, in its frame, the direction of the last bone before it; None where there is none."""
        ways: list[NDArray[np.float64] | None] = [None]
        for joint, parent in zip(self._tree.joints, self._parents, strict=True):
            length = _length(joint.pose.xyz)
            way = np.array(joint.pose.xyz) / length if length > LEAST else ways[parent]
            turn = np.array(matrix_from_quaternion(ZERO, quaternion_from_rpy(joint.pose.rpy)))[:3, :3]
            ways.append(None if way is None else turn.T @ way)
        return ways

    def make(self, link: int) -> Iterator[Bone]:
        """The bones from a link to its joints, and the axis of the joint that moves it."""
        for joint in self._below[link]:
            yield from self._bone(joint.pose.xyz)
        if link == 0:
            return
        joint = self._tree.joints[link - 1]
        if joint.type not in SCALAR_TYPES:
            return
        axis = np.array(normalise_axis(joint.axis))
        yield self._axis(link, joint, axis)
        if not self._below[link]:
            way = self._ways[link]
            x, y, z = (_across(axis) if way is None else way) * STUB * self._scales[link]
            yield from self._bone((float(x), float(y), float(z)))

    def _bone(self, end: Vector) -> Iterator[Bone]:
        length = _length(end)
        if length > LEAST and is_within_reach(Pose(end)):
            radius = max(min(THICK * length, THICK_MAX * self._longest), THIN * self._longest)
            direction = np.array(end) / length
            yield Bone(_along(direction, np.array(end) / 2), "cylinder", (radius, length, 0.0), is_axis=False)

    def _axis(self, link: int, joint: Joint, axis: NDArray[np.float64]) -> Bone:
        """A disc across the axis of a joint that turns, a bar along that of one that slides."""
        radius = min(WIDE * self._scales[link], WIDE_MAX * self._longest)
        radius = max(radius, 1.5 * THIN * self._longest)
        at = _along(axis, np.zeros(3))
        if joint.type == "prismatic":
            return Bone(at, "box", (1.5 * radius, 1.5 * radius, 5 * radius), is_axis=True)
        return Bone(at, "cylinder", (radius, 1.5 * radius, 0.0), is_axis=True)


def _along(direction: NDArray[np.float64], middle: NDArray[np.float64]) -> Pose:
    """The pose of a shape whose z lies along a unit vector."""
    x, y, z = (float(v) for v in direction)
    a, b, c = (float(v) for v in middle)
    return Pose((a, b, c), (0.0, math.atan2(math.hypot(x, y), z), math.atan2(y, x)))


def _length(xyz: Vector) -> float:
    return math.hypot(*xyz)


def _across(axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """A unit vector across a unit vector."""
    way = np.cross(axis, (0.0, 0.0, 1.0) if abs(axis[2]) < 0.9 else (0.0, 1.0, 0.0))
    return way / np.linalg.norm(way)
