"""The joints of a model with a single value, for raw and for built models."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from posecast_edge.model.kinematics import normalise_axis, quaternion_from_rpy
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import SCALAR_TYPES, Urdf

SLIDING_TYPE = "prismatic"


@dataclass(frozen=True)
class MovingJoint:
    """A joint that one value moves: it turns about its axis (rad), or slides along it (m).

    `parent`, `child`: its links; `xyz` (metres), `quat` (unit quaternion w x y z): where the joint's frame is
    in its parent's; `axis`: of length 1, in the joint's frame; `lower`, `upper`: None without a limit.
    """

    name: str
    slides: bool
    parent: str
    child: str
    xyz: tuple[float, float, float]
    quat: tuple[float, float, float, float]
    axis: tuple[float, float, float]
    lower: float | None = None
    upper: float | None = None


def list_moving_joints(urdf: Urdf) -> tuple[MovingJoint, ...]:
    """The joints of a model that one value moves, in the tree's order, without those that mimic another."""
    tree = build_tree(urdf)
    found = []
    for joint, follow in zip(tree.joints, tree.follows, strict=True):
        if joint.type not in SCALAR_TYPES or follow is not None:
            continue
        limit = joint.limit if joint.type != "continuous" else None
        found.append(
            MovingJoint(
                joint.name,
                joint.type == SLIDING_TYPE,
                joint.parent,
                joint.child,
                joint.pose.xyz,
                quaternion_from_rpy(joint.pose.rpy),
                normalise_axis(joint.axis),
                None if limit is None else limit.lower or 0.0,
                None if limit is None else limit.upper or 0.0,
            )
        )
    return tuple(found)


def list_built_joints(manifest: bytes) -> tuple[MovingJoint, ...]:
    """The same for a built model, from its manifest. Leaves out invalid entries."""
    document = json.loads(manifest)
    links, joints = (document.get(name) for name in ("links", "joints"))
    if not isinstance(links, list) or not isinstance(joints, list):
        return ()
    return tuple(found for joint in joints if (found := _read_built(joint, links)) is not None)


def _read_built(joint: Any, links: list[Any]) -> MovingJoint | None:
    try:
        moves = joint["type"] in SCALAR_TYPES and "mimic" not in joint
        return _make_built(joint, links) if moves else None
    except (TypeError, ValueError, LookupError, AttributeError):
        return None


def _make_built(joint: Mapping[str, Any], links: list[Any]) -> MovingJoint:
    x, y, z = map(float, joint["xyz"])
    w, qx, qy, qz = map(float, joint["quat"])
    a, b, c = map(float, joint["axis"])
    limits = joint.get("limits", {})
    lower, upper = (None if limits.get(name) is None else float(limits[name]) for name in ("lower", "upper"))
    if not math.isfinite(x + y + z + w + qx + qy + qz + a + b + c):
        raise ValueError("not finite")
    return MovingJoint(
        str(joint["name"]),
        joint["type"] == SLIDING_TYPE,
        str(links[joint["parent"]]),
        str(links[joint["child"]]),
        (x, y, z),
        (w, qx, qy, qz),
        (a, b, c),
        lower,
        upper,
    )
