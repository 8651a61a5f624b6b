"""Makes one level of detail: a GLB with every body simplified to the same degree.
docs/reference/model-bundle.md describes it."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.builder.mesh_coder import LodChain, can_pack, pack_attributes, pack_indices
from posecast_edge.model.builder.quantise import Grid, Part, make_grid, pack_part
from posecast_edge.model.kinematics import quaternion_from_rpy
from posecast_edge.model.meshes.mesh import Floats, Paint
from posecast_edge.model.meshes.texture import fit_picture
from posecast_edge.model.urdf.types import Pose

ROUGHNESS = 0.7


@dataclass(frozen=True)
class PaintedLods:
    """A surface's simplified versions and its paint; `mark` is written into the material's extras."""

    ladder: LodChain
    paint: Paint
    mark: str | None = None


@dataclass(frozen=True)
class Body:
    """A mesh shown by one or more visuals, in metres, with the mesh scale applied. `low`, `high`: corners of
    its box."""

    skins: tuple[PaintedLods, ...]
    low: Floats
    high: Floats


@dataclass(frozen=True)
class Placed:
    """One visual: its node, its pose link_from_mesh, and its body."""

    node: str
    pose: Pose
    body: int


@dataclass(frozen=True)
class LodSettings:
    """Settings of a level: degree of simplification, bits along the longest side for positions, pixels along
    a picture's side."""

    step: int
    bits: int
    picture: int


@dataclass(frozen=True)
class Drawn:
    """A body as a level draws it: its grid, and its parts, each with the number of its skin."""

    grid: Grid
    parts: tuple[tuple[int, Part], ...]


@dataclass(frozen=True)
class Level:
    """The GLB file and its content. `triangles` counts drawn triangles: a body shown twice counts twice."""

    data: bytes
    triangles: int
    vertices: int
    error_m: float
    drawn: tuple[Drawn, ...]


def make_level(bodies: Sequence[Body], placed: Sequence[Placed], fineness: LodSettings) -> Level:
    """Make a GLB of all bodies with these settings and one node for each visual."""
    drawn = [_draw(body, fineness) for body in bodies]
    error = max((s.ladder.get_rung(fineness.step)[0] for b in bodies for s in b.skins), default=0.0)
    writer = GlbWriter()
    mesh_of = _write_meshes(writer, bodies, drawn, fineness.picture)
    nodes = [_node(p, drawn[p.body].grid, mesh_of.get(p.body)) for p in placed]
    scene = {"nodes": list(range(len(nodes)))} if nodes else {}
    writer.document |= {"scene": 0, "scenes": [scene]} | ({"nodes": nodes} if nodes else {})
    triangles = sum(len(part.faces) for p in placed for _, part in drawn[p.body].parts)
    vertices = sum(len(part.positions) for d in drawn for _, part in d.parts)
    return Level(writer.encode(), triangles, vertices, error, tuple(drawn))


def _draw(body: Body, fineness: LodSettings) -> Drawn:
    grid = make_grid(body.low, body.high, fineness.bits)
    parts = []
    for number, skin in enumerate(body.skins):
        part = pack_part(skin.ladder.surface, skin.ladder.get_rung(fineness.step)[1], grid)
        if len(part.faces):
            parts.append((number, part))
    return Drawn(grid, tuple(parts))


def _write_meshes(
    writer: GlbWriter, bodies: Sequence[Body], drawn: Sequence[Drawn], picture: int
) -> dict[int, int]:
    """The glTF mesh of each body; none for a body without remaining triangles."""
    parts = [part for d in drawn for _, part in d.parts]
    if not parts:
        return {}
    vertices = sum(len(p.positions) for p in parts)
    shared = _shared(writer, parts)
    starts = np.cumsum([0, *(len(p.positions) for p in parts)]).tolist()
    indices = [
        p.faces.reshape(-1).astype(np.uint32) + np.uint32(s) for p, s in zip(parts, starts, strict=False)
    ]
    view = writer.add_index_view(np.concatenate(indices), vertices)
    materials = _Materials(writer, picture)
    meshes: list[dict[str, Any]] = []
    mesh_of: dict[int, int] = {}
    number = offset = 0
    for i, (body, d) in enumerate(zip(bodies, drawn, strict=True)):
        primitives = []
        for skin, part in d.parts:
            slot = writer.add_accessor(view, UINT, "SCALAR", part.faces.size, {"byteOffset": offset})
            offset += 4 * part.faces.size
            attributes = {k: v for k, v in shared.items() if k != "TEXCOORD_0" or part.uv is not None}
            primitives.append(
                {
                    "attributes": attributes,
                    "indices": slot,
                    "material": materials.number(body.skins[skin]),
                    "extras": {"first": starts[number], "count": len(part.positions)},
                }
            )
            number += 1
        if primitives:
            mesh_of[i] = len(meshes)
            meshes.append({"primitives": primitives})
    writer.document |= {"meshes": meshes} | materials.members()
    return mesh_of


