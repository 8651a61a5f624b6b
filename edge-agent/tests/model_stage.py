"""Meshes and robots for the tests of the model: small, made here, broken on purpose."""

from __future__ import annotations

import io
import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from posecast_edge.model.builder.build import Built, build_model
from posecast_edge.model.meshes.mesh import Mesh
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.urdf.resolver import Resolver

CUBE_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
CUBE_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def _red_picture() -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (4, 4), (255, 0, 0)).save(out, "PNG")
    return out.getvalue()


PICTURE = _red_picture()


def nothing(_done: int, _total: int, _what: str) -> None:
    """No progress wanted."""


def resolver_at(folder: Path) -> Resolver:
    """For meshes that are read without a URDF."""
    return Resolver(folder / "robot.urdf")


def read_mesh_of(folder: Path, name: str, data: bytes, **beside: bytes) -> Mesh:
    """`data` as a mesh file of that name, with files beside it (`a_mtl` is a.mtl). Raises ModelRefused."""
    for other, content in {name: data, **{k.replace("_", "."): v for k, v in beside.items()}}.items():
        (folder / other).write_bytes(content)
    return read_mesh(folder / name, resolver_at(folder))


def build_robot(path: Path, *packages: Path) -> Built:
    """What is built of a URDF, without word of its progress."""
    return build_model(load_robot_file(path, packages), Resolver(path, packages), nothing)


def cube_stl(size: float = 0.2, header: bytes = b"cube") -> bytes:
    """A binary STL of a cube with a corner at 0."""
    triangles = CUBE_CORNERS[CUBE_FACES] * np.float32(size)
    records = b"".join(struct.pack("<3f", 0, 0, 0) + t.astype("<f4").tobytes() + b"\0\0" for t in triangles)
    return header.ljust(80, b"\0") + struct.pack("<I", len(triangles)) + records


def cube_text_stl(size: float = 0.2) -> bytes:
    """The same as text."""
    lines = ["solid cube"]
    for t in CUBE_CORNERS[CUBE_FACES] * size:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in t)]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid cube"]).encode()


def cube_obj(extra: str = "") -> bytes:
    """The same as OBJ, with quads."""
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in CUBE_CORNERS * 0.2)
    quads = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
    return (extra + vertices + quads).encode()


def cube_collada(
    *,
    unit: str = "1",
    up: str = "Z_UP",
    effect: str = "",
    node: str = "",
    geometry: str = "",
    size: float = 0.2,
) -> bytes:
    """The same as Collada. `effect` is the inside of <phong>, `node` of the node before its geometry."""
    positions = " ".join(f"{v:g}" for v in (CUBE_CORNERS * size).reshape(-1))
    faces = " ".join(map(str, CUBE_FACES.reshape(-1)))
    material = (
        '<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong>'
        f"{effect}</phong></technique></profile_COMMON></effect></library_effects>"
        '<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>'
    )
    bind = (
        '<bind_material><technique_common><instance_material symbol="s" target="#m"/></technique_common>'
        "</bind_material>"
    )
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>{up}</up_axis></asset>{material if effect else ""}
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="24">{positions}</float_array><technique_common>
<accessor source="#pa" count="8" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12" material="s"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
</mesh></geometry>{geometry}</library_geometries>
<library_visual_scenes><visual_scene id="scene"><node>{node}
<instance_geometry url="#g">{bind if effect else ""}</instance_geometry></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#scene"/></scene></COLLADA>""".encode()


def cube_glb(
    change: Callable[[dict[str, object]], None] = lambda _document: None, cut: int | None = None
) -> bytes:
    """The same as GLB; `change` may spoil its JSON, `cut` shortens its data."""
    positions = (CUBE_CORNERS * 0.2).astype("<f4").tobytes()
    indices = CUBE_FACES.astype("<u2").tobytes()
    document: dict[str, object] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 36},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
    }
    change(document)
    return pack_glb(document, (positions + indices)[:cut])


def pack_glb(document: dict[str, object], binary: bytes) -> bytes:
    """A GLB of that JSON and that data."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb_document(data: bytes) -> dict[str, Any]:
    """The JSON inside a GLB."""
    document: dict[str, Any] = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    return document


def volume(mesh: Mesh) -> float:
    """Positive for a closed body whose faces look outward."""
    total = 0.0
    for surface in mesh.surfaces:
        a, b, c = (surface.positions[surface.faces[:, k]].astype(np.float64) for k in range(3))
        total += float(np.einsum("nk,nk->n", a, np.cross(b, c)).sum()) / 6
    return total


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    inside: str = '<axis xyz="0 0 1"/>',
    limit: str = "d",
) -> str:
    """A joint; `limit` "d" is a decent one."""
    limit = '<limit lower="-1" upper="1" velocity="1" effort="1"/>' if limit == "d" else limit
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}{limit}</joint>'


def link(name: str, inside: str = '<visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual>') -> str:
    """A link with a box on it."""
    return f'<link name="{name}">{inside}</link>'


def mesh(uri: str, more: str = "") -> str:
    """A visual of a mesh file."""
    return f'<visual><geometry><mesh filename="{uri}"{more}/></geometry></visual>'


def robot(*parts: str) -> str:
    """A URDF, one part on each line: line 2 is the first."""
    return '<robot name="r">\n' + "\n".join(parts) + "\n</robot>\n"


def written(folder: Path, text: str | bytes, **files: bytes) -> Path:
    """The URDF's path, with files beside it in meshes/ (`arm_stl` is meshes/arm.stl)."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / "meshes" / name.replace("_", ".")).write_bytes(data)
    path = folder / "robot.urdf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


ROBOT_OF_ALL = robot(
    '<material name="m"><color rgba="1 0 0 1"/></material>',
    link(
        "a",
        mesh("a.stl", ' scale="1 1 1"')
        + '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>',
    ),
    link("b"),
    link("c"),
    joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin xyz="1 2 3" rpy="0 0 1"/>'),
    joint("k", "b", "c", inside='<axis xyz="0 0 1"/><mimic joint="j" multiplier="2"/>'),
    '<gazebo reference="a"><sensor name="s" type="imu"><pose>0 0 0 0 0 0</pose></sensor></gazebo>',
).encode()  # something of each kind that a URDF may have


# --- what lies beside the checkout in ../shared (robots, trajectories), which may be absent

SHARED = Path(os.environ.get("POSECAST_SHARED") or Path(__file__).parents[3] / "shared")
ROBOTS = {
    "hubo2plus-stl": "hubo2plus-stl/hubo-urdf/model.urdf",
    "hubo2plus-collision": "hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf",
    "hubo2plus-collada": "hubo2plus-collada/hubo-urdf/model.urdf",
    "drchubo": "drchubo-stl/drchubo-urdf/drchubo-v3.urdf",
    "g1": "unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1-hands": "unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
}
# as parameters; in `make test` one with its own meshes, and one drawn by its collision bodies
QUICK = ("g1", "hubo2plus-collision")
TO_BUILD = [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.full]) for name in ROBOTS]


def shared_file(path: str) -> Path:
    """A file of ../shared; the test is skipped where it is not there."""
    file = SHARED / path
    if not file.is_file():
        pytest.skip(f"no ../shared/{path} here")
    return file


def shared_robot(name: str) -> Path:
    """The URDF of one of `ROBOTS`; the test is skipped where it is not there."""
    return shared_file(f"robots/{ROBOTS[name]}")
