"""Mesh files of many kinds, sound, odd and broken: what the edge reads in them.

A file with it holds the page's readers to the same.

`python edge-agent/tests/test_mesh_corpus.py` writes the file anew after a reader or a case has changed.
"""

from __future__ import annotations

import base64
import io
import json
import math
import random
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # when run by itself

import numpy as np
import pytest
from model_stage import CUBE_CORNERS, CUBE_FACES, cube_glb, cube_stl, cube_text_stl, pack_glb, resolver_at
from PIL import Image
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes import mesh as mesh_module
from posecast_edge.model.meshes.mesh import BEYOND_EARS, Mesh, Notes, PolygonCutter, turn_upright
from posecast_edge.model.meshes.reader import read_mesh

FILE = Path(__file__).parent / "mesh_corpus.json"
NO_PICTURES = ("texture", "material-file", "collada-opacity")  # notes that the two readers word on their own


@dataclass(frozen=True)
class Case:
    """`main`: the mesh's file name; `beside`: files it may refer to. `area`: m², `reason`: a piece of the
    refusal, `notes`: the codes, `faces`: as face(); None where the test leaves them to the file."""

    name: str
    main: str
    data: bytes
    beside: Mapping[str, bytes] = field(default_factory=dict)
    area: float | None = None
    reason: str | None = None
    notes: tuple[str, ...] | None = None
    faces: list[float] | None = None


# --- glTF: a square of 1 m × 1 m in x and y, with a picture: its left half red, its right half blue

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
LEFT = np.array([[0.1, 0.1], [0.4, 0.1], [0.4, 0.9], [0.1, 0.9]], "<f4")
RIGHT = LEFT + np.array([0.5, 0], "<f4")


def two_halves(kind: str = "PNG") -> bytes:
    """The picture, 8 × 8."""
    image = Image.new("RGB", (8, 8), (255, 0, 0))
    image.paste((0, 0, 255), (4, 0, 8, 8))
    out = io.BytesIO()
    image.save(out, kind, **({"lossless": True} if kind == "WEBP" else {}))
    return out.getvalue()


Document = dict[str, Any]
PICTURED = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}


