"""The transforms between links → joints: which frame is which link, what does not fit, what is missing."""

from __future__ import annotations

import math

import pytest
from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.sources.ros.messages import Transform
from posecast_edge.sources.ros.robot_frames import NO_MODEL, JointFrames
from posecast_edge.sources.ros.transforms import FRAMES_MAX, WAIT_S

LEVEL = (1.0, 0.0, 0.0, 0.0)
ELBOW = MovingJoint("elbow", False, "upper", "lower", (0, 0, 1), LEVEL, (0, 0, 1), -2, 2)
LIFT = MovingJoint("lift", True, "base", "/upper", (0, 0, 0), LEVEL, (1, 0, 0))
ARM = (LIFT, ELBOW)
URDF = """<robot name="r"><link name="base"/><link name="upper"/>
<joint name="lift" type="prismatic"><parent link="base"/><child link="upper"/>
<limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""


def frames(
    joints: tuple[MovingJoint, ...] | None = ARM, namespace: str = ""
) -> tuple[JointFrames, list[str]]:
    said: list[str] = []
    made = JointFrames(said.append, namespace)
    if joints is not None:
        made.set_joints(joints)
    return made, said


def lift(metres: float, prefix: str = "", stamp_s: float = 5.0, aside: float = 0.0) -> Transform:
    return Transform(f"{prefix}base", f"{prefix}upper", (metres, aside, 0), LEVEL, stamp_s)


def elbow(angle: float, prefix: str = "", stamp_s: float = 5.0) -> Transform:
    turned = (math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2))
    return Transform(f"{prefix}upper", f"{prefix}lower", (0, 0, 1), turned, stamp_s)


def test_transforms_become_joints() -> None:
    made, said = frames()
    other = Transform("odom", "base", (9, 9, 9), LEVEL, 99.0)
    report = made.take_transforms([other, elbow(0.5, stamp_s=6.0), lift(0.25)], False, 1.0)
    assert report is not None
    assert (report.stamp_s, report.lasts) == (6.0, False)
    assert report.values == {"pos": {"elbow": pytest.approx(0.5), "lift": 0.25}}
    assert made.take_transforms([other], False, 1.0) is None
    made.check_time(1.0 + WAIT_S)
    assert (made.describe(), said) == ("joints from /tf: 2 of 2", [])
    assert made.names == ["lift", "elbow"]


@pytest.mark.parametrize("prefix", ["r1/", "panda_", "a/b/"])
def test_a_prefix_of_all_frames_is_found(prefix: str) -> None:
    made, said = frames()
    stranger = Transform("upper", "other", (0, 0, 0), LEVEL, 5.0)
    report = made.take_transforms([stranger, lift(0.25, prefix), elbow(0.5, prefix)], False, 1.0)
    assert report is not None
    assert report.values["pos"]["lift"] == 0.25
    assert said == []


def test_of_two_robots_the_first_counts_unless_the_namespace_says_which() -> None:
    both = [lift(0.1, "r1/"), elbow(0.1, "r1/"), lift(0.2, "r2/"), elbow(0.2, "r2/")]
    made, said = frames()
    report = made.take_transforms(both, False, 1.0)
    assert report is not None
    assert report.values["pos"]["lift"] == 0.1
    assert said == ["/tf has the frames of several robots, with the prefixes 'r1/', 'r2/': the first is read"]
    made, said = frames(namespace="/r2")
    report = made.take_transforms(both, False, 1.0)
    assert report is not None
    assert (report.values["pos"]["lift"], said) == (0.2, [])


def test_what_does_not_fit_is_one_remark_and_no_reading() -> None:
    made, said = frames()
    for k in range(5):
        report = made.take_transforms([lift(0.25, aside=0.02), elbow(0.5)], False, float(k))
        assert report is not None
        assert report.values["pos"] == {"lift": None, "elbow": pytest.approx(0.5)}
    assert said == [
        "lift is not read from /tf: base → upper is 0.0° and 20 mm off its axis; is this the robot's model?"
    ]
    assert made.describe() == "joints from /tf: 1 of 2; off their axis: lift"
    fits = made.take_transforms([lift(0.25, aside=0.004)], False, 6.0)  # a calibrated robot
    assert fits is not None
    assert fits.values["pos"] == {"lift": 0.25}
    assert made.describe() == "joints from /tf: 2 of 2"


def test_what_is_missing_is_said_once_and_after_a_while() -> None:
    made, said = frames()
    for k in range(4):
        made.take_transforms([lift(0.25)], False, 1.0)
        made.check_time(1.0 + k * WAIT_S / 2)
        line = "joints from /tf: 1 of 2; no transform for elbow (upper → lower)"
        assert said == ([line] if k >= 2 else [])


def test_without_a_model_one_line_says_what_to_add() -> None:
    made, said = frames(None)
    made.explain_missing()
    assert said == []  # nothing came
    for _ in range(3):
        assert made.take_transforms([lift(0.25)], False, 1.0) is None
        made.check_time(1.0 + WAIT_S)
    assert said == [NO_MODEL]
    assert NO_MODEL in made.describe()
    assert not made.wants_transforms
    made.set_description(URDF)  # later, and the frames are known
    assert made.wants_transforms
    report = made.take_transforms([lift(0.25)], False, 9.0)
    assert report is not None
    assert report.values["pos"] == {"lift": 0.25}


def test_the_model_that_is_given_counts_before_the_one_that_is_told() -> None:
    made, said = frames()
    made.set_description(URDF)
    made.take_transforms([lift(0.25)], False, 1.0)
    assert made.names == ["lift", "elbow"]
    made.set_description("<nothing")
    made.take_transforms([lift(0.25)], False, 1.0)
    assert made.names == ["lift", "elbow"]
    made.set_joints(())  # a model that nothing moves
    assert made.take_transforms([lift(0.25)], False, 1.0) is None
    made.check_time(1.0 + WAIT_S)
    assert (made.wants_transforms, said) == (False, [])
    made, said = frames(None)
    made.set_description("<nothing")
    assert made.take_transforms([lift(0.25)], False, 1.0) is None
    assert said == []


def test_frames_are_bounded_and_a_frame_may_move_to_another() -> None:
    made, said = frames()
    many = [Transform("x", f"f{k}", (0, 0, 0), LEVEL, 5.0) for k in range(FRAMES_MAX)]
    made.take_transforms([Transform("x", "upper", (0, 0, 0), LEVEL, 5.0)], False, 1.0)
    assert made.take_transforms([*many, elbow(0.5)], False, 1.0) is None  # no room for a frame more
    report = made.take_transforms([lift(0.25)], False, 1.0)
    assert report is not None
    assert report.values["pos"] == {"lift": 0.25}
    assert said == []


def test_static_transforms_last() -> None:
    made, _ = frames()
    report = made.take_transforms([lift(0.25)], True, 1.0)
    assert report is not None
    assert report.lasts
