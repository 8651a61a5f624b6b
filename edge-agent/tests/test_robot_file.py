"""A robot's description is read by what stands in the file, not by its name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from model_stage import cube_stl, link, mesh, nothing, robot
from posecast_edge.model.builder.build import build_model
from posecast_edge.model.finding import ModelRefused, advise_mesh_tools
from posecast_edge.model.meshes.mesh import Mesh
from posecast_edge.model.meshes.reader import read_stl
from posecast_edge.model.robot_file import RobotFile, find_format, load_robot_file
from posecast_edge.model.serve.background import BackgroundBuild
from posecast_edge.model.urdf.resolver import Resolver

FORMATS: dict[str, tuple[bytes, str]] = {
    "plain": (b"<robot/>", "urdf"),
    "marked": (b"\xef\xbb\xbf<?xml version='1.0'?>\n<mujoco/>", "mjcf"),
    "late": (b"<!-- mine -->\n<?xml version='1.0'?><mujoco model='m'/>", "mjcf"),
    "wide": ("<?xml version='1.0' encoding='utf-16'?><mujoco/>".encode("utf-16"), "mjcf"),
    "bomb": (b"<!DOCTYPE r [<!ENTITY a 'b'>]><robot>&a;</robot>", "urdf"),
    "other": (b"<html/>", "urdf"),
    "empty": (b"", "urdf"),
    "none": (b"\x00\xff", "urdf"),
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_is_found_by_content(name: str, tmp_path: Path) -> None:
    content, expected = FORMATS[name]
    path = tmp_path / "robot.txt"
    path.write_bytes(content)
    assert find_format(path) == expected


NAMED = "Größe"
OTHER_FORMATS = {
    "r.xacro": f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    f'<xacro:property name="n" value="{NAMED}"/>'
    '<link name="${n}"/></robot>',
    "r.sdf": f'<sdf version="1.9"><model name="m"><link name="{NAMED}"/></model></sdf>',
    "r.xml": f'<mujoco><worldbody><body name="{NAMED}"><geom size="0.1"/></body></worldbody></mujoco>',
}
ENCODED = {
    "utf-8 with a mark": ("", "utf-8-sig"),
    "utf-16 that declares utf-8": ('<?xml version="1.0" encoding="utf-8"?>', "utf-16"),
    "latin-1 that says nothing": ("", "latin-1"),
    "gbk": ('<?xml version="1.0" encoding="gbk"?>', "gb18030"),
}


@pytest.mark.parametrize("encoding", ENCODED)
@pytest.mark.parametrize("name", OTHER_FORMATS)
def test_each_format_is_decoded_alike(name: str, encoding: str, tmp_path: Path) -> None:
    if name == "r.xml":
        pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    head, codec = ENCODED[encoding]
    path = tmp_path / name
    path.write_bytes((head + OTHER_FORMATS[name]).encode(codec))
    found = load_robot_file(path).urdf
    assert NAMED in [one.name for one in found.links]
    codes = [finding.code for finding in found.findings]
    assert ("encoding" in codes) == (codec == "latin-1")


def test_a_urdf_yields_itself(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(robot(link("a")))
    found = load_robot_file(path)
    assert [x.name for x in found.urdf.links] == ["a"]
    assert (found.meshes, found.inputs) == ({}, (path,))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ModelRefused, match="No such file"):
        load_robot_file(tmp_path / "gone.urdf")


ONE_HINGE = (
    '<mujoco><worldbody><body name="arm"><joint name="elbow"/><geom size="0.1"/></body></worldbody></mujoco>'
)


def test_mjcf_is_compiled_by_mujoco(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    path = tmp_path / "robot.xml"
    path.write_text(ONE_HINGE)
    assert [joint.name for joint in load_robot_file(path).urdf.joints if joint.type != "fixed"] == ["elbow"]


def written_urdf(folder: Path, *uris: str) -> Path:
    path = folder / "robot.urdf"
    path.write_text(robot(link("a", "".join(map(mesh, uris)))))
    return path


def test_a_mesh_of_the_file_itself_needs_no_other(tmp_path: Path) -> None:
    cube: Mesh = read_stl(cube_stl())
    path = written_urdf(tmp_path, "mjcf:cube", "mjcf:cube", "mjcf:gone")
    found = RobotFile(load_robot_file(path).urdf, {"mjcf:cube": cube})
    built = build_model(found, Resolver(path), nothing)
    assert [v.get("placeholder") for v in built.document["visuals"]] == [
        None,
        None,
        "mjcf: files are not downloaded",
    ]
    assert [m["uri"] for m in built.document["missing"]] == ["mjcf:gone"]
    assert len(built.figure.looks) == 2


def test_what_only_the_builder_reads_is_not_shown_without_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setitem(sys.modules, "numpy", None)
    shown: list[object] = []
    build = BackgroundBuild(tmp_path / "robot.xml", None, shown.append)
    build.start()
    build.stop()
    assert shown == []
    [record] = caplog.records
    assert f"robot.xml is not shown: it needs the mesh tools: {advise_mesh_tools()}" in record.getMessage()
