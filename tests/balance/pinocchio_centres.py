"""Centres of mass by Pinocchio, at random configurations and velocities of a robot that floats freely.

    out/balance/venv/bin/python tests/balance/pinocchio_centres.py URDF COUNT   (or: --robots)

Prints JSON: a list of `readings` (rad, m, or parts of a quaternion, by joint variable), `root`
(world_from_root: x, y, z, and a quaternion w, x, y, z), `centre` (m) and `velocity` (m/s) of the centre of
mass. With --robots: name → URDF of those of example-robot-data.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio

ROBOTS = {
    "talos": "talos_data/robots/talos_full_v2.urdf",
    "icub": "icub_description/robots/icub.urdf",
    "romeo": "romeo_description/urdf/romeo.urdf",
    "simple_humanoid": "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "tiago": "tiago_description/robots/tiago.urdf",
    "hyq": "hyq_description/robots/hyq_no_sensors.urdf",
}
SLIDE_M = 0.3


def find_robots() -> dict[str, str]:
    """Those that are there."""
    shared = Path(pinocchio.__file__).parents[4] / "share" / "example-robot-data" / "robots"
    return {name: str(shared / path) for name, path in ROBOTS.items() if (shared / path).is_file()}


def compute_centres(path: str, count: int) -> list[dict[str, Any]]:
    """Of a URDF."""
    model = pinocchio.buildModelFromXML(Path(path).read_text(), pinocchio.JointModelFreeFlyer())
    data = model.createData()
    chance = np.random.default_rng(22)
    found = []
    for _ in range(count):
        q, v = pinocchio.neutral(model), chance.normal(size=model.nv)
        quat = chance.normal(size=4)
        quat /= np.linalg.norm(quat)
        root = [*chance.uniform(-1, 1, 3), *quat]
        q[:7] = [*root[:3], *quat[1:], quat[0]]
        readings: dict[str, float] = {}
        for i in range(2, model.njoints):
            name, joint = model.names[i], model.joints[i]
            slides = "Prismatic" in joint.shortname()
            value = float(chance.uniform(-SLIDE_M, SLIDE_M) if slides else chance.uniform(-math.pi, math.pi))
            readings[name] = value
            if joint.nq == 2:  # an angle without limits is its cosine and sine
                q[joint.idx_q : joint.idx_q + 2] = [math.cos(value), math.sin(value)]
            elif joint.nq == 1:
                q[joint.idx_q] = value
            else:
                raise SystemExit(f"{name}: a joint of {joint.nq} values")
        centre = pinocchio.centerOfMass(model, data, q, v)
        found.append(
            {
                "readings": readings,
                "root": [float(n) for n in root],
                "centre": centre.tolist(),
                "velocity": data.vcom[0].tolist(),
            }
        )
    return found


if __name__ == "__main__":
    if sys.argv[1] == "--robots":
        print(json.dumps(find_robots()))
    else:
        print(json.dumps(compute_centres(sys.argv[1], int(sys.argv[2]))))
