"""Finds problems in a robot's description. Works on parsed values and reads no files.

The URDF reader (urdf/reader.py) and the tree report what can't be read or connected. This module reports what
can be read but is probably not intended.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

from posecast_wire.schema import Mapping as Meaning

from posecast_edge.model.doctor.masses import examine_masses
from posecast_edge.model.doctor.meshes import MeshFacts, examine_files, examine_meshes
from posecast_edge.model.finding import Finding, quote_name, quote_names, sort_by_severity
from posecast_edge.model.kinematics import (
    Matrix,
    compute_motion,
    compute_plane_axes,
    identity,
    list_variables,
    multiply,
    normalise_axis,
)
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import SCALAR_TYPES, UNBOUNDED, Joint, Link, Urdf, find_material

TURN = 2 * math.pi
FAR = 10.0  # m, from one joint to the next: more suggests a wrong unit
UNIT = 1e-3  # how far an axis may be from length 1


def examine_model(
    urdf: Urdf,
    tree: Tree,
    facts: Mapping[str, MeshFacts] | None,
    meaning: Meaning | None = None,
    lost: Mapping[str, MeshFacts] | None = None,
) -> list[Finding]:
    """All findings, worst first. `facts`: the meshes by URI, None if they were not read; `meaning`: a
    profile's joints and sensors; `lost`: if meshes were not read, the missing files."""
    found = [*urdf.findings, *tree.findings]
    for joint in urdf.joints:
        found += _joint(joint)
    for link in urdf.links:
        found += _link(link)
    found += _materials(urdf)
    found += _mentions(urdf)
    found += examine_masses(tree, facts)
    found += examine_meshes(urdf, tree, facts)
    if facts is None and lost:
        found += examine_files(urdf, lost)
    if meaning is not None:
        found += _profile(urdf, meaning)
        found += examine_soles(tree, meaning)
    return sort_by_severity(found)


def _joint(joint: Joint) -> Iterator[Finding]:
    what = f"joint {quote_name(joint.name)}"
    yield from _origin(what, joint.pose.xyz, joint.pose.rpy, joint.line)
    if joint.type in ("floating", "planar"):
        channels = ", ".join(map(quote_name, _variables(joint)))
        yield Finding(
            "hint", "joint-free", f"{what} is {joint.type}: its channels are {channels}", joint.line
        )
    if joint.type not in SCALAR_TYPES and joint.mimic is not None:
        yield Finding("hint", "mimic-useless", f"{what} is {joint.type} and mimics another", joint.line)
    if joint.type in ("fixed", "floating"):
        return
    if joint.axis is None:
        plane = joint.type == "planar"
        more = ": its plane is vertical; for a floor, use 0 0 1" if plane else ""
        text = f"{what} has no axis; the standard says x (1 0 0){more}"
        yield Finding("warning" if plane else "hint", "axis-missing", text, joint.line)
    else:
        length = math.hypot(*joint.axis)
        if length < 1e-9:
            yield Finding("error", "axis-zero", f"{what}: its axis is 0 0 0; read as 1 0 0", joint.line)
        elif abs(length - 1) > UNIT:
            text = f"{what}: its axis has length {length:.3g}, not 1; other programs scale the motion by it"
            yield Finding("warning", "axis-length", text, joint.line)
    if joint.type in SCALAR_TYPES:
        yield from _limits(joint, what)


