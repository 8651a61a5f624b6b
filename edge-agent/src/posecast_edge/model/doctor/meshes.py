"""Finds problems with a robot's meshes: missing, of an implausible size, or not quite valid."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import product as corners_of

from posecast_edge.model.finding import Finding, ModelRefused, quote_name
from posecast_edge.model.kinematics import Matrix, matrix_from_quaternion, multiply
from posecast_edge.model.urdf.resolver import ADVICE, Resolver
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import Geometry, Shape, Urdf, Vector, find_material

LARGE_M = 20.0
SMALL_M = 0.05
SPECK_M = 1e-4
HEAVY_BYTES = 20_000_000
MISSING_WORDS = ("no such file", "no package")  # with which a reason begins


@dataclass(frozen=True)
class MeshFacts:
    """Facts about the mesh of one URI. `reason`: why there is none; `hint`: how it was found despite a wrong
    URI; `low`, `high`: corners of its box in the file's axes, metres, before the URDF's scale; `has_uv`: it
    has texture coordinates."""

    uri: str
    reason: str | None = None
    hint: str | None = None
    size: int = 0
    triangles: int = 0
    low: Vector = (0.0, 0.0, 0.0)
    high: Vector = (0.0, 0.0, 0.0)
    notes: tuple[tuple[str, str], ...] = ()
    has_uv: bool = False


def examine_meshes(urdf: Urdf, tree: Tree, facts: Mapping[str, MeshFacts] | None) -> Iterator[Finding]:
    """Yield all findings about meshes; without `facts` only those that follow from the URDF itself."""
    shapes = [(link.name, s) for link in urdf.links for s in link.visuals if s.geometry is not None]
    if urdf.links and not shapes:
        yield Finding("warning", "nothing-drawn", "no link has a visual: only the skeleton is drawn", None)
    for name, shape in shapes:
        yield from _scale(name, shape)
    if facts is None:
        return
    yield from examine_files(urdf, facts)
    for name, shape in shapes:
        yield from _size(name, shape, facts)
    yield from _whole(tree, facts)
    size, triangles = sum(f.size for f in facts.values()), sum(f.triangles for f in facts.values())
    if size > HEAVY_BYTES:
        text = f"the meshes have {size / 1e6:.1f} MB and {triangles:,} triangles"
        yield Finding("hint", "bundle-size", f"{text}; `posecast-edge model build` makes them small", None)


def examine_files(urdf: Urdf, facts: Mapping[str, MeshFacts]) -> Iterator[Finding]:
    """Yield the findings about the files that the visuals name, if there are facts about them."""
    shapes = [(link.name, s) for link in urdf.links for s in link.visuals if s.geometry is not None]
    yield from _files(shapes, facts)
    yield from _textures(urdf, shapes, facts)


def _scale(name: str, shape: Shape) -> Iterator[Finding]:
    geometry = shape.geometry
    if geometry is None or geometry.kind != "mesh":
        return
    x, y, z = geometry.scale
    if x * y * z < 0:
        text = f"link {quote_name(name)}: a mirrored mesh (negative scale); some programs turn it inside out"
        yield Finding("hint", "scale-mirrored", text, geometry.line)
    if max(abs(x), abs(y), abs(z)) > 1.01 * min(abs(x), abs(y), abs(z)):
        text = f"link {quote_name(name)}: a mesh stretched by {x:g} {y:g} {z:g}"
        yield Finding("hint", "scale-uneven", text, geometry.line)


def _files(shapes: list[tuple[str, Shape]], facts: Mapping[str, MeshFacts]) -> Iterator[Finding]:
    """Findings about files, one per file or kind of note."""
    first: dict[str, int] = {}
    links: dict[str, list[str]] = {}
    for name, shape in shapes:
        if shape.geometry is not None and shape.geometry.uri:
            first.setdefault(shape.geometry.uri, shape.geometry.line)
            links.setdefault(shape.geometry.uri, []).append(name)
    lenient: dict[tuple[str, str], list[str]] = {}
    for uri, line in first.items():
        fact = facts.get(uri)
        if fact is None:
            continue
        if fact.reason is not None:
            code = "mesh-missing" if fact.reason.startswith(MISSING_WORDS) else "mesh-broken"
            code = "mesh-outside" if fact.reason.endswith(ADVICE) and code == "mesh-broken" else code
            of = f" of link {quote_name(links[uri][0])}" + (" and others" if len(set(links[uri])) > 1 else "")
            yield Finding("error", code, f"mesh {quote_name(uri)}{of}: {fact.reason}", line)
        if fact.hint is not None:
            yield Finding("hint", "mesh-found", f"mesh {quote_name(uri)}: {fact.hint}", line)
        for note in fact.notes:
            lenient.setdefault(note, []).append(uri)
    for (code, text), uris in lenient.items():
        more = f" and {len(uris) - 1} more" if len(uris) > 1 else ""
        yield Finding("hint", code, f"mesh {quote_name(uris[0])}{more}: {text}", first[uris[0]])


def _textures(
    urdf: Urdf, shapes: list[tuple[str, Shape]], facts: Mapping[str, MeshFacts]
) -> Iterator[Finding]:
    """Pictures that the URDF names and that can't be shown."""
    reported: set[str] = set()
    for name, shape in shapes:
        material = find_material(shape, urdf.materials)
        if material is None or not material.texture:
            continue
        lost = facts.get(material.texture)
        if lost is not None and lost.reason is not None:
            if material.texture not in reported:
                text = f"texture {quote_name(material.texture)} of link {quote_name(name)}: {lost.reason}"
                yield Finding("error", "texture-missing", text, material.line)
            reported.add(material.texture)
            continue
        fact = facts.get(shape.geometry.uri) if shape.geometry is not None else None
        if fact is not None and fact.reason is None and not fact.has_uv:
            text = f"link {quote_name(name)}: its mesh has no texture coordinates; the mean colour is shown"
            yield Finding("hint", "texture-coordinates", text, shape.line)


