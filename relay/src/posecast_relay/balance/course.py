"""Computes one robot's balance, pose by pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from posecast_wire import Schema
from posecast_wire.mapping import Xyz

from posecast_relay.balance.balance import Balance, BalanceGap, BalanceGaps, FootBalance
from posecast_relay.balance.feet import Foot, FootChoice, choose_feet
from posecast_relay.balance.foot_pose import FootPose, is_near, pose_foot
from posecast_relay.balance.model import BalanceModel
from posecast_relay.balance.polygon import find_hull, find_nearest_edge
from posecast_relay.balance.velocity_filter import VelocityFilter
from posecast_relay.kinematics.link_poses import FrameReadings, LinkPose, place_point
from posecast_relay.kinematics.model_tree import VARIABLES
from posecast_relay.kinematics.vector import add, scale

GRAVITY = 9.81  # m/s²
BEARS_FROM = 0.05  # of the weight, along the sole's normal
BEARS_UNTIL = 0.03  # a bearing foot bears until its force is below this
UNKNOWN_WEIGHT_N = 400.0  # assumed if no masses are known: a foot then bears from 20 N on
CARRIES = 0.01  # a joint carries weight from this share of the mass on
NAN = math.nan
NOWHERE = LinkPose((NAN, NAN, NAN), (NAN, NAN, NAN, NAN))
LOWEST_M = 0.01  # soles that are assumed to bear are at most so much higher than the lowest


class BalanceCourse:
    """The balance of one course of poses, in the order of time: which feet bear, and the velocity, depend on
    the poses before. Another model or schema needs another one.

    Takes time proportional to the model's links, and to n log n of the n corners of its feet.
    """

    def __init__(self, model: BalanceModel, schema: Schema, choice: FootChoice | None = None) -> None:
        """`choice`: the feet, where they have been chosen already."""
        self._model = model
        self._choice = choose_feet(model, schema) if choice is None else choice
        self._weight_n = model.mass_kg * GRAVITY or UNKNOWN_WEIGHT_N
        self._carriers = _list_carriers(model, self._choice.feet)
        self._bore: set[str] = set()
        self._velocity = VelocityFilter()

    @property
    def is_empty(self) -> bool:
        """Whether no pose has a balance, because there are no masses and no feet."""
        return not self._model.inertials and not self._choice.feet

    @property
    def feet(self) -> tuple[str, ...]:
        """The feet's names."""
        return tuple(foot.name for foot in self._choice.feet)

    def read(
        self, codes: Sequence[int], readings: FrameReadings, poses: Sequence[LinkPose], t_s: float
    ) -> Balance:
        """The balance of a frame: its codes and what they say of the body, world_from_link of each link, and
        the robot's time, seconds. Nothing in the world is told while nobody knows how the body is turned, or
        where a joint is that carries weight."""
        unread = tuple(name for name in self._carriers if name in readings.unread)
        blind: BalanceGap | None = "joint-unread" if unread else None
        if readings.lacks_turn:
            blind = "orientation-unread"
        told = self._read(codes, [NOWHERE] * len(poses) if blind else poses, t_s)
        if blind is None:
            return told
        return replace(told, gaps=_name_unread(told.gaps, blind), unread_joints=unread)

    def _read(self, codes: Sequence[int], poses: Sequence[LinkPose], t_s: float) -> Balance:
        centre = _compute_centre(self._model, poses)
        posed = [pose_foot(foot, codes, poses) for foot in self._choice.feet]
        feet, gap = self._judge_feet(posed, self._velocity.follows(t_s))
        bearing = {foot.foot.name: foot for foot, told in zip(posed, feet, strict=True) if told.bears}
        floor_m = None if gap else min(foot.lowest_m for foot in bearing.values()) + 0.0  # never -0
        corners = [] if gap else [(x, y) for foot in bearing.values() for x, y, _ in foot.corners]
        polygon = find_hull(corners)
        nearest = None if centre is None else find_nearest_edge(polygon, centre[:2])
        pressure, pressure_gap = self._sum_pressures(posed, feet, floor_m)
        velocity = self._velocity.take(t_s, centre, None if gap in ("unread", "no-wrench") else bearing)
        capture_point = _find_capture_point(centre, velocity, floor_m)
        centre_gap = None if centre is not None else self._find_centre_gap()
        margin_gap = centre_gap or gap
        return Balance(
            mass_kg=self._model.mass_kg,
            centre_of_mass=centre,
            velocity=velocity,
            capture_point=capture_point,
            floor_m=floor_m,
            ground=self._choice.ground,
            polygon=tuple(polygon),
            nearest_edge=None if nearest is None else nearest.corner,
            margin_m=None if nearest is None else nearest.margin_m,
            pressure=pressure,
            feet=feet,
            gaps=BalanceGaps(
                centre_gap,
                gap,
                margin_gap,
                pressure_gap,
                margin_gap or ("first-pose" if velocity is None else None),
            ),
        )

    def _judge_feet(
        self, posed: Sequence[FootPose], follows: bool
    ) -> tuple[tuple[FootBalance, ...], BalanceGap | None]:
        """Which feet bear, and why there is no polygon."""
        if not posed:
            return (), self._choice.gap
        lowest_m = min(math.inf if foot.is_tilted else foot.lowest_m for foot in posed)
        if any(math.isnan(foot.lowest_m) for foot in posed):
            lowest_m = math.nan
        least_n = BEARS_UNTIL * self._weight_n
        links = self._model.tree.links
        feet: list[FootBalance] = []
        for foot in posed:
            bears: bool | None
            if math.isnan(lowest_m):
                bears = None
            elif foot.is_tilted:
                bears = False
            elif self._choice.ground == "lowest":
                bears = foot.lowest_m <= lowest_m + LOWEST_M
            elif foot.force_n is None:
                bears = None
            else:
                bore = follows and foot.foot.name in self._bore
                bears = foot.force_n >= (BEARS_UNTIL if bore else BEARS_FROM) * self._weight_n
            feet.append(foot.tell(links[foot.foot.link], bears, least_n))
        self._bore = {foot.name for foot in feet if foot.bears}
        return tuple(feet), self._find_gap(posed, feet)

    def _find_gap(self, posed: Sequence[FootPose], feet: Sequence[FootBalance]) -> BalanceGap | None:
        unknown = [
            foot.foot.measures_force for foot, told in zip(posed, feet, strict=True) if told.bears is None
        ]
        if unknown:
            return "unread" if self._choice.ground == "lowest" or all(unknown) else "no-wrench"
        return None if any(foot.bears for foot in feet) else "airborne"

    def _find_centre_gap(self) -> BalanceGap:
        if self._model.inertials is None:
            return "old-bundle"
        if self._model.inertials:
            return "unread"
        return "impossible-masses" if self._model.has_impossible_masses else "no-masses"

    def _sum_pressures(
        self, posed: Sequence[FootPose], feet: Sequence[FootBalance], floor_m: float | None
    ) -> tuple[Xyz | None, BalanceGap | None]:
        """The mean of the feet's centres of pressure, weighted by their forces, on the floor.

        A foot that does not bear counts while it is pressed as the foot with the greatest force is: 4 % of
        the weight 20 cm away are 8 mm. One that is pulled hangs, by its own weight below the sensor.
        """
        if not feet:
            return None, self._choice.gap
        if not all(foot.measures_pressure for foot in self._choice.feet):
            return None, "no-wrench"
        both = list(zip(posed, feet, strict=True))
        if any(
            foot.push_n is None or told.bears is None or (told.bears and foot.push_n and not foot.pushed_at)
            for foot, told in both
        ):
            return None, "unread"
        strongest = max((foot.push_n or 0.0 for foot in posed), key=abs)
        if not strongest or floor_m is None:
            return None, "airborne"
        sums = [0.0, 0.0, 0.0]
        for foot, told in both:
            push_n, at = foot.push_n or 0.0, foot.pushed_at
            if at is not None and (told.bears or push_n * strongest >= 0):
                force_n = abs(push_n)
                sums = [sums[0] + force_n, sums[1] + force_n * at[0], sums[2] + force_n * at[1]]
        point = (sums[1] / sums[0], sums[2] / sums[0], floor_m) if sums[0] > 0 else (math.nan,) * 3
        return (point, None) if is_near(point) else (None, "unread")


