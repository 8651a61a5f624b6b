"""Compares the page's centre of mass and capture point with Pinocchio's, for the robots in ../shared and in
example-robot-data. `make balance` and `make test-full` run it."""

from __future__ import annotations

import json
import math
import os
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from posecast_edge.model.builder.manifest import make_skeleton
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.model.urdf.tree import build_tree

from tests.balance.page import REPO, build_fine_schema, encode_values, read_balance

pytestmark = pytest.mark.full

CONFIGURATIONS = 20
SHARED = Path(os.environ.get("POSECAST_SHARED") or REPO.parent / "shared")
PYTHON = REPO / "out/balance/venv/bin/python"
ORACLE = REPO / "tests/balance/pinocchio_centres.py"
OF_OTHERS = ("talos", "icub", "romeo", "simple_humanoid", "tiago", "hyq")
OURS = sorted((SHARED / "robots").rglob("*.urdf"))


@pytest.fixture(scope="module")
def oracle() -> dict[str, str]:
    """The URDFs of example-robot-data. Skips if Pinocchio can't be installed."""
    done = subprocess.run([REPO / "tests/balance/install"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        pytest.skip(f"no Pinocchio here: {done.stderr.strip()[-200:]}")
    found: dict[str, str] = run_oracle("--robots")
    return found


def run_oracle(*arguments: str) -> Any:
    """The oracle's output."""
    done = subprocess.run([PYTHON, ORACLE, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.parametrize("urdf", OURS, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_robots_of_ours(oracle: dict[str, str], urdf: Path) -> None:
    compare(urdf.stem, urdf)


@pytest.mark.parametrize("name", OF_OTHERS)
def test_robots_of_others(oracle: dict[str, str], name: str) -> None:
    compare(name, Path(oracle[name]))


def compare(name: str, path: Path) -> None:
    """Twenty configurations."""
    manifest = make_manifest(path)
    configurations = run_oracle(str(path), str(CONFIGURATIONS))
    joints = sorted(configurations[0]["readings"])
    schema = build_fine_schema(joints, {})
    frames = [
        {"t": i, "codes": codes_of(schema, c), "velocity": c["velocity"]}
        for i, c in enumerate(configurations)
    ]
    found = read_balance(manifest, schema, frames)
    centres = captures = 0.0
    for one, expected in zip(found, configurations, strict=True):
        centre, velocity = expected["centre"], expected["velocity"]
        centres = max(centres, math.dist(one["centre_of_mass_m"], centre))
        ahead = math.sqrt(max(0.0, centre[2]) / 9.81)
        point = [centre[0] + velocity[0] * ahead, centre[1] + velocity[1] * ahead, 0.0]
        captures = max(captures, math.dist(one["captured"], point))
    print(f"{name}: {found[0]['mass_kg']:.2f} kg, {len(joints)} joints; ", end="")
    print(f"centre of mass {1000 * centres:.5f} mm, capture point {1000 * captures:.5f} mm")
    assert centres <= 0.001
    assert captures <= 0.002


def codes_of(schema: str, configuration: Mapping[str, Any]) -> list[int]:
    """The frame of a configuration."""
    values = {f"pos {joint}": value for joint, value in configuration["readings"].items()}
    xyz, quat = configuration["root"][:3], configuration["root"][3:]
    values |= {f"base base.{part}": value for part, value in zip("xyz", xyz, strict=True)}
    values |= {f"baseq base.{part}": value for part, value in zip("wxyz", quat, strict=True)}
    return encode_values(schema, values)


def make_manifest(path: Path) -> dict[str, Any]:
    """What the page's kinematics need, and the masses from the URDF."""
    urdf = load_urdf(path)
    skeleton = make_skeleton(urdf, build_tree(urdf))
    inertials = []
    elements = {link.get("name"): link for link in ElementTree.parse(path).getroot().iter("link")}
    for i, link in enumerate(skeleton["links"]):
        mass = elements[link].find("inertial/mass")
        if mass is None or float(mass.get("value", "0")) <= 0:
            continue
        origin = elements[link].find("inertial/origin")
        xyz = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        centre = [float(part) for part in xyz.split()]
        inertials.append(
            {
                "link": i,
                "mass_kg": float(mass.get("value", "0")),
                "xyz": centre,
                "inertia": [1, 0, 0, 1, 0, 1],
            }
        )
    rest = {"v": 2, "robot": "r", "files": [], "levels": [], "visuals": [], "inertials": inertials}
    return {**rest, **skeleton}