def _size(name: str, shape: Shape, facts: Mapping[str, MeshFacts]) -> Iterator[Finding]:
    box = compute_shape_box(shape.geometry, facts)
    if box is None or shape.geometry is None:
        return
    longest = max(b - a for a, b in zip(*box, strict=True))
    what = f"link {quote_name(name)}: its {shape.geometry.kind}"
    if longest > LARGE_M:
        advice = ': millimetres? scale="0.001 0.001 0.001"' if shape.geometry.kind == "mesh" else ""
        yield Finding("warning", "mesh-large", f"{what} is {longest:.3g} m long{advice}", shape.geometry.line)
    elif longest < SPECK_M:
        yield Finding("warning", "mesh-small", f"{what} is only {longest:.3g} m long", shape.geometry.line)


def _whole(tree: Tree, facts: Mapping[str, MeshFacts]) -> Iterator[Finding]:
    low, high = compute_robot_box(tree, facts)
    size = max(b - a for a, b in zip(low, high, strict=True))
    if size > LARGE_M:
        text = f"the robot measures {size:.3g} m: are its meshes or origins in millimetres?"
        yield Finding("warning", "robot-large", text, None)
    elif 0 <= size < SMALL_M:
        text = f"the robot measures only {size:.3g} m: is it scaled twice?"
        yield Finding("warning", "robot-small", text, None)


def compute_zero_poses(tree: Tree) -> list[Matrix]:
    """root_from_link of each link with all joints at 0."""
    poses = [matrix_from_quaternion((0, 0, 0), (1, 0, 0, 0))]
    for joint in tree.joints:
        at = joint.pose.to_matrix()
        poses.append(multiply(poses[tree.index[joint.parent]], at))
    return poses


def compute_robot_box(tree: Tree, facts: Mapping[str, MeshFacts]) -> tuple[list[float], list[float]]:
    """The lowest and highest corner of all visuals, with all joints at 0, in the root's axes, metres. The
    lowest is above the highest if there are no visuals."""
    low, high = [math.inf] * 3, [-math.inf] * 3
    for link, pose in zip(tree.links, compute_zero_poses(tree), strict=False):  # no link, one pose
        for shape in link.visuals:
            box = compute_shape_box(shape.geometry, facts)
            if box is None:
                continue
            at = multiply(pose, shape.pose.to_matrix())
            for corner in corners_of(*zip(*box, strict=True)):
                point = [sum(at[i][k] * corner[k] for k in range(3)) + at[i][3] for i in range(3)]
                low, high = [*map(min, low, point)], [*map(max, high, point)]
    return low, high


def compute_shape_box(
    geometry: Geometry | None, facts: Mapping[str, MeshFacts]
) -> tuple[Vector, Vector] | None:
    """The lowest and highest corner of a shape in its own axes, metres; None when its mesh is missing."""
    if geometry is None:
        return None
    if geometry.kind == "mesh":
        fact = facts.get(geometry.uri)
        if fact is None or fact.reason is not None:
            return None
        ends = [sorted((a * s, b * s)) for a, b, s in zip(fact.low, fact.high, geometry.scale, strict=True)]
        return (ends[0][0], ends[1][0], ends[2][0]), (ends[0][1], ends[1][1], ends[2][1])
    if geometry.kind == "box":
        x, y, z = (d / 2 for d in geometry.dims)
    else:
        radius = geometry.dims[0]
        half = {"cylinder": 0.0, "capsule": radius}.get(geometry.kind)
        x, y, z = radius, radius, radius if half is None else geometry.dims[1] / 2 + half
    x, y, z = (abs(half * factor) for half, factor in zip((x, y, z), geometry.scale, strict=True))
    return (-x, -y, -z), (x, y, z)


# --- missing files. Opens none, so it needs no mesh tools

FILES_MAX = 1000


def find_lost_files(urdf: Urdf, resolver: Resolver, inline: Collection[str] = ()) -> dict[str, MeshFacts]:
    """The meshes and pictures of visuals that can't be found, by URI, with the reason. `inline`: URIs of
    meshes that need no file. Looks for at most FILES_MAX files."""
    uris: dict[str, None] = {}
    for link in urdf.links:
        for shape in link.visuals:
            material = find_material(shape, urdf.materials)
            if shape.geometry is not None and shape.geometry.uri:
                uris[shape.geometry.uri] = None
            if material is not None and material.texture:
                uris[material.texture] = None
    lost: dict[str, MeshFacts] = {}
    for uri in list(uris)[:FILES_MAX]:
        if uri in inline:
            continue
        try:
            resolver.find_file(uri)
        except ModelRefused as e:
            lost[uri] = MeshFacts(uri, e.reason)
    return lost
