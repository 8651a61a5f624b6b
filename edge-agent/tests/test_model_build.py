"""Bundles: the same robot from every distance, small enough, laid out as docs/reference/model-bundle.md
says."""

from __future__ import annotations

import hashlib
import io
import json
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import meshoptimizer
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from model_stage import (
    CUBE_CORNERS,
    CUBE_FACES,
    PICTURE,
    TO_BUILD,
    build_robot,
    cube_collada,
    cube_obj,
    cube_stl,
    glb_document,
    joint,
    link,
    mesh,
    robot,
    shared_robot,
    written,
)
from numpy.typing import NDArray
from PIL import Image
from posecast_edge.model.builder.build import Built, collect_triangles
from posecast_edge.model.builder.manifest import BYTES_MAX, compute_home, encode_manifest
from posecast_edge.model.builder.soles import CORNERS_MAX
from posecast_edge.model.builder.thumbnail import aim_camera, draw_triangles
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.kinematics import compute_link_poses, matrix_from_quaternion, quaternion_from_rpy
from posecast_edge.model.serve.bundle_dir import MANIFEST_MAX
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.sources.demo import BUNDLE
from posecast_testing import count_examples

VIEWS = [np.array(v) for v in ((1.0, 0.0, 0.05), (0.0, 1.0, 0.1), (1.0, 0.55, 0.42))]
PIXELS = 512
SAME = {"low": 0.975, "middle": 0.99, "high": 0.997}  # intersection over union of silhouettes
SIZES = {  # bytes of a level at most; the issue's, and what the others should not exceed
    "g1": {"low": 200_000, "middle": 600_000, "high": 3_600_000},
    "g1-hands": {"low": 200_000, "middle": 600_000, "high": 3_600_000},
    "hubo2plus-collada": {"low": 300_000, "middle": 600_000, "high": 4_000_000},
}

MASSES_AND_SOLES = {  # kg; m along and across a sole
    "hubo2plus-collision": (40.70, 0.214, 0.144),
    "hubo2plus-collada": (40.70, 0.214, 0.144),
    "drchubo": (58.20, 0.220, 0.150),
    "g1": (33.34, 0.207, 0.076),
    "g1-hands": (34.39, 0.207, 0.076),
}


def poses_of(built: Built) -> list[NDArray[np.float64]]:
    return [np.array(p) for p in compute_link_poses(built.document, compute_home(built.document)).values()]


def original(built: Built) -> NDArray[np.float64]:
    """The triangles (m, 3, 3) before any simplification."""
    poses, corners = poses_of(built), []
    for visual in built.figure.visuals:
        at = poses[visual.link] @ np.array(
            matrix_from_quaternion(visual.pose.xyz, quaternion_from_rpy(visual.pose.rpy))
        )
        for surface, _, _ in built.figure.looks[visual.looks].skins:
            points = surface.positions.astype(np.float64) @ at[:3, :3].T + at[:3, 3]
            corners.append(points[surface.faces])
    return np.concatenate(corners)


@pytest.mark.parametrize("name", TO_BUILD)
def test_robots_of_others(name: str) -> None:
    """In one test, because each takes seconds to build."""
    built = build_robot(shared_robot(name))
    check_sizes(name, built)
    check_layout(built)
    check_silhouettes(built)
    if name in MASSES_AND_SOLES:
        check_masses_and_soles(name, built.document)


def check_masses_and_soles(name: str, document: dict[str, Any]) -> None:
    mass, long, wide = MASSES_AND_SOLES[name]
    assert sum(e["mass_kg"] for e in document["inertials"]) == pytest.approx(mass, abs=0.01)
    assert len(document["soles"]) == 2
    for sole in document["soles"]:
        assert np.ptp(np.array(sole["points"]), axis=0) == pytest.approx([long, wide, 0], abs=0.002)
        assert 3 <= len(sole["points"]) <= CORNERS_MAX


def check_sizes(name: str, built: Built) -> None:
    limits = SIZES.get(name, {"low": 200_000, "middle": 600_000, "high": 600_000})
    assert {n: len(level.data) for n, level in built.levels.items() if len(level.data) > limits[n]} == {}
    assert len(built.files["thumbnail.png"]) < 30_000
    assert len(built.manifest) < 60_000
    sizes = [len(level.data) for level in built.levels.values()]
    assert sizes == sorted(sizes)


