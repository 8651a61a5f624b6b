"""Reads glTF 2.0, as GLB or with separate files: triangles, base colours and their pictures.

The mesh keeps glTF's axes, of which y is up; builder/up_axis.py turns them, as RViz does. A problem of a
material never costs the shape: it gives a note, and the material lacks what could not be read.
"""

from __future__ import annotations

import binascii
import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.finding import ModelRefused, make_printable, quote_name
from posecast_edge.model.kinematics import matrix_from_quaternion
from posecast_edge.model.meshes.mesh import (
    GLTF_UP,
    UP_NOTES,
    Expansion,
    Floats,
    Load,
    Mesh,
    Notes,
    Paint,
    Surface,
    clip_to_unit,
    select_used_vertices,
)
from posecast_edge.model.meshes.texture import Pictures

JSON_MAX = 16 << 20
NODES_MAX = 10_000
DEPTH_MAX = 64
# extensions that may be required: those that are read, and those that only change how a surface looks; the
# page has the same list (spa/src/scene/three/gltf.ts)
KNOWN = re.compile(
    r"KHR_mesh_quantization|(KHR|EXT|MSFT|ADOBE|FB|GODOT)_(materials?|texture|lights?|xmp|animation)_?.*"
)
COMPRESSED = re.compile(r"KHR_draco_mesh_compression|(EXT|KHR)_meshopt_compression")
COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


# what malformed JSON raises where something is looked up in it
MALFORMED = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError)


def read_gltf(data: bytes, load: Load, pictures: Pictures | None = None) -> Mesh:
    """Read a file. Raises ModelRefused when it is not glTF or needs an extension that is not read, and one of
    MALFORMED when it is broken."""
    document, binary = _chunks(data) if data[:4] == b"glTF" else (_json(data), None)
    reader = _Reader(document, binary, load, pictures or Pictures(), len(data))
    return Mesh(tuple(reader.surfaces()), reader.notes.list_entries(), "Y_UP", is_up_certain=True)


def _json(text: bytes) -> dict[str, Any]:
    if len(text) > JSON_MAX:
        raise ModelRefused("its JSON is longer than the file, or than 16 MiB")
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        raise ModelRefused("its JSON is invalid") from None
    if not isinstance(document, dict):
        raise ModelRefused("its JSON is invalid")
    return document


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    if len(data) < 20 or data[:4] != b"glTF" or int.from_bytes(data[4:8], "little") != 2:
        raise ModelRefused("not a glTF 2.0 binary")
    length = int.from_bytes(data[12:16], "little")
    if data[16:20] != b"JSON" or length > len(data) - 20 or length > JSON_MAX:
        raise ModelRefused("its JSON is longer than the file, or than 16 MiB")
    document = _json(data[20 : 20 + length])
    at = 20 + length
    binary = b""
    if at + 8 <= len(data) and data[at + 4 : at + 8] == b"BIN\0":
        binary = data[at + 8 : at + 8 + int.from_bytes(data[at : at + 4], "little")]
    return document, binary


