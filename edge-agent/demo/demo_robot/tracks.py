"""Curves through keys: at every key the velocity and acceleration are zero, as a hand that arrives."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

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