def _shared(writer: GlbWriter, parts: Sequence[Part]) -> dict[str, int]:
    """The accessors of all vertices."""
    positions = np.concatenate([p.positions for p in parts])
    count, corners = len(positions), positions[:, :3]
    box = {"min": corners.min(0).tolist(), "max": corners.max(0).tolist()}
    normals = np.concatenate([p.normals for p in parts])
    shared = {
        "POSITION": writer.add_accessor(writer.add_attribute_view(positions), SHORT, "VEC3", count, box),
        "NORMAL": writer.add_accessor(
            writer.add_attribute_view(normals), BYTE, "VEC3", count, {"normalized": True}
        ),
    }
    if any(p.uv is not None for p in parts):
        uv = [np.zeros((len(p.positions), 2), np.float32) if p.uv is None else p.uv for p in parts]
        shared["TEXCOORD_0"] = writer.add_accessor(
            writer.add_attribute_view(np.concatenate(uv)), FLOAT, "VEC2", count, {}
        )
    return shared


def _node(placed: Placed, grid: Grid, mesh: int | None) -> dict[str, Any]:
    """link_from_mesh and metres from grid, in one."""
    w, x, y, z = quaternion_from_rpy(placed.pose.rpy)
    turned = _turned(grid.centre.tolist(), (w, x, y, z))
    translation = [_short(a + b) for a, b in zip(placed.pose.xyz, turned, strict=True)]
    node: dict[str, Any] = {"name": placed.node} | ({} if mesh is None else {"mesh": mesh})
    node |= {"translation": translation} if any(translation) else {}
    node |= {"rotation": [_short(v) for v in (x, y, z, w)]} if (x, y, z) != (0, 0, 0) else {}
    return node | {"scale": [_short(grid.step)] * 3}


def _turned(v: Sequence[float], q: tuple[float, float, float, float]) -> list[float]:
    w, u = q[0], np.array(q[1:])
    twice = 2 * np.cross(u, v)
    turned: list[float] = (np.array(v) + w * twice + np.cross(u, twice)).tolist()
    return turned


def _short(value: float) -> float:
    """Round to nine digits: a tenth of a nanometre in a metre."""
    return float(f"{value:.9g}")


