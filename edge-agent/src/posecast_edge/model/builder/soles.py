"""Finds the soles of a robot's feet: the parts of its lowest shells that touch a level floor at home."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.visuals import Figure
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import Limit

Vectors = NDArray[np.float64]

NEAR = 0.02  # of the robot's height: a foot ends within this height above the lowest one
THICK_M = 0.005  # of a sole: points within this height above its lowest point belong to it
TURNS = 16 * math.pi  # rad; a joint with a larger range is a wheel, not a leg with wide limits
AREA_MIN_M2 = 1e-4
CORNERS_MAX = 16
DIRECTIONS = 64  # the outermost point in each is a corner: a round sole of 10 cm loses 0.1 mm
SPECK_M2 = 1e-7  # a corner that adds less area is left out


def find_soles(tree: Tree, figure: Figure, poses: Sequence[Vectors]) -> list[dict[str, Any]]:
    """The manifest's member `soles`. `poses`: root_from_link of every link at home, z up.

    A foot is a link, including the links fixed to it, whose lowest point is about as low as the robot's. It
    is neither fixed to the root nor a wheel, which turns without limits.
    """
    groups, wheels = _group_links(tree)
    shells = _collect_shells(figure, poses)
    if not shells:
        return []
    lowest = min(float(points[:, 2].min()) for points in shells.values())
    highest = max(float(points[:, 2].max()) for points in shells.values())
    feet: dict[int, list[int]] = {}
    for link in shells:
        if groups[link] != 0 and groups[link] not in wheels:
            feet.setdefault(groups[link], []).append(link)
    lows = {foot: min(float(shells[link][:, 2].min()) for link in links) for foot, links in feet.items()}
    near = {foot: low for foot, low in lows.items() if low <= lowest + NEAR * (highest - lowest)}
    soles = []
    for foot in _leave_ankles_out(near, _list_ancestors(tree, near)):
        low = near[foot]
        points = np.concatenate([shells[link] for link in feet[foot]])
        corners = find_corners(points[points[:, 2] <= low + THICK_M, :2])
        if compute_area(corners) >= AREA_MIN_M2:
            link = next(link for link in feet[foot] if float(shells[link][:, 2].min()) == low)
            soles.append((foot, {"link": link, "points": _express(corners, low, poses[link])}))
    ancestors = _list_ancestors(tree, [foot for foot, _ in soles])
    if all(a in ancestors[b] or b in ancestors[a] for a, _ in soles for b, _ in soles if a != b):
        return []  # one above the other: an arm that hangs down
    return sorted((sole for _, sole in soles), key=lambda sole: int(sole["link"]))


def _list_ancestors(tree: Tree, links: Iterable[int]) -> dict[int, set[int]]:
    """The links above each of `links`."""
    found: dict[int, set[int]] = {}
    for link in links:
        above, at = set[int](), link
        while at:
            at = tree.index[tree.joints[at - 1].parent]
            above.add(at)
        found[link] = above
    return found


def _leave_ankles_out(lows: Mapping[int, float], ancestors: Mapping[int, set[int]]) -> list[int]:
    """The feet by height, without those that have a clearly lower one on the same leg. Toes stay."""
    return [
        foot
        for foot, low in lows.items()
        if not any(
            other < low - THICK_M and (foot in ancestors[one] or one in ancestors[foot])
            for one, other in lows.items()
        )
    ]


def _group_links(tree: Tree) -> tuple[list[int], set[int]]:
    """For each link, the first of the links that it is fixed to; and which of these turn without limits."""
    groups, wheels = [0] * len(tree.links), set[int]()
    for number, joint in enumerate(tree.joints, 1):
        if joint.type == "fixed":
            groups[number] = groups[tree.index[joint.parent]]
        else:
            groups[number] = number
            limit = joint.limit or Limit(None, None, None, None, 0)
            turns = (limit.upper or 0.0) - (limit.lower or 0.0) > TURNS
            if joint.type == "continuous" or (joint.type == "revolute" and turns):
                wheels.add(number)
    return groups, wheels


def _collect_shells(figure: Figure, poses: Sequence[Vectors]) -> dict[int, Vectors]:
    """Link → vertices of its own shells, in the root link's frame, m. Placeholders and bones don't count."""
    found: dict[int, list[Vectors]] = {}
    for visual in figure.visuals:
        if visual.reason is not None or visual.source == "bones":
            continue
        link_from_mesh = visual.pose.to_matrix()
        at = poses[visual.link] @ np.array(link_from_mesh)
        for surface, _, _ in figure.looks[visual.looks].skins:
            found.setdefault(visual.link, []).append(surface.positions @ at[:3, :3].T + at[:3, 3])
    return {link: np.concatenate(parts) for link, parts in found.items()}


def find_corners(points: Vectors) -> list[tuple[float, float]]:
    """At most CORNERS_MAX corners of the convex polygon around points (n, 2), m, counter-clockwise. Left-out
    corners make the sole smaller, never larger."""
    outermost: dict[tuple[float, float], None] = {}
    for step in range(DIRECTIONS):
        angle = 2 * math.pi * step / DIRECTIONS
        along = points[:, 0] * math.cos(angle) + points[:, 1] * math.sin(angle)
        x, y = points[int(along.argmax())]
        outermost[float(x), float(y)] = None
    corners = list(outermost)
    while len(corners) > 2:
        added = [
            _area_of(corners[i - 1], corners[i], corners[(i + 1) % len(corners)]) for i in range(len(corners))
        ]
        least = min(range(len(corners)), key=added.__getitem__)
        if added[least] > SPECK_M2 and len(corners) <= CORNERS_MAX:
            break
        del corners[least]
    return corners


def _area_of(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2


def compute_area(corners: Sequence[tuple[float, float]]) -> float:
    """The area of a polygon, m²; positive if it is counter-clockwise."""
    return sum(_area_of((0.0, 0.0), corners[i - 1], corners[i]) for i in range(len(corners)))


def _express(corners: Sequence[tuple[float, float]], height: float, pose: Vectors) -> list[list[float]]:
    """Corners at a height in the root link, in the link of that pose."""
    found = []
    for x, y in corners:
        ways = [value - float(pose[i, 3]) for i, value in enumerate((x, y, height))]
        found.append([round(sum(float(pose[k, i]) * ways[k] for k in range(3)), 5) + 0.0 for i in range(3)])
    return found
