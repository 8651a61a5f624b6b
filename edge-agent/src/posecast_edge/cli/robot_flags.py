"""The flags by which every command is told how to read a robot's file."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from posecast_edge.model.urdf.resolver import list_package_folders


def add_robot_flags(parser: argparse.ArgumentParser) -> None:
    """Add --package-path (also spelled --packages) and --xacro-arg."""
    text = f"folders where packages or models lie, with {os.pathsep} between; before ROS_PACKAGE_PATH"
    parser.add_argument(
        "--package-path",
        "--packages",
        type=parse_folders,
        action="extend",
        default=[],
        metavar="DIR",
        help=text,
    )
    parser.add_argument(
        "--xacro-arg",
        type=parse_xacro_argument,
        action="append",
        default=[],
        metavar="NAME:=VALUE",
        help="a value for an argument of a xacro file; can be given more than once",
    )


def parse_folders(text: str) -> list[Path]:
    """The folders of a search path."""
    return [Path(part) for part in text.split(os.pathsep) if part]


def parse_xacro_argument(text: str) -> tuple[str, str]:
    """`name:=value`, as xacro itself spells it. Raises argparse.ArgumentTypeError when it is not that."""
    name, given, value = text.partition(":=")
    if not name or not given:
        raise argparse.ArgumentTypeError(f"{text[:80]!r} is not NAME:=VALUE")
    return name, value


def list_packages(given: Sequence[Path], environment: Mapping[str, str]) -> list[Path]:
    """What was given comes first, then where ROS and Gazebo look."""
    return [*given, *list_package_folders(environment)]
