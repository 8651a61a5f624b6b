"""Collada (1.4 and 1.5): triangles, materials and the scene they stand in.

As RViz does: <unit> is applied, <up_axis> ignored (exporters write it and rotate the vertices as well). An
opacity of 0 is read as 1: exporters mean the opposite of what the specification says.
"""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mesh import TEXT_MAX, TRIANGLES_MAX, Mesh, Paint, Rgba, Surface, fans
from posecast_edge.model.obj import Load
from posecast_edge.model.texture import checked_picture
from posecast_edge.model.xml_tree import Element, read_xml

ELEMENTS_MAX = 200_000
DEPTH_MAX = 64
INSTANCES_MAX = 10_000

T = TypeVar("T", np.float64, np.int64)

Transform = NDArray[np.float64]
SHADERS = ("phong", "lambert", "blinn", "constant")


@dataclass(frozen=True)
class _Piece:
    """Triangles of one material symbol: (m, 3) corners into positions; uv and colour per corner."""

    symbol: str
    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64] | None  # (m, 3, 2)
    colours: NDArray[np.float64] | None  # (m, 3, 3)


def read_collada(data: bytes, load: Load, keep_uv: bool = False) -> Mesh:
    """ModelRefused when it is none; a missing texture only costs the texture. `keep_uv`: also without one."""
    root = read_xml(
        io.BytesIO(data), bytes_max=TEXT_MAX, elements_max=ELEMENTS_MAX, depth_max=DEPTH_MAX, texts=True
    )
    if root.tag.rpartition(":")[2] != "COLLADA":
        raise ModelRefused(f"its root is <{root.tag[:40]}>, not <COLLADA>", root.line)
    return _Reader(root, load, keep_uv).mesh()


