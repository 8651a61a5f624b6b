"""Balance is what the shared vectors say, which an arithmetic of its own made; so does the page."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.balance.balance import Balance
from posecast_relay.balance.course import BalanceCourse
from posecast_relay.balance.model import read_balance_model
from posecast_relay.kinematics.link_poses import FrameReadings, LinkPoses
from posecast_wire import Schema

VECTORS = json.loads((Path(__file__).resolve().parents[2] / "wire" / "vectors" / "balance.json").read_text())
NEAR = 5e-6  # of a metre: what codes of the vectors are rounded to moves a centre of pressure by less
NEAR_N = 2e-3


@pytest.mark.parametrize("case", VECTORS["cases"], ids=lambda case: case["name"])
def test_balance_is_what_the_vectors_say(case: dict[str, Any]) -> None:
    document = {**VECTORS["model"], **case["changes"]}
    manifest = {name: each for name, each in document.items() if each is not None}
    model, schema = read_balance_model(json.dumps(manifest).encode()), Schema.parse(case["schema"])
    readings, poses = FrameReadings(schema), LinkPoses(model.tree)
    course = BalanceCourse(model, schema)
    for i, frame in enumerate(case["frames"]):
        readings.take(frame["codes"])
        poses.update(readings)
        found = tell(course.read(frame["codes"], readings, poses.compute_world_poses(), frame["t"]))
        begin_alike(found, frame["balance"])
        compare(found, frame["balance"], f"frame {i}")


def begin_alike(found: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Count corners from the same one: where two have the least x, rounding says which is the first."""
    polygon, first = found["support_polygon_m"], wanted["support_polygon_m"][:1]
    if polygon and first:
        at = min(range(len(polygon)), key=lambda i: math.dist(polygon[i], first[0]))
        found["support_polygon_m"] = polygon[at:] + polygon[:at]
        if found["nearest_edge"] is not None:
            found["nearest_edge"] = (found["nearest_edge"] - at) % len(polygon)


def compare(found: Any, wanted: Any, where: str) -> None:
    """The numbers within the vectors' rounding, all else exactly."""
    if isinstance(wanted, dict):
        assert isinstance(found, dict), where
        assert found.keys() == wanted.keys(), where
        for name, each in wanted.items():
            compare(found[name], each, f"{where}.{name}")
    elif isinstance(wanted, list):
        assert isinstance(found, list), where
        assert len(found) == len(wanted), where
        for i, each in enumerate(wanted):
            compare(found[i], each, f"{where}[{i}]")
    elif isinstance(wanted, float):
        assert found == pytest.approx(wanted, abs=NEAR_N if where.endswith("force_n") else NEAR), where
    else:
        assert found == wanted, where


def tell(balance: Balance) -> dict[str, Any]:
    """As the vectors have it."""

    def listed(point: Any) -> Any:
        return None if point is None else list(point)

    gaps = vars(balance.gaps)
    return {
        "mass_kg": balance.mass_kg,
        "centre_of_mass_m": listed(balance.centre_of_mass),
        "velocity_mps": listed(balance.velocity),
        "capture_point_m": listed(balance.capture_point),
        "floor_m": balance.floor_m,
        "ground": balance.ground,
        "support_polygon_m": [list(corner) for corner in balance.polygon],
        "nearest_edge": balance.nearest_edge,
        "margin_m": balance.margin_m,
        "centre_of_pressure_m": listed(balance.pressure),
        "feet": {
            foot.name: {
                "bears": foot.bears,
                "force_n": foot.force_n,
                "centre_of_pressure_m": listed(foot.pressure),
                "at_edge": foot.at_edge,
            }
            for foot in balance.feet
        },
        "gaps": {name: gap for name, gap in gaps.items() if gap is not None},
    }
