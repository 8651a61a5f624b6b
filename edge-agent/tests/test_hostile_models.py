"""Files of a model that once raised what nobody caught, or cost what nobody had: one line, and the rest is
shown."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_parsers import VERTICES, obj_polygon
from model_stage import (
    build_robot,
    cube_collada,
    cube_glb,
    cube_obj,
    cube_stl,
    joint,
    link,
    mesh,
    nothing,
    read_mesh_of,
    robot,
    written,
)
from posecast_edge.cli import model_command as command
from posecast_edge.model.builder import thumbnail
from posecast_edge.model.builder import visuals as figure
from posecast_edge.model.builder.mesh_coder import CROWD_MAX, LodChain, weld_vertices
from posecast_edge.model.builder.model_files import read_visual_files
from posecast_edge.model.builder.quantise import compute_crease_normals
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.serve import background as described
from posecast_edge.model.serve.bundle import ModelError, load_bundle
from posecast_edge.model.serve.bundle_dir import list_entries
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.tree import Follow, build_tree


def glb(**members: object) -> bytes:
    return cube_glb(lambda document: document.update(members))


@pytest.mark.parametrize("depth", range(900, 1000, 3))
def test_a_gltf_of_any_depth_is_no_recursion(depth: int, tmp_path: Path) -> None:
    needs = "[" * depth + "]" * depth
    with pytest.raises(ModelRefused):
        read_mesh_of(tmp_path, "a.gltf", f'{{"extensionsRequired":{needs}}}'.encode())


def test_colours_that_are_none_cost_the_colour(tmp_path: Path) -> None:
    libraries = [b"newmtl m\nKd 0.5 0 0\nKd nan 0 0\n", b"newmtl m\nKd 0.5 0 0\nKd 1e999 0 0\n"]
    for library in libraries:
        [surface] = read_mesh_of(
            tmp_path, "a.obj", cube_obj("mtllib a.mtl\nusemtl m\n"), a_mtl=library
        ).surfaces
        assert surface.paint is not None
        assert surface.paint.rgba == (0.5, 0, 0, 1)


def test_notes_are_one_line_and_few(tmp_path: Path) -> None:
    names = "".join(f"mtllib a{i}\u202e.mtl\n" for i in range(100))
    notes = read_mesh_of(tmp_path, "a.obj", names.encode() + cube_obj()).notes
    assert len(notes) == 20
    assert all(text.isprintable() for _, text in notes)
    [note] = read_mesh_of(tmp_path, "a.dae", cube_collada(up="Z_\nUP")).notes
    assert note == ("collada-axis", "it says Z_�UP; ignored, as RViz does")


def test_a_scene_is_counted_before_it_is_made(tmp_path: Path) -> None:
    """Files of some 100 kB that show thousands of triangles thousands of times."""
    shown = b'<instance_geometry url="#g"></instance_geometry>'
    data = cube_collada().replace(b"</p>", b" 0 1 2" * 5000 + b"</p>").replace(shown, shown * 5000)
    with pytest.raises(ModelRefused, match="repeats its parts so often"):
        read_mesh_of(tmp_path, "a.dae", data)
    many = {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}] * 100}
    nodes = [{"children": [1] * 9000}, {"mesh": 0}]
    with pytest.raises(ModelRefused, match="repeats its parts so often"):
        read_mesh_of(tmp_path, "a.glb", glb(meshes=[many], nodes=nodes))


def test_a_fan_is_smooth_in_whatever_order_it_comes() -> None:
    """Corners that hang together in one long chain."""
    n = 3000
    angle = 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    positions = np.concatenate([np.zeros((1, 3)), rim]).astype(np.float32)
    i = np.arange(n - 1)
    faces = np.stack([0 * i, i + 1, i + 2], axis=1).astype(np.int32)
    dice = np.random.default_rng(1)
    for order in (faces, faces[::-1], faces[dice.permutation(len(faces))]):
        group, normals = compute_crease_normals(positions, order, 40.0)
        centre = group.reshape(-1, 3)[order == 0]
        assert len(set(centre.tolist())) == 1
        assert np.allclose(normals[centre[0]], (0, 0, 1))


def test_triangles_about_a_crowded_vertex_stay_as_they_are(tmp_path: Path) -> None:
    few, many = (read_mesh_of(tmp_path, "a.obj", obj_polygon(n)) for n in (CROWD_MAX - 10, CROWD_MAX + 10))
    coarse = [len(LodChain(weld_vertices(m.surfaces[0]), 2.0, 2.0, 30).get_rung(20)[1]) for m in (few, many)]
    assert coarse[0] < 200
    assert coarse[1] == CROWD_MAX + 8


def test_a_heap_as_large_as_the_robot_is_drawn_in_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of triangles that each fill the picture as many as there is time for; small ones come first."""
    monkeypatch.setattr(thumbnail, "TESTS_IN_ALL", 1 << 22, raising=False)
    large, small = (np.array([[-s, -s, z], [s, -s, z], [0, s, z]]) for s, z in ((9.0, 0), (0.05, 1)))
    corners = np.stack([*[large] * 1000, small])
    tests = 0
    test = thumbnail._test

    def counted(xy: np.ndarray[Any, Any], *rest: Any) -> None:
        nonlocal tests
        tests += len(xy) * rest[2][0] * rest[2][1]
        test(xy, *rest)

    monkeypatch.setattr(thumbnail, "_test", counted)
    triangle, _ = thumbnail.draw_triangles(corners, thumbnail.Camera(np.eye(3), np.zeros(3), 2.0, 64))
    assert tests <= 1 << 22
    assert (triangle >= 0).all()
    assert (triangle == 1000).any()


