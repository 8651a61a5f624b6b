"""Mesh files of every kind: read right, against another library where it can read them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from cost_stage import cost
from model_stage import (
    CUBE_CORNERS,
    CUBE_FACES,
    SHARED,
    build_robot,
    cube_collada,
    cube_glb,
    cube_obj,
    cube_stl,
    cube_text_stl,
    glb_document,
    pack_glb,
    read_mesh_of,
    resolver_at,
    volume,
)
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import Mesh, pick_part, triangulate_fans
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.sdf.reader import read_sdf

CUBES = {
    "a.stl": cube_stl(),
    "solid.stl": cube_stl(header=b"solid facet but binary"),
    "colour.stl": cube_stl(header=b"COLOR=\x01\x02\x03\x04"),
    "text.STL": cube_text_stl(),
    "shouted.stl": cube_text_stl().upper(),
    "a.obj": cube_obj(),
    "named.OBJ": cube_obj("# by hand\no cube\ng side\ns 1\n"),
    "windows.obj": cube_obj().replace(b"\n", b"\r\n"),
    "a.dae": cube_collada(),
    "a.DAE": cube_collada(up="Y_UP"),
    "plain.glb": cube_glb(),
    "glb-named.stl": cube_glb(),
}


@pytest.mark.parametrize("name", CUBES)
def test_cubes(name: str, tmp_path: Path) -> None:
    mesh = read_mesh_of(tmp_path, name, CUBES[name])
    assert mesh.triangles == 12
    assert np.allclose(mesh.compute_box(), np.array([[0, 0, 0], [0.2, 0.2, 0.2]]))
    assert volume(mesh) == pytest.approx(0.008, rel=1e-5)


def test_stl_with_more_after_it(tmp_path: Path) -> None:
    mesh = read_mesh_of(tmp_path, "a.stl", cube_stl() + b"some trailer")
    assert mesh.triangles == 12
    assert [code for code, _ in mesh.notes] == ["stl-tail"]


def test_collada_transforms_in_order(tmp_path: Path) -> None:
    node = (
        "<translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>1 2 1</scale>"
        "<matrix>1 0 0 0.5 0 1 0 0 0 0 1 0 0 0 0 1</matrix>"
    )
    mesh = read_mesh_of(tmp_path, "a.dae", cube_collada(node=node, unit="0.1"))
    # x → 0.5 … 0.7; scaled y 0 … 0.4; turned: x' = −y, y' = x; moved; tenths of a metre
    assert np.allclose(mesh.compute_box(), [[0.06, 0.25, 0.3], [0.1, 0.27, 0.32]], atol=1e-6)
    assert [code for code, _ in mesh.notes] == ["collada-unit"]
    assert volume(mesh) > 0


def test_collada_mirrored_by_its_scene_is_turned(tmp_path: Path) -> None:
    assert volume(read_mesh_of(tmp_path, "a.dae", cube_collada(node="<scale>-1 1 1</scale>"))) > 0


@pytest.mark.parametrize(
    ("tag", "inside"),
    [("polylist", "<vcount>4 4 4 4 4 4</vcount><p>{all}</p>"), ("polygons", "{each}"), ("trifans", "{each}")],
)
def test_collada_polygons(tag: str, inside: str, tmp_path: Path) -> None:
    quads = ["0 1 3 2", "4 6 7 5", "0 4 5 1", "2 3 7 6", "0 2 6 4", "1 5 7 3"]
    body = inside.format(all=" ".join(quads), each="".join(f"<p>{q}</p>" for q in quads))
    data = cube_collada().decode()
    start, end = data.index("<p>"), data.index("</triangles>")
    data = (data[:start] + body + data[end:]).replace("triangles", tag)
    mesh = read_mesh_of(tmp_path, "a.dae", data.encode())
    assert mesh.triangles == 12
    assert volume(mesh) == pytest.approx(0.008)


def test_collada_strips(tmp_path: Path) -> None:
    data = cube_collada().decode()
    start, end = data.index("<p>"), data.index("</triangles>")
    data = (data[:start] + "<p>0 1 2 3 6 7</p>" + data[end:]).replace("triangles", "tristrips")
    [surface] = read_mesh_of(tmp_path, "a.dae", data.encode()).surfaces
    corners = CUBE_CORNERS[[[0, 1, 2], [2, 1, 3], [2, 3, 6], [6, 3, 7]]] * np.float32(0.2)
    np.testing.assert_allclose(surface.positions[surface.faces], corners)


def test_collada_colours(tmp_path: Path) -> None:
    def colour(effect: str) -> tuple[float, ...] | None:
        [surface] = read_mesh_of(tmp_path, "a.dae", cube_collada(effect=effect)).surfaces
        return surface.paint.rgba if surface.paint else None

    diffuse = "<diffuse><color>0.1 0.2 0.3 1</color></diffuse>"
    half = "<transparency><float>0.5</float></transparency>"
    assert colour(diffuse) == (0.1, 0.2, 0.3, 1)
    assert colour(diffuse + half) == (0.1, 0.2, 0.3, 0.5)
    none = "<transparent><color>1 1 1 1</color></transparent><transparency><float>0</float></transparency>"
    assert colour(diffuse + none) == (0.1, 0.2, 0.3, 1)
    zero = '<transparent opaque="RGB_ZERO"><color>0 0 0 1</color></transparent>'
    assert colour(diffuse + zero + half) == (0.1, 0.2, 0.3, 1)
    assert colour("<shininess><float>3</float></shininess>") is None


def test_obj_materials(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(
        "newmtl red\nKd 1 0 0\nnewmtl glass\nKd 0 0 1\nd 0.4\nnewmtl odd\nKd x\nTr 1\n"
    )
    faces = cube_obj().decode().partition("f ")
    parts = ["f " + f for f in ("f " + faces[2]).split("f ")[2:] if f]
    text = "mtllib a.mtl\n" + faces[0]
    for material, part in zip(("red", "glass", "odd", "gone", "red", "red"), parts, strict=False):
        text += f"usemtl {material}\n{part}"
    mesh = read_mesh_of(tmp_path, "a.obj", text.encode())
    rgba = [s.paint.rgba if s.paint else None for s in mesh.surfaces]
    assert rgba == [(1, 0, 0, 1), (0, 0, 1, 0.4), (0.8, 0.8, 0.8, 1), None]


def test_obj_and_its_materials_with_a_byte_order_mark(tmp_path: Path) -> None:
    mark = b"\xef\xbb\xbf"
    first = mark + b"v 0 0 0\n" + cube_obj("mtllib a.mtl\nusemtl m\n").replace(b"v 0.0 0.0 0.0\n", b"", 1)
    mesh = read_mesh_of(tmp_path, "a.obj", first, a_mtl=mark + b"newmtl m\nKd 1 0 0\n")
    assert (mesh.triangles, mesh.notes) == (12, ())
    assert [s.paint and s.paint.rgba for s in mesh.surfaces] == [(1.0, 0.0, 0.0, 1.0)]


def test_obj_counts_from_the_end(tmp_path: Path) -> None:
    mesh = read_mesh_of(tmp_path, "a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n")
    assert mesh.surfaces[0].faces.tolist() == [[0, 1, 2]]


def test_glb_scene_and_colour(tmp_path: Path) -> None:
    def moved(document: dict[str, object]) -> None:
        document["nodes"] = [
            {"children": [1], "translation": [1, 0, 0], "scale": [2, 2, 2]},
            {"mesh": 0, "rotation": [0, 0, 0.70710678, 0.70710678]},
        ]

    mesh = read_mesh_of(tmp_path, "a.glb", cube_glb(moved))
    assert np.allclose(mesh.compute_box(), [[0.6, 0, 0], [1, 0.4, 0.4]], atol=1e-6)
    [surface] = mesh.surfaces
    assert surface.paint is not None
    assert surface.paint.rgba == pytest.approx((1, 0, 0, 1))


def test_glb_part_that_is_shown_often_is_read_once(tmp_path: Path) -> None:
    def crowd(of: int) -> bytes:
        def nodes(document: dict[str, object]) -> None:
            document["nodes"] = [{"children": [1] * of}, {"mesh": 0, "scale": [1, 1, -1]}]

        return cube_glb(nodes)

    (tmp_path / "one.glb").write_bytes(crowd(1))
    (tmp_path / "crowd.glb").write_bytes(crowd(1001))
    resolver = resolver_at(tmp_path)
    one = cost(lambda: read_mesh(tmp_path / "one.glb", resolver))
    many = cost(lambda: read_mesh(tmp_path / "crowd.glb", resolver))
    steps_each = (many - one) / 1000
    assert steps_each < 500  # lines and calls, numpy's too: twice as many if its vertices are read for each
    surfaces = read_mesh(tmp_path / "crowd.glb", resolver).surfaces
    assert len(surfaces) == 1001
    assert len({surface.positions.tobytes() for surface in surfaces}) == 1
    assert volume(Mesh((surfaces[1000],))) == pytest.approx(0.2**3, rel=1e-5)  # mirrored, and turned for it


def test_glb_of_small_integers(tmp_path: Path) -> None:
    document = glb_document(cube_glb())
    corners = np.array([[x, y, z, 0] for x in (0, 1) for y in (0, 1) for z in (0, 1)], "<i2") * 32767
    faces = CUBE_FACES.astype("u1").tobytes()
    document["accessors"][0] |= {"componentType": 5122, "normalized": True}
    document["accessors"][1] |= {"componentType": 5121}
    document["bufferViews"] = [
        {"buffer": 0, "byteLength": 64, "byteStride": 8},
        {"buffer": 0, "byteOffset": 64, "byteLength": 36},
    ]
    mesh = read_mesh_of(tmp_path, "a.glb", pack_glb(document, corners.tobytes() + faces))
    assert np.allclose(mesh.compute_box(), [[0, 0, 0], [1, 1, 1]])


def test_fans() -> None:
    assert triangulate_fans(np.array([3, 5, 2, 4])).tolist() == [
        [0, 1, 2],
        [3, 4, 5],
        [3, 5, 6],
        [3, 6, 7],
        [10, 11, 12],
        [10, 12, 13],
    ]


def test_unreadable_kinds(tmp_path: Path) -> None:
    for name in ("a.ply", "a.step", "a"):
        with pytest.raises(ModelRefused):
            read_mesh_of(tmp_path, name, b"something")


@pytest.mark.parametrize("pattern", ["**/*.dae", "**/*.stl", "**/*.STL"])
def test_shared_meshes_as_another_library_reads_them(pattern: str) -> None:
    files = sorted((SHARED / "robots").glob(pattern))[::7]
    if not files:
        pytest.skip("no ../shared/robots here")
    for path in files:
        mesh = read_mesh(path, resolver_at(path.parent))
        other: Any = trimesh.load(
            io.BytesIO(path.read_bytes()), file_type=path.suffix[1:].lower(), force="mesh", process=False
        )
        assert mesh.triangles == len(other.faces), path.name
        assert np.abs(np.array(mesh.compute_box()) - other.bounds).max() < 1e-6, path.name


# --- parts of a mesh that an SDF shows by their names (`<submesh>`), and what it can't show of a mesh

WHEEL = '<node name="wheel" id="w"><translate>1 0 0</translate><instance_geometry url="#g"/></node>'


def sdf(uri: str, submesh: str) -> str:
    shape = f"<mesh><uri>{uri}</uri><scale>2 2 2</scale><submesh>{submesh}</submesh></mesh>"
    visual = f"<visual name='v'><geometry>{shape}</geometry></visual>"
    return f"<sdf version='1.9'><model name='m'><link name='a'>{visual}</link></model></sdf>"


def build(folder: Path, uri: str, submesh: str) -> dict[str, Any]:
    (folder / "two.dae").write_bytes(cube_collada(node=WHEEL))
    (folder / "one.stl").write_bytes(cube_stl())
    path = folder / "robot.sdf"
    path.write_text(sdf(uri, submesh))
    return build_robot(path).document


BOXES: dict[str, list[list[float]]] = {
    "": [[0, 0, 0], [2.4, 0.4, 0.4]],
    "<name>wheel</name>": [[2, 0, 0], [2.4, 0.4, 0.4]],
    "<name>w</name>": [[2, 0, 0], [2.4, 0.4, 0.4]],
    "<name>g</name>": [[0, 0, 0], [2.4, 0.4, 0.4]],
    "<name>wheel</name><center>true</center>": [[-0.2, -0.2, -0.2], [0.2, 0.2, 0.2]],
    "<center>true</center>": [[-1.2, -0.2, -0.2], [1.2, 0.2, 0.2]],
}


@pytest.mark.parametrize("submesh", BOXES)
def test_parts_of_a_collada_file(submesh: str, tmp_path: Path) -> None:
    [visual] = build(tmp_path, "two.dae", submesh)["visuals"]
    for corner, expected in zip(visual["box"], BOXES[submesh], strict=True):
        assert corner == pytest.approx(expected, abs=1e-4)


def test_a_part_that_there_is_not_is_a_stand_in_that_says_so(tmp_path: Path) -> None:
    [visual] = build(tmp_path, "two.dae", "<name>door</name>")["visuals"]
    assert visual["placeholder"] == "it has no part 'door', but 'wheel', 'w', 'g'"
    mesh = read_mesh(tmp_path / "two.dae", resolver_at(tmp_path))
    with pytest.raises(ModelRefused, match="it has no part"):
        pick_part(mesh, "door", False)
    assert pick_part(mesh, "wheel", False).triangles == 12
    assert pick_part(mesh, "", False).triangles == 24


def test_of_a_file_without_parts_the_whole_is_shown(tmp_path: Path) -> None:
    document = build(tmp_path, "one.stl", "<name>door</name>")
    assert "placeholder" not in document["visuals"][0]
    [finding] = document["findings"]
    assert (finding["code"], finding["severity"]) == ("submesh", "warning")
    assert "the whole mesh is shown" in finding["text"]


@pytest.mark.parametrize("shape", ["heightmap", "polyline"])
def test_what_has_to_be_a_mesh(shape: str) -> None:
    visual = f"<visual name='v'><geometry><{shape}/></geometry></visual>"
    found = read_sdf(f"<sdf><model name='m'><link name='a'>{visual}</link></model></sdf>".encode())
    text = f"link 'a': shape '{shape}' is not shown; save it as a mesh to see it"
    assert text in [f.text for f in found.findings]
