"""A URDF that an SDF includes, as the `<model>` that would say the same."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from posecast_edge.model.sdf.shapes import DIMENSIONS, MOMENTS
from posecast_edge.model.urdf.types import (
    ONES,
    Geometry,
    Joint,
    Link,
    Pose,
    Sensor,
    Shape,
    Urdf,
    find_material,
)
from posecast_edge.model.urdf.xml_tree import Element

VERSION = "1.11"
KINDS = {"floating": "ball"}  # which reads the same channels here
AXIS = (1.0, 0.0, 0.0)  # of a joint that gives none


def make_sdf(urdf: Urdf) -> Element:
    """An `<sdf>` with one model: each link stands relative to its parent, where its joint is at zero."""
    held: dict[str, Joint] = {}
    for joint in urdf.joints:
        held.setdefault(joint.child, joint)
    sensors: dict[str, list[Sensor]] = {}
    for sensor in urdf.sensors:
        sensors.setdefault(sensor.link, []).append(sensor)
    links = (_link(link, held.get(link.name), sensors.get(link.name, ()), urdf) for link in urdf.links)
    model = _element("model", [*links, *map(_joint, urdf.joints)], name=urdf.name or "robot")
    return _element("sdf", [model], version=VERSION)


def _element(tag: str, inside: str | Iterable[Element] = "", **attributes: str) -> Element:
    made = Element(tag, attributes, 0)
    if isinstance(inside, str):
        made.text = inside
    else:
        for child in inside:
            made.add(child)
    return made


def _numbers(tag: str, *values: float) -> Element:
    return _element(tag, " ".join(map(repr, values)))


def _pose(pose: Pose, parent: str = "") -> Element:
    made = _numbers("pose", *pose.xyz, *pose.rpy)
    if parent:
        made.attributes = {"relative_to": parent}
    return made


def _link(link: Link, joint: Joint | None, sensors: Iterable[Sensor], urdf: Urdf) -> Element:
    parts = [_pose(joint.pose, joint.parent)] if joint is not None else []
    if link.inertial is not None:
        moments = (_numbers(*one) for one in zip(MOMENTS, link.inertial.inertia, strict=False))
        mass = _numbers("mass", link.inertial.mass)
        pose = _pose(link.inertial.pose)
        parts.append(_element("inertial", [pose, mass, _element("inertia", moments)]))
    for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
        parts += [_element(tag, _shape(shape, urdf)) for shape in shapes]
    parts += [_element("sensor", [_pose(s.pose)], name=s.name, type=s.kind) for s in sensors]
    return _element("link", parts, name=link.name)


def _shape(shape: Shape, urdf: Urdf) -> Iterator[Element]:
    yield _pose(shape.pose)
    if shape.geometry is not None:
        yield _element("geometry", [_geometry(shape.geometry)])
    material = find_material(shape, urdf.materials)
    if material is not None:
        parts = [_numbers("diffuse", *material.rgba)] if material.rgba else []
        if material.texture:
            picture = _element("albedo_map", material.texture)
            parts.append(_element("pbr", [_element("metal", [picture])]))
        yield _element("material", parts)


def _geometry(geometry: Geometry) -> Element:
    if geometry.kind == "mesh":
        return _element("mesh", [_element("uri", geometry.uri), _numbers("scale", *geometry.scale)])
    if geometry.kind == "box":
        return _element("box", [_numbers("size", *geometry.dims)])
    if geometry.scale != ONES:
        radii = (geometry.dims[0] * factor for factor in geometry.scale)
        return _element("ellipsoid", [_numbers("radii", *radii)])
    sizes = zip(DIMENSIONS[geometry.kind], geometry.dims, strict=False)
    return _element(geometry.kind, [_numbers(*one) for one in sizes])


def _joint(joint: Joint) -> Element:
    ends = [_element("parent", joint.parent), _element("child", joint.child)]
    axis = [_numbers("xyz", *(joint.axis or AXIS))]
    if joint.limit is not None:
        limit = joint.limit
        values = (limit.lower, limit.upper, limit.velocity, limit.effort)
        given = zip(("lower", "upper", "velocity", "effort"), values, strict=True)
        axis.append(_element("limit", [_numbers(tag, value) for tag, value in given if value is not None]))
    if joint.mimic is not None:
        line = [_numbers("multiplier", joint.mimic.multiplier), _numbers("offset", joint.mimic.offset)]
        axis.append(_element("mimic", line, joint=joint.mimic.joint))
    kind = KINDS.get(joint.type, joint.type)
    return _element("joint", [*ends, _element("axis", axis)], name=joint.name, type=kind)
