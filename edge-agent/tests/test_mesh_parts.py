"""Parts of a mesh that an SDF shows by their names (`<submesh>`), and what it can't show of a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from model_stage import build_robot, cube_collada, cube_stl, resolver_at
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import pick_part
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.sdf.reader import read_sdf

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
