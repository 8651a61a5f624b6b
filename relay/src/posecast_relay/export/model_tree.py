"""Checks values of a model's manifest, because it comes from a robot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

from posecast_wire.checked import loads, make_visible
from posecast_wire.schema import Xyz


class ModelTreeError(ValueError):
    """A part of a manifest that can't be used: one line, `where: reason`."""


def check_table(value: object, where: str) -> Mapping[str, object]:
    """Return `value` if it is an object. Raises ModelTreeError."""
    if not isinstance(value, dict):
        fail(where, "no object")
    return value


def check_list(value: object, where: str, most: int) -> Sequence[object]:
    """Return `value` if it is a list of at most `most`. Raises ModelTreeError."""
    if not isinstance(value, list):
        fail(where, "no list")
    if len(value) > most:
        fail(where, f"{len(value)} are too many")
    return value


def check_name(value: object, where: str) -> str:
    """Return `value` if it is a text. Raises ModelTreeError."""
    if not isinstance(value, str):
        fail(where, "no name")
    return value


def check_number(value: object, where: str) -> float:
    """Return `value` as float if it is a number. Raises ModelTreeError."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        fail(where, "no number")
    return float(value)


def check_numbers(value: object, size: int, where: str) -> list[float]:
    """Return `value` if it is a list of `size` numbers. Raises ModelTreeError."""
    found = check_list(value, where, size)
    if len(found) != size:
        fail(where, f"not {size} numbers")
    return [check_number(each, where) for each in found]


def make_xyz(value: Sequence[float]) -> Xyz:
    """The first three of some numbers."""
    return (value[0], value[1], value[2])


def fail(where: str, reason: str) -> NoReturn:
    """Raise ModelTreeError with the text `where: reason`."""
    raise ModelTreeError(f"{make_visible(where)}: {make_visible(reason)}")


BYTES_MAX = 1 << 20
LINKS_MAX = 1000
VISUALS_MAX = 1024
LENGTH_SLACK = 1e-3  # by which a unit vector's length may differ from 1

Quat = tuple[float, float, float, float]  # w, x, y, z
Box = tuple[Xyz, Xyz]  # lowest and highest corner, metres

# suffixes of the names of a joint's readings, and their values at rest
VARIABLES: Mapping[str, tuple[tuple[str, float], ...]] = {
    "fixed": (),
    "revolute": (("", 0.0),),
    "continuous": (("", 0.0),),
    "prismatic": (("", 0.0),),
    "planar": (("/x", 0.0), ("/y", 0.0), ("/theta", 0.0)),
    "floating": (
        *(("/trans_x", 0.0), ("/trans_y", 0.0), ("/trans_z", 0.0)),
        *(("/rot_x", 0.0), ("/rot_y", 0.0), ("/rot_z", 0.0), ("/rot_w", 1.0)),
    ),
}


@dataclass(frozen=True)
class CopiedJoint:
    """The joint (index) that a joint copies where it has no reading of its own: q = multiplier · its value +
    offset."""

    joint: int
    multiplier: float
    offset: float


@dataclass(frozen=True)
class TreeJoint:
    """A joint: the child of joint i is link i + 1. `xyz` (metres), `quat`: parent_from_joint at rest; `axis`,
    `plane`: unit vectors in the joint's frame."""

    name: str
    type: str
    parent: int
    xyz: Xyz
    quat: Quat
    axis: Xyz
    plane: tuple[Xyz, Xyz] | None
    mimic: CopiedJoint | None


@dataclass(frozen=True)
class ModelTree:
    """A model's links, root first, its joints, parents before children, and by link the box around all that
    it shows, in its own frame."""

    links: tuple[str, ...]
    joints: tuple[TreeJoint, ...]
    boxes: Mapping[int, Box]


