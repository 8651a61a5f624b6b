"""Builds a bundle from a robot's description: three levels of detail, a thumbnail and a manifest. The same
input gives the same bytes."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.lod import Body, Level, LodSettings, PaintedLods, Placed, make_level
from posecast_edge.model.builder.manifest import (
    VERSION,
    compute_home,
    encode_manifest,
    is_within_reach,
    make_file_entry,
    make_finding_entries,
    make_skeleton,
    round_digits,
)
from posecast_edge.model.builder.mesh_coder import LAST_RUNGS, LodChain, count_rungs
from posecast_edge.model.builder.model_files import Progress, collect_facts, read_visual_files
from posecast_edge.model.builder.soles import find_soles
from posecast_edge.model.builder.thumbnail import draw_thumbnail, encode_png
from posecast_edge.model.builder.up_axis import settle_up_axis
from posecast_edge.model.builder.visuals import Appearance, Figure, Visual, build_figure
from posecast_edge.model.doctor.masses import has_impossible_masses
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import Finding, ModelRefused, quote_name
from posecast_edge.model.kinematics import compute_link_poses, matrix_from_quaternion, quaternion_from_rpy
from posecast_edge.model.meshes.mesh import Paint
from posecast_edge.model.meshes.texture import compute_mean_colour
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.urdf.reader import NAME_MAX
from posecast_edge.model.urdf.resolver import URI_MAX, Resolver
from posecast_edge.model.urdf.tree import Tree, build_tree
from posecast_edge.model.urdf.types import AUTO, Inertial

Vectors = NDArray[np.float64]
Triangles = tuple[Vectors, Vectors, Vectors]  # corners and normals (m, 3, 3), display colours (m, 3)

ROUGH = 15  # a rung: 0.2 % of the robot's size. Coarser rungs open gaps between shells and save few bytes
PATIENCE = 1.5  # to avoid that, a level may exceed its budget by this factor

THUMBNAIL_MAX = 300_000  # triangles in the thumbnail; only a mesh that can't be simplified has more

NEAR = 1.25  # a level within this factor of the next coarser one, or of its own target, counts as equal


@dataclass(frozen=True)
class LodBudget:
    """Limits of one level: file size in bytes, drawn triangles, bits along the longest side for positions,
    pixels along a picture's side."""

    name: str
    size: int
    triangles: float
    bits: int
    pixels: int

    def is_met_by(self, level: Level, slack: float) -> bool:
        """Whether the level's size and triangle count are within `slack` times the budget."""
        return len(level.data) <= self.size * slack and level.triangles <= self.triangles * slack


AIMS = (
    LodBudget("high", 3_500_000, math.inf, 14, 2048),
    LodBudget("middle", 550_000, math.inf, 13, 512),
    LodBudget(
        "low", 190_000, 24_000, 12, 128
    ),  # of what a phone without a graphics card fills 20 times a second
)


@dataclass(frozen=True)
class Built:
    """A bundle in memory: the manifest's bytes, files by path, and findings."""

    manifest: bytes
    files: dict[str, bytes]
    findings: tuple[Finding, ...]
    figure: Figure
    levels: dict[str, Level]
    document: dict[str, Any]


