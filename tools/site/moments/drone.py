"""A simulated quadrotor: a rigid body with thrust along its own z axis and a controller that flies it.

It takes off, flies a circle, returns to its place after a gust, and lands. There is no drag, nor other wind.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from posecast_edge.sample import Sample

URDF = Path(__file__).with_name("drone.urdf")
RATE_HZ = 60.0  # of samples
STEPS = 8  # of the simulation to a sample
GROUND_M = 0.081  # of the body's centre above the floor, when it stands
HEIGHT_M, RADIUS_M = 1.1, 0.9
UP_S, CIRCLE_S, AROUND_S, GUST_S, CALM_S, DOWN_S, LANDED_S = 0.8, 3.0, 7.5, 9.0, 10.0, 11.6, 13.2
GUST = np.array([0.0, -5.5, 0.0])  # m/s², what it does to the body
GRAVITY = np.array([0.0, 0.0, 9.81])
PUSH, BRAKE = 9.0, 5.0  # of the controller: m/s² for a metre off its place, and for a m/s off its pace
TURN, CALM = 160.0, 22.0  # rad/s² for a radian off its attitude, and for a rad/s
TILT_MAX = 0.7  # rad

Vector = NDArray[np.float64]


def fly(from_s: float, to_s: float) -> Iterator[Sample]:
    """What the drone reports, RATE_HZ times a second."""
    place, speed = np.array([0.0, 0.0, GROUND_M]), np.zeros(3)
    turned, spin = np.eye(3), np.zeros(3)
    step_s, is_down = 1 / (RATE_HZ * STEPS), False
    for number in range(round(to_s * RATE_HZ) + 1):
        t_s = number / RATE_HZ
        felt = turned.T @ GRAVITY
        for part in range(STEPS):
            now_s = t_s + part * step_s
            aim, pace = aim_at(now_s)
            gain = (aim_at(now_s + step_s)[1] - pace) / step_s  # of pace, m/s²
            wanted = PUSH * (aim - place) + BRAKE * (pace - speed) + gain + GRAVITY
            thrust = max(0.0, float(wanted @ turned[:, 2])) if now_s >= UP_S and not is_down else 0.0
            felt = np.array([0.0, 0.0, thrust])
            moved = thrust * turned[:, 2] - GRAVITY + (GUST if GUST_S <= now_s < CALM_S else 0.0)
            speed, spin = speed + moved * step_s, spin + (_right(turned, wanted) - CALM * spin) * step_s
            place = place + speed * step_s
            if place[2] <= GROUND_M:  # it stands on the floor
                is_down = now_s > DOWN_S
                place[2], speed, spin, turned = GROUND_M, np.zeros(3), np.zeros(3), _level(turned)
                felt = turned.T @ GRAVITY
            turned = turned @ _rotation(spin * step_s)
        if t_s >= from_s:
            yield _report(t_s, place, turned, spin, felt)


def aim_at(t_s: float) -> tuple[Vector, Vector]:
    """Where it should be at a time, m, and how fast, m/s."""
    rise = _ease((t_s - UP_S) / (CIRCLE_S - UP_S)) - _ease((t_s - DOWN_S) / (LANDED_S - DOWN_S))
    around = 2 * math.pi * _ease((t_s - CIRCLE_S) / (AROUND_S - CIRCLE_S))
    climbs = _slope((t_s - UP_S) / (CIRCLE_S - UP_S)) / (CIRCLE_S - UP_S)
    climbs -= _slope((t_s - DOWN_S) / (LANDED_S - DOWN_S)) / (LANDED_S - DOWN_S)
    turns = 2 * math.pi * _slope((t_s - CIRCLE_S) / (AROUND_S - CIRCLE_S)) / (AROUND_S - CIRCLE_S)
    low = GROUND_M - 0.03 * (t_s > DOWN_S)  # it comes down on the floor, not just above
    aim = (RADIUS_M * math.sin(around), RADIUS_M * (1 - math.cos(around)), low + HEIGHT_M * rise)
    pace = (RADIUS_M * math.cos(around) * turns, RADIUS_M * math.sin(around) * turns, HEIGHT_M * climbs)
    return np.array(aim), np.array(pace)


def _ease(x: float) -> float:
    """From 0 to 1, at rest at both ends."""
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10 - 15 * x + 6 * x * x)


def _slope(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return 30 * x * x * (1 - x) ** 2


def _right(turned: Vector, wanted: Vector) -> Vector:
    """What turns its z to where the thrust is wanted, and its nose forward; rad/s² about its own axes."""
    up = wanted / max(float(np.linalg.norm(wanted)), 1e-9)
    sideways = float(np.linalg.norm(up[:2]))
    if sideways > math.sin(TILT_MAX):
        up = np.array([*(up[:2] / sideways * math.sin(TILT_MAX)), math.cos(TILT_MAX)])
    left = np.cross(up, [1.0, 0.0, 0.0])
    left /= np.linalg.norm(left)
    error = turned.T @ np.column_stack((np.cross(left, up), left, up))
    axis = np.array([error[2, 1] - error[1, 2], error[0, 2] - error[2, 0], error[1, 0] - error[0, 1]]) / 2
    return TURN * axis


def _level(turned: Vector) -> Vector:
    """The same heading, upright."""
    yaw = math.atan2(turned[1, 0], turned[0, 0])
    return _rotation(np.array([0.0, 0.0, yaw]))


def _rotation(turn: Vector) -> Vector:
    """A rotation vector, rad, as a matrix."""
    angle = float(np.linalg.norm(turn))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def _report(t_s: float, place: Vector, turned: Vector, spin: Vector, felt: Vector) -> Sample:
    w = math.sqrt(max(0.0, 1 + float(np.trace(turned)))) / 2
    quat = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    x, y, z = (quat / (4 * w)).tolist()
    turn = {"x": x, "y": y, "z": z, "w": w}
    volts = 16.4 - 0.02 * t_s - 0.05 * float(np.linalg.norm(felt)) / 9.81
    return Sample(
        t_s,
        {
            "base": {f"base.{axis}": v for axis, v in zip("xyz", place.tolist(), strict=True)},
            "baseq": {f"base.{axis}": v for axis, v in turn.items()},
            "gyro": {f"imu.{axis}": v for axis, v in zip("xyz", spin.tolist(), strict=True)},
            "acc": {f"imu.{axis}": v for axis, v in zip("xyz", felt.tolist(), strict=True)},
            "volt": {"battery": volts},
        },
    )
