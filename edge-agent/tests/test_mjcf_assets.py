"""Meshes and pictures of MuJoCo models, compiled one by one: they lie and look as in the model as a whole."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from mjcf_stage import write_everything  # noqa: E402
from model_stage import cube_obj, cube_stl  # noqa: E402
from posecast_edge.model.finding import ModelRefused  # noqa: E402
from posecast_edge.model.mjcf import assets  # noqa: E402
from posecast_edge.model.mjcf.assets import find_path, shrink_picture, sort_by_name  # noqa: E402
from posecast_edge.model.mjcf.compiled import CompiledModel  # noqa: E402
from posecast_edge.model.mjcf.compiler import compile_model, explain_failure  # noqa: E402
from posecast_edge.model.mjcf.files import ModelFiles, collect_files  # noqa: E402
from posecast_edge.model.mjcf.reader import load_mjcf  # noqa: E402

MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
OWN = {"body_soft", "body_driven"}  # not MuJoCo's
FRAMES = ("body_pos", "body_quat", "jnt_pos", "jnt_axis", "qpos0", "site_pos")


def png(width: int, height: int, rgb: tuple[int, int, int] = (255, 0, 0)) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", (width, height), rgb).save(out, "PNG")
    return out.getvalue()


def write(folder: Path, asset: str, geom: str) -> Path:
    path = folder / "model.xml"
    body = f'<body name="b"><joint name="j"/><geom size=".1"/>{geom}</body>'
    path.write_text(f"<mujoco><asset>{asset}</asset><worldbody>{body}</worldbody></mujoco>")
    return path


def place_mesh(model: Any, geom: int) -> NDArray[Any]:
    """The mesh that a geom shows, in the frame of its body."""
    mesh = model["geom_dataid"][geom]
    start, count = model["mesh_vertadr"][mesh], model["mesh_vertnum"][mesh]
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model["geom_quat"][geom])
    moved = model["mesh_vert"][start : start + count] @ turned.reshape(3, 3).T
    placed: NDArray[Any] = moved + model["geom_pos"][geom]
    return placed


def test_all_is_where_the_model_as_a_whole_has_it(tmp_path: Path) -> None:
    path = write_everything(tmp_path)
    ours = compile_model(path, ())
    whole = mujoco.MjModel.from_xml_path(str(path))
    known = {name: np.asarray(getattr(whole, name)) for name in ours.arrays.keys() - OWN}
    for name in FRAMES:
        assert np.array_equal(ours[name].reshape(-1), known[name].reshape(-1)), name
    shown = [i for i, kind in enumerate(ours["geom_type"]) if kind == MESH]
    assert len(shown) == 2
    for geom in shown:
        assert np.abs(place_mesh(ours, geom) - place_mesh(known, geom)).max() < 1e-6
    assert np.array_equal(ours["mesh_face"], known["mesh_face"])
    assert np.array_equal(ours["mesh_texcoord"], known["mesh_texcoord"])


def test_a_mesh_that_a_primitive_is_fitted_to_stays(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(cube_stl())
    asset = '<mesh name="m" file="m.stl" scale="1 2 3"/>'
    path = write(tmp_path, asset, '<geom type="box" mesh="m"/><geom type="mesh" mesh="m"/>')
    ours, whole = compile_model(path, ()), mujoco.MjModel.from_xml_path(str(path))
    assert np.array_equal(ours["geom_size"][1], whole.geom_size[1])
    assert np.array_equal(ours["mesh_vert"], whole.mesh_vert)


def test_a_mesh_that_nothing_shows_is_not_compiled(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(b"no mesh")
    ours = compile_model(write(tmp_path, '<mesh name="m" file="m.stl"/>', ""), ())
    assert ours.names["mesh"] == ["m"]


def test_pictures(tmp_path: Path) -> None:
    (tmp_path / "red.png").write_bytes(png(3, 5))
    (tmp_path / "wide.png").write_bytes(png(4096, 2))
    texture = '<texture name="{0}" type="2d" file="{0}.png"/>'
    asset = "".join(texture.format(name) for name in ("red", "wide"))
    sky = '<texture type="skybox" builtin="flat" rgb1="0 0 1" width="200" height="1200"/>'
    ours = compile_model(write(tmp_path, asset + sky, ""), ())
    assert sorted(zip(ours["tex_width"], ours["tex_height"], strict=True))[1:] == [(3, 5), (2048, 2)]
    assert len(ours["tex_data"]) < 3 * (3 * 5 + 2048 * 2) + 100  # of the sky next to nothing


def test_a_picture_that_is_too_large_is_named_and_not_decoded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(assets, "PICTURE_PIXELS_MAX", 63)
    (tmp_path / "m.obj").write_bytes(cube_obj())
    (tmp_path / "red.png").write_bytes(png(8, 8))
    asset = (
        '<texture name="red" type="2d" file="red.png"/><material name="red" texture="red" rgba="1 1 0 1"/>'
    )
    ours = compile_model(write(tmp_path, asset, '<geom size=".2" material="red"/>'), ())
    assert ours.remarks == ("texture 'red': more than 4096 × 4096 points; not shown",)
    assert set(ours["tex_data"].tolist()) == {255}


def test_a_picture_that_is_too_large_is_a_finding(tmp_path: Path) -> None:
    (tmp_path / "red.png").write_bytes(png(4097, 4096))
    path = write(tmp_path, '<texture name="red" type="2d" file="red.png"/>', "")
    assert [f.code for f in load_mjcf(path).urdf.findings] == ["picture"]


def test_shrinking_means() -> None:
    checks = np.zeros((4096, 3000, 3), np.uint8)
    checks[::2] = 200
    assert shrink_picture(checks).shape == (2048, 1500, 3)
    assert set(shrink_picture(checks).reshape(-1)) == {100}
    assert np.array_equal(shrink_picture(checks[:4, :5]), checks[:4, :5])


CONTENTS = {"/r/a/m.stl": b"1", "/r/b/m.stl": b"2", "/r/c/n.stl": b"3", "/r/d/n.stl": b"3"}
PATHS = {
    ("m.stl", "a"): "/r/a/m.stl",
    ("m.stl", "../b/"): "/r/b/m.stl",
    ("b\\m.stl", ""): "/r/b/m.stl",
    ("m.stl", ""): None,  # which?
    ("n.stl", ""): "/r/c/n.stl",  # all the same
    ("m", "a"): None,
    ("", "a"): None,
}


@pytest.mark.parametrize(("name", "folder"), PATHS)
def test_the_file_that_is_meant(name: str, folder: str) -> None:
    assert find_path(name, folder, CONTENTS, sort_by_name(CONTENTS)) == PATHS[name, folder]


REFUSED: dict[str, tuple[bytes, str]] = {
    "m.stl": (b"a" * 50, "MuJoCo: stl_decoder: invalid header"),
    "m.obj": (b"v 0 0 0\n", "MuJoCo: at least 4 vertices required: save it again"),
    "m.png": (b"\x89PNG\r\n\x1a\nnothing", "MuJoCo: error decoding PNG file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_cannot_be_read_is_named(name: str, tmp_path: Path) -> None:
    content, reason = REFUSED[name]
    (tmp_path / name).write_bytes(content)
    kind = "texture" if name.endswith("png") else "mesh"
    asset = f'\n<{kind} name="m" file="{name}"{" type=" + repr("2d") if kind == "texture" else ""}/>'
    path = write(tmp_path, asset, '<geom type="mesh" mesh="m"/>' if kind == "mesh" else "")
    with pytest.raises(ModelRefused) as refused:
        load_mjcf(path)
    assert refused.value.reason.startswith(f"{kind} 'm', file '{name}': ")
    assert reason in refused.value.reason
    assert refused.value.line == 2


def fail(_: Any, *__: Any, **___: Any) -> CompiledModel:
    raise RuntimeError("Caught an unknown exception!")


WITHOUT_WORDS: dict[str, tuple[Callable[[pytest.MonkeyPatch], None], str]] = {
    "a mesh": (
        lambda patch: patch.setattr(assets, "_compile", fail),
        "mesh 'm', file 'm.stl': MuJoCo failed without a reason: save it again",
    ),
    "the model": (
        lambda patch: patch.setattr(mujoco.MjSpec, "from_file", fail),
        "file 'model.xml', or one that it names: MuJoCo failed without a reason: try it",
    ),
}


@pytest.mark.parametrize("case", WITHOUT_WORDS)
def test_where_mujoco_has_no_words(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It raised something that its Python doesn't know."""
    change, said = WITHOUT_WORDS[case]
    (tmp_path / "m.stl").write_bytes(cube_stl())
    path = write(tmp_path, '<mesh name="m" file="m.stl"/>', '<geom type="mesh" mesh="m"/>')
    change(monkeypatch)
    with pytest.raises(ModelRefused) as refused:
        compile_model(path, ())
    assert refused.value.reason.startswith(said)


def test_too_little_memory_is_said_of_the_mesh() -> None:
    refused = explain_failure(MemoryError(), ModelFiles("m.xml"), "mesh 'm', file 'm.stl'")
    assert refused.reason == "mesh 'm', file 'm.stl': needs more memory than is allowed"


def test_nothing_is_kept_between_models(tmp_path: Path) -> None:
    compile_model(write_everything(tmp_path), ())
    assert mujoco.mj_getCacheSize(mujoco.mj_getCache()) == 0
    assert collect_files(tmp_path / "everything.xml").contents
