"""Flags that several commands share: how to read a robot's file, and the type of flags that take a number."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from posecast_edge.kit import quote
from posecast_edge.model.urdf.resolver import list_package_folders


def add_robot_flags(parser: argparse.ArgumentParser) -> None:
    """Add --package-path (also spelled --packages) and --xacro-arg."""
    text = f"folders to search for packages and models, separated by {os.pathsep}; before ROS_PACKAGE_PATH"
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
        help="set an argument of a xacro file; can be repeated",
    )


def parse_folders(text: str) -> list[Path]:
    """Split a search path into folders."""
    return [Path(part) for part in text.split(os.pathsep) if part]


def parse_xacro_argument(text: str) -> tuple[str, str]:
    """Parse `name:=value`, xacro's own syntax. Raises argparse.ArgumentTypeError for anything else."""
    name, given, value = text.partition(":=")
    if not name or not given:
        raise argparse.ArgumentTypeError(f"{text[:80]!r} is not NAME:=VALUE")
    return name, value


def list_packages(given: Sequence[Path], environment: Mapping[str, str]) -> list[Path]:
    """The given folders first, then those where ROS and Gazebo look."""
    return [*given, *list_package_folders(environment)]


def limit_number(low: float, high: float) -> Callable[[str], float]:
    """A type for argparse: a number from `low` to `high`."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{quote(text)} is not a number from {low:g} to {high:g}")
        return value

    return parse