class _Reader:
    def __init__(
        self, document: dict[str, Any], binary: bytes | None, load: Load, pictures: Pictures, size: int
    ) -> None:
        """`size`: bytes of the file."""
        self._document = document
        self._load = load
        self._buffers: dict[int, bytes] = {}
        self._binary = binary
        self._pictures = pictures
        self._picture_bytes = size  # limit for all pictures inside it: they do not overlap
        self._looks: dict[int, _Look] = {}
        self._images: dict[int, bytes | None] = {}
        self._places: dict[int, NDArray[np.float64]] = {}  # of nodes, in their parents
        self._parts: dict[int, _Part] = {}  # by the identity of their JSON
        self._expansion = Expansion(size)
        self._visited = 0
        self.notes = Notes()
        self.notes.add(UP_NOTES[1], f"{GLTF_UP}; taken as written")
        unknown = sorted({n for n in document.get("extensionsRequired", []) if not KNOWN.fullmatch(n)})
        if unknown:
            how = "compression" if COMPRESSED.fullmatch(unknown[0]) else "this extension"
            raise ModelRefused(f"it needs {make_printable(unknown[0][:60])}; export it without {how}")

    def surfaces(self) -> Iterator[Surface]:
        document = self._document
        if "scenes" in document:
            roots = document["scenes"][document.get("scene", 0)].get("nodes", [])
        else:
            below = {c for n in document.get("nodes", []) for c in n.get("children", [])}
            roots = [i for i in range(len(document.get("nodes", []))) if i not in below]
        for root in roots:
            yield from self._node(root, np.eye(4), 0)

    def _node(self, index: int, parent: NDArray[np.float64], depth: int) -> Iterator[Surface]:
        self._visited += 1
        if self._visited > NODES_MAX or depth > DEPTH_MAX:
            raise ModelRefused(f"a scene of more than {NODES_MAX:,} nodes, or more than {DEPTH_MAX} deep")
        node = _at(self._document["nodes"], index)
        if index not in self._places:
            self._places[index] = _local(node)
        at = parent @ self._places[index]
        if "mesh" in node:
            for primitive in _at(self._document["meshes"], node["mesh"])["primitives"]:
                part = self._part(primitive)
                if part is not None:
                    yield part.placed(at)
        for child in node.get("children", []):
            yield from self._node(child, at, depth + 1)

    def _part(self, primitive: dict[str, Any]) -> _Part | None:
        """A mesh's primitive, read once even if the scene shows it often; None for points and lines."""
        known = self._parts.get(id(primitive))
        if known is None:
            known = self._parts[id(primitive)] = self._read_part(primitive)
        else:
            self._expansion.add_part(known.triangles)
        return known if known.triangles else None

    def _read_part(self, primitive: dict[str, Any]) -> _Part:
        mode = primitive.get("mode", 4)
        if mode not in (4, 5, 6):
            self._expansion.add_part(0)
            return _Part(0)
        attributes = primitive["attributes"]
        count = len(self._accessor(attributes["POSITION"], 3)[0])
        indices = self._accessor(primitive["indices"], 1)[0] if "indices" in primitive else None
        corners = count if indices is None else len(indices)
        triangles = corners // 3 if mode == 4 else max(corners - 2, 0)
        self._expansion.add_part(triangles)
        if not triangles:
            return _Part(0)
        corners = 3 * triangles if mode == 4 else corners
        numbers = np.arange(corners) if indices is None else indices[:corners, 0].astype(np.int64)
        kept, place = select_used_vertices(numbers, count)
        look = self._look(primitive.get("material"))
        uv = self._uv(attributes, look, kept, count)
        colours = self._colours(attributes, kept, count)
        faces = _faces(place, mode).astype(np.int32)
        positions = self._values(attributes["POSITION"], 3, kept, count)
        return _Part(triangles, positions, faces, uv, look.paint, colours)

    def _uv(
        self, attributes: dict[str, Any], look: _Look, kept: NDArray[np.int64], count: int
    ) -> Floats | None:
        """Texture coordinates (n, 2) of the set that the material's picture uses; None without them."""
        name = f"TEXCOORD_{look.uv_set}"
        if name not in attributes:
            if look.paint is not None and look.paint.texture is not None:
                self.notes.add("texture", f"a texture in it: its mesh has no {name}")
            return None
        try:
            uv = self._values(attributes[name], 2, kept, count)
        except (ModelRefused, *MALFORMED):
            self.notes.add("texture", f"a texture in it: {name} can't be read")
            return None
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is left out later
            return (uv @ look.uv_turn.T + look.uv_offset).astype(np.float32)

    def _colours(self, attributes: dict[str, Any], kept: NDArray[np.int64], count: int) -> Floats | None:
        """Display values (n, 3) of vertices with colours."""
        if "COLOR_0" not in attributes:
            return None
        number = attributes["COLOR_0"]
        width = WIDTHS[_at(self._document["accessors"], number)["type"]]
        if width < 3:
            raise ModelRefused("colours with fewer than three components")
        linear = np.clip(self._values(number, width, kept, count)[:, :3], 0, 1)
        low = linear * 12.92
        return np.where(linear <= 0.0031308, low, 1.055 * linear ** (1 / 2.4) - 0.055).astype(np.float32)

    def _values(self, index: int, width: int, kept: NDArray[np.int64], count: int) -> NDArray[np.float64]:
        """(n, width) values of the kept vertices, of which there are `count` in all."""
        values, normalised = self._accessor(index, width)
        if len(values) != count:
            raise ModelRefused("vertices and their attributes differ in number")
        found = values[kept].astype(np.float64)
        return np.maximum(found / np.iinfo(values.dtype).max, -1.0) if normalised else found

    def _accessor(self, index: int, width: int) -> tuple[NDArray[Any], bool]:
        """(n, width) values as stored, without a copy; and whether they must be normalised."""
        accessor = _at(self._document["accessors"], index)
        if "sparse" in accessor or "bufferView" not in accessor:
            raise ModelRefused("sparse vertices are not supported")
        if WIDTHS[accessor["type"]] != width:
            raise ModelRefused("vertices of the wrong width")
        kind = np.dtype(COMPONENTS[accessor["componentType"]])
        view = _at(self._document["bufferViews"], accessor["bufferView"])
        whole = self._view(view)
        count, offset = _whole(accessor["count"]), _whole(accessor.get("byteOffset", 0))
        stride = _whole(view.get("byteStride", 0)) or width * kind.itemsize
        if count and offset + (count - 1) * stride + width * kind.itemsize > len(whole):
            raise ModelRefused(f"it claims {count:,} vertices, its data has fewer")
        values = np.ndarray((count, width), kind, whole, offset if count else 0, (stride, kind.itemsize))
        return values, bool(accessor.get("normalized"))

    def _view(self, view: dict[str, Any]) -> memoryview:
        data = self._buffer(_whole(view.get("buffer", 0)))
        offset, length = _whole(view.get("byteOffset", 0)), _whole(view["byteLength"])
        if offset + length > len(data):
            raise ModelRefused("it claims more data than it has")
        return memoryview(data)[offset : offset + length]

    def _buffer(self, number: int) -> bytes:
        if number not in self._buffers:
            uri = _at(self._document["buffers"], number).get("uri")
            if uri is None and number == 0 and self._binary is not None:
                self._buffers[number] = self._binary
            else:
                self._buffers[number] = data = self._resource(uri)
                self._expansion.add_bytes(len(data))
        return self._buffers[number]

    def _resource(self, uri: Any) -> bytes:
        """The bytes of a URI: embedded in it, or from a file next to this one."""
        if not isinstance(uri, str):
            raise ModelRefused("it has no data")
        if not uri.startswith("data:"):
            return self._file(uri)
        head, comma, text = uri.partition(",")
        if not comma or not head.endswith(";base64"):
            raise ModelRefused("its embedded data is not base64")
        return binascii.a2b_base64(text)

    def _file(self, uri: str) -> bytes:
        try:
            return self._load(uri)
        except ModelRefused as e:
            raise ModelRefused(f"its file {quote_name(uri, 40)}: {e.reason}") from None

    def _look(self, index: int | None) -> _Look:
        if index is None:
            return PLAIN
        number = _whole(index)
        if number not in self._looks:
            try:
                self._looks[number] = self._read_look(_at(self._document["materials"], number))
            except (ModelRefused, *MALFORMED):
                self.notes.add("material", "a material in it can't be read; it is shown without")
                self._looks[number] = PLAIN
        return self._looks[number]

    def _read_look(self, material: dict[str, Any]) -> _Look:
        pbr, factor, picture = material.get("pbrMetallicRoughness", {}), "baseColorFactor", "baseColorTexture"
        glossy = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
        if glossy is not None:
            pbr, factor, picture = glossy, "diffuseFactor", "diffuseTexture"
        r, g, b, a = (clip_to_unit(float(x)) for x in pbr.get(factor, (1, 1, 1, 1)))
        alpha = a if material.get("alphaMode") == "BLEND" and a >= 0.02 else 1.0
        paint = Paint((_display(r), _display(g), _display(b), alpha))
        if picture not in pbr:
            return _Look(paint)
        try:
            return self._read_texture(paint, pbr[picture])
        except ModelRefused as e:
            self.notes.add("texture", f"a texture in it: {e.reason}")
        except MALFORMED:
            self.notes.add("texture", "a texture in it can't be read")
        return _Look(paint)

    def _read_texture(self, paint: Paint, info: dict[str, Any]) -> _Look:
        """A material with its picture and where that lies."""
        texture = _at(self._document["textures"], info["index"])
        extensions = texture.get("extensions", {})
        webp, ktx = (extensions.get(name, {}) for name in ("EXT_texture_webp", "KHR_texture_basisu"))
        source = webp.get("source", texture.get("source"))
        if source is None:
            raise ModelRefused("a KTX2 picture; export it as PNG or JPEG" if ktx else "it has no picture")
        moved = info.get("extensions", {}).get("KHR_texture_transform", {})
        uv_set = _whole(moved.get("texCoord", info.get("texCoord", 0)))
        angle = float(moved.get("rotation", 0))
        s, c = math.sin(angle), math.cos(angle)
        scale, offset = (np.array(moved.get(k, (d, d)), np.float64) for k, d in (("scale", 1), ("offset", 0)))
        turn = np.array([[c, s], [-s, c]]) * scale.reshape(2)  # counter-clockwise, with v downwards
        return _Look(replace(paint, texture=self._picture(_whole(source))), uv_set, turn, offset.reshape(2))

    def _picture(self, number: int) -> bytes | None:
        if number not in self._images:
            try:
                data = self._image(_at(self._document["images"], number))
                self._images[number] = self._pictures.validate(data)
            except ModelRefused as e:
                self.notes.add("texture", f"a texture in it: {e.reason}")
                self._images[number] = None
        return self._images[number]

    def _image(self, image: dict[str, Any]) -> bytes:
        if "bufferView" not in image:
            return self._resource(image.get("uri"))
        inside = self._view(_at(self._document["bufferViews"], image["bufferView"]))
        self._picture_bytes -= len(inside)
        if self._picture_bytes < 0:
            raise ModelRefused("its pictures together are larger than the file")
        return bytes(inside)