def square(change: Callable[[Document], None], picture: bytes | None = None) -> bytes:
    """The square as GLB; `change` changes its JSON."""
    parts = [SQUARE.tobytes(), np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes(), LEFT.tobytes(), RIGHT.tobytes()]
    parts.append(picture if picture is not None else two_halves())
    views, at = [], 0
    for part in parts:
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(part)})
        at += len(part) + -len(part) % 4
    binary = b"".join(part + b"\0" * (-len(part) % 4) for part in parts)
    document: Document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "TEXCOORD_0": 2, "TEXCOORD_1": 3},
                        "indices": 1,
                        "material": 0,
                    }
                ]
            }
        ],
        "materials": [json.loads(json.dumps(PICTURED))],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 4, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 4},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 6},
            {"bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 4},
            {"bufferView": 3, "componentType": 5126, "type": "VEC2", "count": 4},
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    change(document)
    return pack_glb(document, binary)


def textured(info: Document, **more: Any) -> Callable[[Document], None]:
    """With `info` in the material's texture, and `more` at the document's top."""

    def change(document: Document) -> None:
        document["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] |= info
        document.update(more)

    return change


def transform(required: bool = True, uv_set: int | None = None, **values: Any) -> Callable[[Document], None]:
    """With KHR_texture_transform; `uv_set`: that of the texture itself."""
    names = ["KHR_texture_transform"]
    info: Document = {"extensions": {"KHR_texture_transform": values}}
    if uv_set is not None:
        info["texCoord"] = uv_set
    return textured(info, extensionsUsed=names, **({"extensionsRequired": names} if required else {}))


def source_of(extension: str, fallback: bool, required: bool) -> Callable[[Document], None]:
    """With a picture named by an extension, and one named in the ordinary way."""
    texture: Document = {"extensions": {extension: {"source": 0}}} | ({"source": 1} if fallback else {})
    images = [{"bufferView": 4, "mimeType": "image/x"}] * 2
    names: Document = {"extensionsUsed": [extension]} | (
        {"extensionsRequired": [extension]} if required else {}
    )
    return textured({}, textures=[texture], images=images, **names)


def needing(name: str) -> Callable[[Document], None]:
    """Requires an extension, and gives the material an object of it."""

    def change(document: Document) -> None:
        document["extensionsUsed"] = document["extensionsRequired"] = [name]
        document["materials"] = [
            {"pbrMetallicRoughness": {"baseColorFactor": [0, 0.5, 0, 1]}, "extensions": {name: {"x": 1}}}
        ]

    return change


def glossy(**values: Any) -> Callable[[Document], None]:
    """With a colour in KHR_materials_pbrSpecularGlossiness."""

    def change(document: Document) -> None:
        document["extensionsUsed"] = ["KHR_materials_pbrSpecularGlossiness"]
        document["materials"] = [{"extensions": {"KHR_materials_pbrSpecularGlossiness": values}}]

    return change


def material(value: Any) -> Callable[[Document], None]:
    """With this material."""
    return lambda document: document.update(materials=[value])


def at_node(node: Document) -> Callable[[Document], None]:
    """Shown by this node."""
    return lambda document: document.update(nodes=[node])


RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
# which half of the picture the square shows
PICTURES: dict[str, tuple[Callable[[Document], None], bytes | None, tuple[float, float, float] | None]] = {
    "plain": (textured({}), None, RED),
    "offset": (transform(offset=[0.5, 0]), None, BLUE),
    "offset, used only": (transform(required=False, offset=[0.5, 0]), None, BLUE),
    "offset and scale": (transform(offset=[0.5, 0], scale=[0.5, 1]), None, BLUE),
    "scale": (transform(scale=[0.1, 1], offset=[0.55, 0]), None, BLUE),
    "mirrored": (transform(scale=[-1, 1], offset=[1, 0]), None, BLUE),
    "turned by 180°": (transform(rotation=math.pi, offset=[1, 1]), None, BLUE),
    "turned by 90°": (transform(rotation=math.pi / 2, scale=[1, 0.1], offset=[0.6, 0.9]), None, BLUE),
    "turned by 90°, with the second set": (
        transform(rotation=math.pi / 2, scale=[1, 0.1], texCoord=1),
        None,
        RED,
    ),
    "the second set": (textured({"texCoord": 1}), None, BLUE),
    "the first set instead of the second": (transform(uv_set=1, texCoord=0), None, RED),
    "the second set instead of the first": (transform(texCoord=1), None, BLUE),
    "the second set, moved back": (transform(uv_set=1, offset=[-0.5, 0]), None, RED),
    "WebP, required": (source_of("EXT_texture_webp", False, True), two_halves("WEBP"), RED),
    "WebP, used": (source_of("EXT_texture_webp", True, False), two_halves("WEBP"), RED),
    "KTX2 only used": (source_of("KHR_texture_basisu", False, False), b"\xabKTX 20\xbb\r\n\x1a\n", None),
    "KTX2 required": (source_of("KHR_texture_basisu", False, True), b"\xabKTX 20\xbb\r\n\x1a\n", None),
    "KTX2 with another picture": (source_of("KHR_texture_basisu", True, False), None, RED),
    "a texture without a picture": (textured({}, textures=[{}]), None, None),
    "no such texture": (textured({"index": 7}), None, None),
    "no such picture": (textured({}, textures=[{"source": 9}]), None, None),
    "a texture that is a word": (textured({}, textures=["x"]), None, None),
    "a picture that is none": (textured({}), b"nothing of the kind", None),
    "a set that the mesh lacks": (textured({"texCoord": 3}), None, None),
    "a set that is a word": (textured({"texCoord": "one"}), None, None),
    "a transform of words": (transform(offset=["a", "b"]), None, None),
    "a transform of one number": (transform(scale=[1]), None, None),
    "an endless transform": (transform(scale=[1e308, 1e308], offset=[1e308, 1e308]), None, None),
    "diffuse": (glossy(diffuseTexture={"index": 0}), None, RED),
    "diffuse, second set": (glossy(diffuseTexture={"index": 0, "texCoord": 1}), None, BLUE),
}

LOOKS = [
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_volume",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_iridescence",
    "KHR_materials_anisotropy",
    "KHR_materials_emissive_strength",
    "KHR_materials_dispersion",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_diffuse_transmission",
    "KHR_lights_punctual",
    "EXT_lights_image_based",
    "KHR_xmp_json_ld",
    "KHR_texture_basisu",
    "EXT_texture_webp",
    "EXT_texture_avif",
    "MSFT_texture_dds",
    "KHR_animation_pointer",
    "KHR_materials_of_tomorrow",
    "KHR_mesh_quantization",
]
SHAPES = {
    "KHR_draco_mesh_compression": "export it without compression",
    "KHR_meshopt_compression": "export it without compression",
    "KHR_gaussian_splatting": "export it without this extension",
    "EXT_mesh_gpu_instancing": "export it without this extension",
    "VENDOR_something": "export it without this extension",
}


def gltf_cases() -> Iterator[Case]:
    for name, (change, picture, _) in PICTURES.items():
        yield Case(f"glTF picture: {name}", "a.glb", square(change, picture), area=1)
    for name in LOOKS:
        yield Case(f"glTF needs {name}", "a.glb", square(needing(name)), area=1)
    for name, advice in SHAPES.items():
        yield Case(f"glTF needs {name}", "a.glb", square(needing(name)), reason=f"it needs {name}; {advice}")
    colours: dict[str, Any] = {
        "diffuse": {"extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 1, 0, 1]}}},
        "diffuse beside another": {
            "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]},
            "extensions": {"KHR_materials_pbrSpecularGlossiness": {"diffuseFactor": [0, 0.25, 0, 1]}},
        },
        "diffuse without a colour": {"extensions": {"KHR_materials_pbrSpecularGlossiness": {}}},
        "white": {},
        "glass": {"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 0.5]}},
        "opaque whatever its alpha": {"pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 0.5]}},
        "wholly transparent": {
            "alphaMode": "BLEND",
            "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 0]},
        },
        "too bright": {"pbrMetallicRoughness": {"baseColorFactor": [3, -1, 0.5, 1]}},
        "of words": {"pbrMetallicRoughness": {"baseColorFactor": ["a", 0, 0, 1]}},
        "of two numbers": {"pbrMetallicRoughness": {"baseColorFactor": [1, 1]}},
        "a list": {"pbrMetallicRoughness": []},
        "a word": "red",
        "nothing": None,
    }
    for name, value in colours.items():
        yield Case(f"glTF material: {name}", "a.glb", square(material(value)), area=1)
    yield Case("glTF material: no such", "a.glb", square(lambda d: d.update(materials=[])), area=1)
    yield Case("glTF without a scene", "a.glb", square(lambda d: (d.pop("scenes"), d.pop("scene"))), area=1)  # type: ignore[arg-type]
    nodes: list[Document] = [
        {"mesh": 0, "rotation": [0.5, 0.5, 0.5, 0.5], "translation": [1, 2, 3]},
        {"mesh": 0, "scale": [1, 2, 3]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 4, 5, 6, 1]},
        {"mesh": 0, "scale": [-1, 1, 1]},
    ]
    for i, node in enumerate(nodes):
        yield Case(
            f"glTF node {i}: y is up",
            "a.glb",
            square(at_node(node)),
            notes=("gltf-axis",),
        )
    yield Case("a cube as glTF: y is up", "a.glb", cube_glb(), area=0.24, notes=("gltf-axis",))


# --- polygons


Outline = Sequence[tuple[float, float]]


def flat(points: Outline, axes: str = "xy") -> list[tuple[float, ...]]:
    """Points of a plane in space: each axis as in the letters, the third is 0.5."""
    return [tuple({**dict(zip(axes, p, strict=True))}.get(a, 0.5) for a in "xyz") for p in points]


U = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
ARROW = [(0, 0), (2, 1), (0, 2), (1, 1)]
L = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
STAR = [((1 + i % 2) * math.cos(i * math.pi / 5), (1 + i % 2) * math.sin(i * math.pi / 5)) for i in range(10)]
CIRCLE = [(math.cos(i * math.pi / 16), math.sin(i * math.pi / 16)) for i in range(32)]
COMB = [(i // 2, 0.1 if i % 2 else 1 + i % 4) for i in range(1, 60)] + [(30, 0), (0, 0)]
SPIRAL = [
    (r * math.cos(t), r * math.sin(t))
    for r0, ts in ((0, range(60)), (1.2, range(59, -1, -1)))
    for t, r in ((k / 5, r0 + k / 10 + 0.1) for k in ts)
]
CLOSED = [*U, U[0]]
TWICE = [p for p in U for _ in range(2)]
OUTLINES: dict[str, Outline] = {
    "U": U,
    "arrow": ARROW,
    "L": L,
    "star": STAR,
    "circle": CIRCLE,
    "comb": COMB,
    "spiral": SPIRAL,
    "closed": CLOSED,
    "corners twice": TWICE,
    "straight corners": [(0, 0), (1, 0), (2, 0), (2, 2), (1, 2), (0, 2)],
}


def shoelace(points: Outline) -> float:
    """The area of a plane polygon."""
    pairs = zip(points, [*points[1:], points[0]], strict=True)
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs)) / 2


def newell(points: Sequence[tuple[float, ...]]) -> list[float]:
    """Where a polygon faces, m²."""
    corners = np.array(points, np.float64)
    return [float(v) for v in np.cross(corners, np.roll(corners, -1, axis=0)).sum(0) / 2]


def obj_of(points: list[tuple[float, ...]], tab: bool = False) -> bytes:
    """One polygon as OBJ."""
    gap = "\t" if tab else " "
    lines = [f"v{gap}{x!r}{gap}{y!r} {z!r}" for x, y, z in points]
    return "\n".join([*lines, f"f{gap}" + gap.join(str(i + 1) for i in range(len(points)))]).encode() + b"\n"


INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'


def collada_of(
    points: list[tuple[float, ...]], body: str, scene: str = "", asset: str | None = None
) -> bytes:
    """Collada of these positions; `body`: the elements with polygons, with {input} for their input."""
    numbers = " ".join(f"{v!r}" for p in points for v in p)
    given = '<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>' if asset is None else asset
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">{given}
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="pa" count="{3 * len(points)}">{numbers}</float_array>
<technique_common><accessor source="#pa" count="{len(points)}" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{body.replace("{input}", INPUT)}
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="s">
<node id="n">{scene}<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def listed(*numbers: int) -> str:
    return " ".join(map(str, numbers))


SQUARE_3 = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0)]
HOLES: dict[str, list[Outline]] = {
    "one": [[(1, 1), (1, 2), (2, 2), (2, 1)]],
    "turning the other way": [[(1, 1), (2, 1), (2, 2), (1, 2)]],
    "two": [[(0.5, 0.5), (0.5, 1), (1, 1), (1, 0.5)], [(2, 2), (2, 2.5), (2.5, 2.5), (2.5, 2)]],
    "a triangle": [[(1, 1), (1, 2), (2, 1)]],
    "concave": [[(0.5 + x / 2, 0.5 + y / 2) for x, y in L]],
    "many": [
        [(0.2 + i, 0.2 + j), (0.2 + i, 0.6 + j), (0.6 + i, 0.6 + j), (0.6 + i, 0.2 + j)]
        for i in range(3)
        for j in range(3)
    ],
}


def polygon_cases() -> Iterator[Case]:
    for name, outline in OUTLINES.items():
        for axes, turned in (("xy", False), ("zx", True), ("yz", False)):
            points = flat(outline[::-1] if turned else outline, axes)
            area = shoelace(outline)
            facing = newell(points)
            yield Case(f"OBJ polygon: {name} in {axes}", "a.obj", obj_of(points), area=area, faces=facing)
        every = range(len(outline))
        polylist = (
            f"<polylist count='1'>{{input}}<vcount>{len(outline)}</vcount><p>{listed(*every)}</p></polylist>"
        )
        polygons = f"<polygons count='1'>{{input}}<p>{listed(*every)}</p></polygons>"
        for kind, body in (("polylist", polylist), ("polygons", polygons)):
            points, area = flat(outline), shoelace(outline)
            data = collada_of(points, body)
            yield Case(f"Collada {kind}: {name}", "a.dae", data, area=area, faces=newell(points))
    for name, holes in HOLES.items():
        corners = [*SQUARE_3, *(p for hole in holes for p in hole)]
        ends = np.cumsum([4, *map(len, holes)])
        rings = "".join(f"<h>{listed(*range(a, b))}</h>" for a, b in pairwise(ends))
        body = f"<polygons count='1'>{{input}}<ph><p>0 1 2 3</p>{rings}</ph></polygons>"
        area = 9 - sum(map(shoelace, holes))
        yield Case(
            f"Collada hole: {name}", "a.dae", collada_of(flat(corners), body), area=area, faces=[0, 0, area]
        )
        other_way = f"<polygons count='1'>{{input}}<ph><p>3 2 1 0</p>{rings}</ph></polygons>"
        yield Case(
            f"Collada hole, turned: {name}", "a.dae", collada_of(flat(corners, "zx"), other_way), area=area
        )
    mixed = "<polygons count='2'>{input}<p>0 1 2</p><p>0 2 3</p></polygons>"
    yield Case("Collada polygons: two", "a.dae", collada_of(flat(SQUARE_3), mixed), area=9)
    strip = "<tristrips count='1'>{input}<p>0 1 3 2</p></tristrips>"
    yield Case("Collada tristrips", "a.dae", collada_of(flat(SQUARE_3), strip), area=9)
    fans = "<trifans count='1'>{input}<p>0 1 2 3</p></trifans>"
    yield Case("Collada trifans", "a.dae", collada_of(flat(SQUARE_3), fans), area=9)
    several = "".join(
        f"<polylist count='2' material='{m}'>{{input}}<vcount>3 3</vcount><p>0 1 2 0 2 3</p></polylist>"
        for m in "ab"
    )
    yield Case("Collada polylist: two", "a.dae", collada_of(flat(SQUARE_3), several), area=18)
    yield Case("OBJ of a prism", "a.obj", PRISM, area=2 * 0.07 * 1 + 0.05 * 1.6)


BASE = [(x / 10, y / 10) for x, y in U]
PRISM = "\n".join(
    [f"v {x} {y} {z}" for z in (0, 0.05) for x, y in BASE]
    + ["f 8 7 6 5 4 3 2 1", "f 9 10 11 12 13 14 15 16"]
    + [f"f {i + 1} {(i + 1) % 8 + 1} {(i + 1) % 8 + 9} {i + 9}" for i in range(8)]
).encode()

# --- OBJ with its libraries, Collada with its unit

SOUND = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
TWO = {"one.mtl": b"newmtl p\nKd 1 0 0\n", "two words.mtl": b"newmtl q\nKd\t0 1 0\nd 0.5\n"}
FACES = "usemtl p\nf 1 2 3\nusemtl q\nf 1 3 4\n"


def text_cases() -> Iterator[Case]:
    for name, text in {
        "tabs": SOUND.replace(" ", "\t") + "f\t1\t2\t3 4\n",
        "tabs and blanks": "v\t0 0  0\n v \t1 0 0\nv\t 1 1 0\nv 0 1 0\t\nf \t1 2 3 4\n",
        "slashes": SOUND + "vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1 4\n",
        "from the end": SOUND + "f -4 -3 -2 -1\n",
        "a line goes on": SOUND + "f 1 2 \\\n3 4\n",
        "old Mac lines": (SOUND + "f 1 2 3 4\n").replace("\n", "\r"),
        "quarters": SOUND.replace("v ", "v  ") + ["f 1 2 3 4", " a remark\n"][0],
    }.items():
        yield Case(f"OBJ: {name}", "a.obj", text.encode(), area=1)
    for name, libraries in {
        "two libraries on a line": "mtllib one.mtl two words.mtl\n",
        "two libraries on two lines": "mtllib one.mtl\nmtllib two words.mtl\n",
        "tabs between libraries": "mtllib\tone.mtl\ttwo words.mtl\n",
        "a name with blanks": "mtllib two words.mtl\n",
        "shouted": "mtllib one.MTL two words.mtl\n",
        "one is gone": "mtllib gone.mtl one.mtl\n",
        "both are gone": "mtllib gone.mtl lost.mtl\n",
        "none": "",
        "the same twice": "mtllib one.mtl one.mtl\n",
        "without a suffix": "mtllib one two\n",
    }.items():
        yield Case(f"OBJ: {name}", "a.obj", (libraries + SOUND + FACES).encode(), TWO, area=1)
    for unit in (
        "0,01",
        "0.01",
        "1",
        "1,0",
        "2.54e-2",
        "",
        "metre",
        "0",
        "-1",
        "nan",
        "1e99",
        " 0.5 ",
        "1.000,5",
    ):
        asset = f'<asset><unit meter="{unit}"/></asset>'
        body = "<triangles count='1'>{input}<p>0 1 2</p></triangles>"
        yield Case(f"Collada unit {unit!r}", "a.dae", collada_of(flat(SQUARE_3), body, asset=asset))
    yield Case("a text STL", "a.stl", cube_text_stl(), area=0.24)
    yield Case("a binary STL", "a.stl", cube_stl(), area=0.24)
    triangle = "<triangles count='1'>{input}<p>0 1 2</p></triangles>"
    yield Case("Collada without an asset", "a.dae", collada_of(flat(SQUARE_3), triangle, asset=""), area=4.5)
    for tag, inside in (("skew", "45 0 1 0 1 0 0"), ("lookat", "0 0 1 0 0 0 0 1 0")):
        data = collada_of(flat(SQUARE_3), triangle, scene=f"<{tag}>{inside}</{tag}>")
        yield Case(f"Collada {tag}", "a.dae", data, area=4.5, notes=("collada-transform",))


# --- broken files: each is refused by a sentence, or read alike


def broken_cases() -> Iterator[Case]:
    document = json.loads(cube_glb()[20 : 20 + int.from_bytes(cube_glb()[12:16], "little")])
    binary = (CUBE_CORNERS * 0.2).astype("<f4").tobytes() + CUBE_FACES.astype("<u2").tobytes()
    changes: dict[str, Callable[[Document], Any]] = {
        "no accessors": lambda d: d.pop("accessors"),
        "accessors are a word": lambda d: d.update(accessors="x"),
        "no such accessor": lambda d: d["meshes"][0]["primitives"][0].update(indices=9),
        "no position": lambda d: d["meshes"][0]["primitives"][0].update(attributes={}),
        "no such mesh": lambda d: d["nodes"][0].update(mesh=5),
        "no such node": lambda d: d["scenes"][0].update(nodes=[3]),
        "no such view": lambda d: d["accessors"][0].update(bufferView=7),
        "no such buffer": lambda d: d["bufferViews"][0].update(buffer=7),
        "an unknown type": lambda d: d["accessors"][0].update(type="VEC9"),
        "an unknown component": lambda d: d["accessors"][0].update(componentType=1),
        "too many vertices": lambda d: d["accessors"][0].update(count=10_000),
        "too many indices": lambda d: d["accessors"][1].update(count=10_000),
        "a count of words": lambda d: d["accessors"][0].update(count="many"),
        "a view beyond the data": lambda d: d["bufferViews"][0].update(byteOffset=10_000),
        "primitives are missing": lambda d: d["meshes"][0].pop("primitives"),
        "a translation of words": lambda d: d["nodes"][0].update(translation=["a", "b", "c"]),
        "too few vertices for the indices": lambda d: d["accessors"][0].update(count=3),
    }
    for name, change in changes.items():
        changed = json.loads(json.dumps(document))
        change(changed)
        yield Case(f"broken glTF: {name}", "a.glb", pack_glb(changed, binary), reason="")
    for name, data in {
        "cut short": cube_glb()[:60],
        "cut in its data": cube_glb()[:-40],
        "of version 1": b"glTF\1\0\0\0" + cube_glb()[8:],
        "JSON that is a list": pack_glb([], b""),  # type: ignore[arg-type]
        "JSON that is none": cube_glb().replace(b'{"asset"', b'{{asset"'),
        "its header alone": b"glTF\2\0\0\0\x14\0\0\0",
    }.items():
        yield Case(f"broken glTF: {name}", "a.glb", data, reason="")
    for name, text in {
        "a face of words": SOUND + "f a b c\n",
        "a face of fractions": SOUND + "f 1.5 2 3\n",
        "a vertex of words": "v a b c\nf 1 1 1\n",
        "a vertex of two numbers": "v 0 0\n" + SOUND + "f 1 2 3\n",
        "a vertex that is not finite": "v nan 0 0\n" + SOUND + "f 1 2 3\n",
        "a vertex too many": SOUND + "f 1 2 9\n",
        "a vertex before the first": SOUND + "f -9 2 3\n",
        "vertex 0": SOUND + "f 0 0 0\n",
        "no face": SOUND,
        "faces of two corners": SOUND + "f 1 2\n",
    }.items():
        yield Case(f"broken OBJ: {name}", "a.obj", text.encode(), reason="")
    whole = collada_of(
        flat(SQUARE_3), "<polylist count='1'>{input}<vcount>4</vcount><p>0 1 2 3</p></polylist>"
    )
    for name, (old, new) in {
        "a list of words": (b"<p>0 1 2 3</p>", b"<p>a b c d</p>"),
        "a vertex too many": (b"<p>0 1 2 3</p>", b"<p>0 1 2 9</p>"),
        "too many corners": (b"<vcount>4</vcount>", b"<vcount>9</vcount>"),
        "positions of words": (b">0.0 ", b">zero "),
        "no positions": (b'<input semantic="POSITION" source="#p"/>', b""),
        "an element that never ends": (b"</mesh>", b""),
        "no polygons": (b"polylist", b"polyline"),
        "nothing but its root": (whole[whole.index(b"<asset>") : whole.index(b"</COLLADA>")], b""),
    }.items():
        yield Case(f"broken Collada: {name}", "a.dae", whole.replace(old, new), reason="")


CASES = [*gltf_cases(), *polygon_cases(), *text_cases(), *broken_cases()]
assert len({case.name for case in CASES}) == len(CASES)


def read(case: Case, folder: Path) -> Mesh | str:
    """As a bundle shows it, or why it is refused."""
    for name, data in {case.main: case.data, **case.beside}.items():
        (folder / name).write_bytes(data)
    try:
        mesh = read_mesh(folder / case.main, resolver_at(folder))
    except ModelRefused as e:
        return e.reason
    return turn_upright(mesh) if mesh.is_up_certain else mesh


def face(mesh: Mesh) -> list[float]:
    """The sum of its triangles' normals, each as long as the triangle's area, m²: where it faces."""
    corners = np.concatenate([s.positions.astype(np.float64)[s.faces] for s in mesh.surfaces])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return [round(float(v), 6) + 0.0 for v in across.sum(0) / 2]


def measure(mesh: Mesh) -> float:
    """Its area, m²."""
    corners = np.concatenate([s.positions.astype(np.float64)[s.faces] for s in mesh.surfaces])
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(across, axis=1).sum() / 2)


def expected(case: Case, folder: Path) -> dict[str, Any]:
    """What the page must find. `paints`: None where a picture gives the colour."""
    files = {
        name: base64.b64encode(data).decode() for name, data in {case.main: case.data, **case.beside}.items()
    }
    row: dict[str, Any] = {"name": case.name, "main": case.main, "files": files}
    mesh = read(case, folder)
    if isinstance(mesh, str):
        return row | {"reason": mesh}
    low, high = mesh.compute_box()
    paints = sorted({s.paint.rgba if s.paint else () for s in mesh.surfaces})
    pictured = any(s.paint and s.paint.texture for s in mesh.surfaces)
    return row | {
        "area": round(measure(mesh), 6),
        "faces": face(mesh),
        "box": [[round(float(v), 6) for v in corner] for corner in (low, high)],
        "paints": None if pictured else [[round(v, 4) for v in paint] for paint in paints],
        "notes": [note for note in mesh.notes if note[0] not in NO_PICTURES],
    }


def corpus() -> str:
    """The file's text."""
    lines = []
    for case in CASES:
        with TemporaryDirectory() as folder:
            lines.append(json.dumps(expected(case, Path(folder)), ensure_ascii=False))
    return "[\n" + ",\n".join(lines) + "\n]\n"


NO_SENTENCE = re.compile(
    r"Error|Exception|Traceback|object at 0x|undefined|invalid literal|unsupported operand|NoneType"
)


def check_sentences(mesh: Mesh | str) -> None:
    """What is said of a file is written for people, not by an exception."""
    for text in [mesh] if isinstance(mesh, str) else [text for _, text in mesh.notes]:
        assert not NO_SENTENCE.search(text), text


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_what_a_file_is_read_as(case: Case, tmp_path: Path) -> None:
    mesh = read(case, tmp_path)
    check_sentences(mesh)
    if isinstance(mesh, str):
        assert (case.area, case.notes) == (None, None), mesh
        assert (case.reason or "") in mesh
        return
    if case.area is not None:
        assert measure(mesh) == pytest.approx(case.area, rel=1e-5)
    if case.faces is not None:
        assert face(mesh) == pytest.approx(case.faces, rel=1e-5, abs=1e-5)
    if case.notes is not None:
        assert tuple(code for code, _ in mesh.notes) == case.notes


SPOILT = {
    case.name: case
    for case in CASES
    if case.name
    in (
        "a cube as glTF: y is up",
        "glTF picture: offset and scale",
        "OBJ of a prism",
        "OBJ: two libraries on a line",
        "Collada polylist: U",
        "Collada hole: two",
        "a text STL",
        "a binary STL",
    )
}


@pytest.mark.parametrize("name", SPOILT)
def test_whatever_is_spoilt_gives_a_sentence(name: str, tmp_path: Path) -> None:
    """Bytes are cut off, dropped, doubled or replaced, in 60 places."""
    case = SPOILT[name]
    chance = random.Random(name)
    refused = 0
    for _ in range(60):
        data = bytearray(case.data)
        at = chance.randrange(len(data))
        match chance.randrange(4):
            case 0:
                del data[at:]
            case 1:
                del data[at : at + chance.randrange(1, 40)]
            case 2:
                data[at:at] = data[at : at + 40]
            case _:
                data[at] = chance.choice(b'0az"<{[-.\0')
        mesh = read(replace(case, data=bytes(data)), tmp_path)
        check_sentences(mesh)
        refused += isinstance(mesh, str)
    assert refused


@pytest.mark.parametrize("name", PICTURES)
def test_which_half_of_a_picture_is_shown(name: str, tmp_path: Path) -> None:
    change, picture, colour = PICTURES[name]
    mesh = read(Case(name, "a.glb", square(change, picture)), tmp_path)
    assert isinstance(mesh, Mesh)
    [surface] = mesh.surfaces
    if colour is None:
        assert surface.paint is None or surface.paint.texture is None or surface.uv is None
        assert "texture" in [code for code, _ in mesh.notes] or surface.uv is None
        return
    assert surface.paint is not None
    assert surface.paint.texture is not None
    assert surface.uv is not None
    image = Image.open(io.BytesIO(surface.paint.texture)).convert("RGB")
    u, v = (surface.uv[surface.faces].mean(axis=(0, 1)) % 1).tolist()
    assert image.getpixel((int(u * 8), int(v * 8))) == tuple(int(255 * c) for c in colour)


@pytest.mark.parametrize(
    ("options", "scale", "offset"),
    [
        ("", (1, 1), (0, 0)),
        ("-s 2 1 1", (2, 1), (0, 0)),
        ("-s 2", (2, 1), (0, 0)),
        ("-s 0.5 3", (0.5, 3), (0, 0)),
        ("-o 0.25 0 0", (1, 1), (0.25, 0)),
        ("-o 0.25 -0.5", (1, 1), (0.25, -0.5)),
        ("-o 0 0.5 -s 2 2 2", (2, 2), (0, 0.5)),
        ("-s 2 3 -o 0.1 0.2 -clamp on", (2, 3), (0.1, 0.2)),
        ("-bm 2 -s -1 1 1", (-1, 1), (0, 0)),
        ("-s inf 1", (1, 1), (0, 0)),
        ("-clamp on", (1, 1), (0, 0)),
        ("-s nan nan", (1, 1), (0, 0)),
    ],
)
def test_a_picture_of_an_obj_is_scaled_and_moved(
    options: str, scale: tuple[float, float], offset: tuple[float, float], tmp_path: Path
) -> None:
    text = "mtllib a.mtl\n" + SOUND + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl p\nf 1/1 2/2 3/3 4/4\n"
    library = f"newmtl p\nmap_Kd {options} two halves.png\n".encode()
    case = Case("", "a.obj", text.encode(), {"a.mtl": library, "two halves.png": two_halves()})
    mesh = read(case, tmp_path)
    assert isinstance(mesh, Mesh)
    [surface] = mesh.surfaces
    assert surface.uv is not None
    low, high = (surface.uv * (1, -1) + (0, 1)).min(0), (surface.uv * (1, -1) + (0, 1)).max(0)
    ends = np.sort([offset, np.add(offset, scale)], axis=0)
    assert np.allclose([low, high], ends, atol=1e-6)


def test_cutting_ears_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """One polygon too large, or too many: their notches are filled, and that is said once."""
    jagged: Outline = [(i / 2, 1 + i % 2) for i in range(60)] + [(30, 0), (0, 0)]
    corners = np.array(flat(jagged))
    for name, most in (("EARS_MAX", 61), ("EARS_WORK_MAX", 62**2)):
        monkeypatch.setattr(mesh_module, name, most)
        notes = Notes()
        counts = np.array([62, 62, 4])
        square = np.array(flat(SQUARE_3))
        triangles = PolygonCutter(notes).cut(counts, np.concatenate([corners, corners, square]))
        assert triangles.shape == (60 + 60 + 2, 3)
        assert notes.list_entries() == (BEYOND_EARS,)
        monkeypatch.undo()


def test_the_page_is_held_to_what_the_edge_reads() -> None:
    assert FILE.read_text(encoding="utf-8") == corpus(), f"run python {Path(__file__).name}"


if __name__ == "__main__":
    FILE.write_text(corpus(), encoding="utf-8")
