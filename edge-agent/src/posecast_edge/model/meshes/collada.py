"""Reads Collada (1.4 and 1.5): triangles and the scene that places them.

Like RViz it applies <unit> and ignores <up_axis>, because exporters may write it although they have rotated
the vertices. The mesh keeps the declared axis; builder/up_axis.py decides with the whole robot in view.

A part shown in several places is read once, and its triangles are counted before they are made, because a
small file may show its parts more often than memory allows.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.meshes.mesh import (
    TEXT_MAX,
    UP_NOTES,
    UPRIGHT,
    Expansion,
    Load,
    Mesh,
    Notes,
    Paint,
    PolygonCutter,
    Rgba,
    Surface,
    select_used_vertices,
    triangulate_fans,
)
from posecast_edge.model.meshes.texture import Pictures
from posecast_edge.model.urdf.xml_tree import Element, read_xml

ELEMENTS_MAX = 200_000
DEPTH_MAX = 64
INSTANCES_MAX = 10_000
SEMANTICS = ("POSITION", "TEXCOORD", "COLOR")  # that are read

Transform = NDArray[np.float64]
Input = tuple[int, Element]  # offset within a corner, source


@dataclass(frozen=True)
class _Piece:
    """Triangles of one material symbol: (m, 3) corners into positions; uv and colour per corner. `url`: of
    the material if no binding sets one."""

    symbol: str
    url: str
    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None  # (m, 3, 2)
    colours: NDArray[np.float64] | None  # (m, 3, 3)


@dataclass(frozen=True)
class _Shown:
    """An element shown by a node, with the URLs that its symbols are bound to."""

    kind: str
    element: Element
    bound: Mapping[str, str]


@dataclass(frozen=True)
class _Node:
    """Its transform, and all it shows."""

    parent_from_node: Transform
    shows: tuple[_Shown, ...]


def read_collada(data: bytes, load: Load, keep_uv: bool = False, pictures: Pictures | None = None) -> Mesh:
    """Read a file. Raises ModelRefused when it is not Collada; a missing texture only gives a note.
    `keep_uv`: keep texture coordinates even without a texture."""
    root = read_xml(
        io.BytesIO(data), bytes_max=TEXT_MAX, elements_max=ELEMENTS_MAX, depth_max=DEPTH_MAX, texts=True
    )
    if root.tag.rpartition(":")[2] != "COLLADA":
        raise ModelRefused(f"its root is <{make_printable(root.tag[:40])}>, not <COLLADA>", root.line)
    with np.errstate(over="ignore", invalid="ignore"):  # non-finite values are refused at the end
        return _Reader(root, load, keep_uv, pictures or Pictures(), len(data)).mesh()


class _Reader:
    def __init__(self, root: Element, load: Load, keep_uv: bool, pictures: Pictures, size: int) -> None:
        """`size`: bytes of the file."""
        self._root = root
        self._keep_uv = keep_uv
        self._notes = Notes()
        self._ids: dict[str, Element] = {}
        self._materials = Materials(self._ids, load, pictures, self._notes)
        self._cutter = PolygonCutter(self._notes)
        self._expansion = Expansion(size)
        self._instances = 0
        # already read, by the element's identity
        self._nodes: dict[int, _Node] = {}
        self._bases: dict[int, tuple[Transform, Element] | None] = {}  # of controllers
        self._pieces: dict[int, list[_Piece]] = {}
        self._vertices: dict[int, dict[str, Element]] = {}
        self._arrays: dict[int, NDArray[np.float64]] = {}
        waiting = [root]
        while waiting:
            element = waiting.pop()
            element.tag = element.tag.rpartition(":")[2]
            if identity := element.get("id"):
                self._ids.setdefault(identity, element)
            waiting += reversed(element.children)

    def mesh(self) -> Mesh:
        unit = self._root.find_first("asset", "unit")
        written = ((unit.get("meter") if unit else None) or "1").strip()
        metre = convert_float(written.replace(",", "."), 0.0)  # some exporters write a decimal comma
        if metre == 0:
            self._notes.add(
                "collada-unit", f"its unit {quote_name(written, 20)} is not a number above 0; read as 1 m"
            )
            metre = 1.0
        if not 1e-9 < metre < 1e9:
            raise ModelRefused(f"its unit is {metre:g} m")
        if metre != 1:
            self._notes.add("collada-unit", f"its unit is {metre:g} m; applied")
        axis = self._root.find_first("asset", "up_axis")
        up = axis.text.strip() if axis is not None else ""
        if up not in ("", "Z_UP"):
            self._notes.add(UP_NOTES[0], f"it says {up[:10]}; ignored, as RViz does")
        scene = self._root.find_first("scene", "instance_visual_scene")
        visual = self._target(scene.get("url") if scene else None) or self._root.find_first(
            "library_visual_scenes", "visual_scene"
        )
        base = np.diag([metre, metre, metre, 1.0])
        if visual is not None:
            surfaces = [s for node in visual.find_all("node") for s in self._node(node, base, 0)]
        else:
            library = self._root.find_first("library_geometries")
            surfaces = [s for g in (library.children if library else []) for s in self._geometry(g, base, {})]
        return Mesh(tuple(surfaces), self._notes.list_entries(), up if up in UPRIGHT else "")

    def _target(self, url: str | None) -> Element | None:
        return find_target(self._ids, url)

    # ---- scene ----

    def _node(self, element: Element, parent: Transform, depth: int) -> Iterator[Surface]:
        self._count(depth)
        if id(element) not in self._nodes:
            self._nodes[id(element)] = self._read_node(element)
        node = self._nodes[id(element)]
        at = parent @ node.parent_from_node
        for shown in node.shows:
            if shown.kind == "node":
                yield from self._node(shown.element, at, depth + 1)
                continue
            read = self._geometry if shown.kind == "instance_geometry" else self._controlled
            names = tuple(n for e in (element, shown.element) for n in (e.get("name"), e.get("id")) if n)
            for surface in read(shown.element, at, shown.bound):
                yield replace(surface, names=names)

    def _read_node(self, element: Element) -> _Node:
        at = np.eye(4)
        shows = []
        for child in element.children:
            if child.tag == "node":
                shows.append(_Shown("node", child, {}))
            elif child.tag in TRANSFORMS:
                at = at @ _transform(child)
            elif child.tag in UNREAD:
                self._notes.add("collada-transform", f"a <{child.tag}> in its scene is not applied")
            elif child.tag in INSTANCES and (target := self._target(child.get("url"))) is not None:
                shows.append(_Shown(INSTANCES[child.tag], target, _bindings(child)))
        return _Node(at, tuple(shows))

    def _controlled(
        self, controller: Element, at: Transform, bound: Mapping[str, str], depth: int = 0
    ) -> Iterator[Surface]:
        """A skinned or morphed shape in its bind pose, because URDF moves bodies, not bones."""
        self._count(depth)
        if id(controller) not in self._bases:
            self._bases[id(controller)] = self._read_base(controller)
        base = self._bases[id(controller)]
        if base is None:
            return
        at, source = at @ base[0], base[1]
        if source.tag == "controller":
            yield from self._controlled(source, at, bound, depth + 1)
        else:
            yield from self._geometry(source, at, bound)

    def _read_base(self, controller: Element) -> tuple[Transform, Element] | None:
        """The geometry of a controller, and its bind transform."""
        how = controller.find_first("skin") or controller.find_first("morph")
        source = self._target(how.get("source")) if how else None
        if how is None or source is None:
            return None
        bind = how.find_first("bind_shape_matrix")
        values = extract_floats(bind) if bind else np.zeros(0)
        known = len(values) == 16 and bool(np.isfinite(values).all())
        return values.reshape(4, 4) if known else np.eye(4), source

    def _geometry(self, geometry: Element, at: Transform, bound: Mapping[str, str]) -> Iterator[Surface]:
        self._count(0)
        if id(geometry) not in self._pieces:
            self._pieces[id(geometry)] = list(self._read_pieces(geometry))
        for piece in self._pieces[id(geometry)]:
            self._expansion.add_part(len(piece.faces))
            paint = self._materials.find_paint(bound.get(piece.symbol) or piece.url)
            textured = self._keep_uv or (paint is not None and paint.texture is not None)
            yield _placed(piece, at, paint, textured)

    def _count(self, depth: int) -> None:
        self._instances += 1
        if self._instances > INSTANCES_MAX or depth > DEPTH_MAX:
            raise ModelRefused(f"a scene of more than {INSTANCES_MAX:,} nodes, or more than {DEPTH_MAX} deep")

    # ---- geometry ----

    def _read_pieces(self, geometry: Element) -> Iterator[_Piece]:
        mesh = geometry.find_first("mesh")
        for element in mesh.children if mesh else ():
            if element.tag not in ("triangles", "polylist", "polygons", "tristrips", "trifans"):
                continue
            inputs = self._inputs(element)
            if "POSITION" not in inputs:
                continue
            stride = max(offset for offset, _ in inputs.values()) + 1
            offset, source = inputs["POSITION"]
            polygons = _polygons(element, stride)
            if not len(polygons.numbers):
                continue
            positions = self._source(source, 3)
            numbers, corners = polygons.numbers, self._triangles(polygons, offset, positions)
            if not len(corners):
                continue
            kept, faces = select_used_vertices(numbers[corners, offset].reshape(-1), len(positions))
            uv, colours = (
                self._of_corners(inputs, semantic, width, numbers, corners)
                for semantic, width in (("TEXCOORD", 2), ("COLOR", 3))
            )
            symbol = element.get("material") or ""
            url = f"#{symbol}" if symbol else ""
            yield _Piece(symbol, url, positions[kept], faces.reshape(-1, 3), uv, colours)

    def _triangles(
        self, polygons: _Polygons, offset: int, positions: NDArray[np.float64]
    ) -> NDArray[np.int64]:
        """The triangles (m, 3) of polygons as numbers of corners. `offset`: of the position in a corner."""
        if polygons.tag == "triangles":
            return np.arange(3 * len(polygons.counts)).reshape(-1, 3)
        if polygons.tag == "trifans":
            return triangulate_fans(polygons.counts)
        if polygons.tag == "tristrips":
            return _split_strips(polygons.counts)
        numbers = polygons.numbers[:, offset]
        if numbers.min() < 0 or numbers.max() >= len(positions):
            raise ModelRefused("a triangle refers to a vertex that does not exist")
        at = positions[numbers]
        total = int(polygons.counts.sum())
        found = [self._cutter.cut(polygons.counts, at[:total])]
        start = total
        for rings in polygons.holes:
            ends = np.cumsum([start, *rings])
            cut = self._cutter.cut_rings([at[a:b] for a, b in pairwise(ends)])
            outline = triangulate_fans(np.array(rings[:1], np.int64))
            found.append((outline if cut is None else cut) + start)
            start = int(ends[-1])
        return np.concatenate(found)

    def _of_corners(
        self,
        inputs: dict[str, Input],
        semantic: str,
        width: int,
        numbers: NDArray[np.int64],
        corners: NDArray[np.int64],
    ) -> NDArray[np.float64] | None:
        """(m, 3, width) values; None when there are none, or too few."""
        if semantic not in inputs:
            return None
        offset, source = inputs[semantic]
        values, at = self._source(source, width), numbers[corners, offset]
        return values[at] if at.min() >= 0 and at.max() < len(values) else None

    def _inputs(self, element: Element) -> dict[str, Input]:
        """Offset and source by semantic; the first set of each."""
        found: dict[str, Input] = {}
        for entry in element.find_all("input"):
            offset = int(convert_float(entry.get("offset"), 0))
            target = self._target(entry.get("source"))
            if not 0 <= offset < 64 or target is None:
                continue
            semantic = entry.get("semantic") or ""
            if semantic == "VERTEX":
                for inner, source in self._of_vertices(target).items():
                    found.setdefault(inner, (offset, source))
            found.setdefault(semantic, (offset, target))
        return found

    def _of_vertices(self, vertices: Element) -> dict[str, Element]:
        """The sources of <vertices> by semantic."""
        if id(vertices) not in self._vertices:
            found: dict[str, Element] = {}
            self._vertices[id(vertices)] = found
            for entry in vertices.find_all("input"):
                semantic, target = entry.get("semantic") or "", self._target(entry.get("source"))
                if semantic in SEMANTICS and target is not None:
                    found.setdefault(semantic, target)
        return self._vertices[id(vertices)]

    def _source(self, source: Element, width: int) -> NDArray[np.float64]:
        """(n, width) floats. Raises ModelRefused when the array is shorter than declared."""
        accessor = source.find_first("technique_common", "accessor")
        array = self._target(accessor.get("source") if accessor else None) or source.find_first("float_array")
        if array is None:
            raise ModelRefused("vertices without numbers", source.line)
        if id(array) not in self._arrays:
            self._arrays[id(array)] = extract_floats(array)
        values = self._arrays[id(array)]
        stride = int(convert_float(accessor.get("stride") if accessor else None, width))
        offset = int(convert_float(accessor.get("offset") if accessor else None, 0))
        if not width <= stride <= 256 or not 0 <= offset <= len(values):
            raise ModelRefused("vertices of an impossible stride", source.line)
        rows = (len(values) - offset) // stride
        return values[offset : offset + rows * stride].reshape(rows, stride)[:, :width]


# which of a node's children move it, and which show something
TRANSFORMS = ("matrix", "translate", "rotate", "scale")
UNREAD = ("skew", "lookat")
INSTANCES = {
    "instance_node": "node",
    "instance_geometry": "instance_geometry",
    "instance_controller": "instance_controller",
}


def _bindings(instance: Element) -> dict[str, str]:
    common = instance.find_first("bind_material", "technique_common")
    return {e.get("symbol") or "": e.get("target") or "" for e in (common.children if common else ())}


def _placed(piece: _Piece, at: Transform, paint: Paint | None, textured: bool) -> Surface:
    positions = piece.positions @ at[:3, :3].T + at[:3, 3]
    faces, uv, colours = piece.faces, piece.uv if textured else None, piece.colours
    if np.linalg.det(at[:3, :3]) < 0:
        faces = faces[:, ::-1]
        uv, colours = (None if v is None else v[:, ::-1] for v in (uv, colours))
    if uv is None and colours is None:
        return Surface(positions.astype(np.float32), faces.astype(np.int32), None, paint)
    own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    return Surface(
        positions[faces.reshape(-1)].astype(np.float32),
        own,
        None if uv is None else (uv.reshape(-1, 2) * (1, -1) + (0, 1)).astype(np.float32),  # from below
        paint,
        None if colours is None else colours.reshape(-1, 3).astype(np.float32),
    )


@dataclass(frozen=True)
class _Polygons:
    """`numbers`: all corners' indices (n, stride); `counts`: corners of each polygon or strip; `holes`: for
    polygons with holes, after all others, the corners of each ring."""

    tag: str
    numbers: NDArray[np.int64]
    counts: NDArray[np.int64]
    holes: list[list[int]]


def _polygons(element: Element, stride: int) -> _Polygons:
    lists = [extract_integers(p) for p in element.find_all("p")]
    holes = []
    for holed in element.find_all("ph"):
        rings = [extract_integers(ring) for tag in ("p", "h") for ring in holed.find_all(tag)]
        lists += rings
        holes.append([len(ring) // stride for ring in rings])
    numbers = np.concatenate(lists) if lists else np.zeros(0, np.int64)
    if any(len(x) % stride for x in lists):
        raise ModelRefused("a list of corners ends within a corner", element.line)
    numbers = numbers.reshape(-1, stride)
    counts = np.array([len(x) // stride for x in lists[: len(lists) - sum(map(len, holes))]], np.int64)
    if element.tag == "triangles":
        counts = np.full(len(numbers) // 3, 3)
    elif element.tag == "polylist":
        vcount = element.find_first("vcount")
        counts = extract_integers(vcount) if vcount else np.zeros(0, np.int64)
        if len(counts) and (counts.min() < 0 or counts.max() > len(numbers) or counts.sum() > len(numbers)):
            raise ModelRefused("polygons with more corners than the list has", element.line)
    return _Polygons(element.tag, numbers, counts, holes)


def _split_strips(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (m, 3) of strips, as numbers of corners."""
    strips = []
    for first, length in zip(np.cumsum(lengths) - lengths, lengths, strict=True):
        i = np.arange(max(length - 2, 0)) + first
        odd = (i - first) % 2
        strips.append(np.stack([i + odd, i + 1 - odd, i + 2], axis=1))
    return np.concatenate(strips) if strips else np.zeros((0, 3), np.int64)


