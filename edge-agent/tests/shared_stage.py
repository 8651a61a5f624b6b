"""What lies beside the checkout in ../shared (robots, trajectories), which may be absent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("POSECAST_SHARED") or Path(__file__).parents[3] / "shared")
ROBOTS = {
    "hubo2plus-stl": "hubo2plus-stl/hubo-urdf/model.urdf",
    "hubo2plus-collision": "hubo2plus-stl/hubo-urdf/model_collision_as_visual.urdf",
    "hubo2plus-collada": "hubo2plus-collada/hubo-urdf/model.urdf",
    "drchubo": "drchubo-stl/drchubo-urdf/drchubo-v3.urdf",
    "g1": "unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1-hands": "unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
}
# as parameters; in `make test` one with its own meshes, and one drawn by its collision bodies
QUICK = ("g1", "hubo2plus-collision")
TO_BUILD = [pytest.param(name, marks=[] if name in QUICK else [pytest.mark.full]) for name in ROBOTS]


def shared_file(path: str) -> Path:
    """A file of ../shared; the test is skipped where it is not there."""
    file = SHARED / path
    if not file.is_file():
        pytest.skip(f"no ../shared/{path} here")
    return file


def shared_robot(name: str) -> Path:
    """The URDF of one of `ROBOTS`; the test is skipped where it is not there."""
    return shared_file(f"robots/{ROBOTS[name]}")
