"""Visuals, collisions, materials and sensors of an SDF's links."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable
from urllib.parse import urlsplit

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.kinematics import Matrix
from posecast_edge.model.sdf.frames import make_pose
from posecast_edge.model.sdf.values import SdfValues, get_flag, get_text
from posecast_edge.model.urdf.types import ONES, SHAPES_MAX, Geometry, Inertial, Material, Shape, Vector
from posecast_edge.model.urdf.xml_tree import Element

Rgba = tuple[float, float, float, float]
DIMENSIONS = {"cylinder": ("radius", "length"), "sphere": ("radius",), "capsule": ("radius", "length")}
COLLADA = re.compile(r"\.dae$", re.IGNORECASE)
NEEDS_MESH = ("heightmap", "polyline", "image")
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
# Gazebo's own materials that robots name by script
SCRIPTS: dict[str, Vector] = {
    "Black": (0.0, 0.0, 0.0),
    "Blue": (0.0, 0.0, 1.0),
    "BlueLaser": (0.0, 0.0, 1.0),
    "DarkGrey": (0.175, 0.175, 0.175),
    "DarkGray": (0.175, 0.175, 0.175),
    "FlatBlack": (0.1, 0.1, 0.1),
    "Gold": (0.8, 0.65, 0.12),
    "Green": (0.0, 1.0, 0.0),
    "Grey": (0.7, 0.7, 0.7),
    "Gray": (0.7, 0.7, 0.7),
    "Indigo": (0.33, 0.0, 0.5),
    "LightWood": (0.75, 0.6, 0.4),
    "Orange": (1.0, 0.5088, 0.0468),
    "Purple": (1.0, 0.0, 1.0),
    "Red": (1.0, 0.0, 0.0),
    "SkyBlue": (0.13, 0.44, 0.7),
    "Turquoise": (0.0, 1.0, 1.0),
    "White": (1.0, 1.0, 1.0),
    "Wood": (0.6, 0.45, 0.3),
    "Yellow": (1.0, 1.0, 0.0),
}


class ShapeReader:
    """Reads what is drawn. It counts, so that a file has no more than SHAPES_MAX visuals and as many
    collisions."""

    def __init__(self, values: SdfValues) -> None:
        self._values = values
        self._count = 0

    def read(self, element: Element, base: str, what: str, find_pose: Callable[[Element], Matrix]) -> Shape:
        """A visual or collision. `base`: what stands before its relative addresses. Raises ModelRefused when
        there are too many."""
        self._count += 1
        if self._count > 2 * SHAPES_MAX:
            raise ModelRefused(f"more than {2 * SHAPES_MAX} visuals and collisions", element.line)
        holder = element.find_first("geometry")
        geometry = self._geometry(holder, base, what) if holder is not None else None
        if holder is None or not holder.children:
            text = f"{what}: a {element.tag} without a geometry"
            self._values.note("warning", f"{element.tag}-empty", text, element)
        paint = self._material(element, base, what) if element.tag == "visual" else None
        return Shape(make_pose(find_pose(element)), geometry, paint, element.line)

    def _geometry(self, holder: Element, base: str, what: str) -> Geometry | None:
        for shape in holder.children:
            if shape.tag == "mesh":
                return self._mesh(shape, base, what)
            if shape.tag in ("box", "ellipsoid", *DIMENSIONS):
                return self._primitive(shape, what)
            if shape.tag == "plane":
                self._values.note("hint", "plane", f"{what}: a plane is infinite and not shown", shape)
            elif shape.tag != "empty":
                advice = "; save it as a mesh to see it" if shape.tag in NEEDS_MESH else ""
                text = f"{what}: shape {quote_name(shape.tag)} is not shown{advice}"
                self._values.note("warning", "shape-unknown", text, shape)
        return None

    def _mesh(self, shape: Element, base: str, what: str) -> Geometry | None:
        uri = get_text(shape, "uri")
        if not uri:
            self._values.note("error", "mesh-unnamed", f"{what}: a mesh without a uri", shape)
            return None
        part = get_text(shape, "submesh", "name")
        if part and not COLLADA.search(uri):
            text = f"{what}: it names part {quote_name(part)} of a mesh; the whole mesh is shown, because"
            self._values.note("warning", "submesh", f"{text} only Collada files have named parts", shape)
        scale = self._values.read_vector(shape.find_first("scale"), ONES, what)
        if 0.0 in scale:
            self._values.note("error", "scale-zero", f"{what}: a mesh scaled by 0", shape)
            scale = ONES
        is_centred = get_flag(shape, "submesh", "center")
        return Geometry("mesh", (), join_uri(base, uri), scale, shape.line, part, is_centred)

    def _primitive(self, shape: Element, what: str) -> Geometry | None:
        kind, dims, scale = shape.tag, [0.0], ONES
        if kind == "box":
            dims = list(self._values.read_vector(shape.find_first("size"), ONES, what))
        elif kind == "ellipsoid":
            kind, dims = "sphere", [1.0]
            scale = self._values.read_vector(shape.find_first("radii"), ONES, what)
        else:
            found = (self._values.read_number(shape.find_first(n), what) for n in DIMENSIONS[kind])
            dims = [value or 0.0 for value in found]
        if min(*dims, *scale) <= 0:
            self._values.note("error", "shape-size", f"{what}: a {shape.tag} needs sizes above 0", shape)
            return None
        return Geometry(kind, tuple(dims), "", scale, shape.line)

    def _material(self, visual: Element, base: str, what: str) -> Material | None:
        element = visual.find_first("material")
        if element is None:
            return None
        rgba = self._colour(element, what)
        opaque = 1 - min(
            max(self._values.read_number(visual.find_first("transparency"), what) or 0.0, 0.0), 1.0
        )
        if rgba is not None:
            rgba = (*rgba[:3], rgba[3] * opaque)
        picture = get_text(element, "pbr", "metal", "albedo_map")
        return Material("", rgba, join_uri(base, picture) if picture else None, element.line)

    def _colour(self, element: Element, what: str) -> Rgba | None:
        for tag in ("diffuse", "ambient"):
            holder = element.find_first(tag)
            if holder is None:
                continue
            count = 3 if len(holder.text.split()) == 3 else 4
            values = self._values.read_numbers(holder, count, what)
            if values is not None:
                r, g, b, a = (min(max(v, 0.0), 1.0) for v in (*values, 1.0)[:4])
                return (r, g, b, a)
        name = get_text(element, "script", "name").rpartition("/")[2]
        return (*SCRIPTS[name], 1.0) if name in SCRIPTS else None

    def read_inertial(
        self, element: Element | None, what: str, find_pose: Callable[[Element], Matrix]
    ) -> Inertial | None:
        """A link's mass, its centre and moments."""
        mass = self._values.read_number(element.find_first("mass"), what) if element is not None else None
        if element is None or mass is None:
            return None
        holder = element.find_first("inertia")
        moments = [
            self._values.read_number(holder.find_first(name), what) or 0.0 if holder is not None else 0.0
            for name in MOMENTS
        ]
        return Inertial(mass, tuple(moments), element.line, make_pose(find_pose(element)))


def join_uri(base: str, uri: str) -> str:
    """An address in a file that stands at `base`; one that is whole stays as it is."""
    try:
        scheme = urlsplit(uri).scheme
    except ValueError:
        return uri
    if not base or scheme or uri.startswith("/"):
        return uri
    head, mark, path = base.partition("://")
    if not mark:
        return posixpath.normpath(posixpath.join(base, uri))
    package, _, folder = path.partition("/")
    inside = posixpath.normpath(posixpath.join(folder, uri))
    return f"{head}://{package}/{inside}"