def test_few_bytes_can_be_many_triangles() -> None:
    """The demo robot suits a phone's line as it is, but not a phone without a graphics card."""
    path = BUNDLE / "robot.urdf"
    if not path.exists():
        pytest.skip("the demo robot is not built: make setup")
    built = build_robot(path)
    low, high = built.document["levels"]
    assert [low["name"], high["name"]] == ["low", "high"]
    assert high["triangles"] > 40_000
    assert low["triangles"] <= 24_000
    assert low["bytes"] < high["bytes"] / 2
    assert low["error_m"] < 0.0015


def test_many_parts_move_further_than_else_where_they_are_too_many_for_a_phone(tmp_path: Path) -> None:
    places = np.stack(np.meshgrid(*[np.linspace(-1, 1, 14)] * 3), -1).reshape(-1, 1, 3)
    corners = 0.09 * CUBE_CORNERS / np.ptp(CUBE_CORNERS) + places
    triangles = np.zeros(14**3 * 12, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("mark", "<u2")])
    triangles["corners"] = corners[:, CUBE_FACES].reshape(-1, 3, 3)
    heap = bytes(80) + len(triangles).to_bytes(4, "little") + triangles.tobytes()
    built = build_robot(written(tmp_path, robot(link("heap", mesh("meshes/heap.stl"))), heap_stl=heap))
    low, high = built.document["levels"]
    assert high["triangles"] == len(triangles)
    assert low["triangles"] < 24_000
    assert 0.02 < low["error_m"] / 2.09 < 0.0401


def check_silhouettes(built: Built) -> None:
    """No holes, nothing grown, seen from three sides: levels against the meshes as they were read."""
    corners, poses = original(built), poses_of(built)
    for view in VIEWS:
        camera = aim_camera(view, corners.reshape(-1, 3), PIXELS)
        expected = draw_triangles(corners, camera)[0] >= 0
        for name, level in built.levels.items():
            shown = draw_triangles(collect_triangles(level, built.figure, poses)[0], camera)[0] >= 0
            same = (shown & expected).sum() / (shown | expected).sum()
            assert same > SAME[name], f"{name} from {view}: {same:.4f}"


def check_layout(built: Built) -> None:
    """Read back what was written, by other code than wrote it."""
    document = json.loads(built.manifest)
    assert [f["path"] for f in document["files"]] == list(built.files)
    for entry in document["files"]:
        data = built.files[entry["path"]]
        assert (entry["size"], entry["sha256"]) == (len(data), hashlib.sha256(data).hexdigest())
    for level in document["levels"]:
        gltf, positions, normals, indices = unpacked(built.files[level["path"]])
        assert [n["name"] for n in gltf["nodes"]] == [v["node"] for v in document["visuals"]]
        assert gltf["scenes"] == [{"nodes": list(range(len(gltf["nodes"])))}]
        assert np.abs(np.linalg.norm(normals / 127, axis=1) - 1).max() < 0.02
        assert len(positions) == level["vertices"]
        drawn = 0
        end = 0
        for number, (node, visual) in enumerate(zip(gltf["nodes"], document["visuals"], strict=True)):
            points = []
            for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
                accessor = gltf["accessors"][primitive["indices"]]
                start = accessor.get("byteOffset", 0) // 4
                slots = indices[start : start + accessor["count"]]
                span = primitive["extras"]
                assert (slots.min(), slots.max()) == (span["first"], span["first"] + span["count"] - 1)
                assert primitive["attributes"] == {"POSITION": 0, "NORMAL": 1}
                end = max(end, start + accessor["count"])
                drawn += accessor["count"] // 3
                points.append(positions[slots] * node["scale"][0])
            x, y, z, w = node.get("rotation", (0, 0, 0, 1))
            at = np.array(matrix_from_quaternion(node.get("translation", (0, 0, 0)), (w, x, y, z)))
            placed = np.concatenate(points) @ at[:3, :3].T + at[:3, 3]
            low, high = np.array(visual["box"])
            slack = level["error_m"] * 1.5 + 1e-4
            assert np.abs(placed.min(0) - low).max() < slack, f"visual {number}"
            assert np.abs(placed.max(0) - high).max() < slack, f"visual {number}"
        assert drawn == level["triangles"]
        assert end == len(indices)