@dataclass(frozen=True)
class _Look:
    """A material: its paint, the set of texture coordinates that its picture uses, and how these are turned
    (2 × 2) and then moved."""

    paint: Paint | None
    uv_set: int = 0
    uv_turn: NDArray[np.float64] = field(default_factory=lambda: np.eye(2))
    uv_offset: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))


PLAIN = _Look(None)  # of a primitive without a material


class _Part(NamedTuple):
    """A primitive in its mesh's own space. Its surfaces share all arrays but the positions."""

    triangles: int
    positions: NDArray[np.float64] = np.empty((0, 3))
    faces: NDArray[np.int32] = np.empty((0, 3), np.int32)
    uv: Floats | None = None
    paint: Paint | None = None
    colours: Floats | None = None

    def placed(self, at: NDArray[np.float64]) -> Surface:
        """The surface placed at `at` (4 x 4); a mirrored one is turned to face outwards."""
        (a, b, c), (d, e, f), (g, h, i) = at[:3, :3].tolist()
        mirrored = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0
        faces = self.faces[:, ::-1] if mirrored else self.faces
        placed = self.positions @ at[:3, :3].T + at[:3, 3]
        with np.errstate(over="ignore"):  # overflows to infinity, which is refused later
            return Surface(placed.astype(np.float32), faces, self.uv, self.paint, self.colours)