# --- URDF and what is built of it


def mimicking(name: str, parent: str, child: str, leader: str, multiplier: str) -> str:
    inside = f'<axis xyz="0 0 1"/><mimic joint="{leader}" multiplier="{multiplier}"/>'
    return joint(name, parent, child, inside=inside)


def test_numbers_without_end_are_never_in_a_manifest(tmp_path: Path) -> None:
    parts = [link(name) for name in "abcd"]
    parts += [
        joint("j", "a", "b"),
        mimicking("k", "b", "c", "j", "1e200"),
        mimicking("l", "c", "d", "k", "1e200"),
    ]
    parts.append(
        '<gazebo reference="a"><sensor name="s" type="imu"><pose>inf 0 0 1e999 0 0</pose></sensor></gazebo>'
    )
    parts.append(
        '<gazebo reference="a"><sensor name="t" type="imu"><pose>1e300 0 0 0 0 0</pose></sensor></gazebo>'
    )
    built = build_robot(written(tmp_path, robot(*parts)))
    document = json.loads(built.manifest, parse_constant=pytest.fail)
    assert [j.get("mimic", {}).get("multiplier") for j in document["joints"]] == [None, 1e200, None]
    assert [s["name"] for s in document["sensors"]] == ["s"]
    assert document["sensors"][0]["xyz"] == [0, 0, 0]
    assert "mimic-endless" in {f.code for f in built.findings}


def test_what_is_nowhere_is_not_shown_there(tmp_path: Path) -> None:
    far = '<visual><origin xyz="1e308 0 0"/><geometry><box size="1 1 1"/></geometry></visual>'
    large = '<visual><geometry><sphere radius="1e300"/></geometry></visual>'
    scaled = mesh("meshes/a.stl", ' scale="1e300 1 1"')
    parts = [link("a", far), link("b", large), link("c", scaled)]
    parts += [joint("j", "a", "b", "fixed"), joint("k", "b", "c", "fixed")]
    built = build_robot(written(tmp_path, robot(*parts), a_stl=cube_stl()))
    reasons = [visual["placeholder"] for visual in built.document["visuals"]]
    assert reasons[0] == "its origin is more than 10,000 km away"
    assert all("finite" in reason or "km away" in reason for reason in reasons[1:])
    away = joint("j", "a", "b", "fixed", '<origin xyz="0 1e308 0"/>')
    path = written(tmp_path, robot(link("a"), link("b"), away))
    with pytest.raises(ModelRefused, match="joint 'j': an origin more than 10,000 km away") as refused:
        build_robot(path)
    assert refused.value.line == 4


def test_an_axis_of_any_length_has_a_direction(tmp_path: Path) -> None:
    axis = '<axis xyz="1e308 1e308 0"/>'
    built = build_robot(written(tmp_path, robot(link("a"), link("b"), joint("j", "a", "b", inside=axis))))
    assert built.document["joints"][0]["axis"] == pytest.approx([0.5**0.5, 0.5**0.5, 0])


def shown(path: Path) -> figure.Figure:
    """What is drawn of a robot."""
    robot, resolver = load_robot_file(path), Resolver(path)
    files = read_visual_files(robot, resolver, nothing)
    return figure.build_figure(robot.urdf, build_tree(robot.urdf), files)


