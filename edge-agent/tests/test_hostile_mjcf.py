"""MuJoCo models that read what is not theirs, or make MuJoCo hang, crash or fill the memory: one line."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from model_stage import cube_stl
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf import reader
from posecast_edge.model.mjcf.child import run_child
from posecast_edge.model.mjcf.reader import load_mjcf
from posecast_edge.model.urdf.resolver import OUTSIDE
from posecast_edge.sample import SourceError
from posecast_edge.sources.mujoco.model import load_simulation
from posecast_edge.sources.registry import open_source

BODY = '<body name="b"><joint name="j"/><geom size=".1"/></body>'


def mjcf(inside: str = BODY, head: str = "") -> str:
    return f"<mujoco>{head}<worldbody>{inside}</worldbody></mujoco>"


def with_mesh(file: str, compiler: str = "") -> str:
    return mjcf(
        BODY + '<geom type="mesh" mesh="m"/>', f'{compiler}<asset><mesh name="m" file="{file}"/></asset>'
    )


def model(tmp_path: Path, text: str) -> Path:
    """In a folder of its own, with secrets beside, above and elsewhere."""
    folder = tmp_path / "deep" / "er" / "still" / "here" / "robot"
    folder.mkdir(parents=True)
    for place in (tmp_path, folder.parent):
        (place / "secret.stl").write_bytes(cube_stl())
        (place / "secret.xml").write_text("<mujocoinclude><body name='secret'/></mujocoinclude>")
    (folder.parent / ".hidden").mkdir()
    (folder.parent / ".hidden" / "secret.stl").write_bytes(cube_stl())
    for beside in ("meshes", "packed", "shells"):
        (folder.parent / beside).mkdir()
        (folder.parent / beside / "own.stl").write_bytes(cube_stl())
    (folder.parent / "packed" / "package.xml").write_text("<package/>")
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    path = folder / "model.xml"
    path.write_text(text.replace("TMP", str(tmp_path)))
    return path


OUTSIDERS = {
    "an include above": mjcf('<include file="../secret.xml"/>'),
    "an include by its path": mjcf('<include file="TMP/secret.xml"/>'),
    "a model above": mjcf(BODY, '<asset><model name="s" file="../secret.xml"/></asset>'),
    "a mesh above": with_mesh("../secret.stl"),
    "a mesh by its path": with_mesh("TMP/secret.stl"),
    "a mesh in a folder by its path": with_mesh("secret.stl", '<compiler meshdir="TMP"/>'),
    "a mesh behind a link": with_mesh("link.stl"),
    "a mesh in a hidden folder": with_mesh("../.hidden/secret.stl"),
    "a mesh in a folder beside it": with_mesh("own.stl", '<compiler meshdir="../shells"/>'),
    "a mesh with an entity in its name": with_mesh("..&#47;secret.stl"),
    "a height field": mjcf(BODY, '<asset><hfield name="h" file="../secret.png" size="1 1 1 1"/></asset>'),
    "a texture": mjcf(BODY, '<asset><texture name="t" type="2d" file="/etc/secret.png"/></asset>'),
    "a skin": mjcf(BODY, '<deformable><skin file="/etc/secret.skn"/></deformable>'),
    "a file that is none of a model": with_mesh("/etc/passwd"),
}


@pytest.mark.parametrize("case", OUTSIDERS)
def test_nothing_is_read_that_is_not_the_models(case: str, tmp_path: Path) -> None:
    path = model(tmp_path, OUTSIDERS[case])
    with pytest.raises(ModelRefused) as refused:
        load_mjcf(path)
    said = refused.value.reason
    assert OUTSIDE in said or "not a supported mesh" in said or "Error opening file" in said, said
    with pytest.raises(SourceError) as simulated:
        open_source(f"mujoco:{path}", None)
    assert said[:60] in str(simulated.value)


def test_what_the_user_names_belongs_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = model(tmp_path, with_mesh("../secret.stl"))
    assert path.parent.parent / "secret.stl" in load_mjcf(path, [path.parent.parent]).inputs
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(path.parent.parent))
    assert "j" in load_simulation(path).joints


@pytest.mark.parametrize("folder", ["meshes", "packed"])
def test_a_folder_of_meshes_and_a_package_beside_the_model_belong_to_it(folder: str, tmp_path: Path) -> None:
    path = model(tmp_path, with_mesh("own.stl", f'<compiler meshdir="../{folder}"/>'))
    assert len(load_mjcf(path).inputs) == 2


WRONG = {
    "not XML": ("nothing", None, "MuJoCo"),
    "an unknown element": (
        "<mujoco>\n<worldbody>\n<boody/></worldbody></mujoco>",
        3,
        "unrecognized element; element 'boody'",
    ),
    "a part": ("<mujocoinclude/>", None, "give the file that includes it"),
    "no mesh": (with_mesh("none.stl"), None, "file 'none.stl': no such file"),
    "no mass": (mjcf('<body name="b"><joint/></body>'), 1, "give the body a mass"),
    "a circle": ('<mujoco><include file="model.xml"/></mujoco>', 1, "already included"),
    "a name without letters": (mjcf(BODY.replace('"j"', '"a&#10;b"')), 1, "control characters"),
    "a long name": (mjcf(BODY.replace('"j"', f'"{"j" * 300}"')), 1, "longer than 200"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_mujoco_says_comes_in_one_line(case: str, tmp_path: Path) -> None:
    text, line, reason = WRONG[case]
    with pytest.raises(ModelRefused) as refused:
        load_mjcf(model(tmp_path, text))
    assert reason in refused.value.reason
    assert refused.value.line == line
    assert refused.value.reason.isprintable()


HEAVY = {
    "a replica": mjcf('<replicate count="100000000"><geom size=".1"/></replicate>' + BODY),
    "heights": mjcf(head='<asset><hfield name="h" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>'),
    "bodies": mjcf(
        '<replicate count="1500" offset="1 0 0"><body><joint/><geom size=".1"/></body></replicate>'
    ),
    "a texture": mjcf(
        head='<asset><texture name="t" type="2d" builtin="flat" width="20000" height="20000"/></asset>'
    ),
}


@pytest.mark.parametrize("case", HEAVY)
def test_models_that_are_too_much(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "SECONDS_MAX", 3.0)
    with pytest.raises(ModelRefused) as refused:
        load_mjcf(model(tmp_path, HEAVY[case]))
    assert refused.value.reason.isprintable()


def test_a_file_that_is_not_there() -> None:
    with pytest.raises(ModelRefused, match=r"^No such file or directory$"):
        load_mjcf(Path("/none.xml"))


def test_no_file_is_left_open(tmp_path: Path) -> None:
    path = model(tmp_path, mjcf())
    before = len(os.listdir("/proc/self/fd"))
    load_mjcf(path)
    assert len(os.listdir("/proc/self/fd")) == before


def test_a_model_that_takes_too_long_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As by the kernel, after the processor's seconds that a child has."""
    (tmp_path / "slow_model.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGXCPU)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(ModelRefused, match=r"^not loaded within 20 s of CPU time$"):
        run_child("slow_model", [], None, 30.0)