def build_model(robot: RobotFile, resolver: Resolver, progress: Progress, up_axis: str = AUTO) -> Built:
    """Build a robot's bundle. `up_axis`: how to treat that of Collada and glTF files, one of UP_AXIS_MODES.
    Raises ModelRefused when the file has no robot."""
    urdf = robot.urdf
    tree = build_tree(urdf)
    if not tree.links:
        unexpanded = (f for f in urdf.findings if f.code == "xacro")
        reason = next(unexpanded, tree.findings[-1])
        raise ModelRefused(reason.text, reason.line)
    for joint in tree.joints:
        if not is_within_reach(joint.pose):
            raise ModelRefused(
                f"joint {quote_name(joint.name)}: an origin more than 10,000 km away", joint.line
            )
    files = read_visual_files(robot, resolver, progress)
    settle_up_axis(urdf, tree, files, up_axis)
    figure = build_figure(urdf, tree, files)
    document: dict[str, Any] = {"v": VERSION, "robot": urdf.name[:NAME_MAX], **make_skeleton(urdf, tree)}
    poses = [np.array(p) for p in compute_link_poses(document, compute_home(document)).values()]
    box = _robot_box(figure, poses)
    size = float(np.linalg.norm(box[1] - box[0])) if box is not None else 0.0
    levels = _levels(figure, size, progress)
    drawn = collect_triangles(next(iter(levels.values())), figure, poses, THUMBNAIL_MAX)
    thumbnail = encode_png(draw_thumbnail(*drawn))
    findings = examine_model(urdf, tree, collect_facts(files))
    contents = {f"{name}.glb": level.data for name, level in levels.items()}
    entries = [make_file_entry(path, data, "model/gltf-binary") for path, data in contents.items()]
    entries.append(make_file_entry("thumbnail.png", thumbnail, "image/png"))
    document |= {
        "files": entries,
        "levels": [
            {
                "name": name,
                "path": f"{name}.glb",
                "bytes": entry["size"],
                "sha256": entry["sha256"],
                "triangles": level.triangles,
                "vertices": level.vertices,
                "error_m": round_digits(level.error_m),
            }
            for (name, level), entry in zip(levels.items(), entries, strict=False)
        ],
        "thumbnail": "thumbnail.png",
        "visuals": [_visual(i, v, figure.looks[v.looks]) for i, v in enumerate(figure.visuals)],
    }
    document |= {"box": _corners(*box)} if box is not None else {}
    document |= {"inertials": make_inertials(tree, findings), "soles": find_soles(tree, figure, poses)}
    missing = [{"uri": uri[:URI_MAX], "reason": reason} for uri, reason in files.list_missing().items()]
    document |= {"missing": missing} if missing else {}
    document |= {"findings": make_finding_entries(findings)} if findings else {}
    contents["thumbnail.png"] = thumbnail
    return Built(encode_manifest(document), contents, tuple(findings), figure, levels, document)


def _levels(figure: Figure, size: float, progress: Progress) -> dict[str, Level]:
    """The levels, coarsest first, without those that are no smaller than the next finer one."""
    boxes = [looks.mesh.compute_box() for looks in figure.looks]
    sizes = [float((high - low).max()) for low, high in boxes]
    rungs = count_rungs(sizes, size)
    bodies = []
    for looks, own, (low, high) in zip(figure.looks, sizes, boxes, strict=True):
        skins = tuple(
            PaintedLods(LodChain(s, own, size, rungs), paint, mark) for s, paint, mark in looks.skins
        )
        bodies.append(Body(skins, low, high))
    placed = [Placed(f"v{i}", v.pose, v.looks) for i, v in enumerate(figure.visuals)]
    made: dict[str, Level] = {}
    finer = None
    for number, aim in enumerate(AIMS):
        if finer is not None and aim.is_met_by(finer, NEAR):
            continue
        progress(number, len(AIMS), f"level {aim.name}")

        def at(step: int, aim: LodBudget = aim) -> Level:
            return make_level(bodies, placed, LodSettings(step, aim.bits, aim.pixels))

        level = _fitted(at, bodies, placed, rungs, aim)
        if finer is None or len(level.data) < len(finer.data):
            made[aim.name] = finer = level
    return dict(reversed(made.items()))


def _fitted(
    at: Callable[[int], Level], bodies: Sequence[Body], placed: Sequence[Placed], rungs: int, aim: LodBudget
) -> Level:
    """The finest level within the budget. If none is small enough, the coarsest; and if that still has too
    many triangles, one with a larger error."""

    def triangles(step: int) -> int:
        return sum(len(s.ladder.get_rung(step)[1]) for b in bodies for s in b.skins)

    def drawn(step: int) -> int:
        return sum(len(s.ladder.get_rung(step)[1]) for p in placed for s in bodies[p.body].skins)

    def small(step: int) -> bool:
        return triangles(step) * per_triangle <= aim.size and drawn(step) <= aim.triangles

    per_triangle, made = 8.0, dict[int, Level]()
    while True:
        step = 0 if small(0) else bisect_left(range(rungs - 1), True, key=small)
        while step in made and not aim.is_met_by(made[step], 1) and step < rungs - 1:
            step += 1
        if step in made:
            break
        made[step] = at(step)
        per_triangle = len(made[step].data) / max(triangles(step), 1)
    if step > ROUGH:
        smoother = at(ROUGH)
        if aim.is_met_by(smoother, PATIENCE):
            return smoother
    while made[step].triangles > aim.triangles * NEAR and step < rungs - 1 + LAST_RUNGS:
        step += 1
        made[step] = at(step)
    return made[step]


