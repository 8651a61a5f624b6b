"""Numbers, poses and names of an SDF. What can't be read counts as absent and is reported."""

from __future__ import annotations

import math
from collections.abc import Sequence

from posecast_edge.model.finding import Finding, quote_name
from posecast_edge.model.kinematics import Matrix, identity, matrix_from_quaternion
from posecast_edge.model.urdf.reader import NAME_MAX, parse_floats
from posecast_edge.model.urdf.types import FAR_M, Pose, Vector
from posecast_edge.model.urdf.xml_tree import Element

NEWEST = (1, 12)  # SDF version that is known
ROTATIONS = ("euler_rpy", "quat_xyzw")
POSE_ATTRIBUTES = ("relative_to", "rotation_format", "degrees", "frame")  # the last until SDF 1.6


class SdfValues:
    """Reads values, and collects what is wrong with them."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def note(self, severity: str, code: str, text: str, element: Element) -> None:
        """Report a problem at an element."""
        self.findings.append(Finding(severity, code, text, element.line))

    def read_numbers(self, element: Element | None, count: int, what: str) -> list[float] | None:
        """So many finite numbers in an element's text; None when it is absent, or reported as wrong."""
        if element is None or not element.text.strip():
            return None
        values = parse_floats(element.text)
        if values is None or len(values) != count or not all(map(math.isfinite, values)):
            many = "a number" if count == 1 else f"{count} numbers"
            shown = quote_name(element.text.strip(), 40)
            self.note("error", "number", f"{what}: <{element.tag}> needs {many}: {shown}", element)
            return None
        return values

    def read_number(self, element: Element | None, what: str) -> float | None:
        """One finite number."""
        values = self.read_numbers(element, 1, what)
        return values[0] if values else None

    def read_vector(self, element: Element | None, default: Vector, what: str) -> Vector:
        """Three finite numbers."""
        values = self.read_numbers(element, 3, what)
        return (values[0], values[1], values[2]) if values else default

    def read_pose(self, element: Element | None, what: str) -> Matrix:
        """The transform of a `<pose>`: six numbers, or seven with a quaternion."""
        if element is None:
            return identity()
        form = element.get("rotation_format") or ROTATIONS[0]
        if not self._is_known(element, form, what):
            return identity()
        if form == "quat_xyzw":
            values = self.read_numbers(element, 7, what)
            if values is None:
                return identity()
            x, y, z, w = values[3:]
            length = math.hypot(x, y, z, w)
            if not 1e-6 < length < FAR_M:
                self.note("error", "number", f"{what}: <pose> has a quaternion of length {length:g}", element)
                return identity()
            quat = (w / length, x / length, y / length, z / length)
            return self._near(matrix_from_quaternion(values[:3], quat), element, what)
        unit = math.pi / 180 if element.get("degrees") in ("true", "1") else 1.0
        values = self.read_numbers(element, 6, what) or [0.0] * 6
        x, y, z, roll, pitch, yaw = values
        pose = Pose((x, y, z), (roll * unit, pitch * unit, yaw * unit))
        return self._near(pose.to_matrix(), element, what)

    def _is_known(self, pose: Element, form: str, what: str) -> bool:
        """Whether a pose's rotation is in a known format; attributes that are not read are reported."""
        for name in pose.attributes:
            if name not in POSE_ATTRIBUTES and ":" not in name:
                say = f"{what}: <pose> has no attribute {quote_name(name, 40)} in SDF; ignored"
                self.note("warning", "attribute-unknown", say, pose)
        if form not in ROTATIONS:
            say = f"{what}: <pose> has the unknown rotation_format {quote_name(form, 40)}; left out"
            self.note("error", "number", say, pose)
        return form in ROTATIONS

    def _near(self, transform: Matrix, element: Element, what: str) -> Matrix:
        if max(abs(transform[i][3]) for i in range(3)) <= FAR_M:
            return transform
        self.note("error", "number", f"{what}: <pose> is more than 10,000 km away", element)
        return identity()

    def read_name(self, element: Element, what: str) -> str | None:
        """An element's name; None when it can't be used, which is reported."""
        name = element.get("name")
        if not name:
            self.note("error", "name-missing", f"a {what} without a name; left out", element)
            return None
        if len(name) > NAME_MAX or not all(c.isprintable() for c in name):
            text = f"{what} {quote_name(name)}: longer than {NAME_MAX} or with control characters; left out"
            self.note("error", "name-unusable", text, element)
            return None
        return name


def get_text(element: Element | None, *path: str) -> str:
    """The text at the end of a path, without blanks around it; "" where there is none."""
    found = element.find_first(*path) if element is not None else None
    return found.text.strip() if found is not None else ""


def get_flag(element: Element | None, *path: str) -> bool:
    """A boolean; False where there is none."""
    return get_text(element, *path).lower() in ("true", "1")


def get_version(root: Element) -> tuple[int, ...]:
    """The format's version; the newest where it can't be read."""
    words: Sequence[str] = (root.get("version") or "").split(".")
    if len(words) in (2, 3) and all(w.isascii() and w.isdigit() and len(w) < 5 for w in words):
        return tuple(map(int, words))
    return (1, 11)
