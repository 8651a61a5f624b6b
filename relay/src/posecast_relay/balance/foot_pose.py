"""A foot in one pose: the position of its sole, and the force on it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from posecast_wire.mapping import Xyz

from posecast_relay.balance.balance import FootBalance
from posecast_relay.balance.feet import Foot
from posecast_relay.balance.sole import OUTSIDE_M, compute_pressure
from posecast_relay.kinematics.link_poses import LinkPose, place_point
from posecast_relay.kinematics.model_tree import Quat
from posecast_relay.kinematics.rotation import rotate_vector
from posecast_relay.kinematics.vector import dot

TILT_COS = 0.5  # cosine of the most that a sole which bears is tilted: 60°
REACH_M = 1e9  # points farther away are invalid


class FootPose(NamedTuple):
    """A foot in the world, metres. `lowest_m`: height of its lowest corner; `is_tilted`:
    by more than 60° or upside down, so that nothing can stand on its sole; `centre`: of its sole; `turn`: of
    the link that has it, world_from_link; `push_n`: the force along the sole's normal, N, with the sensor's
    sign, None where it is not measured or has no reading; `pushed_at`: where in the sole's plane it acts,
    also while the foot does not bear; `at_edge`: whether that is on the sole's edge."""

    foot: Foot
    corners: tuple[Xyz, ...]
    lowest_m: float
    is_tilted: bool
    centre: Xyz
    turn: Quat
    push_n: float | None
    pushed_at: Xyz | None
    at_edge: bool

    @property
    def force_n(self) -> float | None:
        """The size of that force."""
        return None if self.push_n is None else abs(self.push_n)

    def tell(self, link: str, bears: bool | None, least_n: float) -> FootBalance:
        """The foot when it is known whether it bears. A force below `least_n` has a centre of pressure that
        is not worth telling."""
        presses = bears is True and self.force_n is not None and self.force_n >= least_n
        pressure = self.pushed_at if presses else None
        at_edge = pressure is not None and self.at_edge
        return FootBalance(self.foot.name, link, bears, self.force_n, pressure, at_edge, self.corners)


def pose_foot(foot: Foot, codes: Sequence[int], poses: Sequence[LinkPose]) -> FootPose:
    """A foot in a frame: its codes, and world_from_link of each link."""
    world_from_sole, sole = poses[foot.link], foot.sole
    corners = tuple(place_point(world_from_sole, corner) for corner in sole.corners)
    heights = [corner[2] for corner in corners]
    lowest_m = min(heights) if all(map(is_near, corners)) else math.nan
    push_n, pushed_at = _read_push(foot, codes)
    return FootPose(
        foot,
        corners,
        lowest_m,
        rotate_vector(world_from_sole.quat, sole.normal)[2] < TILT_COS,
        place_point(world_from_sole, sole.centre),
        world_from_sole.quat,
        push_n,
        None if pushed_at is None else place_point(world_from_sole, pushed_at),
        pushed_at is not None and sole.is_at_edge(pushed_at),
    )


def is_near(point: Xyz) -> bool:
    """Whether a point is plausible for a robot: data from robots can contain anything."""
    return all(abs(each) <= REACH_M for each in point)


def _read_push(foot: Foot, codes: Sequence[int]) -> tuple[float | None, Xyz | None]:
    """The force along the sole's normal, and where it acts, in the frame of the link that has the sole."""
    sole, sensor = foot.sole, foot.sensor
    sole_from_sensor = foot.sole_from_sensor
    if sensor is None or sole_from_sensor is None or not foot.measures_force:
        return None, None
    wrench = sensor.read(codes)
    if wrench.force is None:
        return None, None
    force = rotate_vector(sole_from_sensor.quat, wrench.force)
    push_n = dot(force, sole.normal)
    if not abs(push_n) < math.inf:
        return None, None
    if wrench.moment is None or not foot.measures_pressure:
        return push_n, None
    moment = rotate_vector(sole_from_sensor.quat, wrench.moment)
    point = compute_pressure(force, moment, sole_from_sensor.xyz, sole.normal, sole.centre)
    return push_n, point if point is not None and sole.is_inside(point, -OUTSIDE_M) else None
