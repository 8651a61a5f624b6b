"""Reads a profile's [balance] table: what the robot stands on, if model and sensors don't define it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, cast

from posecast_wire.schema import CORNERS_MAX, FEET_MAX, GROUNDS, BalanceRule, Ground, SensorMount, Xyz
from posecast_wire.schema import Mapping as Meaning

from posecast_edge.visible import quote

if TYPE_CHECKING:
    from posecast_edge.profile.reader import ProfileReader

WRENCH = "wrench"
AREA_MIN_M2 = 1e-4
REACH_MAX_M = 10.0


def read_balance(reader: ProfileReader, value: object, sensors: Mapping[str, SensorMount]) -> BalanceRule:
    """Parse [balance]. A foot is the site of a wrench sensor, otherwise a link of the model. Raises
    ProfileError, which names the line."""
    item = reader.check_table(value, "balance", ("feet", "ground", "soles"))
    ground = item.get("ground")
    if ground is not None:
        reader.check_choice(ground, GROUNDS, "ground", "balance.ground")
    feet = _feet(reader, item["feet"], sensors, ground == "measured") if "feet" in item else None
    soles = reader.check_table(item.get("soles", {}), "balance.soles")
    if len(soles) > FEET_MAX:
        reader.fail("balance.soles", f"more than {FEET_MAX} soles")
    for foot in soles:
        if feet is not None and foot not in feet:
            reader.fail(f"balance.soles.{foot}", f"{quote(foot)} is not one of the feet")
    read = {foot: _sole(reader, points, f"balance.soles.{foot}") for foot, points in soles.items()}
    return BalanceRule(feet, cast("Ground | None", ground), read)


def find_unknown_feet(meaning: Meaning, links: Collection[str]) -> dict[str, str]:
    """The feet of [balance] that a model with these links lacks → the missing link: the sensor's link,
    otherwise the foot's own name."""
    rule = meaning.balance
    link_of = {foot: _find_link(foot, meaning.sensors) for foot in (*(rule.feet or ()), *rule.soles)}
    return {foot: link for foot, link in link_of.items() if link not in links}


def _feet(
    reader: ProfileReader, value: object, sensors: Mapping[str, SensorMount], is_measured: bool
) -> tuple[str, ...]:
    feet = () if value == [] else reader.check_unique_texts(value, "balance.feet")
    if len(feet) > FEET_MAX:
        reader.fail("balance.feet", f"more than {FEET_MAX} feet")
    for i, foot in enumerate(feet):
        where, mount = f"balance.feet[{i}]", sensors.get(foot)
        if mount is None:
            if is_measured:
                reader.fail(where, f"unknown site {quote(foot)}: list feet with a sensor in [sensors]")
        elif mount.kind != WRENCH:
            reader.fail(where, f"{quote(foot)} is a sensor of kind {mount.kind}, not {WRENCH}")
        elif mount.link is None:
            reader.fail(where, f"sensor {quote(foot)} has no link in [sensors]")
    _refuse_one_link_twice(reader, feet, sensors)
    return feet


def _refuse_one_link_twice(
    reader: ProfileReader, feet: Collection[str], sensors: Mapping[str, SensorMount]
) -> None:
    """Two feet on one link are an error: its force would count twice."""
    foot_on: dict[str, str] = {}
    for i, foot in enumerate(feet):
        link = _find_link(foot, sensors)
        if link in foot_on:
            both = f"{quote(foot_on[link])} and {quote(foot)}"
            reader.fail(f"balance.feet[{i}]", f"{both} are the same foot: both are on link {quote(link)}")
        foot_on[link] = foot


def _find_link(foot: str, sensors: Mapping[str, SensorMount]) -> str:
    """The link of a foot: its sensor's link, otherwise the foot's own name."""
    return (sensors[foot].link or foot) if foot in sensors else foot


def _sole(reader: ProfileReader, value: object, where: str) -> tuple[Xyz, ...]:
    if not isinstance(value, list) or not 3 <= len(value) <= CORNERS_MAX:
        reader.fail(where, f"must be a list of 3 to {CORNERS_MAX} corners, each of three numbers")
    corners = tuple(reader.check_xyz(corner, f"{where}[{i}]") for i, corner in enumerate(value))
    for i, corner in enumerate(corners):
        if max(map(abs, corner)) > REACH_MAX_M:
            reader.fail(f"{where}[{i}]", f"more than {REACH_MAX_M:g} m from its link; give corners in metres")
    if compute_area(corners) < AREA_MIN_M2:
        reader.fail(where, "its corners enclose under 1 cm²; give them in metres, in order around the sole")
    return corners


def compute_area(corners: Sequence[Xyz]) -> float:
    """The area of a polygon in space, m² (half the length of its Newell vector)."""
    x0, y0, z0 = corners[0]
    total = [0.0, 0.0, 0.0]
    for one, other in pairwise(corners):  # each pair forms a triangle with the first corner
        a, b, c = one[0] - x0, one[1] - y0, one[2] - z0
        d, e, f = other[0] - x0, other[1] - y0, other[2] - z0
        for i, part in enumerate((b * f - c * e, c * d - a * f, a * e - b * d)):
            total[i] += part
    return math.hypot(*total) / 2
