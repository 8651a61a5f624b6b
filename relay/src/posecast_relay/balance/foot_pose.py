"""A foot in one pose: where its sole is, and what pushes against it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from posecast_wire.mapping import Xyz

from posecast_relay.balance.balance import FootBalance
from posecast_relay.balance.feet import Foot
from posecast_relay.balance.sole import compute_pressure
from posecast_relay.kinematics.link_poses import LinkPose, place_point
from posecast_relay.kinematics.model_tree import Quat
from posecast_relay.kinematics.rotation import rotate_vector
from posecast_relay.kinematics.vector import dot

REACH_M = 1e9  # points beyond are no points of a robot


class FootPose(NamedTuple):
    """A foot in the world, metres. `lowest_m`: height of its lowest corner; `centre`: of its sole; `turn`: of
    the link that has it, world_from_link; `force_n`: the size of the force
    along the sole's normal, None where it is not measured or has no reading; `pressure`: where in the sole's
    plane it acts, likewise; `at_edge`: whether that is on the sole's edge."""

    foot: Foot
    corners: tuple[Xyz, ...]
    lowest_m: float
    centre: Xyz
    turn: Quat
    force_n: float | None
    pressure: Xyz | None
    at_edge: bool

    def tell(self, link: str, bears: bool | None, least_n: float) -> FootBalance:
        """The foot when it is known whether it bears: only if so, and from `least_n` on, it presses."""
        presses = bears is True and self.force_n is not None and self.force_n >= least_n
        pressure = self.pressure if presses else None
        at_edge = pressure is not None and self.at_edge
        return FootBalance(self.foot.name, link, bears, self.force_n, pressure, at_edge, self.corners)


def pose_foot(foot: Foot, codes: Sequence[int], poses: Sequence[LinkPose]) -> FootPose:
    """A foot in a frame: its codes, and world_from_link of each link."""
    world_from_sole, sole = poses[foot.link], foot.sole
    corners = tuple(place_point(world_from_sole, corner) for corner in sole.corners)
    heights = [corner[2] for corner in corners]
    lowest_m = min(heights) if all(map(is_near, corners)) else math.nan
    force_n, pressure = _read_push(foot, codes)
    return FootPose(
        foot,
        corners,
        lowest_m,
        place_point(world_from_sole, sole.centre),
        world_from_sole.quat,
        force_n,
        None if pressure is None else place_point(world_from_sole, pressure),
        pressure is not None and sole.is_at_edge(pressure),
    )


def is_near(point: Xyz) -> bool:
    """Whether a point is where a robot can be: what a robot wrote may lead to anything."""
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
    force_n = abs(dot(force, sole.normal))
    if not force_n < math.inf:
        return None, None
    if wrench.moment is None or not foot.measures_pressure:
        return force_n, None
    moment = rotate_vector(sole_from_sensor.quat, wrench.moment)
    point = compute_pressure(force, moment, sole_from_sensor.xyz, sole.normal, sole.centre)
    return force_n, point if point is not None and is_near(point) else None
