"""Converts the units that robots report to SI, by quantity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

Quantity = Literal[
    "position", "velocity", "effort", "rotation rate", "acceleration", "force", "torque", "part"
]

DEGREE = math.pi / 180
TURN = 2 * math.pi
ROTATION = {"rad": 1.0, "deg": DEGREE, "°": DEGREE}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
ROTATION_RATE = {"rad/s": 1.0, "deg/s": DEGREE, "°/s": DEGREE, "rpm": TURN / 60}
SPEED = {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3}
FORCE = {"N": 1.0, "mN": 1e-3, "kN": 1e3}
TORQUE = {
    **dict.fromkeys(("N·m", "Nm", "N*m", "N.m"), 1.0),
    **dict.fromkeys(("mN·m", "mNm", "N·mm", "Nmm"), 1e-3),
    **dict.fromkeys(("kN·m", "kNm"), 1e3),
}
ACCELERATION = {
    **dict.fromkeys(("m/s²", "m/s2", "m/s^2"), 1.0),
    **dict.fromkeys(("mm/s²", "mm/s2", "mm/s^2"), 1e-3),
    "g": 9.80665,
}
# a field without a unit uses the usual one, which is SI (SPEC §2)
USUAL = {"": 1.0}

FACTORS: Mapping[Quantity, Mapping[str, float]] = {
    "position": USUAL | ROTATION | LENGTH,
    "velocity": USUAL | ROTATION_RATE | SPEED,
    "effort": USUAL | TORQUE | FORCE,
    "rotation rate": USUAL | ROTATION_RATE,
    "acceleration": USUAL | ACCELERATION,
    "force": USUAL | FORCE,
    "torque": USUAL | TORQUE,
    "part": USUAL,  # of a quaternion
}


def find_factor(quantity: Quantity, unit: str) -> float | None:
    """Return the factor that converts a value in `unit` to SI (rad, m, s, N and their products). None if the
    unit is unknown or measures another quantity."""
    return FACTORS[quantity].get(unit)
