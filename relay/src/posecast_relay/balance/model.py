"""Reads from a model's manifest (docs/reference/model-bundle.md) what balance needs: the tree, the links'
masses and the soles. It comes from a robot, so everything is checked, by the rules of the page's reader."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from posecast_wire.mapping import Xyz

from posecast_relay.kinematics.link_poses import AT_ORIGIN, LinkPose, compose_poses
from posecast_relay.kinematics.manifest_values import (
    ModelTreeError,
    check_list,
    check_number,
    check_numbers,
    check_table,
    fail,
    make_xyz,
)
from posecast_relay.kinematics.model_tree import ModelTree, load_manifest, make_model_tree
from posecast_relay.kinematics.vector import add, scale

SOLES_MAX = 64
CORNERS_MAX = 16  # of a sole
MASS_MAX_KG = 1e6  # a heavier link is invalid
MASS_MIN_KG = 1e-3  # a lighter robot is invalid
REACH_M = 100.0  # a link's centre of mass farther away is invalid
IMPOSSIBLE = ("mass", "inertia")  # prefixes of the codes of findings about impossible masses

T = TypeVar("T")


@dataclass(frozen=True)
class LinkMass:
    """The mass of a link (index). `xyz`: its centre in the link's frame, metres."""

    link: int
    mass_kg: float
    xyz: Xyz


@dataclass(frozen=True)
class Sole:
    """What a link (index) stands on: a convex polygon in one plane, in the link's frame (metres),
    counter-clockwise seen from above while it is level."""

    link: int
    points: tuple[Xyz, ...]


@dataclass(frozen=True)
class BalanceModel:
    """A model's tree with what it weighs and stands on.

    `inertials`: the links that have a mass; () without any, None where the bundle's builder knew of none;
    `soles` likewise. `has_impossible_masses`: there are some, and they can't be. `why`: what is wrong with
    what the manifest says of masses or soles, which is then left out as of such a bundle.
    """

    tree: ModelTree
    inertials: tuple[LinkMass, ...] | None
    soles: tuple[Sole, ...] | None
    has_impossible_masses: bool = False
    why: str | None = None

    @cached_property
    def mass_kg(self) -> float:
        """Of all links, kg; 0 when no masses are known."""
        return sum(each.mass_kg for each in self.inertials or ())

    @cached_property
    def groups(self) -> tuple[int, ...]:
        """By link, the link at the root of those that fixed joints hold together with it."""
        groups = [0]
        for i, joint in enumerate(self.tree.joints):
            groups.append(groups[joint.parent] if joint.type == "fixed" else i + 1)
        return tuple(groups)

    @cached_property
    def group_from_link(self) -> tuple[LinkPose, ...]:
        """By link, where it is against the one at the root of its group."""
        poses = [AT_ORIGIN]
        for joint in self.tree.joints:
            is_fixed = joint.type == "fixed"
            at_rest = LinkPose(joint.xyz, joint.quat)
            poses.append(compose_poses(poses[joint.parent], at_rest) if is_fixed else AT_ORIGIN)
        return tuple(poses)

    @cached_property
    def root_from_link(self) -> tuple[LinkPose, ...]:
        """By link, where it is while all joints are at 0."""
        poses = [AT_ORIGIN]
        for joint in self.tree.joints:
            poses.append(compose_poses(poses[joint.parent], LinkPose(joint.xyz, joint.quat)))
        return tuple(poses)

    @cached_property
    def inside(self) -> Xyz:
        """A point on the inside of any sole: the mean of the links' origins (root's frame, metres) while all
        joints are at 0."""
        total: Xyz = (0.0, 0.0, 0.0)
        for pose in self.root_from_link:
            total = add(total, pose.xyz)
        return scale(total, 1 / len(self.root_from_link))

    @cached_property
    def link_of(self) -> Mapping[str, int]:
        """The index of a link by its name."""
        return {name: i for i, name in enumerate(self.tree.links)}


def read_balance_model(manifest: bytes | bytearray) -> BalanceModel:
    """Read a manifest, in time proportional to its size. Raises ModelTreeError if the links can't be placed
    with it. Invalid masses and soles are left out, and `why` gives the reason."""
    doc = load_manifest(manifest)
    tree = make_model_tree(doc)
    links = len(tree.links)
    inertials, wrong_masses = _attempt(lambda: _read_by_link(doc, "inertials", links, links, _read_mass))
    listed = inertials or ()
    is_impossible = len(listed) > 0 and not _can_be(listed)
    inertials = () if is_impossible else inertials
    soles, wrong_soles = _attempt(lambda: _read_by_link(doc, "soles", SOLES_MAX, links, _read_sole))
    has_impossible = is_impossible or (not inertials and _has_impossible(doc.get("findings")))
    return BalanceModel(tree, inertials, soles, has_impossible, wrong_masses or wrong_soles)


def _attempt(read: Callable[[], tuple[T, ...] | None]) -> tuple[tuple[T, ...] | None, str | None]:
    """What is read; or nothing, as of a bundle without it, and why: building it again is what helps."""
    try:
        return read(), None
    except ModelTreeError as e:
        return None, str(e)


def _read_by_link(
    doc: Mapping[str, object],
    member: str,
    most: int,
    links: int,
    read: Callable[[Mapping[str, object], int, str], T],
) -> tuple[T, ...] | None:
    """Entries of which each belongs to a link of its own; None where the member is absent."""
    if member not in doc:
        return None
    found: list[T] = []
    before = -1
    for i, each in enumerate(check_list(doc[member], member, most)):
        where = f"{member}[{i}]"
        entry = check_table(each, where)
        link = entry.get("link")
        if type(link) is not int or not 0 <= link < links:
            fail(where, "its link is not there")
        if link <= before:
            fail(where, "its link does not come after the one before")
        before = link
        found.append(read(entry, link, where))
    return tuple(found)


def _read_mass(entry: Mapping[str, object], link: int, where: str) -> LinkMass:
    mass_kg = check_number(entry.get("mass_kg"), f"{where}.mass_kg")
    if not mass_kg > 0:
        fail(f"{where}.mass_kg", "no number above 0")
    check_numbers(entry.get("inertia"), 6, f"{where}.inertia")
    return LinkMass(link, mass_kg, make_xyz(check_numbers(entry.get("xyz"), 3, f"{where}.xyz")))


def _can_be(masses: Sequence[LinkMass]) -> bool:
    return sum(each.mass_kg for each in masses) >= MASS_MIN_KG and all(
        each.mass_kg <= MASS_MAX_KG and all(abs(x) <= REACH_M for x in each.xyz) for each in masses
    )


def _read_sole(entry: Mapping[str, object], link: int, where: str) -> Sole:
    corners = check_list(entry.get("points"), f"{where}.points", CORNERS_MAX)
    if len(corners) < 3:
        fail(f"{where}.points", "fewer than 3")
    points = (check_numbers(corner, 3, f"{where}.points[{i}]") for i, corner in enumerate(corners))
    return Sole(link, tuple(make_xyz(point) for point in points))


def _has_impossible(findings: object) -> bool:
    entries: Sequence[object] = findings if isinstance(findings, list) else ()
    codes = (each.get("code") for each in entries if isinstance(each, dict))
    return any(isinstance(code, str) and code.startswith(IMPOSSIBLE) for code in codes)
