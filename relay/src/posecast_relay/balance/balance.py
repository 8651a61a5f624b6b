"""A robot's support and centre of mass in one pose; the same as the page's `Balance`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from posecast_wire.mapping import Ground, Xyz

from posecast_relay.balance.polygon import Xy

# Why a part is None; docs/reference/protocol.md explains each.
BalanceGap = Literal[
    "old-bundle",
    "no-masses",
    "impossible-masses",
    "no-feet",
    "no-wrench",
    "unread",
    "orientation-unread",
    "joint-unread",
    "airborne",
    "first-pose",
]


@dataclass(frozen=True)
class FootBalance:
    """A foot. `name`: the site of its sensor, or its link; `link`: the one that has the sole; `bears`: None
    when its sensor has no reading; `force_n`: the size of the force along the sole's normal; `pressure`: the
    centre of pressure on the sole; `corners`: of the sole. Points are in the world, metres."""

    name: str
    link: str
    bears: bool | None
    force_n: float | None
    pressure: Xyz | None
    at_edge: bool
    corners: tuple[Xyz, ...]


@dataclass(frozen=True)
class BalanceGaps:
    """Why a part is None; None for parts that exist. `polygon` also applies to the floor."""

    centre_of_mass: BalanceGap | None = None
    polygon: BalanceGap | None = None
    margin: BalanceGap | None = None
    pressure: BalanceGap | None = None
    capture_point: BalanceGap | None = None


@dataclass(frozen=True)
class Balance:
    """A robot's balance. Points are in the world (z up), metres; see LinkPoses for where that is.

    `mass_kg`: of all links, 0 when no masses are known; `centre_of_mass`: Σ m·p / Σ m; `velocity`: of it,
    m/s, see VelocityFilter; `capture_point`: where the robot would have to step to come to rest, on the
    floor; `floor_m`: height of the lowest corner of the soles that bear; `polygon`: convex hull of these
    soles' corners, counter-clockwise, () for none; `nearest_edge`: index of the corner where the edge begins
    that is nearest to the centre of mass; `margin_m`: its distance from that, positive inside; `pressure`:
    the centre of pressure of all feet that bear, on the floor; `unread_joints`: those that carry weight and
    have no reading.
    """

    mass_kg: float
    centre_of_mass: Xyz | None
    velocity: Xyz | None
    capture_point: Xyz | None
    floor_m: float | None
    ground: Ground | None
    polygon: tuple[Xy, ...]
    nearest_edge: int | None
    margin_m: float | None
    pressure: Xyz | None
    feet: tuple[FootBalance, ...]
    gaps: BalanceGaps
    unread_joints: tuple[str, ...] = ()


def make_balance_document(balance: Balance) -> Mapping[str, Any]:
    """The member `balance` of a robot's state (docs/reference/protocol.md): metres with tenths of a
    millimetre, newtons with tenths."""
    gaps = balance.gaps
    why = {
        "centre_of_mass_m": gaps.centre_of_mass,
        "support_polygon_m": gaps.polygon,
        "margin_mm": gaps.margin,
        "centre_of_pressure_m": gaps.pressure,
    }
    return {
        "mass_kg": round(balance.mass_kg, 3) if balance.mass_kg else None,
        "centre_of_mass_m": _round_all(balance.centre_of_mass),
        "ground": balance.ground,
        "floor_m": None if balance.floor_m is None else round(balance.floor_m, 4) + 0.0,
        "support_polygon_m": [_round_all(corner) for corner in balance.polygon] or None,
        "margin_mm": None if balance.margin_m is None else round(1000 * balance.margin_m, 1) + 0.0,
        "centre_of_pressure_m": _round_all(balance.pressure),
        "feet": {
            foot.name: {
                "bears": foot.bears,
                "force_n": None if foot.force_n is None else round(foot.force_n, 1),
                "centre_of_pressure_m": _round_all(foot.pressure),
            }
            for foot in balance.feet
        },
        "why": {part: gap for part, gap in why.items() if gap is not None},
    }


def _round_all(point: tuple[float, ...] | None) -> list[float] | None:
    return None if point is None else [round(each, 4) + 0.0 for each in point]
