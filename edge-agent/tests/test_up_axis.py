"""The up axis that Collada files name: whether it counts shows in what fits together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from command_stage import run_edge
from model_stage import cube_collada, cube_glb, joint, link, mesh, nothing, robot, written
from posecast_edge.model.builder.build import Built, build_model
from posecast_edge.model.meshes.mesh import UPRIGHT
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.serve.bundle_dir import Cache
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.types import UP_AXIS_MODES

AS_WRITTEN, UPRIGHT_Y = [[0, 0, 0], [0.2, 0.2, 0.2]], [[0, -0.2, 0], [0.2, 0, 0.2]]
WHERE = {"as written": 0.25, "upright": -0.25}  # of a box's y that touches the mesh then


def robot_of(folder: Path, y: float, up: str = "Y_UP") -> Path:
    """A mesh, and a box that is joined to it; between them a link that shows nothing."""
    box = f'<visual><origin xyz="0.1 {y} 0.1"/><geometry><box size="0.2 0.2 0.2"/></geometry></visual>'
    text = robot(
        link("a", mesh("meshes/a.dae")),
        link("b", ""),
        link("c", box),
        joint("j", "a", "b"),
        joint("k", "b", "c"),
    )
    return written(folder, text, a_dae=cube_collada(up=up))


def build(path: Path, mode: str) -> Built:
    return build_model(load_robot_file(path), Resolver(path), nothing, up_axis=mode)


def said(built: Built) -> list[str]:
    return [f.text for f in built.findings if f.code == "up-axis"]


@pytest.mark.parametrize("fits", WHERE)
def test_what_fits_together_decides(fits: str, tmp_path: Path) -> None:
    built = build(robot_of(tmp_path, WHERE[fits]), "auto")
    assert built.document["visuals"][0]["box"] == (UPRIGHT_Y if fits == "upright" else AS_WRITTEN)
    how = "turned upright" if fits == "upright" else "taken as written"
    why = "1 of 1 pairs of neighbouring links touch, otherwise 0"
    assert said(built) == [f"the Collada files declare Y_UP; {how}, because then {why}"]
    note = next(f.text for f in built.findings if f.code == "collada-axis")
    assert note.endswith("it says Y_UP; applied" if fits == "upright" else "ignored, as RViz does")


@pytest.mark.parametrize("fits", WHERE)
def test_the_user_decides(fits: str, tmp_path: Path) -> None:
    path = robot_of(tmp_path, WHERE[fits])
    assert build(path, "ignore").document["visuals"][0]["box"] == AS_WRITTEN
    applied = build(path, "apply")
    assert applied.document["visuals"][0]["box"] == UPRIGHT_Y
    assert said(applied) == ["the Collada files declare Y_UP; turned upright because of --up-axis"]


TURNED, LEFT = (
    "the y axis of glTF is up; turned to z",
    "the y axis of glTF is up; taken as written",
)


@pytest.mark.parametrize("mode", UP_AXIS_MODES)
@pytest.mark.parametrize("y", [*WHERE.values(), 0.0, 5.0])
def test_gltf_is_turned_unless_it_fits_as_written(y: float, mode: str, tmp_path: Path) -> None:
    path = robot_of(tmp_path, y)
    as_written = mode == "ignore" or (mode == "auto" and y == WHERE["as written"])
    box, note = (AS_WRITTEN, LEFT) if as_written else (UPRIGHT_Y, TURNED)
    path.write_text(path.read_text().replace("a.dae", "a.glb"))
    (tmp_path / "meshes" / "a.glb").write_bytes(cube_glb())
    built = build(path, mode)
    assert built.document["visuals"][0]["box"] == box
    assert [f.text for f in built.findings if f.code == "gltf-axis"] == [f"mesh 'meshes/a.glb': {note}"]
    why = f"{LEFT}, because then 1 of 1 pairs of neighbouring links touch, otherwise 0"
    assert said(built) == ([why] if as_written and mode == "auto" else [])


def test_gltf_beside_collada_leaves_that_its_choice(tmp_path: Path) -> None:
    path = robot_of(tmp_path, WHERE["as written"])
    (tmp_path / "meshes" / "b.glb").write_bytes(cube_glb())
    above = mesh("meshes/b.glb").replace(
        "<geometry>", '<origin xyz="0 0.5 0"/><geometry>'
    )  # touches when turned
    path.write_text(
        path.read_text().replace("</robot>", link("d", above) + joint("l", "c", "d") + "</robot>")
    )
    boxes = [v["box"] for v in build(path, "auto").document["visuals"]]
    assert boxes[0] == AS_WRITTEN
    assert boxes[-1] == [[0, 0.3, 0], [0.2, 0.5, 0.2]]  # turned, it touches the box


def test_where_both_fit_it_is_as_in_rviz(tmp_path: Path) -> None:
    built = build(robot_of(tmp_path, 0.0), "auto")
    assert built.document["visuals"][0]["box"] == AS_WRITTEN
    assert "1 of 1 pairs of neighbouring links touch, otherwise 1" in said(built)[0]


def test_nothing_is_said_where_there_is_nothing_to_decide(tmp_path: Path) -> None:
    for number, up in enumerate(("Z_UP", "", "W_UP")):
        path = robot_of(tmp_path / str(number), -0.25, up)
        assert said(build(path, "auto")) == []
    alone = written(tmp_path, robot(link("a", mesh("meshes/a.dae"))), a_dae=cube_collada(up="Y_UP"))
    assert said(build(alone, "auto")) == []


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    path = robot_of(tmp_path, -0.25)
    assert build(path, "auto").manifest == build(path, "auto").manifest


def test_collision_shapes_that_stand_in_are_turned_too(tmp_path: Path) -> None:
    path = robot_of(tmp_path, -0.25)
    collision = mesh("meshes/a.dae").replace("visual", "collision")
    both = mesh("meshes/none.dae") + collision + mesh("meshes/b.dae")
    (tmp_path / "meshes" / "b.dae").write_bytes(cube_collada(up="Y_UP"))
    path.write_text(path.read_text().replace(mesh("meshes/a.dae"), both))
    stand_in = next(v for v in build(path, "apply").document["visuals"] if "placeholder" in v)
    assert stand_in["box"] == UPRIGHT_Y


@pytest.mark.parametrize("up", UPRIGHT)
def test_turning_mirrors_nothing_and_brings_the_axis_up(up: str) -> None:
    turn = UPRIGHT[up]
    assert np.linalg.det(turn) == pytest.approx(1)
    assert (turn @ np.eye(3)["XYZ".index(up[0])]).tolist() == [0, 0, 1]


def test_commands_and_cache_tell_the_modes_apart(tmp_path: Path) -> None:
    path = robot_of(tmp_path, -0.25)
    done = run_edge("doctor", "--urdf", str(path))
    assert "turned upright, because then 1 of 1" in done.stdout
    done = run_edge("doctor", "--urdf", str(path), "--up-axis", "ignore")
    assert "[up-axis]" not in done.stdout
    done = run_edge("doctor", "--urdf", str(path), "--up-axis", "sideways")
    assert (done.returncode, "invalid choice: 'sideways'" in done.stderr) == (2, True)
    run = ("run", "--robot", "a", "--source", "demo", "--relay", "tcp/127.0.0.1:1")
    done = run_edge(*run, "--up-axis", "sideways")
    assert (done.returncode, "'sideways' is not one of auto, ignore, apply" in done.stderr) == (2, True)
    assert len({Cache(tmp_path, path, [], up_axis=mode)._entry for mode in UP_AXIS_MODES}) == 3
