"""Computes the velocity of the centre of mass from successive poses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from posecast_wire.mapping import Xyz

from posecast_relay.balance.foot_pose import FootPose
from posecast_relay.kinematics.model_tree import Quat
from posecast_relay.kinematics.rotation import invert_quat, multiply_quats
from posecast_relay.kinematics.vector import subtract

TAU_S = 0.1  # time constant: after this time the output shows 63 % of a change
# Over a longer gap between poses nothing is known of the way between them. A robot that stands still sends a
# frame at its first sample after 0.5 s: with a gap of 0.5 s it would never have a velocity.
GAP_S = 0.75


class _Taken(NamedTuple):
    """A pose: the robot's time, the centre of mass, and the feet that bore, by name."""

    t_s: float
    centre: Xyz
    bearing: Mapping[str, FootPose]


class VelocityFilter:
    """The velocity of the centre of mass (world, m/s), from differences of successive poses.

    It is relative to a foot that bears in both, the one with the greatest force now, else the first: such a
    foot neither slides nor turns about the vertical, while odometry drifts. A low-pass of first order with a
    time constant of 0.1 s smooths it, so what is told lies 0.1 s and half the time between two poses behind.
    It begins anew after more than 0.75 s without a pose, when time runs back, and when no foot bears in both.
    """

    def __init__(self) -> None:
        self._last: _Taken | None = None
        self._velocity: Xyz | None = None

    def follows(self, t_s: float) -> bool:
        """Whether a pose of this time goes on from the one before."""
        return self._last is not None and 0 <= t_s - self._last.t_s <= GAP_S

    def take(self, t_s: float, centre: Xyz | None, bearing: Mapping[str, FootPose] | None) -> Xyz | None:
        """Take a pose and return the velocity. `centre`: centre of mass (world, metres), None while it is not
        known; `bearing`: the feet that bear, by name, None while that is not known. What came before is then
        kept for the next pose."""
        if not self.follows(t_s):
            self._last = self._velocity = None
        if centre is None or bearing is None:
            return None
        last, self_ = self._last, _Taken(t_s, centre, bearing)
        if last is not None and t_s == last.t_s:
            return self._velocity
        self._last = self_
        name = None if last is None else _find_shared(last.bearing, bearing)
        self._velocity = None if last is None or name is None else _smooth(self._velocity, last, self_, name)
        return self._velocity


def _find_shared(before: Mapping[str, FootPose], now: Mapping[str, FootPose]) -> str | None:
    shared = [name for name in now if name in before]
    return max(shared, key=lambda name: now[name].force_n or 0.0, default=None)


def _smooth(velocity: Xyz | None, last: _Taken, now: _Taken, name: str) -> Xyz:
    foot_then, foot_now = last.bearing[name], now.bearing[name]
    cos, sin = _find_twist(multiply_quats(foot_now.turn, invert_quat(foot_then.turn)))
    passed_s = now.t_s - last.t_s
    x, y, z = subtract(last.centre, foot_then.centre)
    to_x, to_y, to_z = subtract(now.centre, foot_now.centre)
    raw = (
        (to_x - (cos * x - sin * y)) / passed_s,
        (to_y - (sin * x + cos * y)) / passed_s,
        (to_z - z) / passed_s,
    )
    if velocity is None:
        return raw
    share = -math.expm1(-passed_s / TAU_S)
    vx, vy, vz = velocity
    old = (cos * vx - sin * vy, sin * vx + cos * vy, vz)
    smoothed = [before + share * (to - before) for before, to in zip(old, raw, strict=True)]
    return (smoothed[0], smoothed[1], smoothed[2])


def _find_twist(turn: Quat) -> tuple[float, float]:
    """Cosine and sine of a rotation's part about the vertical."""
    w, _, _, z = turn
    length2 = w * w + z * z
    return ((w * w - z * z) / length2, 2 * w * z / length2) if length2 > 0 else (1.0, 0.0)