def _limits(joint: Joint, what: str) -> Iterator[Finding]:
    limit = joint.limit
    if joint.type == "continuous":
        return
    if limit is None:
        yield Finding("warning", "limit-missing", f"{what} is {joint.type} and has no <limit>", joint.line)
        return
    line = limit.line
    if limit.lower is None and limit.upper is None:
        text = f"{what}: a <limit> without lower and upper means 0 to 0: it can't move"
        yield Finding("warning", "limit-empty", text, line)
        return
    lower, upper = limit.lower or 0.0, limit.upper or 0.0
    shown = f"{lower:g} to {upper:g}"
    if lower > upper:
        yield Finding("error", "limit-reversed", f"{what}: lower is above upper: {shown}", line)
    elif lower == upper:
        yield Finding("warning", "limit-zero", f"{what}: lower and upper are the same: {shown}", line)
    elif not lower <= 0 <= upper:
        text = f"{what}: 0 is outside its limits, {shown}: it can't reach the zero pose"
        yield Finding("hint", "limit-without-zero", text, line)
    largest = max(abs(lower), abs(upper))
    if joint.type == "revolute" and 2 * TURN < largest < UNBOUNDED:
        yield Finding("warning", "limit-degrees", f"{what}: limits {shown} rad: are these degrees?", line)
    if joint.type == "prismatic" and FAR < largest < UNBOUNDED:
        yield Finding(
            "warning", "limit-millimetres", f"{what}: limits {shown} m: are these millimetres?", line
        )
    if (limit.velocity or 0) < 0 or (limit.effort or 0) < 0:
        yield Finding("warning", "limit-negative", f"{what}: velocity or effort is below 0", line)


def _origin(what: str, xyz: tuple[float, ...], rpy: tuple[float, ...], line: int) -> Iterator[Finding]:
    if max(map(abs, rpy)) > TURN + 0.01:
        angles = " ".join(f"{a:g}" for a in rpy)
        yield Finding("warning", "origin-degrees", f"{what}: rpy {angles} rad: are these degrees?", line)
    if max(map(abs, xyz)) > FAR:
        place = " ".join(f"{v:g}" for v in xyz)
        yield Finding("warning", "origin-far", f"{what}: origin {place} m: are these millimetres?", line)


def _link(link: Link) -> Iterator[Finding]:
    for shape in link.visuals:
        yield from _origin(
            f"link {quote_name(link.name)}, visual", shape.pose.xyz, shape.pose.rpy, shape.line
        )


def _materials(urdf: Urdf) -> Iterator[Finding]:
    """Material names without a colour, each once."""
    lines: dict[str, list[int]] = {}
    for link in urdf.links:
        for shape in link.visuals:
            own = shape.material
            if own is not None and own.name and not own.texture:
                found = find_material(shape, urdf.materials)
                if found is None or (found.rgba is None and not found.texture):
                    lines.setdefault(own.name, []).append(own.line)
    for name, where in lines.items():
        times = f", {len(where)} times" if len(where) > 1 else ""
        text = f"material {quote_name(name)} has no colour{times}; shown in grey"
        yield Finding("hint", "material-colour", text, where[0])


def _mentions(urdf: Urdf) -> Iterator[Finding]:
    """Sensors, transmissions and <gazebo> that refer to missing elements."""
    links, joints = {x.name for x in urdf.links}, {x.name for x in urdf.joints}
    for sensor in urdf.sensors:
        if sensor.link not in links:
            where = f"link {quote_name(sensor.link)}, which does not exist" if sensor.link else "no link"
            text = f"sensor {quote_name(sensor.name)} is on {where}"
            yield Finding("warning", "sensor-link", text, sensor.line)
    for mention in urdf.references:
        known = joints if mention.what == "joint" else links | joints
        if mention.name not in known:
            text = f"{mention.by} refers to {mention.what} {quote_name(mention.name)}, which does not exist"
            yield Finding("warning", "reference", text, mention.line)