def _robot_box(figure: Figure, poses: Sequence[Vectors]) -> tuple[Vectors, Vectors] | None:
    """The lowest and highest corner of the whole robot, in the root link's frame."""
    if not figure.visuals:
        return None
    boxes = [_box(figure.looks[v.looks], poses[v.link] @ _matrix(v)) for v in figure.visuals]
    return np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)


def _box(looks: Appearance, at: Vectors) -> tuple[Vectors, Vectors]:
    points = np.concatenate([s.positions for s, _, _ in looks.skins]) @ at[:3, :3].T + at[:3, 3]
    return points.min(0), points.max(0)


def _matrix(visual: Visual) -> Vectors:
    """link_from_mesh."""
    return np.array(visual.pose.to_matrix())


def _visual(number: int, visual: Visual, looks: Appearance) -> dict[str, Any]:
    entry = {
        "node": f"v{number}",
        "link": visual.link,
        "source": visual.source,
        "color": _colour(looks),
        "box": _corners(*_box(looks, _matrix(visual))),
    }
    return entry | ({"placeholder": visual.reason} if visual.reason else {})


def _corners(low: Vectors, high: Vectors) -> list[list[float]]:
    return [[round(float(v), 5) + 0.0 for v in corner] for corner in (low, high)]


def _colour(looks: Appearance) -> str:
    """The mean of the paints by number of triangles, as #rrggbb."""
    colours = np.array([compute_display_colour(paint) for _, paint, _ in looks.skins])
    weights = np.array([len(s.faces) for s, _, _ in looks.skins], np.float64)
    mean = (colours * weights[:, None]).sum(0) / weights.sum()
    return "#" + "".join(f"{round(float(v) * 255):02x}" for v in mean)


def compute_display_colour(paint: Paint) -> tuple[float, float, float]:
    """The mean colour of a paint as display (sRGB) values 0 … 1."""
    r, g, b = paint.rgba[:3]
    if paint.texture is None:
        return (r, g, b)
    x, y, z = compute_mean_colour(paint.texture)
    return (r * x, g * y, b * z)


def collect_triangles(
    level: Level, figure: Figure, poses: Sequence[Vectors], most: int | None = None
) -> Triangles:
    """The triangles that a level draws with the links at `poses` (root_from_link). If there are more than
    `most`, only every second, third, … of them."""
    step = 1 if most is None else -(-level.triangles // most) or 1
    corners, normals, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for visual in figure.visuals:
        at = poses[visual.link] @ _matrix(visual)
        drawn = level.drawn[visual.looks]
        for skin, part in drawn.parts:
            points = drawn.grid.to_metres(part.positions) @ at[:3, :3].T + at[:3, 3]
            faces = part.faces[::step]
            corners.append(points[faces])
            normals.append(((part.normals[:, :3] / 127.0) @ at[:3, :3].T)[faces])
            colour = compute_display_colour(figure.looks[visual.looks].skins[skin][1])
            colours.append(np.tile(colour, (len(faces), 1)))
    return np.concatenate(corners), np.concatenate(normals), np.concatenate(colours)


# --- the manifest's member inertials: the mass of each link, in the link's frame


def make_inertials(tree: Tree, findings: Collection[Finding]) -> list[dict[str, Any]]:
    """An entry for each link that has a mass, in the links' order; [] if one of the findings reports an
    impossible mass."""
    if has_impossible_masses(findings):
        return []
    return [
        {
            "link": number,
            "mass_kg": _round(link.inertial.mass),
            "xyz": [_round(v) for v in link.inertial.pose.xyz],
            "inertia": [_round(v) for v in turn_inertia(link.inertial)],
        }
        for number, link in enumerate(tree.links)
        if link.inertial is not None and link.inertial.mass > 0
    ]


def turn_inertia(inertial: Inertial) -> tuple[float, ...]:
    """The inertia about the centre of mass as ixx, ixy, ixz, iyy, iyz, izz in the link's axes, kg·m²."""
    if inertial.pose.rpy == (0.0, 0.0, 0.0):
        return inertial.inertia
    turn = matrix_from_quaternion((0.0, 0.0, 0.0), quaternion_from_rpy(inertial.pose.rpy))
    xx, xy, xz, yy, yz, zz = inertial.inertia
    own = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))

    def at(i: int, j: int) -> float:
        return sum(turn[i][k] * own[k][m] * turn[j][m] for k in range(3) for m in range(3))

    return (at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2))


def _round(value: float) -> float:
    """Seven significant digits, more than can be measured, without negative zero."""
    return float(f"{value:.7g}") + 0.0