def unpacked(data: bytes) -> tuple[dict[str, Any], NDArray[Any], NDArray[Any], NDArray[Any]]:
    """The JSON, positions, normals and indices of a level."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    gltf = glb_document(data)
    binary = data[28 + struct.unpack_from("<I", data, 12)[0] :]
    views = []
    for view in gltf["bufferViews"][:3]:
        how = view["extensions"]["EXT_meshopt_compression"]
        packed = binary[how["byteOffset"] : how["byteOffset"] + how["byteLength"]]
        count, stride = how["count"], how["byteStride"]
        assert count * stride == view["byteLength"]
        if how["mode"] == "TRIANGLES":
            views.append(meshoptimizer.decode_index_buffer(count, stride, packed))
        else:
            row = np.dtype((np.uint8, stride))
            views.append(meshoptimizer.decode_vertex_buffer(count, stride, packed, dtype=row))
    positions = views[0].view("<i2").reshape(-1, 4)[:, :3].astype(np.float64)
    normals = views[1].view("i1").reshape(-1, 4)[:, :3].astype(np.float64)
    return gltf, positions, normals, views[2]


def test_same_input_same_bytes(tmp_path: Path) -> None:
    """Whatever folder it lies in, whichever way this process orders its sets: a hash must name one model."""
    coloured = cube_obj().decode().replace("\nv 0.2", "\nv 0.2 ").splitlines()
    obj = "\n".join(f"{v} {i / 8} 0 {1 - i / 8}" if v[:2] == "v " else v for i, v in enumerate(coloured))
    shapes = mesh("meshes/a.stl") + mesh("meshes/b.obj") + mesh("meshes/c.dae") + mesh("meshes/gone.stl")
    picture = '<material name="m"><texture filename="meshes/t.png"/></material>'
    more = f'<visual><geometry><sphere radius="1"/></geometry>{picture}</visual>'
    manifests = set()
    for seed in ("1", "2"):
        text = robot(link("a", shapes + more), link("b"), joint("j", "a", "b"))
        files = {"a_stl": cube_stl(), "b_obj": obj.encode(), "c_dae": cube_collada(), "t_png": PICTURE}
        path = written(tmp_path / f"folder {seed}", text, **files)
        out = tmp_path / f"bundle {seed}"
        program = [
            sys.executable,
            "-m",
            "posecast_edge",
            "model",
            "build",
            str(path),
            "-o",
            str(out),
            "--no-cache",
        ]
        subprocess.run(program, env={"PYTHONHASHSEED": seed}, capture_output=True, check=True)
        manifests.add((out / "manifest.json").read_bytes())
    assert len(manifests) == 1


def colours(built: Built) -> list[str]:
    return [v["color"] for v in built.document["visuals"]]


def test_whose_colour_wins(tmp_path: Path) -> None:
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    green = "<diffuse><color>0 1 0 1</color></diffuse>"

    def visual(file: str, material: str) -> str:
        return f'<visual><geometry><mesh filename="meshes/{file}"/></geometry>{material}</visual>'

    inside = [
        visual("plain.stl", ""),
        visual("plain.stl", red),
        visual("plain.stl", '<material name="blue"/>'),
        visual("green.dae", red),
        visual("plain.dae", red),
        visual("plain.stl", '<material name="unheard-of"/>'),
    ]
    blue = '<material name="blue"><color rgba="0 0 1 1"/></material>'
    files = {"plain_stl": cube_stl(), "green_dae": cube_collada(effect=green), "plain_dae": cube_collada()}
    built = build_robot(written(tmp_path, robot(blue, link("a", "".join(inside))), **files))
    grey = "#b8bdc4"
    assert colours(built) == [grey, "#ff0000", "#0000ff", "#00ff00", "#ff0000", grey]
    gltf = unpacked(built.files["high.glb"])[0]
    materials = gltf["materials"]
    assert [m["pbrMetallicRoughness"]["baseColorFactor"][:3] for m in materials[1:]] == [
        [1, 0, 0],
        [0, 0, 1],
        [0, 1, 0],
    ]
    assert materials[0]["extras"] == {"default": True}


def test_scale_and_mirror(tmp_path: Path) -> None:
    inside = mesh("meshes/a.stl", ' scale="1 -2 0.5"')
    built = build_robot(written(tmp_path, robot(link("a", inside)), a_stl=cube_stl(1)))
    assert built.document["visuals"][0]["box"] == [[0, -2, 0], [1, 0, 0.5]]
    corners, normals, _ = collect_triangles(built.levels["high"], built.figure, poses_of(built))
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = np.array([0.5, -1, 0.25])
    assert (np.einsum("nk,nk->n", outward, corners.mean(1) - centre) > 0).all()
    assert (np.einsum("nk,nck->nc", outward, normals) > 0).all()


def test_shapes(tmp_path: Path) -> None:
    shapes = {
        '<box size="1 2 3"/>': [0.5, 1, 1.5],
        '<cylinder radius="0.5" length="2"/>': [0.5, 0.5, 1],
        '<sphere radius="0.7"/>': [0.7, 0.7, 0.7],
        '<capsule radius="0.5" length="2"/>': [0.5, 0.5, 1.5],
    }
    visuals = "".join(f"<visual><geometry>{shape}</geometry></visual>" for shape in shapes)
    built = build_robot(written(tmp_path, robot(link("a", visuals))))
    for visual, half in zip(built.document["visuals"], shapes.values(), strict=True):
        assert np.allclose(visual["box"], [[-v for v in half], half], atol=2e-3)
    for looks in built.figure.looks:  # closed, and the right way round
        [(surface, _, _)] = looks.skins
        corners = surface.positions[surface.faces].astype(np.float64)
        volume = np.einsum("nk,nk->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
        assert volume > 0


def test_a_mesh_shown_often_is_kept_once(tmp_path: Path) -> None:
    parts = [link("l0", mesh("meshes/a.stl"))]
    for i in range(20):
        parts += [link(f"l{i + 1}", mesh("meshes/a.stl")), joint(f"j{i}", "l0", f"l{i + 1}")]
    built = build_robot(written(tmp_path, robot(*parts), a_stl=cube_stl()))
    [level] = built.document["levels"]
    assert len(built.document["visuals"]) == 21
    assert level["triangles"] == 21 * 12
    assert level["vertices"] == 24
    assert level["name"] == "high"


def test_stand_ins(tmp_path: Path) -> None:
    """The collision shape where there is one, else a box that reaches to the link's children."""
    collision = '<collision><geometry><sphere radius="0.3"/></geometry></collision>'
    parts = [
        link("a", mesh("meshes/gone.stl") + mesh("meshes/gone-too.stl") + collision),
        link("b", mesh("meshes/gone.stl")),
        link("c"),
        joint("ab", "a", "b"),
        joint("bc", "b", "c", inside='<axis xyz="0 0 1"/><origin xyz="0 0 0.5"/>'),
    ]
    built = build_robot(written(tmp_path, robot(*parts)))
    shown = built.document["visuals"]
    assert [(v["link"], v.get("placeholder", "").partition(";")[0]) for v in shown] == [
        (0, "no such file"),
        (1, "no such file"),
        (2, ""),
    ]
    assert np.allclose(shown[0]["box"], [[-0.3] * 3, [0.3] * 3], atol=1e-3)
    assert shown[1]["box"] == [[-0.02, -0.02, -0.02], [0.02, 0.02, 0.52]]
    assert {m["uri"] for m in built.document["missing"]} == {"meshes/gone.stl", "meshes/gone-too.stl"}
    gltf = unpacked(built.files["high.glb"])[0]
    assert [m.get("extras") for m in gltf["materials"]] == [{"placeholder": True}, {"default": True}]