def _transform(element: Element) -> Transform:
    matrix = np.eye(4)
    values = extract_floats(element)
    if len(values) != {"matrix": 16, "rotate": 4}.get(element.tag, 3) or not np.isfinite(values).all():
        raise ModelRefused(f"a <{element.tag}> of {len(values)} numbers", element.line)
    if element.tag == "matrix":
        return values.reshape(4, 4)
    if element.tag == "translate":
        matrix[:3, 3] = values
    elif element.tag == "scale":
        matrix[:3, :3] = np.diag(values)
    else:
        length = float(np.linalg.norm(values[:3]))
        if length > 0:
            x, y, z = values[:3] / length
            s, c = math.sin(math.radians(values[3])), math.cos(math.radians(values[3]))
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            matrix[:3, :3] = np.eye(3) + s * cross + (1 - c) * cross @ cross
    return matrix


# --- materials

NAME_MAX = 4096  # characters
SHADERS = ("phong", "lambert", "blinn", "constant")


def find_target(ids: Mapping[str, Element], url: str | None) -> Element | None:
    """The element that the URL `#id` refers to, or None."""
    return ids.get(url[1:]) if url and url.startswith("#") else None


class Materials:
    """The materials of one file. A missing texture only gives a note. An opacity of 0 is read as 1, because
    exporters often invert the specification's meaning."""

    def __init__(self, ids: Mapping[str, Element], load: Load, pictures: Pictures, notes: Notes) -> None:
        self._ids = ids
        self._load = load
        self._pictures = pictures
        self._notes = notes
        self._paints: dict[str, Paint | None] = {}  # by URL
        self._effects: dict[int, Paint | None] = {}

    def find_paint(self, url: str) -> Paint | None:
        """The paint of the material that a URL refers to; None if there is no such material or it has no
        paint."""
        if url not in self._paints:
            material = find_target(self._ids, url)
            instance = material.find_first("instance_effect") if material else None
            effect = find_target(self._ids, instance.get("url")) if instance else None
            self._paints[url] = self._of_effect(effect) if effect else None
        return self._paints[url]

    def _of_effect(self, effect: Element) -> Paint | None:
        """The paint of an effect, which is read once for all its materials."""
        if id(effect) not in self._effects:
            self._effects[id(effect)] = self._read_paint(effect)
        return self._effects[id(effect)]

    def _read_paint(self, effect: Element) -> Paint | None:
        profile = effect.find_first("profile_COMMON")
        technique = profile.find_first("technique") if profile else None
        shader = next((c for c in technique.children if c.tag in SHADERS), None) if technique else None
        if profile is None or shader is None:
            return None
        colour = shader.find_first("emission" if shader.tag == "constant" else "diffuse")
        alpha = self._opacity(shader)
        texture = colour.find_first("texture") if colour else None
        if texture is not None:
            picture = self._picture(profile, texture.get("texture") or "")
            return Paint((1.0, 1.0, 1.0, alpha) if picture else (0.8, 0.8, 0.8, alpha), picture)
        color = colour.find_first("color") if colour else None
        if color is None:
            return None
        r, g, b, _ = extract_rgba(color)
        return Paint((r, g, b, alpha))

    def _opacity(self, shader: Element) -> float:
        transparent = shader.find_first("transparent")
        amount = shader.find_first("transparency", "float")
        if transparent is None and amount is None:
            return 1.0
        color = transparent.find_first("color") if transparent else None
        r, g, b, a = extract_rgba(color) if color else (1.0, 1.0, 1.0, 1.0)
        factor = convert_float(amount.text if amount else None, 1.0)
        mode = (transparent.get("opaque") if transparent else None) or "A_ONE"
        light = 0.2126 * r + 0.7152 * g + 0.0722 * b
        alpha = {"RGB_ZERO": 1 - light * factor, "A_ZERO": 1 - a * factor, "RGB_ONE": light * factor}.get(
            mode, a * factor
        )
        if alpha < 0.02:
            self._notes.add("collada-opacity", "a material is fully transparent; read as opaque")
        return alpha if 0.02 <= alpha < 0.98 else 1.0

    def _picture(self, profile: Element, name: str) -> bytes | None:
        """Follow sampler → surface → image, or the image directly, as some exporters write it."""
        params = {p.get("sid") or "": p for p in profile.find_all("newparam")}
        for path in (("sampler2D", "source"), ("surface", "init_from")):
            param = params.get(name)
            inner = param.find_first(*path) if param else None
            if inner is not None:
                name = _name(inner)
        param = params.get(name)
        instance = param.find_first("sampler2D", "instance_image") if param else None  # 1.5
        image = find_target(self._ids, instance.get("url")) if instance else self._ids.get(name)
        source = image.find_first("init_from") if image else None
        ref = source.find_first("ref") if source else None
        file = _name(ref) if ref else _name(source) if source else name.strip()
        try:
            return self._pictures.validate(self._load(file))
        except ModelRefused as e:
            self._notes.add("texture", f"its texture {quote_name(file)}: {e.reason}")
            return None


