"""The robots of dm_control, Gymnasium-Robotics and robosuite, where these packages are installed: each
becomes a body whose links are where MuJoCo has them."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from mjcf_stage import assert_as_mujoco
from model_stage import build_robot
from posecast_edge.model.mjcf.reader import load_mjcf

ROBOTS = {
    "dm_control": (
        *(
            f"suite/{name}.xml"
            for name in ("cheetah", "dog", "fish", "humanoid", "humanoid_CMU", "quadruped")
        ),
        *(f"suite/{name}.xml" for name in ("manipulator", "swimmer", "walker")),
        *(f"locomotion/walkers/assets/{name}.xml" for name in ("humanoid_CMU_V2020", "rodent")),
        *(f"third_party/{name}.xml" for name in ("ant/ant", "kinova/jaco_arm", "kinova/jaco_hand")),
    ),
    "gymnasium_robotics": tuple(
        f"envs/assets/{name}.xml" for name in ("adroit_hand/adroit_door", "fetch/reach", "hand/reach")
    ),
    "robosuite": (
        *(
            f"models/assets/robots/{name}/robot.xml"
            for name in (
                "baxter",
                "iiwa",
                "jaco",
                "kinova3",
                "panda",
                "sawyer",
                "spot",
                "tiago",
                "ur5e",
                "xarm7",
            )
        ),
        *(f"models/assets/grippers/{name}.xml" for name in ("inspire_left_hand", "robotiq_gripper_s")),
    ),
}


@pytest.mark.full
@pytest.mark.parametrize(
    ("package", "name"), [(package, name) for package, names in ROBOTS.items() for name in names]
)
def test_a_robot_of_others(package: str, name: str) -> None:
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed (its folder may stand in PYTHONPATH)")
    path = Path(found.origin).parent / name
    robot = load_mjcf(path)
    assert assert_as_mujoco(robot, path, seed=3) >= len(robot.urdf.links) / 4
    built = build_robot(path)
    assert not [f for f in built.findings if f.severity == "error"]
    assert not [v for v in built.document["visuals"] if "placeholder" in v]
    assert len(built.document["visuals"]) >= 3
