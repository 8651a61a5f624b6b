"""A small MuJoCo model that has something of everything, and MuJoCo's own kinematics to compare with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from model_stage import cube_obj, cube_stl
from posecast_edge.model.builder.manifest import encode_manifest, make_skeleton
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.urdf.tree import build_tree

from tools.gallery.poses import compare_with_mujoco

MILLIMETRE = 1e-3  # and a thousandth of a radian

EVERYTHING = """<mujoco model="everything">
  <compiler angle="degree" meshdir="meshes" autolimits="true"/>
  <include file="parts/looks.xml"/>
  <asset>
    <mesh name="cube" file="cube.stl" scale="1 2 .5" refpos=".1 0 0" refquat=".8 0 .6 0"/>
    <mesh name="painted" file="painted.obj"/>
    <model name="hand" file="hand.xml"/>
  </asset>
  <worldbody>
    <geom type="plane" size="5 5 .1"/>
    <body name="pillar" pos="0 0 .4"><geom type="cylinder" size=".05 .2"/></body>
    <body name="target" mocap="true"><geom size=".1"/></body>
    <body name="trunk" pos="0 .2 1" euler="10 20 30">
      <joint name="turn" pos=".1 0 .2" axis="1 2 3" range="-90 45"/>
      <joint name="lean" pos="0 .3 0" axis="0 1 0" ref="20"/>
      <geom type="box" size=".2 .1 .15" euler="0 90 0" material="red"/>
      <geom type="ellipsoid" size=".1 .2 .05" pos="0 0 .3"/>
      <site name="imu.1" pos="0 0 .1" euler="0 0 90"/>
      <body name="lift" pos=".3 0 0" quat=".5 .5 .5 .5">
        <joint name="up" type="slide" axis="0 0 2" range="-.1 .4" ref=".05" pos="1 1 1"/>
        <joint name="around" axis="0 0 1" pos="0 .1 0"/>
        <joint name="in" type="slide" axis="1 0 0"/>
        <geom type="mesh" mesh="cube" rgba="0 0 1 1"/>
        <geom type="mesh" mesh="painted" material="checks"/>
        <geom type="capsule" fromto="0 0 0 .1 .2 .3" size=".03" class="hit"/>
        <body name="wrist" pos="0 .1 .2">
          <joint name="ball" type="ball" pos=".05 0 0"/>
          <geom size=".04" rgba="1 1 1 0"/>
          <geom size=".05"/>
          <frame pos="0 .1 0"><attach model="hand" body="palm" prefix="left/"/></frame>
        </body>
      </body>
      <replicate count="3" euler="0 0 120">
        <body name="leg" pos=".3 0 -.1">
          <joint axis="0 1 0"/>
          <geom type="capsule" fromto="0 0 0 0 0 -.3" size=".02"/>
        </body>
      </replicate>
    </body>
    <body name="box" pos="1 2 3" euler="0 0 45"><freejoint name="box"/><geom size=".1"/></body>
  </worldbody>
  <equality>
    <joint joint1="around" joint2="turn" polycoef=".1 -2 0 0 0"/>
    <joint joint1="in" joint2="up" polycoef="0 1 1 0 0"/>
  </equality>
  <actuator><motor name="m" joint="turn"/></actuator>
  <sensor><gyro site="imu.1"/><accelerometer site="imu.1"/><force site="left/tip"/></sensor>
</mujoco>
"""
LOOKS = """<mujocoinclude>
  <default>
    <geom group="2" contype="0" conaffinity="0"/>
    <default class="hit"><geom group="3"/></default>
  </default>
  <asset>
    <texture name="checks" type="2d" builtin="flat" rgb1="0 1 0" width="8" height="8"/>
    <material name="red" rgba="1 0 0 1"/><material name="checks" texture="checks"/>
  </asset>
</mujocoinclude>
"""
HAND = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="palm"><joint name="grip" range="0 1.5"/><geom size=".03" group="2"/>
      <site name="tip" pos="0 0 .1"/></body>
  </worldbody>
</mujoco>
"""


def write_everything(folder: Path) -> Path:
    """The model with all its files. Returns its path."""
    (folder / "parts").mkdir()
    (folder / "meshes").mkdir()
    (folder / "parts" / "looks.xml").write_text(LOOKS)
    (folder / "hand.xml").write_text(HAND)
    (folder / "meshes" / "cube.stl").write_bytes(cube_stl())
    painted = b"".join(b"vt %d %d\n" % corner for corner in ((0, 0), (1, 0), (0, 1)))
    faces = [
        f"f {'/1 '.join(line.split()[1:])}/1" for line in cube_obj().decode().splitlines() if line[:2] == "f "
    ]
    vertices = b"".join(line + b"\n" for line in cube_obj().splitlines() if line[:2] == b"v ")
    (folder / "meshes" / "painted.obj").write_bytes(vertices + painted + "\n".join(faces).encode() + b"\n")
    path = folder / "everything.xml"
    path.write_text(EVERYTHING)
    return path


def make_manifest(robot: RobotFile) -> dict[str, Any]:
    """The skeleton as a viewer gets it: through its bytes."""
    tree = build_tree(robot.urdf)
    assert tree.findings == ()
    document: dict[str, Any] = json.loads(encode_manifest(make_skeleton(robot.urdf, tree)))
    return document


def assert_as_mujoco(robot: RobotFile, path: Path, seed: int) -> int:
    """Assert that every link is where MuJoCo has the body of its name, in random configurations. Returns how
    many links were compared."""
    worst = compare_with_mujoco(make_manifest(robot), path, seed)
    assert worst.distance_m < MILLIMETRE
    assert worst.turn < MILLIMETRE
    return worst.links