def _name(element: Element) -> str:
    """The name of a file or parameter, cut to NAME_MAX: many elements may refer to one huge text."""
    return element.text[:NAME_MAX].strip()


# --- lists of numbers

T = TypeVar("T", np.float64, np.int64)


def extract_rgba(element: Element) -> Rgba:
    """The four numbers 0 … 1 in the element; light grey if it does not contain them."""
    values = extract_floats(element)
    if len(values) < 3 or not np.isfinite(values).all():
        return (0.8, 0.8, 0.8, 1.0)
    r, g, b, a = (min(max(float(v), 0.0), 1.0) for v in (*values[:3], values[3] if len(values) > 3 else 1.0))
    return (r, g, b, a)


def extract_floats(element: Element) -> NDArray[np.float64]:
    """All numbers in the element. Raises ModelRefused when it contains anything else."""
    return _numbers(element, np.float64)


def extract_integers(element: Element) -> NDArray[np.int64]:
    """All integers in the element. Raises ModelRefused when it contains anything else."""
    return _numbers(element, np.int64)


def _numbers(element: Element, kind: type[T]) -> NDArray[T]:
    if not element.text or element.text.isspace():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older NumPy only warns about text after the last number
        try:
            return np.fromstring(element.text, kind, sep=" ")
        except (ValueError, OverflowError, DeprecationWarning):
            raise ModelRefused("a list with something other than numbers", element.line) from None


def convert_float(text: str | None, default: float) -> float:
    """Convert a text to a finite number, or return the default when it is not one."""
    try:
        value = float(text) if text is not None else default
    except ValueError:
        return default
    return value if math.isfinite(value) else default