def read_model_tree(manifest: bytes | bytearray) -> ModelTree:
    """Read a manifest, in time proportional to its size. Raises ModelTreeError."""
    if len(manifest) > BYTES_MAX:
        fail("manifest", f"over {BYTES_MAX} bytes")
    try:
        document = loads(bytes(manifest))
    except ValueError:
        fail("manifest", "not JSON")
    doc = check_table(document, "manifest")
    if doc.get("v") != 2:
        fail("v", "a URDF that has not been built; the robot's program does that with the extra `model`")
    links = tuple(
        check_name(v, f"links[{i}]") for i, v in enumerate(check_list(doc.get("links"), "links", LINKS_MAX))
    )
    if not links:
        fail("links", "none")
    found = check_list(doc.get("joints"), "joints", LINKS_MAX - 1)
    joints = tuple(_joint(check_table(v, f"joints[{i}]"), i) for i, v in enumerate(found))
    if len(joints) != len(links) - 1:
        fail("joints", f"{len(links)} links need {len(links) - 1}")
    for where, names in (("links", links), ("joints", tuple(joint.name for joint in joints))):
        if len(set(names)) < len(names):
            fail(where, "a name is used twice")
    for i, joint in enumerate(joints):
        if joint.mimic is not None and joint.mimic.joint >= len(joints):
            fail(f"joints[{i}]", "mimics a joint that is not there")
    return ModelTree(links, joints, _boxes(doc.get("visuals"), len(links)))


def _joint(doc: Mapping[str, object], i: int) -> TreeJoint:
    where = f"joints[{i}]"
    kind, parent, mimic = doc.get("type"), doc.get("parent"), doc.get("mimic")
    if doc.get("child") != i + 1:
        fail(where, f"its child is not link {i + 1}")
    if type(parent) is not int or not 0 <= parent <= i:
        fail(where, "its parent comes after it")
    if not isinstance(kind, str) or kind not in VARIABLES:
        fail(where, "unknown type")
    axis = _unit(check_numbers(_given(doc, "axis", [1, 0, 0]), 3, f"{where}.axis"), f"{where}.axis")
    quat = _unit(check_numbers(_given(doc, "quat", [1, 0, 0, 0]), 4, f"{where}.quat"), f"{where}.quat")
    return TreeJoint(
        name=check_name(doc.get("name"), f"{where}.name"),
        type=kind,
        parent=parent,
        xyz=make_xyz(check_numbers(_given(doc, "xyz", [0, 0, 0]), 3, f"{where}.xyz")),
        quat=(quat[0], quat[1], quat[2], quat[3]),
        axis=make_xyz(axis),
        plane=_plane(doc.get("plane"), f"{where}.plane") if kind == "planar" else None,
        mimic=None if "mimic" not in doc else _mimic(check_table(mimic, f"{where}.mimic"), where),
    )


def _plane(value: object, where: str) -> tuple[Xyz, Xyz]:
    ways = [make_xyz(_unit(check_numbers(way, 3, where), where)) for way in check_list(value, where, 2)]
    if len(ways) != 2:
        fail(where, "not two directions")
    return ways[0], ways[1]


def _mimic(doc: Mapping[str, object], where: str) -> CopiedJoint:
    joint = doc.get("joint")
    if type(joint) is not int or not 0 <= joint < LINKS_MAX:
        fail(f"{where}.mimic", "not the index of a joint")
    return CopiedJoint(
        joint,
        check_number(doc.get("multiplier", 1), f"{where}.mimic"),
        check_number(doc.get("offset", 0), f"{where}.mimic"),
    )


def _boxes(value: object, links: int) -> dict[int, Box]:
    boxes: dict[int, Box] = {}
    for i, each in enumerate(check_list(value, "visuals", VISUALS_MAX)):
        visual = check_table(each, f"visuals[{i}]")
        link, box = visual.get("link"), visual.get("box")
        if type(link) is not int or not 0 <= link < links:
            fail(f"visuals[{i}]", "its link is not there")
        if "box" not in visual:
            continue
        where = f"visuals[{i}].box"
        corners = [check_numbers(corner, 3, where) for corner in check_list(box, where, 2)]
        if len(corners) != 2:
            fail(where, "not two corners")
        both = [*corners, *boxes.get(link, ())]
        low, high = ([pick(corner[axis] for corner in both) for axis in range(3)] for pick in (min, max))
        boxes[link] = (make_xyz(low), make_xyz(high))
    return boxes


def _given(doc: Mapping[str, object], name: str, otherwise: object) -> object:
    value = doc.get(name)
    return otherwise if value is None else value


def _unit(value: list[float], where: str) -> list[float]:
    length = math.hypot(*value)
    if not abs(length - 1) < LENGTH_SLACK:
        fail(where, "not of length 1")
    return [part / length for part in value]