def test_one_mesh_in_a_thousand_sizes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another size is another body; what is too much is a stand-in."""
    monkeypatch.setattr(figure, "SHOWN_AGAIN_MAX", 12 * 9, raising=False)
    shapes = "".join(mesh("meshes/a.stl", f' scale="{1 + i / 100} 1 1"') for i in range(50))
    parts = [link("a", shapes), link("b", mesh("meshes/a.stl")), joint("j", "a", "b", "fixed")]
    found = shown(written(tmp_path, robot(*parts), a_stl=cube_stl()))
    assert sum(visual.reason is None for visual in found.visuals) == 11  # one of them twice
    assert len(found.looks) <= 12
    monkeypatch.setattr(figure, "TRIANGLES_MAX", 12 * 20, raising=False)
    parts[0] = link("a", mesh("meshes/a.stl") * 50)
    found = shown(written(tmp_path, robot(*parts), a_stl=cube_stl()))
    assert sum(visual.reason is None for visual in found.visuals) == 20


@pytest.mark.parametrize("multipliers", [["2"] * 6, ["1"] * 6])
def test_circles_of_mimics_are_named_as_ever(multipliers: list[str]) -> None:
    """j0 → j1 → j2 → j1; j3 follows j0, j4 nobody that there is, j5 j4."""
    leaders = ["j1", "j2", "j1", "j0", "x", "j4"]
    parts = [link(f"l{i}") for i in range(7)]
    parts += [
        mimicking(f"j{i}", f"l{i}", f"l{i + 1}", leader, multipliers[i]) for i, leader in enumerate(leaders)
    ]
    tree = build_tree(read_urdf(io.BytesIO(robot(*parts).encode())))
    said = [f.text.partition(" mimics ")[2] for f in tree.findings]
    circle = "in a loop, through "
    gone = "joint 'x', which does not exist"
    assert said == [f"{circle}'j1'", f"{circle}'j1'", f"{circle}'j2'", f"{circle}'j1'", gone, gone]
    assert tree.follows == (None,) * 6


def test_a_chain_of_mimics_is_multiplied_out() -> None:
    parts = [link(f"l{i}") for i in range(4)] + [joint("j0", "l0", "l1")]
    parts += [mimicking(f"j{i}", f"l{i}", f"l{i + 1}", f"j{i - 1}", str(i + 1)) for i in (1, 2)]
    tree = build_tree(read_urdf(io.BytesIO(robot(*parts).encode())))
    assert tree.follows == (None, Follow(0, 2.0, 0.0), Follow(0, 6.0, 0.0))


# --- names


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    """They cost their mesh, not the robot."""
    names = ["package://" + "p" * 300 + "/a.stl", "package://p/" + "a/" * 2000 + "a.stl", "#a.stl", "?b.stl"]
    parts = [link("a", "".join(map(mesh, names)))]
    path = written(tmp_path, robot(*parts))
    for name in ("#a.stl", "?b.stl"):
        (tmp_path / name).write_bytes(cube_stl())
    assert len(build_robot(path).document["missing"]) == 2
    bundle = load_bundle(path)
    assert [f.path for f in bundle.files] == ["robot.urdf", "meshes/_a.stl", "meshes/_b.stl"]
    assert list(bundle.missing) == names[:2]


def test_a_manifest_names_a_file_once() -> None:
    entry = {"path": "high.glb", "size": 1 << 28, "sha256": "a" * 64}
    with pytest.raises(ModelRefused, match="twice"):
        list_entries(json.dumps({"v": 2, "files": [entry, entry]}).encode())


def test_a_file_name_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "r\udcff.urdf"
    path.write_text(robot(link("a")))
    bundle = load_bundle(path)
    assert bundle.files[0].path == "r�.urdf"


def test_a_description_that_is_no_text_is_refused(tmp_path: Path) -> None:
    model = described.DescribedModel([], lambda bundle: None)
    with pytest.raises(ModelError, match="half of a surrogate pair"):
        model._begin("<robot name='\ud800'/>", tmp_path / "x")


def test_the_doctor_lists_the_worst(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, robot(link("a"), *("<joint/>" for _ in range(5000))))
    assert command.run_command(["doctor", "--urdf", str(path)], {}) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 202
    assert lines[200].startswith("and 4")


def test_vertices_nobody_uses_are_left_behind(tmp_path: Path) -> None:
    """Else every material would carry them all."""
    far = VERTICES + "v 9 9 9\n" * 100 + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(5))
    assert [len(s.positions) for s in read_mesh_of(tmp_path, "a.obj", far.encode()).surfaces] == [3] * 5