def _profile(urdf: Urdf, meaning: Meaning) -> Iterator[Finding]:
    links, joints = {x.name for x in urdf.links}, {x.name: x for x in urdf.joints}
    for site, mount in meaning.sensors.items():
        if mount.link is not None and mount.link not in links:
            link = quote_name(mount.link)
            text = f"the profile mounts sensor {quote_name(site)} on link {link}, which does not exist"
            yield Finding("warning", "profile-sensor", text)
    for foot in dict.fromkeys((*(meaning.balance.feet or ()), *meaning.balance.soles)):
        if foot not in meaning.sensors and foot not in links:
            text = (
                f"the profile's [balance] names foot {quote_name(foot)}, which is neither a sensor nor a link"
            )
            yield Finding("warning", "profile-foot", text)
    known = {name for joint in urdf.joints for name in _variables(joint)}
    gone = [name for name in meaning.joints if name not in known and name not in joints]
    if gone:  # in one line: with another robot's profile it is all of them
        which = f"joint{'s' if len(gone) > 1 else ''} {quote_names(gone)}"
        text = f"the profile maps {which}, which {'do' if len(gone) > 1 else 'does'} not exist"
        yield Finding("warning", "profile-joint", text)
    for name in meaning.joints:
        if name in known:
            continue
        joint = joints.get(name)
        if joint is None:
            continue
        if joint.type == "fixed":
            text = "which is fixed"
        else:
            text = f"which is {joint.type}: map {', '.join(map(quote_name, _variables(joint)))}"
        yield Finding("warning", "profile-joint", f"the profile maps joint {quote_name(name)}, {text}")


def _variables(joint: Joint) -> list[str]:
    """The names of the readings that move a joint."""
    return [name for name, _ in list_variables(joint.name, joint.type)]


# --- soles of a profile that can't stand on a floor

TILT_MAX = math.radians(60)


def examine_soles(tree: Tree, meaning: Meaning) -> Iterator[Finding]:
    """Yield a finding about each sole of a profile that is upright when the robot is at home, z up."""
    if not meaning.balance.soles:
        return
    poses = _compute_home_poses(tree)
    for foot, corners in meaning.balance.soles.items():
        mount = meaning.sensors.get(foot)
        link = foot if mount is None else mount.link
        if link not in tree.index:
            continue  # reported elsewhere
        pose, (x, y, z) = poses[tree.index[link]], _compute_normal(corners)
        up = abs(sum(pose[2][i] * v for i, v in enumerate((x, y, z)))) / math.hypot(x, y, z)
        if up < math.cos(TILT_MAX):
            tilt = math.degrees(math.acos(min(up, 1.0)))
            text = (
                f"the profile's [balance] soles.{quote_name(foot)} is tilted by {tilt:.0f}° with all joints "
                f"at home; corners are in the axes of link {quote_name(link)}"
            )
            yield Finding("warning", "profile-sole", text)


def _compute_home_poses(tree: Tree) -> list[Matrix]:
    """root_from_link of each link, the joints at 0 or the limit nearest to it."""
    values = [_find_home(joint) for joint in tree.joints]
    poses = [identity()]
    for number, (joint, follow) in enumerate(zip(tree.joints, tree.follows, strict=True)):
        q = values[number]
        if follow is not None:
            q = [follow.multiplier * (values[follow.joint] or [0.0])[0] + follow.offset]
        axis = normalise_axis(joint.axis)
        entry = {"type": joint.type, "axis": axis, "plane": compute_plane_axes(axis)}
        placed = joint.pose.to_matrix()
        moved = multiply(placed, compute_motion(entry, q))
        poses.append(multiply(poses[tree.index[joint.parent]], moved))
    return poses


def _find_home(joint: Joint) -> list[float]:
    values = [rest for _, rest in list_variables(joint.name, joint.type)]
    limit = joint.limit
    if joint.type in SCALAR_TYPES and joint.type != "continuous" and limit is not None:
        low, high = limit.lower or 0.0, limit.upper or 0.0
        return [min(max(0.0, low), high)] if low <= high else values
    return values


def _compute_normal(corners: Sequence[Sequence[float]]) -> tuple[float, float, float]:
    """Newell's vector: its length is twice the area. The profile's reader has checked that it is not 0."""
    x = y = z = 0.0
    for a, b in pairwise((*corners, corners[0])):
        x += (a[1] - b[1]) * (a[2] + b[2])
        y += (a[2] - b[2]) * (a[0] + b[0])
        z += (a[0] - b[0]) * (a[1] + b[1])
    return x, y, z
