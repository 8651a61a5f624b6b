"""Reads a robot's description in any supported format."""

from __future__ import annotations

import importlib
import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from posecast_edge.model.finding import Finding, ModelRefused
from posecast_edge.model.text import Text, read_robot_text, read_text
from posecast_edge.model.urdf.reader import BYTES_MAX, load_urdf, read_urdf
from posecast_edge.model.urdf.resolver import Resolver, open_file, read_bounded
from posecast_edge.model.urdf.types import Urdf
from posecast_edge.model.urdf.xml_tree import read_root_tag

if TYPE_CHECKING:
    from posecast_edge.model.meshes.mesh import Mesh

ROOTS = {"mujoco": "mjcf", "sdf": "sdf", "gazebo": "sdf"}  # root element → format; any other is a URDF
FILE_MAX = 32 << 20  # bytes of a file that is decoded here for its findings alone
MJCF_READER = "posecast_edge.model.mjcf.reader"
COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
MACRO = re.compile(rb"<xacro:|\"[^\"<>]*\$[{(]")  # a tag of xacro's, or an attribute with an expression


@dataclass(frozen=True)
class RobotFile:
    """A robot read from a file of any format. `urdf`: its description in the types that every later step
    uses; `meshes`: those that the file itself yields (MJCF), by URI, {} for the other formats; `inputs`:
    every file that was read on the way, for the cache of built models."""

    urdf: Urdf
    meshes: Mapping[str, Mesh] = field(default_factory=dict)
    inputs: tuple[Path, ...] = ()


def find_format(path: Path) -> str:
    """The format, from the file's content: `urdf`, `xacro`, `sdf` or `mjcf`. A file that can't be read, or
    has another root element, counts as `urdf`, whose reader reports the problem."""
    try:
        with open_file(path) as source:
            content = source.read(BYTES_MAX)
    except OSError:
        return "urdf"
    try:
        text = read_robot_text(content)
    except ModelRefused:
        text = Text(b"")
    if path.suffix.lower() == ".xacro" or (
        b"xacro" in text.utf8 and MACRO.search(COMMENT.sub(b"", text.utf8))
    ):
        return "xacro"
    return _find_plain_format(text)


def _find_plain_format(text: Text) -> str:
    return ROOTS.get(read_root_tag(text) or "", "urdf")


def load_robot_file(
    path: Path, packages: Sequence[Path] = (), xacro_arguments: Mapping[str, str] | None = None
) -> RobotFile:
    """Read a robot's description. `packages`: folders in which packages are looked for, besides those beside
    and above the file; `xacro_arguments`: values for xacro's `<xacro:arg>`.

    Raises ModelRefused when the file holds no robot that can be read.
    """
    kind = find_format(path)
    if kind == "xacro":
        return _load_xacro(path, packages, xacro_arguments or {})
    if xacro_arguments:
        raise ModelRefused("--xacro-arg is only for xacro files; this file has no macros")
    return LOADERS[kind](path, packages)


def _load_xacro(path: Path, packages: Sequence[Path], arguments: Mapping[str, str]) -> RobotFile:
    from posecast_edge.model.sdf.reader import read_sdf  # noqa: PLC0415 - the agent stays small without it
    from posecast_edge.model.xacro.expander import expand_xacro  # noqa: PLC0415 - the agent stays small without it

    try:
        expanded = expand_xacro(path, packages, arguments)
    except ModelRefused as e:
        if path.suffix.lower() == ".xacro":
            raise
        urdf = load_urdf(path)  # a URDF with leftovers of xacro; it may still be shown
        urdf.findings.append(Finding("error", "xacro", f"not expanded: {e.reason}", e.line))
        return RobotFile(urdf, {}, (path,))
    try:
        sdf = _find_plain_format(Text(expanded.text)) == "sdf"
        urdf = read_sdf(expanded.text) if sdf else read_urdf(io.BytesIO(expanded.text))
    except ModelRefused as e:
        where = "" if e.line is None else f"line {e.line} of "
        raise ModelRefused(f"{where}the expanded file: {e.reason}") from None
    if not urdf.links:
        raise ModelRefused("it has macros and no link: give the file that uses them")
    urdf.findings += read_text(read_bounded(path, FILE_MAX)).findings
    urdf.findings += [Finding("hint", "include-found", f"include {note}") for note in expanded.notes]
    return RobotFile(urdf, {}, expanded.inputs)


def _load_urdf(path: Path, packages: Sequence[Path]) -> RobotFile:  # noqa: ARG001 - meshes are found later
    return RobotFile(load_urdf(path), {}, (path,))


def _load_sdf(path: Path, packages: Sequence[Path]) -> RobotFile:
    from posecast_edge.model.sdf.reader import load_sdf  # noqa: PLC0415 - the agent stays small without it

    urdf, inputs = load_sdf(path, Resolver(path, packages))
    return RobotFile(urdf, {}, inputs)


def _load_mjcf(path: Path, packages: Sequence[Path]) -> RobotFile:
    """MJCF is compiled by MuJoCo, an extra that only this branch needs."""
    reader = importlib.import_module(MJCF_READER)
    robot: RobotFile = reader.load_mjcf(path, packages)
    robot.urdf.findings[:0] = read_text(read_bounded(path, FILE_MAX)).findings  # MuJoCo gets UTF-8
    return robot


# format → what reads a file of it; the folders are those in which packages are looked for
LOADERS: dict[str, Callable[[Path, Sequence[Path]], RobotFile]] = {
    "urdf": _load_urdf,
    "sdf": _load_sdf,
    "mjcf": _load_mjcf,
}
