"""A URDF that an SDF includes: the same body as by itself, where the SDF places it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from model_stage import cube_stl, resolver_at
from posecast_edge.model.builder.manifest import make_skeleton
from posecast_edge.model.kinematics import compute_link_poses
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.sdf.reader import load_sdf
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import Link, Urdf

ARM = """<robot name="arm">
<material name="red"><color rgba="1 0 0 1"/></material>
<link name="world"/>
<link name="base"><inertial><mass value="2"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <visual><origin xyz="0 0 .1"/><geometry><mesh filename="meshes/a.stl" scale="2 1 1"/></geometry>
    <material name="red"/></visual>
  <collision><geometry><cylinder radius=".1" length=".3"/></geometry></collision></link>
<link name="upper"><visual><geometry><box size="1 2 3"/></geometry></visual></link>
<link name="slide"><visual><geometry><sphere radius=".2"/></geometry></visual></link>
<link name="float"><visual><geometry><capsule radius=".2" length=".5"/></geometry></visual></link>
<joint name="mount" type="fixed"><origin xyz="0 0 1" rpy="0 0 1.57"/>
  <parent link="world"/><child link="base"/></joint>
<joint name="turn" type="revolute"><origin xyz="1 0 0" rpy=".1 .2 .3"/>
  <parent link="base"/><child link="upper"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="2" velocity="3" effort="4"/></joint>
<joint name="push" type="prismatic"><origin xyz="0 1 0"/><parent link="upper"/><child link="slide"/>
  <limit lower="0" upper=".5" velocity="1" effort="1"/>
  <mimic joint="turn" multiplier="2" offset=".1"/></joint>
<joint name="free" type="floating"><parent link="slide"/><child link="float"/></joint>
<gazebo reference="upper"><sensor name="imu" type="imu"/></gazebo>
</robot>"""
ROBOT = """<sdf version="1.9"><model name="robot"><link name="cart"/>
<include><uri>{}</uri><name>arm</name><pose>0 5 0 0 0 0</pose></include>
<joint name="weld" type="fixed"><parent>cart</parent><child>arm::world</child></joint></model></sdf>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    (tmp_path / "arm" / "meshes" / "a.stl").write_bytes(cube_stl())
    (tmp_path / "arm" / "arm.urdf").write_text(ARM)
    return tmp_path


def include(folder: Path, uri: str) -> Urdf:
    path = folder / "robot.sdf"
    path.write_text(ROBOT.format(uri))
    urdf, inputs = load_sdf(path, resolver_at(folder))
    assert [p.name for p in inputs] == ["robot.sdf", "arm.urdf"]
    return urdf


@pytest.mark.parametrize("uri", ["arm/arm.urdf", "model://arm/arm.urdf"])
def test_it_stands_and_moves_as_by_itself(uri: str, folder: Path) -> None:
    alone, found = load_urdf(folder / "arm" / "arm.urdf"), include(folder, uri)
    assert [f.text for f in (*found.findings, *build_tree(found).findings)] == []
    for turn in (0.0, 0.5):
        readings = {"turn": turn, "free/trans_x": 0.2}
        expected = compute_link_poses(make_skeleton(alone, build_tree(alone)), readings)
        ours = compute_link_poses(
            make_skeleton(found, build_tree(found)), {f"arm::{name}": v for name, v in readings.items()}
        )
        for name, pose in expected.items():
            inside = ours[f"arm::{name}"]
            assert [inside[i][3] - 5.0 * (i == 1) for i in range(3)] == pytest.approx(
                [pose[i][3] for i in range(3)]
            )
            assert [v for row in inside[:3] for v in row[:3]] == pytest.approx(
                [v for row in pose[:3] for v in row[:3]]
            )


def test_it_looks_as_by_itself(folder: Path) -> None:
    alone, found = load_urdf(folder / "arm" / "arm.urdf"), include(folder, "arm/arm.urdf")
    links = {link.name.removeprefix("arm::"): link for link in found.links}
    for link in alone.links:
        ours = links[link.name]
        assert list_sizes(ours) == list_sizes(link)
        assert len(ours.collisions) == len(link.collisions)
    base = links["base"]
    assert base.visuals[0].geometry is not None
    assert base.visuals[0].geometry.uri == "arm/meshes/a.stl"
    assert base.visuals[0].material is not None
    assert base.visuals[0].material.rgba == (1, 0, 0, 1)
    assert base.inertial is not None
    assert base.inertial.mass == 2
    joints = {joint.name: joint for joint in found.joints}
    limit, mimic = joints["arm::turn"].limit, joints["arm::push"].mimic
    assert limit is not None
    assert (limit.lower, limit.upper, limit.velocity, limit.effort) == (-1, 2, 3, 4)
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier, mimic.offset) == ("arm::turn", 2, 0.1)
    assert [(s.name, s.kind, s.link) for s in found.sensors] == [("imu", "imu", "arm::upper")]


def test_what_is_wrong_with_it_is_said_of_the_include(folder: Path) -> None:
    (folder / "arm" / "arm.urdf").write_text("<robot name='arm'/>")
    found = load_robot_file_of(folder)
    [lost] = [f for f in found.findings if f.code == "include"]
    assert (lost.line, lost.text) == (2, "include 'arm/arm.urdf': it has no links")
    (folder / "arm" / "arm.urdf").write_text(ARM.replace("</robot>", ""))
    [lost] = [f for f in load_robot_file_of(folder).findings if f.code == "include"]
    assert lost.text.startswith("include 'arm/arm.urdf': line ")
    assert math.isfinite(lost.line or math.nan)


def list_sizes(link: Link) -> list[tuple[object, ...]]:
    return [(s.geometry.kind, s.geometry.dims, s.geometry.scale) for s in link.visuals if s.geometry]


def load_robot_file_of(folder: Path) -> Urdf:
    path = folder / "robot.sdf"
    path.write_text(ROBOT.format("arm/arm.urdf"))
    return load_robot_file(path, [folder]).urdf