class _Materials:
    """Each paint once, in the order of use."""

    def __init__(self, writer: GlbWriter, picture: int) -> None:
        self._writer = writer
        self._picture = picture
        self._numbers: dict[tuple[Paint, str | None], int] = {}
        self._images: dict[bytes, int] = {}
        self._document: dict[str, list[dict[str, Any]]] = {"materials": [], "textures": [], "images": []}

    def number(self, skin: PaintedLods) -> int:
        key = (skin.paint, skin.mark)
        if key not in self._numbers:
            self._numbers[key] = len(self._numbers)
            self._document["materials"].append(self._material(skin))
        return self._numbers[key]

    def members(self) -> dict[str, Any]:
        """For the document."""
        return {name: items for name, items in self._document.items() if items}

    def _material(self, skin: PaintedLods) -> dict[str, Any]:
        r, g, b, a = skin.paint.rgba
        color = [round(_linear(v), 5) for v in (r, g, b)] + [round(a, 4)]
        pbr: dict[str, Any] = {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": ROUGHNESS}
        if skin.paint.texture is not None:
            pbr["baseColorTexture"] = {"index": self._texture(skin.paint.texture)}
        material: dict[str, Any] = {"pbrMetallicRoughness": pbr, "doubleSided": True}
        material |= {"alphaMode": "BLEND"} if a < 1 else {}
        return material | ({"extras": {skin.mark: True}} if skin.mark else {})

    def _texture(self, data: bytes) -> int:
        if data not in self._images:
            picture = fit_picture(data, self._picture)
            self._images[data] = len(self._document["images"])
            image = {"bufferView": self._writer.add_raw_view(picture.data), "mimeType": picture.type}
            self._document["images"].append(image)
            self._document["textures"].append({"source": self._images[data]})
        return self._images[data]


def _linear(display: float) -> float:
    """Linear light from sRGB, 0 … 1 (IEC 61966-2-1)."""
    return display / 12.92 if display <= 0.04045 else ((display + 0.055) / 1.055) ** 2.4


# --- the file, binary glTF 2.0: packed (EXT_meshopt_compression) if meshoptimizer is installed

FLOAT, BYTE, SHORT, UINT = 5126, 5120, 5122, 5125
PACKING = ("EXT_meshopt_compression",) if can_pack() else ()


class GlbWriter:
    """Collects buffer views; `document` is the rest of the glTF JSON."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "posecast-edge"},
            "extensionsUsed": [*PACKING, "KHR_mesh_quantization"],
            "extensionsRequired": [*PACKING, "KHR_mesh_quantization"],
        }
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._binary = bytearray()
        self._plain = 0  # bytes that the compressed views have when unpacked

    def add_raw_view(self, data: bytes) -> int:
        """Add an uncompressed view, for pictures, and return its number."""
        offset = self._append(data)
        self._views.append({"buffer": 0, "byteOffset": offset, "byteLength": len(data)})
        return len(self._views) - 1

    def add_attribute_view(self, values: NDArray[Any]) -> int:
        """Add a view of values (n, k), packed where possible, and return its number. A row must be a multiple
        of 4 bytes."""
        if not PACKING:
            number = self.add_raw_view(values.tobytes())
            self._views[number]["byteStride"] = values.strides[0]
            return number
        return self._compressed(pack_attributes(values), len(values), values.strides[0], "ATTRIBUTES")

    def add_index_view(self, indices: NDArray[np.uint32], vertices: int) -> int:
        """Add a view of triangle indices, packed where possible, and return its number."""
        if not PACKING:
            return self.add_raw_view(indices.astype("<u4").tobytes())
        return self._compressed(pack_indices(indices, vertices), len(indices), 4, "TRIANGLES")

    def add_accessor(self, view: int, component: int, kind: str, count: int, more: Mapping[str, Any]) -> int:
        """Add an accessor of a view and return its number."""
        self._accessors.append(
            {"bufferView": view, "componentType": component, "type": kind, "count": count, **more}
        )
        return len(self._accessors) - 1

    def _compressed(self, data: bytes, count: int, stride: int, mode: str) -> int:
        offset = self._append(data)
        view: dict[str, Any] = {"buffer": 1, "byteOffset": self._plain, "byteLength": count * stride}
        if mode == "ATTRIBUTES":
            view["byteStride"] = stride
        how = {"buffer": 0, "byteOffset": offset, "byteLength": len(data)}
        view["extensions"] = {
            "EXT_meshopt_compression": {**how, "byteStride": stride, "count": count, "mode": mode}
        }
        self._plain += -(-count * stride // 4) * 4
        self._views.append(view)
        return len(self._views) - 1

    def _append(self, data: bytes) -> int:
        offset = len(self._binary)
        self._binary += data + b"\0" * (-len(data) % 4)
        return offset

    def encode(self) -> bytes:
        """The whole GLB file."""
        fallback = {"byteLength": self._plain, "extensions": {"EXT_meshopt_compression": {"fallback": True}}}
        document = {
            **self.document,
            "buffers": [{"byteLength": len(self._binary)}, *([fallback] if PACKING else [])],
            "bufferViews": self._views,
            "accessors": self._accessors,
        }
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(self._binary), b"BIN\0") + bytes(self._binary)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
