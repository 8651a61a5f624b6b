"""Checks one built robot: draws it, and compares its links with Pinocchio's or MuJoCo's, if installed.

python -m tools.gallery.look ROBOT BUNDLE PICTURE: prints one line of JSON.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.robot_file import find_format
from posecast_edge.model.xacro.expander import expand_xacro

from tools.gallery.picture import draw_robot
from tools.gallery.poses import Worst, compare_with_mujoco, compare_with_pinocchio

SEED = 3
NEEDED = {"urdf": "pinocchio", "xacro": "pinocchio", "mjcf": "mujoco"}


def compare_poses(robot: Path, manifest: dict[str, Any]) -> tuple[Worst | None, str]:
    """The differences, or None and the reason why nothing was compared."""
    kind = find_format(robot)
    if kind not in NEEDED:
        return None, f"nothing to compare {kind} with"
    if importlib.util.find_spec(NEEDED[kind]) is None:
        return None, f"{NEEDED[kind]} is not installed"
    try:
        if kind == "mjcf":
            return compare_with_mujoco(manifest, robot, SEED), ""
        text = robot.read_bytes() if kind == "urdf" else expand_xacro(robot, (), {}).text
        return compare_with_pinocchio(manifest, text.decode("utf-8-sig"), SEED), ""
    except (ValueError, LookupError, RuntimeError, ModelRefused) as e:
        return None, f"{NEEDED[kind]}: {' '.join(str(e).split())[:200]}"


def main(robot: Path, bundle: Path, picture: Path) -> None:
    """Draw and compare one robot."""
    draw_robot(bundle).save(picture)
    manifest = json.loads((bundle / "manifest.json").read_text())
    worst, why = compare_poses(robot, manifest)
    said: dict[str, Any] = {"why": why}
    if worst is not None:
        said |= {"worst_mm": worst.distance_m * 1e3, "turn": worst.turn, "compared": worst.links}
    print(json.dumps(said))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