def _at(items: list[Any], index: Any) -> Any:
    return items[_whole(index)]


def _whole(number: Any) -> int:
    if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < 1 << 40:
        raise ModelRefused("its glTF is broken: an index or a size is not a whole number")
    return number


def _display(linear: float) -> float:
    """sRGB from linear, 0 … 1 (IEC 61966-2-1)."""
    return 12.92 * linear if linear <= 0.0031308 else 1.055 * linear ** (1 / 2.4) - 0.055


def _local(node: dict[str, Any]) -> NDArray[np.float64]:
    if "matrix" in node:
        matrix = np.array(node["matrix"], np.float64).reshape(4, 4).T
    else:
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        matrix = np.array(
            matrix_from_quaternion(node.get("translation", (0, 0, 0)), (w, x, y, z)), np.float64
        )
        matrix[:3, :3] *= np.array(node.get("scale", (1, 1, 1)), np.float64)
    if not np.isfinite(matrix).all():
        raise ModelRefused("a node with a number that is not finite")
    return matrix


def _faces(indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    if mode == 4:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    i = np.arange(max(len(indices) - 2, 0))
    if mode == 5:
        odd = i % 2
        return indices[np.stack([i + odd, i + 1 - odd, i + 2], axis=1)]
    return indices[np.stack([np.zeros_like(i), i + 1, i + 2], axis=1)]
