"""Reads an SDF and the files that it includes."""

from __future__ import annotations

import io
import posixpath
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.finding import Finding, ModelRefused, quote_name
from posecast_edge.model.sdf.shapes import DIMENSIONS, MOMENTS, join_uri
from posecast_edge.model.sdf.values import NEWEST, SdfValues, get_text, get_version
from posecast_edge.model.urdf.reader import BYTES_MAX, DEPTH_MAX, ELEMENTS_MAX, read_urdf
from posecast_edge.model.urdf.resolver import Resolver, open_file
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
from posecast_edge.model.urdf.xml_tree import Element, read_xml

INCLUDES_MAX = 200
NESTED_MAX = 8  # includes within includes


@dataclass(frozen=True)
class ModelElement:
    """A `<model>`, where it was found. `base`: what stands before its relative addresses; `include`: the
    element by which it came, which may give it another name and pose; `version`: of its file; `files`: those
    that include each other on the way to it."""

    element: Element
    base: str
    version: tuple[int, ...]
    files: tuple[Path, ...]
    include: Element | None = None

    @property
    def name(self) -> str | None:
        """The model's name, as its include says it."""
        return get_text(self.include, "name") or self.element.get("name")

    @property
    def pose(self) -> Element | None:
        """Where it is."""
        own = self.element.find_first("pose")
        return (self.include.find_first("pose") if self.include is not None else None) or own

    @property
    def placement(self) -> str:
        """The frame whose pose `pose` is; "" for the model's own."""
        given = get_text(self.include, "placement_frame")
        return given or self.element.get("placement_frame") or ""


class IncludeReader:
    """Reads files, all of them together within the bounds of one."""

    def __init__(self, resolver: Resolver | None, values: SdfValues) -> None:
        """`resolver`: None where no other file is to be read."""
        self._resolver, self._values = resolver, values
        self._bytes, self._elements, self._left = BYTES_MAX, ELEMENTS_MAX, INCLUDES_MAX
        self.inputs: list[Path] = []

    def read_main(self, content: bytes, path: Path) -> list[ModelElement]:
        """The models of the file that was asked for. Raises ModelRefused when it is no SDF."""
        return list(self._list_models(self._parse(content, self._values.findings), "", (path,)))

    def list_nested(self, model: ModelElement) -> Iterator[ModelElement]:
        """The models inside of a model, in the file's order."""
        for child in model.element.children:
            if child.tag == "model":
                yield ModelElement(child, model.base, model.version, model.files)
            elif child.tag == "include":
                yield from self._include(child, model.base, model.files)

    def _list_models(self, root: Element, base: str, files: tuple[Path, ...]) -> Iterator[ModelElement]:
        """At the top of a file, and in its worlds."""
        version = get_version(root)
        if version > NEWEST:
            given, newest = (".".join(map(str, v)) for v in (version, NEWEST))
            text = f"SDF {given} is newer than {newest}, the newest that is known; read as that"
            self._values.note("warning", "version", text, root)
        for holder in (root, *root.find_all("world")):
            for child in holder.children:
                if child.tag == "model":
                    yield ModelElement(child, base, version, files)
                elif child.tag == "include":
                    yield from self._include(child, base, files)

    def _include(self, element: Element, base: str, files: tuple[Path, ...]) -> Iterator[ModelElement]:
        """The model that an `<include>` names; none where it can't be read, which is reported."""
        uri = get_text(element, "uri")
        try:
            found, path = self._read(uri, base, files)
        except ModelRefused as e:
            at = f"line {e.line} of it: " if e.line is not None else ""
            self._values.note("warning", "include", f"include {quote_name(uri)}: {at}{e.reason}", element)
            return
        inside = next(self._list_models(found, self._base_of(base, uri, path), (*files, path)), None)
        if inside is None:
            text = f"include {quote_name(uri)}: it has no model"
            self._values.note("warning", "include", text, element)
            return
        _set_lines(inside.element, element.line)
        yield ModelElement(inside.element, inside.base, inside.version, inside.files, element)

    def _read(self, uri: str, base: str, files: tuple[Path, ...]) -> tuple[Element, Path]:
        if not uri:
            raise ModelRefused("it names no file")
        if self._resolver is None:
            raise ModelRefused("includes are not read here")
        if len(files) > NESTED_MAX:
            raise ModelRefused(f"more than {NESTED_MAX} includes within each other")
        self._left -= 1
        if self._left < 0:
            raise ModelRefused(f"more than {INCLUDES_MAX} includes")
        path = self._resolver.find_description(join_uri(base, uri))
        if path in files:
            names = " → ".join(quote_name(p.name) for p in (*files[files.index(path) :], path))
            raise ModelRefused(f"files include each other: {names}")
        try:
            with open_file(path) as source:
                content = source.read(self._bytes + 1)
        except OSError as e:
            raise ModelRefused(e.strerror or str(e)) from None
        self.inputs.append(path)
        root = self._parse(content)
        if root.tag == "robot":
            urdf = read_urdf(io.BytesIO(content))
            if not urdf.links:
                raise ModelRefused("it has no links")
            root = make_sdf(urdf)
        return root, path

    def _parse(self, content: bytes, findings: list[Finding] | None = None) -> Element:
        if len(content) > self._bytes:
            raise ModelRefused(f"larger than {BYTES_MAX >> 20} MiB, including its includes")
        root = read_xml(
            io.BytesIO(content),
            bytes_max=self._bytes,
            elements_max=self._elements,
            depth_max=DEPTH_MAX,
            texts=True,
            findings=findings,
        )
        self._bytes -= len(content)
        self._elements -= _count(root)
        return root

    def _base_of(self, base: str, uri: str, path: Path) -> str:
        """The folder of an included file, spelt as its include does."""
        address = join_uri(base, uri)
        head, mark, rest = address.partition("://")
        if mark and head in ("model", "package"):
            package, _, inside = rest.partition("/")
            name = inside if inside.endswith(path.name) else posixpath.join(inside, path.name)
            return f"{head}://{package}/{posixpath.dirname(name)}"
        folder = address if not address.endswith(path.name) else posixpath.dirname(address)
        return f"{folder}/" if folder else ""


def _set_lines(element: Element, line: int) -> None:
    """A finding's line is one of the file that was asked for."""
    waiting = [element]
    while waiting:
        one = waiting.pop()
        one.line = line
        waiting += one.children


def _count(root: Element) -> int:
    count, waiting = 0, [root]
    while waiting:
        one = waiting.pop()
        count += 1
        waiting += one.children
    return count


# --- a URDF that an SDF includes, as an SDF's <model>

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
