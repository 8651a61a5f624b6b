"""Steps → feet, centre of mass, zero-moment point. Periodic: the last step leads to where the first began."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from demo_robot.dynamics import GRAVITY
from demo_robot.robot import HIP_Y
from demo_robot.shapes import Floats

Keys = Sequence[tuple[float, float]]  # (time in s, value)


def ease(u: Floats) -> Floats:
    """0 → 1 with least jerk (Flash & Hogan 1985), constant outside 0…1."""
    u = np.clip(u, 0, 1)
    return np.asarray(u**3 * (10 - 15 * u + 6 * u * u))


def bump(u: Floats) -> Floats:
    """0 → 1 → 0 over 0…1, velocity and acceleration zero at both ends."""
    u = np.clip(u, 0, 1)
    return np.asarray(64 * u**3 * (1 - u) ** 3)


def track(t: Floats, keys: Keys) -> Floats:
    """The curve through the keys, in time order; constant before the first and after the last."""
    value = np.full_like(t, keys[0][1])
    for (t0, v0), (t1, v1) in pairwise(keys):
        if v1 != v0:
            value += (v1 - v0) * ease((t - t0) / (t1 - t0))
    return value


def window(t: Floats, start: float, end: float, ramp: float = 0.5) -> Floats:
    """0 outside, 1 inside, eased over `ramp` seconds within both ends."""
    return ease((t - start) / ramp) * ease((end - t) / ramp)


# --- the gait

COM_HEIGHT = 0.70  # nearly always
CENTRE_X = 0.022  # where a foot bears best, ahead of its ankle


@dataclass(frozen=True)
class Step:
    """One foot leaves the floor at `lift_s` and stands at x, y (m), yaw (rad) from `land_s` on."""

    side: str
    lift_s: float
    land_s: float
    x: float
    y: float
    yaw: float
    height: float = 0.05
    roll_over: float = 0.10  # rad, heel first up, then toe up


@dataclass(frozen=True)
class Foot:
    """One foot over time, in the world: where it is, and whether it stands."""

    x: Floats
    y: Floats
    z: Floats  # of the sole
    yaw: Floats
    pitch: Floats
    stands: Floats  # 1 or 0


@dataclass(frozen=True)
class Gait:
    """Everything the legs need, (n,) or (n, 2) arrays over time, metres in the world."""

    feet: dict[str, Foot]
    centre: dict[str, Floats]  # where a foot is to bear
    zmp: Floats
    com: Floats
    load: dict[str, Floats]  # share of the weight, 0…1, left + right = 1


def stance(x: float, y: float, yaw: float) -> dict[str, tuple[float, float, float]]:
    """Where both feet stand when the robot stands at x, y, yaw."""
    s, c = np.sin(yaw), np.cos(yaw)
    return {"L": (x - HIP_Y * s, y + HIP_Y * c, yaw), "R": (x + HIP_Y * s, y - HIP_Y * c, yaw)}


def walk(
    start_s: float, poses: Sequence[tuple[float, float, float]], first: str, period_s: float
) -> list[Step]:
    """Alternating steps: foot k goes where it stands in pose k: x, y, yaw; one more closes."""
    steps = []
    side = first
    for k, pose in enumerate([*poses, poses[-1]]):
        x, y, yaw = stance(*pose)[side]
        lift = start_s + k * period_s
        steps.append(Step(side, lift, lift + 0.72 * period_s, x, y, yaw))
        side = "R" if side == "L" else "L"
    return steps


def plan(t: Floats, steps: Sequence[Step], lean: Floats) -> Gait:
    """`t`: equally spaced over the period, the end left out. `lean`: how far ahead of their usual place both
    feet bear, m."""
    feet = {side: _foot(t, [s for s in steps if s.side == side], side) for side in "LR"}
    load = _load(t, steps)
    centre = {side: _bearing(feet[side], CENTRE_X + lean) for side in "LR"}
    zmp = load["L"][:, None] * centre["L"] + load["R"][:, None] * centre["R"]
    return Gait(feet, centre, zmp, follow(t[1] - t[0], zmp), load)


def _foot(t: Floats, steps: Sequence[Step], side: str) -> Foot:
    x0, y0, yaw0 = stance(0, 0, 0)[side]
    x, y, yaw = np.full_like(t, x0), np.full_like(t, y0), np.full_like(t, yaw0)
    z, pitch, stands = np.zeros_like(t), np.zeros_like(t), np.ones_like(t)
    for s in steps:
        u = (t - s.lift_s) / (s.land_s - s.lift_s)
        go = ease(u)
        x += (s.x - x0) * go
        y += (s.y - y0) * go
        yaw += (s.yaw - yaw0) * go
        z += s.height * bump(u)
        pitch += s.roll_over * bump(u) * (1 - 2 * np.clip(u, 0, 1))
        stands[(u > 0) & (u < 1)] = 0
        x0, y0, yaw0 = s.x, s.y, s.yaw
    return Foot(x, y, z, yaw, pitch, stands)


def _bearing(foot: Foot, ahead: Floats) -> Floats:
    """Where the foot bears, `ahead` of its ankle; while it swings that is of no account, its share is 0."""
    return np.stack([foot.x + ahead * np.cos(foot.yaw), foot.y + ahead * np.sin(foot.yaw)], axis=1)


def _load(t: Floats, steps: Sequence[Step]) -> dict[str, Floats]:
    """Shares: ½ while standing; over to the other foot before a swing, back (or on to the next) after it."""
    left = np.full_like(t, 0.5)
    now, ordered = 0.5, sorted(steps, key=lambda s: s.lift_s)
    for k, s in enumerate(ordered):
        before = s.lift_s - (ordered[k - 1].land_s if k else 0)
        walking = 0 < before < 1.0
        start = ordered[k - 1].land_s if walking else s.lift_s - 0.9
        target = 0.0 if s.side == "L" else 1.0
        left += (target - now) * ease((t - start) / (s.lift_s - start))
        now = target
        if k + 1 == len(ordered) or ordered[k + 1].lift_s - s.land_s >= 1.0:
            left += (0.5 - now) * ease((t - s.land_s) / 0.8)
            now = 0.5
    return {"L": left, "R": 1 - left}


def follow(dt: float, zmp: Floats) -> Floats:
    """The linear inverted pendulum c'' = g/h (c - zmp), its periodic solution, by Fourier series."""
    omega = 2 * np.pi * np.fft.rfftfreq(len(zmp), dt)
    gain = 1 / (1 + omega**2 * COM_HEIGHT / GRAVITY)
    return np.asarray(np.fft.irfft(np.fft.rfft(zmp, axis=0) * gain[:, None], len(zmp), axis=0))
