"""Finds robots in folders: URDF, xacro, SDF and MJCF, detected by how the files begin."""

from __future__ import annotations

import os
import re
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.text import read_robot_text
from posecast_edge.model.urdf.xml_tree import read_root_tag

SUFFIXES = (".urdf", ".xacro", ".sdf", ".xml", ".mjcf")
ROOTS = ("robot", "sdf", "mujoco")
PACKAGES = ("example_robot_data", "dm_control", "gymnasium_robotics", "robosuite", "pybullet_data")
SHARED = Path("shared/robots")
CMEEL = "cmeel.prefix"  # such a wheel keeps its data in share/, often without a module
OBJECTS = "random_urdfs"  # in pybullet_data: a thousand objects to grasp, none of them a robot
BYTES_MAX = 8 << 20
INCLUDED = re.compile(rb"<(?:include|model)\b[^>]*\bfile\s*=\s*[\"']([^\"']+)")
JOINT = re.compile(rb"<(?:free)?joint\b|<include\b|<attach\b|<composite\b|<replicate\b")


@dataclass(frozen=True)
class RobotPath:
    """A robot's file. `name`: its path below the folder in which it was found, for display; `is_included`:
    another robot's file includes a file with that name."""

    path: Path
    name: str
    is_included: bool


def list_packages() -> list[Path]:
    """The folders of the installed robot packages, and shared/robots if it exists."""
    site = Path(sysconfig.get_path("purelib"))
    places = [p for name in PACKAGES for p in (site / name, site / CMEEL / "share" / name.replace("_", "-"))]
    found = [place for place in places if place.is_dir()]
    return [*found, SHARED] if SHARED.is_dir() else found


def _root_of(content: bytes) -> str | None:
    try:
        return read_root_tag(read_robot_text(content))
    except ModelRefused:
        return None


def find_robots(places: Iterable[Path]) -> list[RobotPath]:
    """Every robot in these folders; a place may also be a file. MJCF files count only if they can have a
    joint. A file reachable in two ways counts once."""
    found: dict[Path, str] = {}
    included: set[str] = set()
    for place in places:
        for path in _walk(place):
            content = _read(path)
            root = _root_of(content)
            if root not in ROOTS and path.suffix.lower() not in (".urdf", ".sdf", ".xacro"):
                continue
            if root == "mujoco":
                included.update(os.path.basename(os.fsdecode(name)) for name in INCLUDED.findall(content))
                if not JOINT.search(content):
                    continue
            above = place.parent if path == place else place
            name = str(Path(above.name) / path.relative_to(above))
            found.setdefault(path.resolve(), name)
    return [RobotPath(path, name, path.name in included) for path, name in found.items()]


def _walk(place: Path) -> Iterator[Path]:
    if place.is_file():
        yield place
        return
    for folder, folders, names in os.walk(place):
        folders[:] = sorted(f for f in folders if f != OBJECTS)
        for name in sorted(names):
            if name.lower().endswith(SUFFIXES):
                yield Path(folder, name)


def _read(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(BYTES_MAX)
    except OSError:
        return b""
