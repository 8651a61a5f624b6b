"""Where a child link is → the value of its joint: there and back."""

from __future__ import annotations

import math
import random

import pytest
from posecast_edge.model.kinematics import compute_motion, matrix_from_quaternion, multiply, normalise_axis
from posecast_edge.model.moving_joints import MovingJoint
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
