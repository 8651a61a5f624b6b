"""Reads a URDF tolerantly: an unreadable value is replaced by the standard's default for an absent one and
reported in `findings`, so that the rest of the robot can still be shown."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from posecast_edge.model.finding import Finding, ModelRefused, distrust_masses, make_printable, quote_name
from posecast_edge.model.kinematics import rpy_from_quaternion
from posecast_edge.model.text import read_robot_text
from posecast_edge.model.urdf.resolver import open_file
from posecast_edge.model.urdf.types import (
    JOINT_TYPES,
    ONES,
    SHAPES_MAX,
    ZERO,
    Geometry,
    Inertial,
    Joint,
    Limit,
    Link,
    Material,
    Mimic,
    Pose,
    Reference,
    Sensor,
    Shape,
    Urdf,
    Vector,
)
from posecast_edge.model.urdf.xml_tree import Element, parse_xml, read_at_most

BYTES_MAX = 8 << 20
ELEMENTS_MAX = 50_000
DEPTH_MAX = 64
LINKS_MAX = 1000
NAME_MAX = 200

SHAPES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
}
QUATERNIONS_SINCE = (1, 1)  # `quat_xyzw`, as urdfdom reads it
NEWEST = (1, 2)
ATTRIBUTES = {  # of the elements that place or move something; others are reported
    "origin": {"xyz", "rpy", "quat_xyzw"},
    "axis": {"xyz"},
    "limit": {"lower", "upper", "velocity", "effort", "acceleration", "deceleration", "jerk"},
    "mimic": {"joint", "multiplier", "offset"},
    "mesh": {"filename", "scale"},
}
# narrower than Python's float(), which takes 1_0 and digits of other scripts too
NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|nan|inf(?:inity)?)", re.IGNORECASE
)
VERSION = re.compile(r"[0-9]{1,4}(?:\.[0-9]{1,4})?")
ROOTS_OF_OTHERS = {
    "sdf": "this is SDF, not URDF",
    "mujoco": "this is a MuJoCo model, not URDF",
    "html": "this is an HTML page, not URDF",
    "COLLADA": "this is a Collada mesh, not URDF",
    "package": "this is a ROS package.xml, not URDF",
    "launch": "this is a ROS launch file, not URDF: give the URDF or xacro that it loads",
}
SRDF_TAGS = {"group", "group_state", "end_effector", "virtual_joint", "disable_collisions", "passive_joint"}


def load_urdf(path: Path) -> Urdf:
    """Read a file. Raises ModelRefused when it is not a URDF at all."""
    try:
        with open_file(path) as source:
            return read_urdf(source)
    except OSError as e:
        raise ModelRefused(e.strerror or str(e)) from None


def read_urdf(source: BinaryIO) -> Urdf:
    """Read a stream. Raises ModelRefused when it is not a URDF at all."""
    text = read_robot_text(read_at_most(source, BYTES_MAX))
    root = parse_xml(text, elements_max=ELEMENTS_MAX, depth_max=DEPTH_MAX, texts=True)
    if root.tag != "robot":
        other = f"the root element is <{make_printable(root.tag[:40])}>, not <robot>"
        reason = ROOTS_OF_OTHERS.get(root.tag, other)
        raise ModelRefused(reason, root.line)
    tags = {child.tag for child in root.children}
    if tags & SRDF_TAGS and not tags & {"link", "joint"}:
        raise ModelRefused("this is an SRDF, MoveIt's file beside a URDF: give the URDF", root.line)
    urdf = _Reader(root).urdf
    urdf.findings[:0] = text.findings
    return urdf


def show_collisions(urdf: Urdf, line: int) -> None:
    """A robot made for planning alone has no visuals: its collision shapes are what there is to see."""
    if any(s.geometry for link in urdf.links for s in link.visuals):
        return
    if any(s.geometry for link in urdf.links for s in link.collisions):
        urdf.links = [replace(link, visuals=link.collisions) for link in urdf.links]
        text = "no link has a visual; the collision shapes are shown"
        urdf.findings.append(Finding("hint", "collisions-shown", text, line))


class _Reader:
    def __init__(self, root: Element) -> None:
        self.urdf = Urdf(root.get("name") or "")
        if not self.urdf.name:
            self._note("hint", "robot-name", "<robot> has no name", root)
        self._shapes = 0
        self._version = self._read_version(root)
        self._xacro(root)
        for element in root.find_all("material"):
            self._define(self._material(element))
        readers = {
            "link": self._link,
            "joint": self._joint,
            "sensor": self._sensor,
            "gazebo": self._gazebo,
            "transmission": self._transmission,
        }
        for element in root.children:
            if reader := readers.get(element.tag):
                reader(element)
        self._mount_on_links()
        show_collisions(self.urdf, root.line)

    def _note(self, severity: str, code: str, text: str, element: Element) -> None:
        self.urdf.findings.append(Finding(severity, code, text, element.line))

    def _read_version(self, root: Element) -> tuple[int, ...]:
        """The URDF's version; 1.0 where it has none."""
        text = (root.get("version") or "1.0").strip()
        if not VERSION.fullmatch(text):
            say = f"<robot version> {quote_name(text, 40)} is not like '1.1'; read as 1.0"
            self._note("warning", "version", say, root)
            return (1, 0)
        major, _, minor = text.partition(".")
        version = (int(major), int(minor or 0))
        if version > NEWEST:
            say = f"URDF {major}.{version[1]} is newer than 1.2, the newest that is known; read as 1.2"
            self._note("warning", "version", say, root)
        return version

    def _check_attributes(self, element: Element | None, what: str) -> None:
        """Report attributes that are not read; those of other namespaces belong to other programs."""
        if element is None:
            return
        for name in element.attributes:
            if name not in {*ATTRIBUTES[element.tag], "xmlns"} and ":" not in name:
                say = f"{what}: <{element.tag}> has no attribute {quote_name(name, 40)} in URDF; ignored"
                self._note("warning", "attribute-unknown", say, element)

    def _xacro(self, root: Element) -> None:
        if any(c.tag.startswith("xacro:") for c in root.children):
            text = "it still has xacro macros; expand them first: xacro robot.xacro > robot.urdf"
            self._note("error", "xacro", text, next(c for c in root.children if c.tag.startswith("xacro:")))

    def _define(self, material: Material) -> None:
        """Keep it under its name: the first definition counts for the whole robot, as in ROS (urdfdom)."""
        if not material.name or (material.rgba is None and not material.texture):
            return
        first = self.urdf.materials.setdefault(material.name, material)
        if (first.rgba, first.texture) != (material.rgba, material.texture):
            name = quote_name(material.name)
            text = f"material {name} is defined twice; the first (line {first.line}) is used"
            self.urdf.findings.append(Finding("hint", "material-doubled", text, material.line))

    def _link(self, element: Element) -> None:
        name = self._name(element, "link")
        if name is None:
            return
        if len(self.urdf.links) >= LINKS_MAX:
            raise ModelRefused(f"more than {LINKS_MAX} links", element.line)
        what = f"link {quote_name(name)}"
        visuals = tuple(self._shape(e, what) for e in element.find_all("visual"))
        collisions = tuple(self._shape(e, what) for e in element.find_all("collision"))
        inertial = element.find_first("inertial")
        with distrust_masses(self.urdf.findings):
            mass = self._inertial(inertial, what) if inertial else None
        self.urdf.links.append(Link(name, visuals, collisions, mass, element.line))
        for sensor in element.find_all("sensor"):
            self._add_sensor(sensor, name)

    def _joint(self, element: Element) -> None:
        name = self._name(element, "joint")
        if name is None:
            return
        what = f"joint {quote_name(name)}"
        kind = element.get("type") or ""
        if kind not in JOINT_TYPES:
            text = f"{what}: unknown type {quote_name(kind)}" if kind else f"{what}: no type"
            self._note("error", "joint-type", f"{text}; shown as fixed", element)
            kind = "fixed"
        ends = []
        for end in ("parent", "child"):
            found = element.find_first(end)
            link = found.get("link") if found else None
            if not link:
                self._note("error", "joint-ends", f"{what}: no {end} link", element)
            ends.append(link or "")
        axis = element.find_first("axis")
        self._check_attributes(axis, what)
        self.urdf.joints.append(
            Joint(
                name, kind, ends[0], ends[1], self._pose(element, what),
                self._vector(axis, "xyz", (1.0, 0.0, 0.0), what) if axis else None,
                self._limit(element.find_first("limit"), what),
                self._mimic(element.find_first("mimic"), what),
                element.line,
            )
        )  # fmt: skip

    def _limit(self, element: Element | None, what: str) -> Limit | None:
        if element is None:
            return None
        self._check_attributes(element, what)
        lower, upper, velocity, effort = (
            self._number(element, name, None, what) for name in ("lower", "upper", "velocity", "effort")
        )
        return Limit(lower, upper, velocity, effort, element.line)

    def _mimic(self, element: Element | None, what: str) -> Mimic | None:
        if element is None:
            return None
        self._check_attributes(element, what)
        multiplier = self._number(element, "multiplier", None, what)
        offset = self._number(element, "offset", None, what)
        joint = element.get("joint") or ""
        return Mimic(joint, 1.0 if multiplier is None else multiplier, offset or 0.0, element.line)

    def _inertial(self, element: Element, what: str) -> Inertial | None:
        mass, inertia = element.find_first("mass"), element.find_first("inertia")
        value = self._number(mass, "value", None, what) if mass else None
        if value is None:
            if mass is None or mass.get("value") is None:
                self._note("warning", "inertial-empty", f"{what}: an <inertial> without a <mass>", element)
            return None
        moments = [
            self._number(inertia, n, 0.0, what) or 0.0 if inertia else 0.0
            for n in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        ]
        return Inertial(value, tuple(moments), element.line, self._pose(element, what))

    def _shape(self, element: Element, what: str) -> Shape:
        self._shapes += 1
        if self._shapes > 2 * SHAPES_MAX:
            raise ModelRefused(f"more than {2 * SHAPES_MAX} visuals and collisions", element.line)
        pose = self._pose(element, what)
        material = element.find_first("material") or element.find_first("geometry", "material")
        holder = element.find_first("geometry")
        geometry = self._geometry(holder, what) if holder else None
        if geometry is None:
            text = f"{what}: a {element.tag} without a geometry"
            self._note("warning", f"{element.tag}-empty", text, element)
        paint = self._material(material, what) if material and element.tag == "visual" else None
        if paint is not None:
            self._define(paint)
        return Shape(pose, geometry, paint, element.line)

    def _geometry(self, holder: Element, what: str) -> Geometry | None:
        known = [e for e in holder.children if e.tag == "mesh" or e.tag in SHAPES]
        for e in holder.children:
            if e.tag not in ("mesh", "material") and e.tag not in SHAPES:
                self._note("warning", "shape-unknown", f"{what}: unknown shape {quote_name(e.tag)}", e)
        if len(known) > 1:
            text = f"{what}: several shapes in one geometry; the first is used"
            self._note("warning", "shape-several", text, holder)
        if not known:
            return None
        shape = known[0]
        if shape.tag == "mesh":
            self._check_attributes(shape, what)
            uri = (shape.get("filename") or "").strip()
            if not uri:
                self._note("error", "mesh-unnamed", f"{what}: a mesh without a filename", shape)
                return None
            scale = self._vector(shape, "scale", ONES, what)
            if 0.0 in scale:
                self._note("error", "scale-zero", f"{what}: a mesh scaled by 0", shape)
                scale = ONES
            return Geometry("mesh", (), uri, scale, shape.line)
        dims: list[float] = []
        for name in SHAPES[shape.tag]:
            if name == "size":
                dims += self._vector(shape, name, ZERO, what)
            else:
                dims.append(self._number(shape, name, 0.0, what) or 0.0)
        if min(dims) <= 0:
            self._note("error", "shape-size", f"{what}: a {shape.tag} needs sizes above 0", shape)
            return None
        return Geometry(shape.tag, tuple(dims), "", ONES, shape.line)

    def _material(self, element: Element, what: str = "material") -> Material:
        name = element.get("name") or ""
        what = (
            f"{what}, material {quote_name(name)}" if what != "material" else f"material {quote_name(name)}"
        )
        color, texture = element.find_first("color"), element.find_first("texture")
        rgba = None
        if color is not None:
            values = parse_floats(color.get("rgba") or "")
            if values is not None and len(values) == 3:
                values = [*values, 1.0]
            if values is None or len(values) != 4 or not all(map(math.isfinite, values)):
                self._note("warning", "color", f"{what}: rgba needs four numbers from 0 to 1", color)
            else:
                if max(values) > 1 or min(values) < 0:
                    scale = 255 if max(values) > 1 and min(values) >= 0 and max(values) <= 255 else 1
                    hint = "; read as 0 … 255" if scale == 255 else ""
                    self._note("warning", "color", f"{what}: rgba outside 0 … 1{hint}", color)
                    values = [v / scale for v in values[:3]] + [values[3] / (scale if values[3] > 1 else 1)]
                r, g, b, a = (min(max(v, 0.0), 1.0) for v in values)
                rgba = (r, g, b, a)
        return Material(name, rgba, (texture.get("filename") or None) if texture else None, element.line)

    def _sensor(self, element: Element) -> None:
        parent = element.find_first("parent")
        of = (parent.get("link") or parent.get("joint")) if parent else None
        self._add_sensor(element, of or "")

    def _add_sensor(self, element: Element, link: str) -> None:
        kind = element.get("type") or next((c.tag for c in element.children if c.tag in _SENSOR_TAGS), "")
        pose_tag = element.find_first("pose")  # SDF's way, inside <gazebo>
        if pose_tag is not None:
            numbers = parse_floats(pose_tag.text) or []
            ok = len(numbers) == 6 and all(map(math.isfinite, numbers))
            pose = Pose(_three(numbers[:3]), _three(numbers[3:])) if ok else Pose()
        else:
            pose = self._pose(element, "sensor")
        kind = (kind or "sensor")[:NAME_MAX]
        name = (element.get("name") or kind)[:NAME_MAX]
        self.urdf.sensors.append(Sensor(name, kind, link, pose, element.line))

    def _mount_on_links(self) -> None:
        """A sensor that is said to sit on a joint, as force sensors do, sits on the joint's child."""
        links, children = {link.name for link in self.urdf.links}, dict[str, str]()
        for joint in self.urdf.joints:
            children.setdefault(joint.name, joint.child)
        self.urdf.sensors = [
            s if s.link in links else replace(s, link=children.get(s.link, s.link)) for s in self.urdf.sensors
        ]

    def _gazebo(self, element: Element) -> None:
        reference = element.get("reference")
        if reference:
            self.urdf.references.append(Reference("link or joint", reference, "<gazebo>", element.line))
        for sensor in element.find_all("sensor"):
            self._add_sensor(sensor, reference or "")

    def _transmission(self, element: Element) -> None:
        for joint in element.find_all("joint"):
            if name := joint.get("name"):
                self.urdf.references.append(Reference("joint", name, "<transmission>", joint.line))

    # ---- values ----

    def _name(self, element: Element, what: str) -> str | None:
        name = element.get("name")
        if not name:
            self._note("error", "name-missing", f"a {what} without a name; left out", element)
            return None
        if len(name) > NAME_MAX or not all(c.isprintable() for c in name):
            text = f"{what} {quote_name(name)}: longer than {NAME_MAX} or with control characters; left out"
            self._note("error", "name-unusable", text, element)
            return None
        if name != name.strip():
            self._note("warning", "name-odd", f"{what} {quote_name(name)}: spaces around the name", element)
        elif name in ("__proto__", "constructor", "prototype") or any(c in "<>&\"'`" for c in name):
            text = f"{what} {quote_name(name)}: this name breaks other programs"
            self._note("warning", "name-odd", text, element)
        return name

    def _pose(self, element: Element, what: str) -> Pose:
        origin = element.find_first("origin")
        if origin is None:
            return Pose()
        self._check_attributes(origin, what)
        return Pose(self._vector(origin, "xyz", ZERO, what), self._rpy(origin, what))

    def _rpy(self, origin: Element, what: str) -> Vector:
        """An origin's rotation, which URDF 1.1 may give as a quaternion instead."""
        if origin.get("quat_xyzw") is None:
            return self._vector(origin, "rpy", ZERO, what)
        if self._version < QUATERNIONS_SINCE:
            say = f'{what}: <origin quat_xyzw> is read only with <robot version="1.1">; ignored'
            self._note("warning", "quaternion", say, origin)
            return self._vector(origin, "rpy", ZERO, what)
        if origin.get("rpy") is not None:
            say = f"{what}: <origin> has both rpy and quat_xyzw; remove one. It is not turned"
            self._note("error", "quaternion", say, origin)
            return ZERO
        values = self._numbers(origin, "quat_xyzw", 4, what)
        if values is None:
            return ZERO
        length = max(map(abs, values))
        if not 1e-100 < length < 1e100:
            say = f"{what}: <origin quat_xyzw> has no direction; it is not turned"
            self._note("error", "quaternion", say, origin)
            return ZERO
        x, y, z, w = (v / length for v in values)
        return rpy_from_quaternion((w, x, y, z))

    def _vector(self, element: Element, name: str, default: Vector, what: str) -> Vector:
        values = self._numbers(element, name, 3, what)
        return default if values is None else _three(values)

    def _number(self, element: Element, name: str, default: float | None, what: str) -> float | None:
        values = self._numbers(element, name, 1, what)
        return default if values is None else values[0]

    def _numbers(self, element: Element, name: str, count: int, what: str) -> list[float] | None:
        """So many finite numbers; None when the attribute is absent, or reported as wrong."""
        text, place = element.get(name), f"{what}: <{element.tag} {name}>"
        if text is None:
            return None
        values = parse_floats(text)
        if values is None and "," in text and (values := parse_floats(_uncomma(text))) is not None:
            say = f"{place} with commas: {quote_name(text, 40)}; other programs refuse it"
            self._note("warning", "number-commas", say, element)
        if values is None or not all(map(math.isfinite, values)):
            wrong = "is not a number" if values is None else "is not finite"
            wrong = "was not expanded by xacro" if "${" in text or "$(" in text else wrong
            self._note("error", "number", f"{place} {wrong}: {quote_name(text, 40)}", element)
            return None
        if len(values) == 1 and name == "scale":  # seen in the wild, meant as uniform
            return values * 3
        if len(values) != count:
            needed = {1: "one number", 3: "three numbers"}.get(count, "four numbers")
            self._note("error", "number", f"{place} needs {needed}", element)
            return None
        return values


_SENSOR_TAGS = {"camera", "ray", "imu", "force_torque", "contact", "gps", "lidar"}


def parse_floats(text: str) -> list[float] | None:
    """Numbers with blanks between; None when something else is among them."""
    words = text[:1000].split()
    return [float(word) for word in words] if all(map(NUMBER.fullmatch, words)) else None


def _uncomma(text: str) -> str:
    """Commas between numbers gone; a comma that may be a decimal one stays."""
    return text.replace(", ", " ") if any(c.isspace() for c in text.strip()) else text.replace(",", " ")


def _three(values: list[float]) -> Vector:
    return (values[0], values[1], values[2])
