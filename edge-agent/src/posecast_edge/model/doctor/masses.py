"""Finds impossible masses. A single one disables the display of the robot's centre of mass."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product as corners_of

from posecast_edge.model.doctor.meshes import (
    MeshFacts,
    compute_robot_box,
    compute_shape_box,
    compute_zero_poses,
)
from posecast_edge.model.finding import NO_BALANCE, Finding, quote_name, quote_names
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import Inertial, Link

DENSITY_MAX = 12_000.0  # kg/m³; lead has 11,340
BOX_MIN_M3 = 1e-6
MASS_MAX_KG = 1e6
MASS_MIN_KG = 1e-3  # of a robot
REACH_M = 100.0  # along an axis, from a link to its centre of mass; readers of a bundle have the same limit
# Models of working robots have impossible parts: a finger without mass, a camera with made-up moments, a
# pelvis that shows only a bracket. They hardly affect the centre of mass, so they are hints. Masses are
# distrusted if they concern this share of the robot's mass, or of its boxes.
HEAVY_SHARE = 0.25
MOMENTS_SHARE = 0.1
EMPTY_SHARE = 0.02
SLACK = 0.01  # of the largest moment: the others together may be this much smaller, because of rounding
GROSS = 0.5  # rounding does not explain this much
SPAN_M = 1e-3  # moments that fit only a smaller body count as not given
NOISE = 1e-6  # of the largest number of a matrix: a moment of 0 may have this error
DISTRUST = "mass-"  # prefix of the codes that make masses useless


def examine_masses(tree: Tree, facts: Mapping[str, MeshFacts] | None) -> Iterator[Finding]:
    """Yield findings about each link of the tree with an impossible mass, centre or moments. `facts`: the
    meshes by URI, None if they were not read."""
    held, boxes = _list_held(tree), [None if facts is None else _compute_box(x, facts) for x in tree.links]
    whole = sum(max(link.inertial.mass, 0.0) for link in tree.links if link.inertial is not None)
    shown = sum(box for box in boxes if box is not None)
    for number, (link, box) in enumerate(zip(tree.links, boxes, strict=True)):
        if link.inertial is None:
            continue
        mass = link.inertial.mass
        if mass == 0:
            found = None if number in held else _find_empty(link, (box or 0.0) / (shown or 1.0))
        else:
            share = max(mass, 0.0) / (whole or 1.0)
            found = _find_extreme(link.inertial) or _find_heavy(mass, box, share)
            found = found or _find_impossible(link.inertial, share)
        if found is not None:
            code, text = found
            distrusted = code.startswith(DISTRUST)
            text = f"link {quote_name(link.name)}: {text}{f'; {NO_BALANCE}' if distrusted else ''}"
            yield Finding("warning" if distrusted else "hint", code, text, link.inertial.line)
    yield from _examine_whole(tree, whole)
    if facts is not None:
        yield from _examine_centres(tree, facts)


def has_impossible_masses(findings: Collection[Finding]) -> bool:
    """Whether one of the findings reports impossible or unknown masses."""
    return any(f.code.startswith(DISTRUST) for f in findings)


def _examine_whole(tree: Tree, whole: float) -> Iterator[Finding]:
    if whole == 0:
        return
    if whole < MASS_MIN_KG:
        lines = [link.inertial.line for link in tree.links if link.inertial is not None]
        text = f"the total mass is {whole:.3g} kg; {NO_BALANCE}"
        yield Finding("warning", "mass-light", text, lines[0])
    held = _list_held(tree)
    bare = [x for i, x in enumerate(tree.links) if x.inertial is None and i not in held and _shows(x)]
    if bare:
        have = "links with shells have" if len(bare) > 1 else "link with shells has"
        names = quote_names([link.name for link in bare])
        yield Finding("hint", "unweighed", f"{len(bare)} {have} no mass: {names}", bare[0].line)


def _examine_centres(tree: Tree, facts: Mapping[str, MeshFacts]) -> Iterator[Finding]:
    """Centres that are farther outside the robot than its size, with all joints at 0."""
    shapes = [shape for link in tree.links for shape in link.visuals]
    if not shapes or any(compute_shape_box(shape.geometry, facts) is None for shape in shapes):
        return  # its size is unknown
    low, high = compute_robot_box(tree, facts)
    size = max(b - a for a, b in zip(low, high, strict=True))
    for link, at in zip(tree.links, compute_zero_poses(tree), strict=True):
        inertial = link.inertial
        if inertial is None or inertial.mass <= 0 or max(map(abs, inertial.pose.xyz)) > REACH_M:
            continue
        centre = [sum(at[i][k] * inertial.pose.xyz[k] for k in range(3)) + at[i][3] for i in range(3)]
        outside = math.hypot(*(max(a - c, c - b, 0.0) for a, c, b in zip(low, centre, high, strict=True)))
        if outside > size:
            text = (
                f"link {quote_name(link.name)}: its centre of mass is {outside:.3g} m outside the robot, "
                f"which measures {size:.3g} m"
            )
            yield Finding("warning", "centre-outside", text, inertial.line)


def _shows(link: Link) -> bool:
    return any(shape.geometry is not None for shape in link.visuals)


def _list_held(tree: Tree) -> set[int]:
    """The links that are fixed to one with a mass, which may include theirs."""
    groups = list(range(len(tree.links)))
    for number, joint in enumerate(tree.joints, 1):
        if joint.type == "fixed":
            groups[number] = groups[tree.index[joint.parent]]
    heavy = {
        groups[i] for i, link in enumerate(tree.links) if link.inertial is not None and link.inertial.mass > 0
    }
    return {i for i, group in enumerate(groups) if group in heavy}


def _find_empty(link: Link, share: float) -> tuple[str, str] | None:
    """The code and the text; `share`: of the boxes of all links."""
    if not _shows(link):
        return None
    code = "mass-zero" if share > EMPTY_SHARE else "massless"
    return code, "it is visible but has a mass of 0 kg"


def _find_extreme(inertial: Inertial) -> tuple[str, str] | None:
    if inertial.mass < 0:
        return "mass-negative", f"a mass of {inertial.mass:g} kg"
    if inertial.mass > MASS_MAX_KG:
        return "mass-heavy", f"a mass of {inertial.mass:g} kg"
    far = max(map(abs, inertial.pose.xyz))
    if far > REACH_M:
        return "mass-far", f"a centre of mass {far:.3g} m away (millimetres?)"
    return None


def _find_heavy(mass: float, box: float | None, share: float) -> tuple[str, str] | None:
    if box is None or box < BOX_MIN_M3 or mass <= DENSITY_MAX * box:
        return None
    code = "mass-heavy" if share > HEAVY_SHARE else "dense"
    size = f"{mass:.3g} kg in a box of {box * 1000:.3g} litres"
    return code, f"{size}: more than {DENSITY_MAX / 1000:g} kg a litre"


def _find_impossible(inertial: Inertial, share: float) -> tuple[str, str] | None:
    low, middle, high = compute_principal_moments(inertial.inertia)
    size = max(high, -low)
    lack = max(high - low - middle, -2 * low)
    if lack <= SLACK * size:
        return None
    gross = lack > GROSS * size and size > inertial.mass * SPAN_M**2 and share > MOMENTS_SHARE
    text = f"impossible principal moments of inertia: {high:.3g}, {middle:.3g} and {low:.3g} kg·m²"
    return ("mass-moments", text) if gross else ("inertia", f"{text}; simulators refuse it")


def _compute_box(link: Link, facts: Mapping[str, MeshFacts]) -> float | None:
    """The volume of the box around a link's visuals, m³, along the link's axes; None if it has none, or some
    can't be shown."""
    low, high = [math.inf] * 3, [-math.inf] * 3
    for shape in link.visuals:
        box = compute_shape_box(shape.geometry, facts)
        if box is None:
            return None
        at = shape.pose.to_matrix()
        for corner in corners_of(*zip(*box, strict=True)):
            point = [sum(at[i][k] * corner[k] for k in range(3)) + at[i][3] for i in range(3)]
            low, high = [*map(min, low, point)], [*map(max, high, point)]
    volume = math.prod(b - a for a, b in zip(low, high, strict=True))
    return volume if link.visuals else None


def compute_principal_moments(inertia: Sequence[float]) -> tuple[float, float, float]:
    """The eigenvalues of a symmetric matrix, given as ixx, ixy, ixz, iyy, iyz, izz, ascending (O. K. Smith,
    "Eigenvalues of a symmetric 3 × 3 matrix", 1961)."""
    size = max(map(abs, inertia))
    if size == 0:
        return (0.0, 0.0, 0.0)
    xx, xy, xz, yy, yz, zz = (value / size for value in inertia)  # scale first: large squares overflow
    mean = (xx + yy + zz) / 3
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2 + 2 * (xy * xy + xz * xz + yz * yz)
    p = math.sqrt(spread / 6)
    if p < 1e-9:
        return (mean * size, mean * size, mean * size)
    a, b, c = (xx - mean) / p, (yy - mean) / p, (zz - mean) / p
    d, e, f = xy / p, xz / p, yz / p
    half = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2
    angle = math.acos(min(max(half, -1.0), 1.0)) / 3
    high = mean + 2 * p * math.cos(angle)
    low = mean + 2 * p * math.cos(angle + 2 * math.pi / 3)
    low, middle, high = (0.0 if abs(v) < NOISE else v * size for v in (low, 3 * mean - high - low, high))
    return low, middle, high
