"""Compares the page's centre of pressure and support polygon with MuJoCo's contacts, for a humanoid that
stands, leans and walks. `make balance` and `make test-full` run it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
pytest.importorskip("scipy", reason="SciPy is not installed")

from scipy.spatial import ConvexHull

from tests.balance.humanoid import GAITS, JOINTS, SOLE, find_pressure, make_manifest, make_sensors, play
from tests.balance.page import build_fine_schema, encode_values, read_balance

pytestmark = pytest.mark.full

CLOSE_M = 0.005
# The part of the weight from which on the centre of pressure of one foot is compared: what is below its
# sensor (0.25 kg here) also weighs, and is thrown about at the landing, so that one with less is up to 8 mm
# off.
LOADED = 1 / 3


@pytest.mark.parametrize("gait", GAITS)
def test_the_page_agrees_with_the_contacts(gait: str) -> None:
    joints = [f"{s}_{joint}" for s in "rl" for joint in JOINTS]
    schema, manifest, frames, truths = "", dict[str, Any](), list[dict[str, Any]](), list[dict[str, Any]]()
    for model, data in play(gait):
        if not schema:
            manifest = make_manifest(model)
            schema = build_fine_schema(joints, make_sensors(model), ("r", "l"))
        frames.append({"t": data.time, "codes": encode_values(schema, read_values(model, data, joints))})
        truths.append(read_truth(model, data))
    weight = manifest_mass(manifest) * 9.81
    worst = dict.fromkeys(("centre of mass", "pressure", "of a foot", "polygon"), 0.0)
    compared = dict.fromkeys(worst, 0)
    single = 0
    for i, (found, truth) in enumerate(zip(read_balance(manifest, schema, frames), truths, strict=True)):
        note(worst, compared, "centre of mass", math.dist(found["centre_of_mass_m"], truth["centre"]))
        bearing = [s for s in "rl" if found["feet"][s]["bears"]]
        single += len(bearing) == 1
        assert bearing, f"frame {i}: nothing bears"
        total = sum(truth["forces"].values())
        mean = sum(truth["forces"][s] * truth["points"][s] for s in "rl" if truth["forces"][s] > 0) / total
        pressed = np.array(found["centre_of_pressure_m"])
        note(worst, compared, "pressure", float(np.linalg.norm((pressed - mean)[:2])))
        for s in bearing:
            if truth["forces"][s] < LOADED * weight:
                continue
            off = np.array(found["feet"][s]["centre_of_pressure_m"]) - truth["points"][s]
            note(worst, compared, "of a foot", float(np.linalg.norm(off[:2])))
        corners = np.array([corner for s in bearing for corner in truth["soles"][s]])[:, :2]
        note(worst, compared, "polygon", compare_hulls(np.array(found["support_polygon_m"]), corners))
    print(f"{gait}: {len(frames)} poses, {single} on one foot; ", end="")
    print(", ".join(f"{what} {1000 * by:.3f} mm ({compared[what]})" for what, by in worst.items()))
    assert min(compared.values()) > 100
    assert (single > 100) == (gait == "walking")
    assert worst["centre of mass"] <= 0.001
    assert worst["pressure"] <= CLOSE_M
    assert worst["of a foot"] <= CLOSE_M
    assert worst["polygon"] <= 1e-6


def note(worst: dict[str, float], compared: dict[str, int], what: str, metres: float) -> None:
    """Keeps the largest."""
    worst[what] = max(worst[what], metres)
    compared[what] += 1


def compare_hulls(polygon: Any, points: Any) -> float:
    """How far, at most, a corner of either hull is from the other's edges, m. SciPy's is Qhull."""
    hull = points[ConvexHull(points).vertices]
    off = [distance_to_outline(corner, hull) for corner in polygon]
    return max(off + [distance_to_outline(corner, polygon) for corner in hull])


def distance_to_outline(point: Any, polygon: Any) -> float:
    """Metres to the nearest edge."""
    least = math.inf
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        part = min(1.0, max(0.0, float((point - a) @ (b - a)) / float((b - a) @ (b - a))))
        least = min(least, float(np.linalg.norm(point - a - part * (b - a))))
    return least


def read_values(model: Any, data: Any, joints: list[str]) -> dict[str, float]:
    """The robot's report, by "FIELD LABEL"."""
    values = {f"pos {name}": float(data.qpos[model.joint(name).qposadr[0]]) for name in joints}
    values |= {f"base base.{part}": float(data.qpos[i]) for i, part in enumerate("xyz")}
    values |= {f"baseq base.{part}": float(data.qpos[3 + i]) for i, part in enumerate("wxyz")}
    for s in "rl":
        for field, kind, first in (("ftf", "force", "f"), ("ftm", "torque", "m")):
            vector = data.sensor(f"{s}_{kind}").data
            values |= {f"{field} {s}.{first}{axis}": float(vector[i]) for i, axis in enumerate("xyz")}
    return values


def read_truth(model: Any, data: Any) -> dict[str, Any]:
    """MuJoCo's result."""
    points, forces = find_pressure(model, data)
    soles = {}
    for s in "rl":
        body = data.body(f"{s}_foot")
        soles[s] = [body.xmat.reshape(3, 3) @ corner + body.xpos for corner in np.array(SOLE)]
    return {"points": points, "forces": forces, "soles": soles, "centre": data.subtree_com[1].tolist()}


def manifest_mass(manifest: dict[str, Any]) -> float:
    """kg."""
    return float(sum(one["mass_kg"] for one in manifest["inertials"]))