def _list_carriers(model: BalanceModel, feet: Sequence[Foot]) -> tuple[str, ...]:
    """The joints of one variable beyond which a foot is, or a noticeable part of the mass."""
    joints = model.tree.joints
    whole = model.mass_kg or 1.0
    loads = [0.0] * len(model.tree.links)
    for each in model.inertials or ():
        loads[each.link] += each.mass_kg
    for foot in feet:
        loads[foot.link] += whole
    for i in reversed(range(len(joints))):
        loads[joints[i].parent] += loads[i + 1]
    return tuple(
        joint.name
        for joint, load in zip(joints, loads[1:], strict=True)
        if joint.mimic is None and len(VARIABLES[joint.type]) == 1 and load >= CARRIES * whole
    )


def _name_unread(gaps: BalanceGaps, why: BalanceGap) -> BalanceGaps:
    return BalanceGaps(**{part: why if gap == "unread" else gap for part, gap in vars(gaps).items()})


def _compute_centre(model: BalanceModel, poses: Sequence[LinkPose]) -> Xyz | None:
    """The centre of mass, world, metres: Σ m·p / Σ m over all links that have a mass; None without any."""
    if not 0 < model.mass_kg < math.inf:
        return None
    total: Xyz = (0.0, 0.0, 0.0)
    for each in model.inertials or ():
        total = add(total, scale(place_point(poses[each.link], each.xyz), each.mass_kg))
    centre = (total[0] / model.mass_kg, total[1] / model.mass_kg, total[2] / model.mass_kg)
    return centre if is_near(centre) else None


def _find_capture_point(centre: Xyz | None, velocity: Xyz | None, floor_m: float | None) -> Xyz | None:
    """Where the robot would have to step to come to rest, on the floor: x + ẋ·√(z/g) with the height z of the
    centre of mass above the floor (Pratt, Carff, Drakunov and Goswami, Humanoids 2006)."""
    if centre is None or velocity is None or floor_m is None:
        return None
    ahead_s = math.sqrt(max(0.0, centre[2] - floor_m) / GRAVITY)
    return (centre[0] + velocity[0] * ahead_s, centre[1] + velocity[1] * ahead_s, floor_m)
