"""The demo robot's skeleton: links, joints, limits.

x forward, y left, z up, metres, radians. At zero it stands straight, arms hanging. The axes of each hip, each
ankle, each shoulder and each wrist meet in a point, so that legs and arms have closed solutions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

HIP_Y = 0.084
THIGH = 0.300
SHIN = 0.300
ANKLE = 0.078  # above the sole
WAIST_Z = 0.115
SHOULDER_Y = 0.192
SHOULDER_Z = 0.262
UPPER_ARM = 0.232
FOREARM = 0.212
NECK_Z = 0.338
MASS_KG = 42.0

Xyz = tuple[float, float, float]
ZERO: Xyz = (0.0, 0.0, 0.0)
AXES: dict[str, Xyz] = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0)}

COLOURS = {
    "white": (0.905, 0.912, 0.922),
    "graphite": (0.150, 0.165, 0.190),
    "steel": (0.400, 0.425, 0.460),
    "visor": (0.030, 0.038, 0.052),
    "accent": (0.090, 0.500, 0.560),
}

CHANNELS = (
    *("WST", "NKY", "NK1", "NK2"),
    *("LSP", "LSR", "LSY", "LEB", "LWY", "LWR", "LWP"),
    *("RSP", "RSR", "RSY", "REB", "RWY", "RWR", "RWP"),
    *("LHY", "LHR", "LHP", "LKN", "LAP", "LAR"),
    *("RHY", "RHR", "RHP", "RKN", "RAP", "RAR"),
    *("RF1", "RF2", "RF3", "RF4", "RF5"),
    *("LF1", "LF2", "LF3", "LF4", "LF5"),
)

FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")


@dataclass(frozen=True)
class Joint:
    """One revolute joint: the child's frame stands at `xyz`, `rpy` in the parent's and turns about `axis`."""

    name: str
    parent: str
    child: str
    xyz: Xyz
    axis: str
    low: float
    high: float
    rpy: Xyz = ZERO


@dataclass(frozen=True)
class Visual:
    """A shell on a link: a mesh file by its stem, and a colour."""

    mesh: str
    colour: str
    xyz: Xyz = ZERO
    rpy: Xyz = ZERO


def _leg(s: str, y: int) -> Iterator[Joint]:
    out, within = (0.42, 0.42)
    yield Joint(f"{s}HY", "Body_Hip", f"Body_{s}HY", (0, y * HIP_Y, 0), "z", -0.9, 0.9)
    roll = (-within, out) if y > 0 else (-out, within)
    yield Joint(f"{s}HR", f"Body_{s}HY", f"Body_{s}HR", ZERO, "x", *roll)
    yield Joint(f"{s}HP", f"Body_{s}HR", f"Body_{s}HP", ZERO, "y", -1.5, 0.9)
    yield Joint(f"{s}KN", f"Body_{s}HP", f"Body_{s}KN", (0, 0, -THIGH), "y", -0.05, 2.2)
    yield Joint(f"{s}AP", f"Body_{s}KN", f"Body_{s}AP", (0, 0, -SHIN), "y", -1.2, 0.9)
    yield Joint(f"{s}AR", f"Body_{s}AP", f"Body_{s}AR", ZERO, "x", -0.4, 0.4)


def _arm(s: str, y: int) -> Iterator[Joint]:
    def sided(low: float, high: float) -> tuple[float, float]:
        return (low, high) if y > 0 else (-high, -low)

    yield Joint(f"{s}SP", "Body_Torso", f"Body_{s}SP", (0, y * SHOULDER_Y, SHOULDER_Z), "y", -3.1, 1.5)
    yield Joint(f"{s}SR", f"Body_{s}SP", f"Body_{s}SR", ZERO, "x", *sided(0.0, 2.9))
    yield Joint(f"{s}SY", f"Body_{s}SR", f"Body_{s}SY", ZERO, "z", *sided(-1.8, 2.6))
    yield Joint(f"{s}EB", f"Body_{s}SY", f"Body_{s}EB", (0, 0, -UPPER_ARM), "y", -2.4, 0.05)
    yield Joint(f"{s}WY", f"Body_{s}EB", f"Body_{s}WY", (0, 0, -0.108), "z", *sided(-2.6, 2.6))
    yield Joint(f"{s}WR", f"Body_{s}WY", f"Body_{s}WR", (0, 0, 0.108 - FOREARM), "x", *sided(-0.8, 0.8))
    yield Joint(f"{s}WP", f"Body_{s}WR", f"Body_{s}WP", ZERO, "y", -1.2, 1.2)


def _hand(s: str, y: int) -> Iterator[Joint]:
    side = "left" if y > 0 else "right"
    curl = "-x" if y > 0 else "x"
    thumb_rpy = (0.0, -0.72, y * 0.75)
    roots: dict[str, tuple[Xyz, Xyz]] = {
        "Thumb": ((0.026, -y * 0.004, -0.042), thumb_rpy),
        "Index": ((0.0285, 0, -0.094), (0, -0.06, 0)),
        "Middle": ((0.0095, 0, -0.098), (0, -0.02, 0)),
        "Ring": ((-0.0095, 0, -0.096), (0, 0.02, 0)),
        "Pinky": ((-0.0280, 0, -0.090), (0, 0.06, 0)),
    }
    for finger, (xyz, rpy) in roots.items():
        parent = f"Body_{s}WP"
        for knuckle, (part, at) in enumerate(
            (("Proximal", xyz), ("Medial", (0, 0, -0.033)), ("Distal", (0, 0, -0.025))), start=1
        ):
            child = f"{side}{finger}{part}"
            turn = rpy if knuckle == 1 else ZERO
            yield Joint(f"{side}{finger}Knuckle{knuckle}", parent, child, at, curl, -0.1, 1.5, turn)
            parent = child


ROOT = "Body_Hip"
JOINTS: tuple[Joint, ...] = (
    Joint("WST", ROOT, "Body_Torso", (0, 0, WAIST_Z), "z", -1.0, 1.0),
    Joint("NKY", "Body_Torso", "Body_Neck", (0.004, 0, NECK_Z), "z", -1.4, 1.4),
    Joint("HNP", "Body_Neck", "Body_HNP", (0, 0, 0.052), "y", -0.6, 0.6),
    Joint("HNR", "Body_HNP", "Body_Head", ZERO, "x", -0.5, 0.5),
    *_arm("L", 1),
    *_arm("R", -1),
    *_hand("L", 1),
    *_hand("R", -1),
    *_leg("L", 1),
    *_leg("R", -1),
)
LINKS: tuple[str, ...] = (ROOT, *(j.child for j in JOINTS))


def mapping() -> dict[str, tuple[tuple[tuple[str, float], ...], float]]:
    """URDF joint → (channels with their gains, offset in rad), as profiles/demo.toml has it (a test holds).

    Channel zero: arms a little away from the body, elbows slightly bent. Two cranks push the head. One motor
    bends the three knuckles of a finger.
    """
    same = {j.name: (((j.name, 1.0),), 0.0) for j in JOINTS if j.name in CHANNELS}
    for name, degrees in (("LSR", 15), ("RSR", -15), ("LEB", -10), ("REB", -10)):
        same[name] = (((name, 1.0),), math.radians(degrees))
    neck: dict[str, tuple[tuple[tuple[str, float], ...], float]] = {
        "HNP": ((("NK1", 0.5), ("NK2", 0.5)), 0.0),
        "HNR": ((("NK1", -0.5), ("NK2", 0.5)), 0.0),
    }
    fingers = {
        f"{side}{finger}Knuckle{k}": (((f"{s}F{i}", 1.0),), 0.0)
        for s, side in (("R", "right"), ("L", "left"))
        for i, finger in enumerate(FINGERS, start=1)
        for k in (1, 2, 3)
    }
    return {**same, **neck, **fingers}
