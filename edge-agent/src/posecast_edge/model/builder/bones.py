"""Makes bones for a robot with few visuals: its links as lines from joint to joint, its joints as axes.

The page does the same for a URDF that it reads itself (spa/src/urdf/bones.ts)."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.manifest import is_within_reach
from posecast_edge.model.kinematics import matrix_from_quaternion, normalise_axis, quaternion_from_rpy
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import SCALAR_TYPES, ZERO, Joint, Pose, Vector

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