def test_textures_are_kept_and_shrunk(tmp_path: Path) -> None:
    corners = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    quads = "".join(
        f"f {' '.join(f'{v}/{t}' for t, v in enumerate(q.split(), 1))}\n"
        for q in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")
    )
    vertices = cube_obj().decode().partition("f ")[0]
    (tmp_path / "meshes").mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (600, 600, 4), np.uint8)
    Image.fromarray(noise).save(tmp_path / "meshes" / "skin.png")
    text = f"mtllib a.mtl\nusemtl skin\n{vertices}{corners}{quads}".encode()
    library = b"newmtl skin\nmap_Kd C:\\art\\skin.png\n"
    built = build_robot(written(tmp_path, robot(link("a", mesh("meshes/a.obj"))), a_obj=text, a_mtl=library))
    assert list(built.levels) == ["low", "middle", "high"]
    sides = []
    for name in built.levels:
        gltf = glb_document(built.files[f"{name}.glb"])
        [image] = gltf["images"]
        [material] = gltf["materials"]
        assert material["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}
        assert "TEXCOORD_0" in gltf["meshes"][0]["primitives"][0]["attributes"]
        picture = picture_in(built.files[f"{name}.glb"], gltf, image["bufferView"])
        with (tmp_path / "x").open("wb") as f:
            f.write(picture)
        with Image.open(tmp_path / "x") as opened:
            sides.append(opened.size[0])
    assert sides == [128, 512, 600]
    assert len(built.files["low.glb"]) < 80_000


def picture_in(data: bytes, gltf: dict[str, Any], number: int) -> bytes:
    start = 28 + struct.unpack_from("<I", data, 12)[0]
    view = gltf["bufferViews"][number]
    return data[start + view["byteOffset"] : start + view["byteOffset"] + view["byteLength"]]


def test_a_robot_without_anything_to_draw(tmp_path: Path) -> None:
    built = build_robot(written(tmp_path, robot(link("a", ""), link("b", ""), joint("ab", "a", "b"))))
    assert built.document["visuals"] == []
    assert "box" not in built.document
    assert [level["triangles"] for level in built.document["levels"]] == [0]


def test_no_robot_at_all(tmp_path: Path) -> None:
    for text in (robot(), robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a"))):
        with pytest.raises(ModelRefused):
            build_robot(written(tmp_path, text))


def test_no_robot_but_a_recipe_for_one(tmp_path: Path) -> None:
    text = '<robot name="r" xmlns:xacro="http://ros.org/xacro"><xacro:include filename="a.xacro"/></robot>'
    with pytest.raises(ModelRefused, match=r"xacro robot\.xacro > robot\.urdf"):
        build_robot(written(tmp_path, text))


def test_sensors_and_joints_reach_the_manifest(tmp_path: Path) -> None:
    eye = '<sensor name="eye" type="camera"><pose>1 2 3 0 0 1.5707963</pose></sensor>'
    sensor = f'<gazebo reference="b">{eye}</gazebo>'
    parts = [link("a"), link("b"), joint("ab", "a", "b", inside='<axis xyz="0 0 3"/>'), sensor]
    document = build_robot(written(tmp_path, robot(*parts))).document
    [found] = document["sensors"]
    assert (found["name"], found["kind"], found["link"], found["xyz"]) == ("eye", "camera", 1, [1, 2, 3])
    assert found["quat"] == pytest.approx([0.70710678, 0, 0, 0.70710678])
    [j] = document["joints"]
    assert j["axis"] == [0, 0, 1]
    assert j["limits"] == {"lower": -1, "upper": 1, "velocity": 1, "effort": 1}
    assert [f["code"] for f in document["findings"]] == ["axis-length"]


def test_a_manifest_that_no_relay_takes_is_refused_in_one_line() -> None:
    empty = len(encode_manifest({"n": ""}))
    assert len(encode_manifest({"n": "n" * (BYTES_MAX - empty)})) == BYTES_MAX == MANIFEST_MAX
    with pytest.raises(ModelRefused, match=r"manifest would have 1,049 kB; a relay takes at most 1 MiB"):
        encode_manifest({"n": "n" * (BYTES_MAX - empty + 1)})


# --- trees of links that no robot has. Damaged files of each kind: test_parsers.py

names = st.sampled_from(["a", "b", "c", "d", "e"])


@settings(max_examples=count_examples(200), deadline=None)
@given(links=st.lists(names, max_size=6), joints=st.lists(st.tuples(names, names, names, names), max_size=8))
def test_trees_of_any_shape(links: list[str], joints: list[tuple[str, str, str, str]]) -> None:
    """Every link is shown, or a finding says that it is not."""
    parts = [link(name) for name in links]
    parts += [
        joint(name, parent, child, inside=f'<axis xyz="0 0 1"/><mimic joint="{mimic}"/>')
        for name, parent, child, mimic in joints
    ]
    tree = build_tree(read_urdf(io.BytesIO(robot(*parts).encode())))
    lost = set(links) - set(tree.index)
    assert bool(lost) <= bool(tree.findings)
    assert len(tree.links) == len(tree.joints) + 1 or not tree.links
    assert [tree.index[j.child] for j in tree.joints] == list(range(1, len(tree.links)))
    assert all(tree.index[j.parent] < tree.index[j.child] for j in tree.joints)
    assert all(f is None or tree.joints[f.joint].mimic is None for f in tree.follows)
