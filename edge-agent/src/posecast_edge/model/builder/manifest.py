"""Makes the manifest of a bundle, version 2 (docs/reference/model-bundle.md): the skeleton and the list of
files."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from posecast_edge.model.finding import Finding, ModelRefused
from posecast_edge.model.kinematics import compute_plane_axes, normalise_axis, quaternion_from_rpy
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import FAR_M, SCALAR_TYPES, UNBOUNDED, Pose, Sensor, Urdf

VERSION = 2
FINDINGS_MAX = 200
BYTES_MAX = 1 << 20  # a relay accepts no more


def make_skeleton(urdf: Urdf, tree: Tree) -> dict[str, Any]:
    """The manifest's members `links`, `joints` and `sensors`."""
    sensors = [_sensor(s, tree) for s in urdf.sensors if s.link in tree.index and is_within_reach(s.pose)]
    return {
        "links": [link.name for link in tree.links],
        "joints": [_joint(tree, i) for i in range(len(tree.joints))],
        **({"sensors": sensors} if sensors else {}),
    }


def compute_home(manifest: Mapping[str, Any]) -> dict[str, float]:
    """The home position of every joint (rad or m): 0, or the limit nearest to it."""
    at: dict[str, float] = {}
    for joint in manifest["joints"]:
        limits = joint.get("limits", {})
        low, high = limits.get("lower", -math.inf), limits.get("upper", math.inf)
        if low <= high and joint["type"] in SCALAR_TYPES and not joint.get("mimic"):
            at[joint["name"]] = min(max(0.0, low), high)
    return at


def encode_manifest(manifest: Mapping[str, Any]) -> bytes:
    """The manifest's exact bytes; their SHA-256 identifies the model. Raises ModelRefused when they are too
    many for a relay."""
    data = json.dumps(manifest, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
    if len(data) > BYTES_MAX:
        raise ModelRefused(f"its manifest would have {len(data) / 1000:,.0f} kB; a relay takes at most 1 MiB")
    return data


def make_file_entry(path: str, data: bytes, kind: str) -> dict[str, Any]:
    """One entry of the manifest's `files`."""
    return {"path": path, "size": len(data), "sha256": hashlib.sha256(data).hexdigest(), "type": kind}


def make_finding_entries(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """The manifest's `findings`, at most FINDINGS_MAX."""
    return [
        {"severity": f.severity, "code": f.code, "text": f.text} | ({"line": f.line} if f.line else {})
        for f in findings[:FINDINGS_MAX]
    ]


def is_within_reach(pose: Pose) -> bool:
    """Whether the pose is near enough to be a plausible part of a robot."""
    return max(map(abs, pose.xyz)) <= FAR_M


def round_digits(value: float) -> float:
    """Round to nine significant digits, without negative zero."""
    return float(f"{value:.9g}") + 0.0


def _joint(tree: Tree, number: int) -> dict[str, Any]:
    joint, follow, limit = tree.joints[number], tree.follows[number], tree.joints[number].limit
    entry: dict[str, Any] = {
        "name": joint.name,
        "type": joint.type,
        "parent": tree.index[joint.parent],
        "child": tree.index[joint.child],
        **_pose(joint.pose),
        "axis": [round_digits(v) for v in normalise_axis(joint.axis)],
    }
    if joint.type == "planar":
        entry["plane"] = [
            [round_digits(v) for v in way] for way in compute_plane_axes(normalise_axis(joint.axis))
        ]
    if limit is not None and joint.type in SCALAR_TYPES:
        bounded = joint.type != "continuous"
        given = {
            "lower": limit.lower if limit.lower is not None or not bounded else 0.0,
            "upper": limit.upper if limit.upper is not None or not bounded else 0.0,
            "velocity": limit.velocity,
            "effort": limit.effort,
        }
        if not bounded or max(abs(limit.lower or 0.0), abs(limit.upper or 0.0)) >= UNBOUNDED:
            given["lower"] = given["upper"] = None
        entry["limits"] = {name: round_digits(v) for name, v in given.items() if v is not None}
    if follow is not None:
        entry["mimic"] = {
            "joint": follow.joint,
            "multiplier": round_digits(follow.multiplier),
            "offset": round_digits(follow.offset),
        }
    return entry


def _sensor(sensor: Sensor, tree: Tree) -> dict[str, Any]:
    return {"name": sensor.name, "kind": sensor.kind, "link": tree.index[sensor.link], **_pose(sensor.pose)}


def _pose(pose: Pose) -> dict[str, Any]:
    return {
        "xyz": [round_digits(v) for v in pose.xyz],
        "quat": [round_digits(v) for v in quaternion_from_rpy(pose.rpy)],
    }