class _Reader:
    def __init__(self, root: Element, load: Load, keep_uv: bool) -> None:
        self._root = root
        self._load = load
        self._keep_uv = keep_uv
        self._notes: list[tuple[str, str]] = []
        self._ids: dict[str, Element] = {}
        self._pieces: dict[int, list[_Piece]] = {}
        self._paints: dict[str, Paint | None] = {}
        self._instances = 0
        self._triangles = 0
        waiting = [root]
        while waiting:
            element = waiting.pop()
            element.tag = element.tag.rpartition(":")[2]
            if identity := element.get("id"):
                self._ids.setdefault(identity, element)
            waiting += reversed(element.children)

    def mesh(self) -> Mesh:
        unit = self._root.first("asset", "unit")
        metre = _float(unit.get("meter") if unit else None, 1.0)
        if not 1e-9 < metre < 1e9:
            raise ModelRefused(f"its unit is {metre:g} m")
        if metre != 1:
            self._note("collada-unit", f"its unit is {metre:g} m; applied")
        axis = self._root.first("asset", "up_axis")
        if axis is not None and axis.text.strip() not in ("", "Z_UP"):
            self._note("collada-axis", f"it says {axis.text.strip()[:10]}; ignored, as RViz does")
        scene = self._root.first("scene", "instance_visual_scene")
        visual = self._target(scene.get("url") if scene else None) or self._root.first(
            "library_visual_scenes", "visual_scene"
        )
        base = np.diag([metre, metre, metre, 1.0])
        if visual is not None:
            surfaces = [s for node in visual.all("node") for s in self._node(node, base, 0)]
        else:
            library = self._root.first("library_geometries")
            surfaces = [s for g in (library.children if library else []) for s in self._geometry(g, base, {})]
        return Mesh(tuple(surfaces), tuple(self._notes))

    def _note(self, code: str, text: str) -> None:
        if (code, text) not in self._notes and len(self._notes) < 20:
            self._notes.append((code, text))

    def _target(self, url: str | None) -> Element | None:
        return self._ids.get(url[1:]) if url and url.startswith("#") else None

    # ---- scene ----

    def _node(self, node: Element, parent: Transform, depth: int) -> Iterator[Surface]:
        self._count(depth)
        at = parent
        for child in node.children:
            at = at @ _transform(child)
        for child in node.children:
            target = self._target(child.get("url"))
            if child.tag == "node":
                yield from self._node(child, at, depth + 1)
            elif child.tag == "instance_node" and target is not None:
                yield from self._node(target, at, depth + 1)
            elif child.tag == "instance_geometry" and target is not None:
                yield from self._geometry(target, at, _bindings(child))
            elif child.tag == "instance_controller" and target is not None:
                yield from self._controlled(target, at, _bindings(child), 0)

    def _controlled(
        self, controller: Element, at: Transform, bound: dict[str, str], depth: int
    ) -> Iterator[Surface]:
        """A skinned or morphed shape as it was bound: URDF moves bodies, not bones."""
        self._count(depth)
        how = controller.first("skin") or controller.first("morph")
        source = self._target(how.get("source")) if how else None
        if how is None or source is None:
            return
        bind = how.first("bind_shape_matrix")
        values = _floats(bind) if bind else np.zeros(0)
        if len(values) == 16 and np.isfinite(values).all():
            at = at @ values.reshape(4, 4)
        if source.tag == "controller":
            yield from self._controlled(source, at, bound, depth + 1)
        else:
            yield from self._geometry(source, at, bound)

    def _geometry(self, geometry: Element, at: Transform, bound: dict[str, str]) -> Iterator[Surface]:
        self._count(0)
        if id(geometry) not in self._pieces:
            self._pieces[id(geometry)] = list(self._read_pieces(geometry))
        for piece in self._pieces[id(geometry)]:
            self._triangles += len(piece.faces)
            if self._triangles > TRIANGLES_MAX:
                raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
            paint = self._paint(bound.get(piece.symbol) or (f"#{piece.symbol}" if piece.symbol else ""))
            textured = self._keep_uv or (paint is not None and paint.texture is not None)
            yield _placed(piece, at, paint, textured)

    def _count(self, depth: int) -> None:
        self._instances += 1
        if self._instances > INSTANCES_MAX or depth > DEPTH_MAX:
            raise ModelRefused(f"a scene of more than {INSTANCES_MAX:,} nodes, or more than {DEPTH_MAX} deep")

    # ---- geometry ----

    def _read_pieces(self, geometry: Element) -> Iterator[_Piece]:
        mesh = geometry.first("mesh")
        for element in mesh.children if mesh else ():
            if element.tag not in ("triangles", "polylist", "polygons", "tristrips", "trifans"):
                continue
            inputs = self._inputs(element)
            if "POSITION" not in inputs:
                continue
            stride = max(offset for offset, _ in inputs.values()) + 1
            numbers, corners = _corners(element, stride)
            if not len(corners):
                continue
            offset, source = inputs["POSITION"]
            positions = self._source(source, 3)
            uv, colours = (
                self._of_corners(inputs, semantic, width, numbers, corners)
                for semantic, width in (("TEXCOORD", 2), ("COLOR", 3))
            )
            yield _Piece(element.get("material") or "", positions, numbers[corners, offset], uv, colours)

    def _of_corners(
        self,
        inputs: dict[str, tuple[int, Element]],
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

    def _inputs(self, element: Element) -> dict[str, tuple[int, Element]]:
        """Offset and source by semantic; the first set of each."""
        found: dict[str, tuple[int, Element]] = {}
        for entry in element.all("input"):
            offset = int(_float(entry.get("offset"), 0))
            target = self._target(entry.get("source"))
            if not 0 <= offset < 64 or target is None:
                continue
            semantic = entry.get("semantic") or ""
            if semantic == "VERTEX":
                for inner in target.all("input"):
                    if (inner_target := self._target(inner.get("source"))) is not None:
                        found.setdefault(inner.get("semantic") or "", (offset, inner_target))
            found.setdefault(semantic, (offset, target))
        return found

    def _source(self, source: Element, width: int) -> NDArray[np.float64]:
        """(n, width) floats; ModelRefused when the array is shorter than it says."""
        accessor = source.first("technique_common", "accessor")
        array = self._target(accessor.get("source") if accessor else None) or source.first("float_array")
        if array is None:
            raise ModelRefused("vertices without numbers", source.line)
        values = _floats(array)
        stride = int(_float(accessor.get("stride") if accessor else None, width))
        offset = int(_float(accessor.get("offset") if accessor else None, 0))
        if not width <= stride <= 256 or not 0 <= offset <= len(values):
            raise ModelRefused("vertices of an impossible stride", source.line)
        rows = (len(values) - offset) // stride
        return values[offset : offset + rows * stride].reshape(rows, stride)[:, :width]

    # ---- materials ----

    def _paint(self, url: str) -> Paint | None:
        if url not in self._paints:
            self._paints[url] = self._read_paint(url)
        return self._paints[url]

    def _read_paint(self, url: str) -> Paint | None:
        material = self._target(url)
        instance = material.first("instance_effect") if material else None
        effect = self._target(instance.get("url")) if instance else None
        profile = effect.first("profile_COMMON") if effect else None
        technique = profile.first("technique") if profile else None
        shader = next((c for c in technique.children if c.tag in SHADERS), None) if technique else None
        if profile is None or shader is None:
            return None
        colour = shader.first("emission" if shader.tag == "constant" else "diffuse")
        alpha = self._opacity(shader)
        texture = colour.first("texture") if colour else None
        if texture is not None:
            picture = self._picture(profile, texture.get("texture") or "")
            return Paint((1.0, 1.0, 1.0, alpha) if picture else (0.8, 0.8, 0.8, alpha), picture)
        color = colour.first("color") if colour else None
        if color is None:
            return None
        r, g, b, _ = _rgba(color)
        return Paint((r, g, b, alpha))

    def _opacity(self, shader: Element) -> float:
        transparent = shader.first("transparent")
        amount = shader.first("transparency", "float")
        if transparent is None and amount is None:
            return 1.0
        color = transparent.first("color") if transparent else None
        r, g, b, a = _rgba(color) if color else (1.0, 1.0, 1.0, 1.0)
        factor = _float(amount.text if amount else None, 1.0)
        mode = (transparent.get("opaque") if transparent else None) or "A_ONE"
        light = 0.2126 * r + 0.7152 * g + 0.0722 * b
        alpha = {"RGB_ZERO": 1 - light * factor, "A_ZERO": 1 - a * factor, "RGB_ONE": light * factor}.get(
            mode, a * factor
        )
        if alpha < 0.02:
            self._note("collada-opacity", "a material is fully transparent; read as opaque")
        return alpha if 0.02 <= alpha < 0.98 else 1.0

    def _picture(self, profile: Element, name: str) -> bytes | None:
        """sampler → surface → image, or the image at once, as some exporters write it."""
        params = {p.get("sid") or "": p for p in profile.all("newparam")}
        for path in (("sampler2D", "source"), ("surface", "init_from")):
            param = params.get(name)
            inner = param.first(*path) if param else None
            if inner is not None:
                name = inner.text.strip()
        param = params.get(name)
        instance = param.first("sampler2D", "instance_image") if param else None  # 1.5
        image = self._target(instance.get("url")) if instance else self._ids.get(name)
        source = image.first("init_from") if image else None
        ref = source.first("ref") if source else None
        file = (ref.text if ref else source.text if source else name).strip()
        try:
            return checked_picture(self._load(file))
        except ModelRefused as e:
            self._note("texture", f"its texture {file[:80]!r}: {e.reason}")
            return None


def _bindings(instance: Element) -> dict[str, str]:
    common = instance.first("bind_material", "technique_common")
    return {e.get("symbol") or "": e.get("target") or "" for e in (common.children if common else ())}


def _placed(piece: _Piece, at: Transform, paint: Paint | None, textured: bool) -> Surface:
    positions = piece.positions @ at[:3, :3].T + at[:3, 3]
    faces, uv, colours = piece.faces, piece.uv if textured else None, piece.colours
    if faces.min() < 0 or faces.max() >= len(positions):
        raise ModelRefused("a triangle names a vertex that there is not")
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


def _corners(element: Element, stride: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """All corners' indices (n, stride), and the triangles (m, 3) as numbers of corners."""
    lists = [_ints(p) for p in element.all("p")]
    for hole in element.all("ph"):
        lists += [_ints(p) for p in hole.all("p")]
    numbers = np.concatenate(lists) if lists else np.zeros(0, np.int64)
    if any(len(x) % stride for x in lists):
        raise ModelRefused("a list of corners ends within a corner", element.line)
    numbers = numbers.reshape(-1, stride)
    lengths = np.array([len(x) // stride for x in lists], np.int64)
    if element.tag == "triangles":
        return numbers, np.arange(len(numbers) // 3 * 3).reshape(-1, 3)
    if element.tag == "polylist":
        vcount = element.first("vcount")
        counts = _ints(vcount) if vcount else np.zeros(0, np.int64)
        if len(counts) and (counts.min() < 0 or counts.sum() > len(numbers)):
            raise ModelRefused("polygons of more corners than there are", element.line)
        return numbers, fans(counts)
    if element.tag in ("polygons", "trifans"):
        return numbers, fans(lengths)
    strips = []
    for first, length in zip(np.cumsum(lengths) - lengths, lengths, strict=True):
        i = np.arange(max(length - 2, 0)) + first
        odd = (i - first) % 2
        strips.append(np.stack([i + odd, i + 1 - odd, i + 2], axis=1))
    return numbers, np.concatenate(strips) if strips else np.zeros((0, 3), np.int64)


def _transform(element: Element) -> Transform:
    matrix = np.eye(4)
    if element.tag not in ("matrix", "translate", "rotate", "scale"):
        return matrix
    values = _floats(element)
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


def _rgba(element: Element) -> Rgba:
    values = _floats(element)
    if len(values) < 3 or not np.isfinite(values).all():
        return (0.8, 0.8, 0.8, 1.0)
    r, g, b, a = (min(max(float(v), 0.0), 1.0) for v in (*values[:3], values[3] if len(values) > 3 else 1.0))
    return (r, g, b, a)


def _floats(element: Element) -> NDArray[np.float64]:
    return _numbers(element, np.float64)


def _ints(element: Element) -> NDArray[np.int64]:
    return _numbers(element, np.int64)


def _numbers(element: Element, kind: type[T]) -> NDArray[T]:
    if not element.text or element.text.isspace():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # older numpy only warns of what follows the last number
        try:
            return np.fromstring(element.text, kind, sep=" ")
        except (ValueError, OverflowError, DeprecationWarning):
            raise ModelRefused("a list of numbers that are none", element.line) from None


def _float(text: str | None, default: float) -> float:
    try:
        value = float(text) if text is not None else default
    except ValueError:
        return default
    return value if math.isfinite(value) else default
