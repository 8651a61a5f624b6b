"""Reads a robot's description in whichever format it is written."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_edge.model.finding import EXTRA, ModelRefused
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.model.urdf.types import Urdf
from posecast_edge.model.urdf.xml_tree import read_root_tag

if TYPE_CHECKING:
    from posecast_edge.model.meshes.mesh import Mesh

MJCF_READER = "posecast_edge.model.mjcf.reader"


@dataclass(frozen=True)
class RobotFile:
    """A robot read from a file of any format. `urdf`: its description in the types that every later step
    uses; `meshes`: those that the file itself yields (MJCF), by URI, {} for the other formats; `inputs`:
    every file that was read on the way, for the cache of built models."""

    urdf: Urdf
    meshes: Mapping[str, Mesh] = field(default_factory=dict)
    inputs: tuple[Path, ...] = ()


def find_format(path: Path) -> str:
    """The format by the file's content: `urdf` or `mjcf`. What can't be read, or has another root
    element, counts as `urdf`, whose reader says what is wrong."""
    try:
        with path.open("rb") as source:
            tag = read_root_tag(source)
    except OSError:
        return "urdf"
    return "mjcf" if tag == "mujoco" else "urdf"


def load_robot_file(
    path: Path,
    packages: Sequence[Path] = (),  # noqa: ARG001
    xacro_arguments: Mapping[str, str] | None = None,  # noqa: ARG001
) -> RobotFile:
    """Read a robot's description. `packages`: folders in which packages are looked for, besides those beside
    and above the file; `xacro_arguments`: values for xacro's `<xacro:arg>`.

    Raises ModelRefused when the file holds no robot that can be read.
    """
    if find_format(path) == "mjcf":
        return _load_mjcf(path)
    return RobotFile(load_urdf(path), {}, (path,))


def _load_mjcf(path: Path) -> RobotFile:
    """MJCF is compiled by MuJoCo, an extra that only this branch needs."""
    try:
        reader = importlib.import_module(MJCF_READER)
    except ModuleNotFoundError as e:
        if e.name is not None and e.name.startswith("posecast_edge"):
            raise ModelRefused("this is a MuJoCo model, not URDF") from None
        raise ModelRefused(f"needs MuJoCo: {EXTRA.replace('model', 'model,mujoco')}") from None
    robot: RobotFile = reader.load_mjcf(path)
    return robot
