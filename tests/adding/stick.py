"""Robot descriptions `<stick bones="3"/>`: a chain of bones, each 0.2 m above the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.urdf.types import Geometry, Joint, Limit, Link, Pose, Shape, Urdf

BONES_MAX = 100
BONE_M = 0.2


def load_stick(path: Path, packages: Sequence[Path]) -> RobotFile:
    """Read a chain. Raises ModelRefused when the number of bones is missing or too large."""
    del packages
    bones = ElementTree.parse(path).getroot().get("bones", "")
    if not bones.isdigit() or not 1 <= int(bones) <= BONES_MAX:
        raise ModelRefused(f"bones: use a number from 1 to {BONES_MAX}, not {bones!r}")
    urdf = Urdf("stick", [make_bone(i) for i in range(int(bones))])
    urdf.joints += [make_hinge(i) for i in range(1, int(bones))]
    return RobotFile(urdf, {}, (path,))


def make_bone(i: int) -> Link:
    """Bone `i`, a box above its joint."""
    box = Geometry("box", (0.05, 0.05, BONE_M), "", (1.0, 1.0, 1.0), 1)
    return Link(f"bone{i}", (Shape(Pose((0.0, 0.0, BONE_M / 2)), box, None, 1),), (), None, 1)


def make_hinge(i: int) -> Joint:
    """What bends below bone `i`."""
    limit = Limit(-1.0, 1.0, None, None, 1)
    at = Pose((0.0, 0.0, BONE_M))
    return Joint(f"hinge{i}", "revolute", f"bone{i - 1}", f"bone{i}", at, (0.0, 1.0, 0.0), limit, None, 1)
