"""What colour a thing gets: materials by name, pictures in the URDF, colours of vertices; mirrored meshes."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from model_stage import (
    CUBE_CORNERS,
    CUBE_FACES,
    PICTURE,
    build_robot,
    cube_collada,
    cube_glb,
    cube_obj,
    cube_stl,
    link,
    resolver_at,
    robot,
    volume,
    written,
)
from PIL import Image
from posecast_edge.model.builder.build import Built
from posecast_edge.model.meshes.mesh import Floats, Paint, Surface
from posecast_edge.model.meshes.primitives import tessellate
from posecast_edge.model.meshes.reader import COLOURS_MAX, read_mesh, split_by_colour

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def visual(geometry: str, material: str = "") -> str:
    return f"<visual><geometry>{geometry}</geometry>{material}</visual>"


def named(name: str, inside: str = "") -> str:
    return f'<material name="{name}">{inside}</material>'


def color(rgba: str) -> str:
    return f'<color rgba="{rgba}"/>'


BOX = '<box size="1 1 1"/>'


def built(folder: Path, *parts: str, **files: bytes) -> Built:
    return build_robot(written(folder, robot(*parts), **files))


def paints(made: Built) -> list[list[Paint]]:
    """Of each visual, in order."""
    return [[paint for _, paint, _ in made.figure.looks[v.looks].skins] for v in made.figure.visuals]


def colours(made: Built) -> list[str]:
    return [v["color"] for v in json.loads(made.manifest)["visuals"]]


# ---- names ----


def test_a_name_may_be_defined_anywhere(tmp_path: Path) -> None:
    """For the robot, before or after its use, or in the visual of another link, as ROS has it."""
    made = built(
        tmp_path,
        link("a", visual(BOX, named("late")) + visual(BOX, named("inline"))),
        link("b", visual(BOX, named("inline", color("0 1 0 1")))),
        named("late", color("0 0 1 1")),
        '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>',
    )
    assert colours(made) == ["#0000ff", "#00ff00", "#00ff00"]


def test_the_first_meaning_of_a_name_counts(tmp_path: Path) -> None:
    made = built(
        tmp_path,
        named("m", color("1 0 0 1")),
        link("a", visual(BOX, named("m", color("0 1 0 1"))) + visual(BOX, named("", color("0 1 0 1")))),
    )
    assert colours(made) == ["#ff0000", "#00ff00"]  # and materials without a name are each their own


# ---- pictures ----


def textured(name: str) -> str:
    return named("m", f'<texture filename="meshes/{name}"/>')


@pytest.mark.parametrize("shape", [BOX, '<cylinder radius="1" length="2"/>', '<sphere radius="1"/>'])
def test_a_picture_of_the_urdf_on_a_shape(shape: str, tmp_path: Path) -> None:
    made = built(tmp_path, link("a", visual(shape, textured("t.png"))), t_png=PICTURE)
    [[paint]] = paints(made)
    assert paint.texture == PICTURE
    assert b"image/png" in made.files["high.glb"]
    assert b"TEXCOORD_0" in made.files["high.glb"]
    assert "missing" not in json.loads(made.manifest)


def test_shapes_lie_right_under_their_picture() -> None:
    """Each side of a box shows the whole picture; a sphere has north above."""
    [cube] = tessellate("box", (2.0, 2.0, 2.0)).surfaces
    assert cube.uv is not None
    for side in range(6):
        assert sorted(map(tuple, cube.uv[4 * side : 4 * side + 4].tolist())) == [
            (0, 0),
            (0, 1),
            (1, 0),
            (1, 1),
        ]
    upright = cube.positions[: 4 * 4, 2] > 0
    assert (upright == (cube.uv[: 4 * 4, 1] == 0)).all()
    [ball] = tessellate("sphere", (1.0,)).surfaces
    assert ball.uv is not None
    assert np.allclose(
        np.arcsin(np.clip(ball.positions[:, 2], -1, 1)) / np.pi + 0.5, 1 - ball.uv[:, 1], atol=1e-3
    )


@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere", "capsule"])
def test_shapes_are_closed_and_look_outward(kind: str) -> None:
    dims = {"box": (1.0, 2.0, 3.0), "sphere": (1.0,)}.get(kind, (1.0, 2.0))
    expected = {"box": 6.0, "cylinder": 2 * np.pi, "sphere": 4 / 3 * np.pi, "capsule": 10 / 3 * np.pi}[kind]
    assert volume(tessellate(kind, dims)) == pytest.approx(expected, rel=0.02)


def test_a_picture_of_the_urdf_on_a_mesh_with_coordinates(tmp_path: Path) -> None:
    obj = b"vt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1/1 2/2 3/3\n"
    shape = visual('<mesh filename="meshes/a.obj"/>', textured("t.png"))
    made = built(tmp_path, link("a", shape), a_obj=obj, t_png=PICTURE)
    [[paint]] = paints(made)
    assert paint.texture == PICTURE
    [(surface, _, _)] = made.figure.looks[0].skins
    assert surface.uv is not None
    at = {tuple(p): tuple(t) for p, t in zip(surface.positions.tolist(), surface.uv.tolist(), strict=True)}
    assert at == {(0, 0, 0): (0, 1), (1, 0, 0): (1, 1), (1, 1, 0): (1, 0)}


def test_a_picture_of_the_urdf_on_a_mesh_without(tmp_path: Path) -> None:
    shape = visual('<mesh filename="meshes/a.stl"/>', textured("t.png"))
    made = built(tmp_path, link("a", shape), a_stl=cube_stl(), t_png=PICTURE)
    assert colours(made) == ["#ff0000"]
    assert [f.code for f in made.findings if f.code.startswith("texture")] == ["texture-coordinates"]


def test_a_picture_that_is_not_there(tmp_path: Path) -> None:
    made = built(tmp_path, link("a", visual(BOX, textured("gone.png"))))
    [lost] = json.loads(made.manifest)["missing"]
    assert (lost["uri"], lost["reason"].partition(";")[0]) == ("meshes/gone.png", "no such file")
    assert "placeholder" not in json.loads(made.manifest)["visuals"][0]


@pytest.mark.parametrize("line", ["map_Kd t p.png", "map_Kd -s 1 1 1 -bm 0.5 t p.png", "map_Kd\tt p.png"])
def test_a_material_library_with_a_picture(line: str, tmp_path: Path) -> None:
    (tmp_path / "t p.png").write_bytes(PICTURE)
    (tmp_path / "a.mtl").write_text(f"newmtl m one\nKd 0 0 0\n{line}\nd 0.5\n")
    obj = "mtllib a.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nv 0 0 0\nv 1 0 0\nv 1 1 0\nusemtl m one\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(obj)
    [surface] = read_mesh(tmp_path / "a.obj", resolver_at(tmp_path)).surfaces
    assert surface.paint == Paint((1.0, 1.0, 1.0, 0.5), PICTURE)  # black Kd would hide the picture
    assert surface.uv is not None


# ---- colours of vertices ----


def test_colours_of_vertices_become_parts() -> None:
    positions = np.repeat(CUBE_CORNERS[CUBE_FACES].reshape(-1, 3), 1, axis=0)
    of_face = np.array([RED] * 4 + [GREEN] * 6 + [BLUE] * 2, np.float32)
    cube = Surface(
        positions, np.arange(36, dtype=np.int32).reshape(-1, 3), colours=np.repeat(of_face, 3, axis=0)
    )
    parts = {s.paint.rgba[:3]: len(s.faces) for s in split_by_colour(cube) if s.paint}
    assert parts == {RED: 4, GREEN: 6, BLUE: 2}


def test_colours_of_vertices_tint_the_paint() -> None:
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    tint = np.full((3, 3), 0.5, np.float32)
    face = np.array([[0, 1, 2]], np.int32)
    [tinted] = split_by_colour(Surface(positions, face, None, Paint((1.0, 0.5, 0.0, 0.7)), tint))
    assert tinted.paint == Paint((0.5, 0.25, 0.0, 0.7))
    [plain] = split_by_colour(Surface(positions, face, None, Paint((1.0, 0.5, 0.0, 0.7)), tint * 0))
    assert plain.paint == Paint((1.0, 0.5, 0.0, 0.7))  # a layer of colours that nobody filled


def sheet(side: int) -> Surface:
    """side × side squares, without colours."""
    x, y = np.meshgrid(np.arange(side + 1), np.arange(side + 1))
    positions = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3).astype(np.float32)
    a = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    faces = np.concatenate(
        [np.stack([a, a + 1, a + side + 2], 1), np.stack([a, a + side + 2, a + side + 1], 1)]
    )
    return Surface(positions, faces.astype(np.int32))


def test_a_shade_becomes_few_colours_and_a_scan_its_mean() -> None:
    plain = sheet(64)
    shade: Floats = np.repeat(plain.positions[:, :1] / np.float32(64), 3, axis=1).astype(np.float32)
    parts = list(split_by_colour(Surface(plain.positions, plain.faces, colours=shade)))
    assert 4 <= len(parts) <= COLOURS_MAX
    assert sum(len(p.faces) for p in parts) == len(plain.faces)
    noise: Floats = np.random.default_rng(1).random((len(plain.positions), 3), np.float32)
    [mean] = split_by_colour(Surface(plain.positions, plain.faces, colours=noise))
    assert mean.paint is not None
    assert mean.paint.rgba[:3] == pytest.approx((0.5, 0.5, 0.5), abs=0.02)


def test_an_obj_with_colours(tmp_path: Path) -> None:
    obj = cube_obj().decode().splitlines()
    coloured = "\n".join(f"{line} 0 0 1" if line.startswith("v ") else line for line in obj)
    (tmp_path / "a.obj").write_text(coloured)
    [surface] = read_mesh(tmp_path / "a.obj", resolver_at(tmp_path)).surfaces
    assert (surface.paint, surface.spare) == (None, Paint((*BLUE, 1.0)))


@pytest.mark.parametrize(("material", "shown"), [("", "#0000ff"), (named("m", color("1 0 0 1")), "#ff0000")])
def test_one_colour_on_all_vertices_yields_to_the_urdfs(tmp_path: Path, material: str, shown: str) -> None:
    lines = [f"{line} 0 0 1" if line.startswith("v ") else line for line in cube_obj().decode().splitlines()]
    mesh = visual('<mesh filename="meshes/a.obj"/>', material)
    assert colours(built(tmp_path, link("a", mesh), a_obj="\n".join(lines).encode())) == [shown]


def test_a_collada_with_colours(tmp_path: Path) -> None:
    data = cube_collada(effect="<diffuse><color>1 1 1 1</color></diffuse>").decode()
    source = (
        '<source id="c"><float_array id="ca" count="8">1 0 0 1 0 0 1 1</float_array><technique_common>'
        '<accessor source="#ca" count="2" stride="4"/></technique_common></source>'
    )
    numbers = " ".join(f"{v} {int(v > 3)}" for v in CUBE_FACES.reshape(-1))
    start, end = data.index("<p>"), data.index("</p>")
    data = data[:start] + '<input semantic="COLOR" source="#c" offset="1"/><p>' + numbers + data[end:]
    data = data.replace('<vertices id="v">', source + '<vertices id="v">')
    (tmp_path / "a.dae").write_text(data)
    found = read_mesh(tmp_path / "a.dae", resolver_at(tmp_path))
    rgb = {s.paint.rgba[:3] for s in found.surfaces if s.paint}
    assert rgb >= {RED, BLUE}
    assert found.triangles == 12
    assert volume(found) == pytest.approx(0.008, rel=1e-4)


def test_a_glb_with_colours(tmp_path: Path) -> None:
    def colour(document: dict[str, object]) -> None:
        # the first 8 × 12 bytes of positions serve as colours too: x, y, z of corners at 0 and 0.2, linear
        document["accessors"].append({**document["accessors"][0]})  # type: ignore[attr-defined,index]
        primitive = document["meshes"][0]["primitives"][0]  # type: ignore[index]
        primitive["attributes"]["COLOR_0"] = 2
        del primitive["material"]

    (tmp_path / "a.glb").write_bytes(cube_glb(colour))
    found = read_mesh(tmp_path / "a.glb", resolver_at(tmp_path))
    brightest = max(max(s.paint.rgba[:3]) for s in found.surfaces if s.paint)
    assert brightest == pytest.approx(1.055 * 0.2 ** (1 / 2.4) - 0.055, abs=1e-3)  # sRGB of 0.2
    assert found.triangles == 12


# ---- mirrored ----


@pytest.mark.parametrize("scale", ["1 -1 1", "-1 -1 -1", "-2 0.5 1"])
def test_a_mirrored_mesh_still_looks_outward(scale: str, tmp_path: Path) -> None:
    shape = f'<mesh filename="meshes/a.stl" scale="{scale}"/>'
    made = built(tmp_path, link("a", visual(shape)), a_stl=cube_stl())
    assert volume(made.figure.looks[0].mesh) == pytest.approx(0.008, rel=1e-3)
    assert [f.code for f in made.findings if f.code == "scale-mirrored"] == ["scale-mirrored"]


def test_the_picture_for_the_tests_is_one() -> None:
    assert Image.open(io.BytesIO(PICTURE)).size == (4, 4)
