"""A profile made of a URDF is one the agent takes, and one the doctor finds nothing wrong with."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_stage import run_edge
from model_stage import SHARED
from posecast_edge.cli.profile_new import make_profile_text, split_name
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.profile.reader import load_profile, parse_profile
from posecast_wire.schema import SensorMount
from test_profiles import DRC_URDF, G1_URDF, HUBO_URDF
from test_source_doctor import URDF

G1_HANDS = G1_URDF.with_name("g1_29dof_with_hand_rev_1_0.urdf")


@pytest.mark.parametrize("path", [HUBO_URDF, DRC_URDF, G1_URDF, G1_HANDS], ids=lambda p: p.stem)
@pytest.mark.skipif(not SHARED.is_dir(), reason="no robot models beside this checkout")
def test_of_real_robots(path: Path) -> None:
    urdf = load_urdf(path)
    profile = parse_profile(make_profile_text(urdf, path.name))
    moving = [j.name for j in urdf.joints if j.type in ("revolute", "continuous", "prismatic")]
    assert set(profile.labels["joint"]) == set(moving)
    assert profile.root in {link.name for link in urdf.links}
    assert set(profile.mapping.names) == set(moving)


def test_every_kind_of_joint_and_a_sensor(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    sensor = (
        '<sensor name="wrist ft" type="force_torque"><parent link="hand"/><origin xyz="0 0 0.1"/></sensor>'
    )
    path.write_text(URDF.replace("</robot>", f"{sensor}</robot>"), encoding="utf-8")
    profile = parse_profile(make_profile_text(load_urdf(path), "arm.urdf"))
    assert profile.labels["joint"] == ("shoulder", "elbow", "wrist", "lift")  # grip follows by itself
    assert [f.name for f in profile.fields] == ["ref", "pos", "vel", "ftf", "ftm"]
    assert (profile.mapping.find_unit("pos", "lift"), profile.mapping.find_unit("pos", "elbow")) == (
        "m",
        None,
    )
    assert profile.mapping.find_tolerance("lift") == 0.005
    assert profile.labels["ftm"] == ("wrist ft.mx", "wrist ft.my", "wrist ft.mz")
    assert profile.mapping.sensors == {"wrist ft": SensorMount("wrench", "wrist ft", "hand", (0.0, 0.0, 0.1))}


def test_names_that_bite(tmp_path: Path) -> None:
    path = tmp_path / "odd.urdf"
    name = "a &quot;b&quot; \\ #1.x"
    path.write_text(
        f'<robot name="o&#9;dd"><link name="l"/><link name="m"/><joint name="{name}" type="continuous">'
        '<parent link="l"/><child link="m"/></joint></robot>',
        encoding="utf-8",
    )
    profile = parse_profile(make_profile_text(load_urdf(path), "odd.urdf"))
    assert profile.labels["joint"] == ('a "b" \\ #1.x',)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("left_hip_pitch_joint", "left hip pitch"),
        ("HeadYaw", "head yaw"),
        ("RKN", "RKN"),
        ("arm-1.joint", "arm 1"),
        ("joint", "joint"),
        ("_", "_"),
    ],
)
def test_words(name: str, words: str) -> None:
    assert split_name(name) == words


def test_the_command_writes_a_file_once(tmp_path: Path) -> None:
    urdf, out = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    urdf.write_text(URDF, encoding="utf-8")
    assert run_edge("profile", "new", "--urdf", str(urdf), "-o", str(out)).returncode == 0
    assert load_profile(out).name == "arm"
    assert run_edge("profile", "new", "--urdf", str(urdf)).stdout == out.read_text(encoding="utf-8")
    again = run_edge("profile", "new", "--urdf", str(urdf), "-o", str(out))
    assert (again.returncode, again.stderr) == (
        2,
        f"posecast-edge: {out}: the file exists already and was not changed\n",
    )
    urdf.write_text('<robot name="x"><link name="a"/></robot>', encoding="utf-8")
    statue = run_edge("profile", "new", "--urdf", str(urdf))
    assert statue.returncode == 2
    assert "it has no movable joint" in statue.stderr
    urdf.write_text(
        '<robot name="x"><link name="a"/><link name="b"/><joint name="free" type="floating">'
        '<parent link="a"/><child link="b"/></joint></robot>',
        encoding="utf-8",
    )
    drone = run_edge("profile", "new", "--urdf", str(urdf))
    assert drone.returncode == 2
    assert "it has only floating and planar joints" in drone.stderr
    assert run_edge("profile", "new", "--urdf", str(tmp_path / "gone.urdf")).returncode == 2
