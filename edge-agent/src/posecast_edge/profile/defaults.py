"""Defaults that follow from a field's name: unit, step and label set. A profile may override them."""

from __future__ import annotations

from dataclasses import dataclass

from posecast_wire.mapping import Severity

# common spelling → spelling shown to viewers
UNITS = {
    "": "",
    "rad": "rad",
    "m": "m",
    "mm": "mm",
    "rad/s": "rad/s",
    "m/s": "m/s",
    "A": "A",
    "V": "V",
    "W": "W",
    "N": "N",
    "N·m": "N·m",
    "Nm": "N·m",
    "N*m": "N·m",
    "°C": "°C",
    "C": "°C",
    "degC": "°C",
    "m/s²": "m/s²",
    "m/s2": "m/s²",
    "m/s^2": "m/s²",
    "%": "%",
    "s": "s",
    "J": "J",
    "Hz": "Hz",
    "Pa": "Pa",
}


@dataclass(frozen=True)
class WellKnown:
    """Defaults of one field name. `scale`: units per code step."""

    unit: str
    scale: float
    joints: bool = False
    rel: str | None = None


# Scales are half of the smallest difference that is visible on the page.
WELL_KNOWN = {
    "ref": WellKnown("rad", 0.001, joints=True),
    "pos": WellKnown("rad", 0.001, joints=True, rel="ref"),
    "vel": WellKnown("rad/s", 0.01, joints=True),
    "effort": WellKnown("N·m", 0.05, joints=True),
    "cur": WellKnown("A", 0.01, joints=True),
    "duty": WellKnown("%", 1.0, joints=True),
    "heat": WellKnown("J", 1.0, joints=True),
    "temp": WellKnown("°C", 1.0, joints=True),
    "flags": WellKnown("", 1.0, joints=True),
    "ftm": WellKnown("N·m", 0.05),
    "ftf": WellKnown("N", 1.0),
    "quat": WellKnown("", 0.001),
    "tilt": WellKnown("rad", 0.001),
    "gyro": WellKnown("rad/s", 0.01),
    "acc": WellKnown("m/s²", 0.05),
    "volt": WellKnown("V", 0.05),
    "amp": WellKnown("A", 0.1),
    "watt": WellKnown("W", 1.0),
    "charge": WellKnown("%", 0.5),
    "base": WellKnown("m", 0.001),
    "baseq": WellKnown("", 0.001),
    "diag": WellKnown("", 1.0),
}

JOINT_FIELDS = frozenset(name for name, known in WELL_KNOWN.items() if known.joints)

# field → its defaults for sliding joints, if the robot or its model reports them. Halving a step costs one
# bit per joint of the field, so only positions have steps of 0.1 mm.
SLIDING = {
    "ref": WellKnown("m", 0.0001, joints=True),
    "pos": WellKnown("m", 0.0001, joints=True),
    "vel": WellKnown("m/s", 0.005, joints=True),
    "effort": WellKnown("N", 0.05, joints=True),
}

# field → kind of sensor at its sites
SITES_OF = {
    "ftf": "wrench",
    "ftm": "wrench",
    "quat": "imu",
    "tilt": "imu",
    "gyro": "imu",
    "acc": "imu",
    "volt": "power",
    "amp": "power",
    "watt": "power",
    "charge": "power",
}

PLAIN = WellKnown("", 0.001)  # an unknown field: shown as a plain table

# The bits that any robot without a profile can report, least significant first. `homed` and `enabled` are
# added once the robot names them: a robot that never does is not one that is switched off.
FLAG_BITS = (
    "jam",
    "pwmSaturated",
    "bigError",
    "encError",
    "driverFault",
    "motorFail0",
    "motorFail1",
    "posMinError",
    "posMaxError",
    "velError",
    "accError",
    "tempError",
    "comply",
)

# A bit that reports a state rather than a fault.
STATE_BITS: dict[str, Severity] = {
    "homed": "state",
    "enabled": "state",
    "comply": "state",
    "active": "state",
    "driverOn": "state",
    "ctrlOn": "state",
    "mode": "state",
    "limitSwitch": "state",
    "pwmSaturated": "caution",
    "warn": "caution",
    "stale": "caution",
}

# What the parts of a robot report about themselves: bits of the field `diag`.
DIAG_BITS = ("warn", "error", "stale")

TURN = 6.2832
# field → the largest plausible magnitude in the field's unit, and the likely unit of larger readings
MOST = {
    "ref": (1.5 * TURN, "degrees"),
    "pos": (1.5 * TURN, "degrees"),
    "tilt": (0.6 * TURN, "degrees"),
    "vel": (60.0, "degrees a second"),
    "gyro": (60.0, "degrees a second"),
    "cur": (100.0, "mA"),
    "amp": (500.0, "mA"),
    "volt": (1000.0, "mV"),
    "temp": (200.0, "kelvin or °F"),
    "acc": (500.0, "mm/s²"),
    "base": (100.0, "mm"),
    "ftf": (20_000.0, "mN"),
    "ftm": (5_000.0, "N·mm"),
}


def guess_unit(field: str, largest: float) -> str | None:
    """The unit that readings seem to have when `largest`, their largest magnitude, is implausible in the
    field's usual unit; None when it is plausible."""
    most, instead = MOST.get(field, (float("inf"), ""))
    return instead if largest > most else None


def find_usual_unit(field: str) -> str:
    """The usual unit of a field with this name; "" for an unknown name."""
    known = WELL_KNOWN.get(field)
    return known.unit if known else ""
