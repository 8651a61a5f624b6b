"""Parsers of meshes that are lists, and of what is built of them, with the worst input that is known."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
from model_stage import PICTURE, cube_obj, cube_stl, cube_text_stl
from parser_stage import Input, Parser, Work, Worst, written
from PIL import Image
from posecast_edge.model.builder.mesh_coder import LodChain, weld_vertices
from posecast_edge.model.builder.quantise import make_grid, pack_part
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.urdf.resolver import Resolver


def mesh_work(name: str) -> Callable[[Input, Path], Work]:
    """The file as a robot's mesh."""

    def prepare(given: Input, folder: Path) -> Work:
        path = written(given, folder, name)
        return lambda: read_mesh(path, Resolver(folder / "robot.urdf"), True)

    return prepare


def level_work(given: Input, folder: Path) -> Work:
    """What is built of a mesh: welded, simplified, packed."""
    path = written(given, folder, "a.obj")

    def work() -> None:
        for surface in read_mesh(path, Resolver(folder / "robot.urdf")).surfaces:
            whole = weld_vertices(surface)
            low, high = whole.positions.min(0), whole.positions.max(0)
            faces = LodChain(whole, 1.0, 1.0, 30).get_rung(12)[1]
            pack_part(whole, faces, make_grid(low, high, 14))

    return work


def plain(values: Iterable[object]) -> str:
    return " ".join(map(str, values))


def png(side: int) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (side, side), (255, 0, 0)).save(out, "PNG")
    return out.getvalue()


VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def obj_groups(n: int) -> bytes:
    return (
        VERTICES + "v 1 1 1\n" * (20 * n) + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(n // 2))
    ).encode()


def obj_polygon(n: int) -> bytes:
    angle = 2 * np.pi * np.arange(n) / n
    corners = "".join(f"v {x:.6f} {y:.6f} 0\n" for x, y in zip(np.cos(angle), np.sin(angle), strict=True))
    return (corners + "f " + plain(range(1, n + 1)) + "\n").encode()


def obj_book(n: int) -> bytes:
    """Leaves that share an edge."""
    angle = 2 * np.pi * np.arange(n) / n
    corners = "".join(f"v {x:.6f} {y:.6f} 0\n" for x, y in zip(np.cos(angle), np.sin(angle), strict=True))
    return f"v 0 0 0\nv 0 0 1\n{corners}{''.join(f'f 1 2 {i + 3}{chr(10)}' for i in range(n))}".encode()


def obj_libraries(n: int) -> Input:
    library = "".join(f"newmtl m{i}\n" for i in range(n)).encode()
    return Input(("mtllib a.mtl\n" * n + VERTICES + "f 1 2 3\n").encode(), {"a.mtl": library})


def mtl_pictures(n: int) -> Input:
    library = "".join(f"newmtl m{i}\nmap_Kd a.png\n" for i in range(n)).encode()
    return Input(cube_obj("mtllib a.mtl\nusemtl m0\n"), {"a.mtl": library, "a.png": png(n)})


OBJ = cube_obj("mtllib a.mtl\nusemtl m\nvt 0 0\nvt 1 1\n") + b"usemtl k\nf 1/1 2/2 4/1\nf -1/-1 -2/-2 -3\n"
MTL = b"newmtl m\nKd 1 0 0\nd 0.5\nTr 0.1\nmap_Kd -s 1 1 1 a.png\nnewmtl k\nKd 0 0 0\n"


def mtl_work(given: Input, folder: Path) -> Work:
    """A library of a good mesh, with a picture beside it."""
    beside = {"a.mtl": given.data, "a.png": PICTURE}
    return mesh_work("a.obj")(Input(cube_obj("mtllib a.mtl\nusemtl m\n"), beside), folder)


REFUSED = (ModelRefused,)
PARSERS = (
    Parser(
        "obj",
        ("model.meshes.obj.read_obj", "model.meshes.reader.read_mesh", "model.meshes.mesh.validate_mesh"),
        mesh_work("a.obj"),
        REFUSED,
        (OBJ, cube_obj(), cube_obj().replace(b".2\n", b".2 1 0 0\n")),
        {
            "materials": Worst(obj_groups, 300),
            "one polygon": Worst(obj_polygon, 1000),
            "one library many times": Worst(obj_libraries, 300),
            "one picture many times": Worst(mtl_pictures, 64),
            "vertices": Worst(lambda n: b"v 0 0 0\n" * n + b"f 1 1 1\n", 2000),
            "a line of blanks": Worst(lambda n: (VERTICES + "f 1 2 3" + " " * n + "\n").encode(), 50_000),
            "lines that go on": Worst(lambda n: (VERTICES + "f 1 2 3" + "\\\n" * n).encode(), 20_000),
            "slashes": Worst(lambda n: (VERTICES + "f 1" + "/1" * n + " 2 3\n").encode(), 20_000),
        },
    ),
    Parser(
        "mtl",
        ("model.urdf.resolver.read_bounded",),
        mtl_work,
        REFUSED,
        (MTL,),
        {
            "materials": Worst(lambda n: b"newmtl m\nKd 1 0 0\n" * n, 500),
            "one picture many times": Worst(lambda n: b"newmtl m\n" + b"map_Kd a.png\n" * n, 200),
            "options": Worst(lambda n: b"newmtl m\nmap_Kd" + b" -s 1 1 1" * n + b" a.png\n", 1000),
            "blanks": Worst(lambda n: b"newmtl m\nmap_Kd" + b" " * n + b"a.png\n", 20_000),
        },
    ),
    Parser(
        "stl",
        ("model.meshes.reader.read_stl",),
        mesh_work("a.stl"),
        REFUSED,
        (cube_stl(), cube_text_stl()),
        {
            "triangles": Worst(lambda n: bytes(80) + struct.pack("<I", n) + cube_stl()[84:134] * n, 5000),
            "text": Worst(lambda n: b"solid x\nfacet\n" + b"vertex 0 0 0\n" * (3 * n), 500),
            "blanks": Worst(lambda n: b"solid x\nfacet\n" + b"vertex" + b" " * n, 50_000),
            "a word": Worst(lambda n: b"solid x\nfacet\nvertex 1 2 " + b"vertex" * n, 10_000),
        },
    ),
    Parser(
        "level",
        ("model.builder.model_files.read_visual_files",),
        level_work,
        REFUSED,
        (cube_obj(),),
        {"one polygon": Worst(obj_polygon, 1500), "a book": Worst(obj_book, 1500)},
    ),
)
