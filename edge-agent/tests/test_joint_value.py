"""Where a child link is → the value of its joint: there and back."""

from __future__ import annotations

import io
import json
import math
import random

import pytest
from posecast_edge.model.builder.manifest import encode_manifest, make_skeleton
from posecast_edge.model.kinematics import compute_motion, matrix_from_quaternion, multiply, normalise_axis
from posecast_edge.model.moving_joints import MovingJoint, list_built_joints, list_moving_joints
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.sources.ros.robot_frames import compute_joint_value
from posecast_edge.sources.ros.transforms import Pose, Quaternion, multiply_poses

DICE = random.Random(7)


def quaternion() -> Quaternion:
    parts = [DICE.gauss(0, 1) for _ in range(4)]
    length = math.hypot(*parts)
    w, x, y, z = (part / length for part in parts)
    return w, x, y, z


def pose_of(matrix: list[list[float]]) -> Pose:
    """The quaternion by its largest part, as robot_state_publisher's library takes it, of either sign."""
    m = matrix
    squares = [
        1 + m[0][0] + m[1][1] + m[2][2],
        1 + m[0][0] - m[1][1] - m[2][2],
        1 - m[0][0] + m[1][1] - m[2][2],
        1 - m[0][0] - m[1][1] + m[2][2],
    ]
    wx, wy, wz = m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]
    xy, xz, yz = m[0][1] + m[1][0], m[0][2] + m[2][0], m[1][2] + m[2][1]
    k = max(range(4), key=squares.__getitem__)
    s = squares[k]
    rows = [(s, wx, wy, wz), (wx, s, xy, xz), (wy, xy, s, yz), (wz, xz, yz, s)]
    scale = DICE.choice((-1, 1)) / (2 * math.sqrt(s))
    w, x, y, z = (scale * part for part in rows[k])
    return (m[0][3], m[1][3], m[2][3]), (w, x, y, z)


def joint(slides: bool, lower: float | None = None, upper: float | None = None) -> MovingJoint:
    x, y, z = (DICE.uniform(-2, 2) for _ in range(3))
    axis = normalise_axis([DICE.gauss(0, 1) for _ in range(3)])
    return MovingJoint("j", slides, "a", "b", (x, y, z), quaternion(), axis, lower, upper)


def place(of: MovingJoint, value: float) -> Pose:
    """Where forward kinematics puts the child."""
    kind = {"type": "prismatic" if of.slides else "continuous", "axis": of.axis}
    return pose_of(multiply(matrix_from_quaternion(of.xyz, of.quat), compute_motion(kind, [value])))


@pytest.mark.parametrize("slides", [False, True])
def test_there_and_back(slides: bool) -> None:
    for _ in range(2000):
        one, value = joint(slides), DICE.uniform(-3.14, 3.14)
        found = compute_joint_value(one, place(one, value))
        assert found.value == pytest.approx(value, abs=1e-9)
        assert found.off_m < 1e-9
        assert found.off_rad < 1e-7  # half the digits, as an angle about no axis has it


@pytest.mark.parametrize(
    ("lower", "upper", "value"),
    [(0.0, 6.0, 5.5), (-6.0, 0.0, -5.5), (-7.0, 7.0, 3.0), (0.0, 6.28, 0.0), (None, None, -3.0)],
)
def test_an_angle_is_turned_into_its_limits(lower: float | None, upper: float | None, value: float) -> None:
    one = joint(False, lower, upper)
    assert compute_joint_value(one, place(one, value)).value == pytest.approx(value, abs=1e-9)


def test_an_angle_beyond_its_limits_stays_where_it_is() -> None:
    one = joint(False, -1.0, 1.0)
    assert compute_joint_value(one, place(one, 1.5)).value == pytest.approx(1.5, abs=1e-9)


@pytest.mark.parametrize("slides", [False, True])
def test_what_the_axis_does_not_allow_is_told(slides: bool) -> None:
    one = MovingJoint("j", slides, "a", "b", (0, 0, 1), (1, 0, 0, 0), (0, 0, 1))
    tilt = (math.cos(0.05), math.sin(0.05), 0.0, 0.0)
    found = compute_joint_value(one, multiply_poses(place(one, 0.5), ((0.03, 0.04, 0.0), tilt)))
    assert found.value == pytest.approx(0.5)
    assert found.off_m == pytest.approx(0.05)
    assert found.off_rad == pytest.approx(0.1)


# --- the joints that one value moves: of a model as it is read, and of the same once it is built

JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/>{4}</joint>'
LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
LINKS = "".join(f'<link name="{name}"/>' for name in "abcdefg")
ROBOT = f"""<robot name="r">{LINKS}
{JOINT.format("turn", "revolute", "a", "b", LIMIT + '<origin xyz="1 2 3" rpy="0 0 1.5"/><axis xyz="0 3 4"/>')}
{JOINT.format("spin", "continuous", "b", "c", LIMIT)}
{JOINT.format("slide", "prismatic", "c", "d", '<axis xyz="0 0 2"/>')}
{JOINT.format("glue", "fixed", "d", "e", "")}
{JOINT.format("float", "floating", "e", "f", "")}
{JOINT.format("shadow", "revolute", "e", "g", LIMIT + '<mimic joint="turn"/>')}
</robot>"""


def test_joints_of_a_model_as_it_is_and_as_it_is_built() -> None:
    urdf = read_urdf(io.BytesIO(ROBOT.encode()))
    turn, spin, slide = joints = list_moving_joints(urdf)
    assert [(j.name, j.slides, j.parent, j.child) for j in joints] == [
        ("turn", False, "a", "b"),
        ("spin", False, "b", "c"),
        ("slide", True, "c", "d"),
    ]
    assert (turn.xyz, turn.axis, turn.lower, turn.upper) == ((1, 2, 3), (0, 0.6, 0.8), -1, 2)
    assert turn.quat == (math.cos(0.75), 0, 0, math.sin(0.75))
    assert (spin.axis, spin.lower, spin.upper) == ((1, 0, 0), None, None)
    assert slide.axis == (0, 0, 1)
    built = list_built_joints(encode_manifest(make_skeleton(urdf, build_tree(urdf))))
    assert [(j.name, j.slides, j.parent, j.child, j.xyz, j.axis, j.lower, j.upper) for j in built] == [
        (j.name, j.slides, j.parent, j.child, j.xyz, j.axis, j.lower, j.upper) for j in joints
    ]


def test_what_no_manifest_should_hold_is_left_out() -> None:
    good = {"name": "a", "type": "revolute", "parent": 0, "child": 1}
    good |= {"xyz": [0, 0, 0], "quat": [1, 0, 0, 0], "axis": [0, 0, 1]}
    bad = [5, {}, {**good, "child": 7}, {**good, "axis": "z"}, {**good, "xyz": [0, 1e999, 0]}]
    document = {"links": ["base", "tip"], "joints": [*bad, good]}
    assert [joint.name for joint in list_built_joints(json.dumps(document).encode())] == ["a"]
    for nothing in ({}, {"links": 1, "joints": []}, {"links": [], "joints": 3}):
        assert list_built_joints(json.dumps(nothing).encode()) == ()
