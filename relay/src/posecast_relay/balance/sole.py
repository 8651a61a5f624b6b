"""A foot's sole, and where the floor pushes against it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from posecast_wire.mapping import Xyz

from posecast_relay.balance.polygon import find_hull
from posecast_relay.kinematics.vector import add, cross, dot, scale, subtract

EDGE_M = 0.005  # a pressure that is no further inside is on the edge
FORCE_MIN_N = 1e-9  # a smaller force along the normal has no place where it presses
OUTSIDE_M = 0.2  # a pressure that is farther outside is none: no floor is there
REACH_M = 10.0  # farther along an axis is no corner of a foot
FLAT_M = 0.01  # corners of a sole are no farther from its plane
PARALLEL = 1e-6  # two directions are one when the sine between them is less
ORIGIN: Xyz = (0.0, 0.0, 0.0)


class SolePlane(NamedTuple):
    """A sole, in the frame of the link that has it, metres. `corners`: a convex polygon, counter-clockwise
    about `normal` (a unit vector, which points into the foot); `centre`: the mean of the corners."""

    corners: tuple[Xyz, ...]
    normal: Xyz
    centre: Xyz

    def is_at_edge(self, point: Xyz) -> bool:
        """Whether a point of the plane (link's frame) is on the edge: at most 5 mm inside, or outside."""
        return not self.is_inside(point, EDGE_M)

    def is_inside(self, point: Xyz, by_m: float) -> bool:
        """Whether a point of the plane (link's frame) is so far inside every edge."""
        for i, corner in enumerate(self.corners):
            edge = subtract(self.corners[(i + 1) % len(self.corners)], corner)
            if not dot(self.normal, cross(edge, subtract(point, corner))) >= by_m * math.hypot(*edge):
                return False
        return True


def make_sole_plane(points: Sequence[Xyz], inside: Xyz) -> SolePlane | None:
    """The plane of a sole, from points in any order. They may be a centimetre off their plane, which is
    that of the largest triangle with their mean and the point farthest from it. `inside`: a point
    (link's frame) on the foot's side of that plane. None when the points span no area, or are no sole: beyond
    10 m, or not flat."""
    if len(points) < 3 or not all(abs(each) <= REACH_M for point in points for each in point):
        return None
    centre = _find_mean(points)
    arms = [subtract(point, centre) for point in points]
    far = max(arms, key=lambda arm: math.hypot(*arm))
    reach = math.hypot(*far)
    widest = max((cross(far, arm) for arm in arms), key=lambda rest: math.hypot(*rest))
    width = math.hypot(*widest)
    if not (PARALLEL * reach * reach < width < math.inf):
        return None
    normal = scale(widest, (-1 if dot(widest, subtract(inside, centre)) < 0 else 1) / width)
    if any(abs(dot(arm, normal)) > FLAT_M for arm in arms):
        return None
    across = scale(far, 1 / reach)
    along = cross(normal, across)
    flat: dict[tuple[float, float], Xyz] = {}
    for point, arm in zip(points, arms, strict=True):
        flat.setdefault((dot(arm, across), dot(arm, along)), point)
    corners = tuple(flat[each] for each in find_hull(flat))
    return SolePlane(corners, normal, _find_mean(corners))


def compute_pressure(force: Xyz, moment: Xyz, sensor: Xyz, normal: Xyz, origin: Xyz) -> Xyz | None:
    """The centre of pressure of a foot, metres: where in the sole's plane the moment of the wrench lies along
    its normal, p = o + (n x M_o) / (f · n) (Sardain & Bessonnet, 2004). Of a level sole it is the formula of
    Vukobratović & Borovac (2004). It does not depend on whether the wrench is that on the foot or that on the
    floor.

    `force` (N), `moment` (N·m, about the sensor's origin), `sensor` (its origin), `normal` (of the sole) and
    `origin` (any point of its plane) are in the same axes. None where no force goes along the normal.
    """
    pushed_n = dot(force, normal)
    if abs(pushed_n) < FORCE_MIN_N:
        return None
    about_origin = add(moment, cross(subtract(sensor, origin), force))
    return add(origin, scale(cross(normal, about_origin), 1 / pushed_n))


def _find_mean(points: Sequence[Xyz]) -> Xyz:
    x, y, z = (sum(point[axis] for point in points) / len(points) for axis in range(3))
    return (x, y, z)
