"""Reads the file of robots as a process of these settings may take it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from posecast_relay.config.robots_file import Robots, RobotsError, read_robots, refuse_keep
from posecast_relay.config.settings import Settings, StartError


def load_robots(settings: Settings) -> Robots | None:
    """Read the file; None without one. Raises StartError when it is wrong."""
    if settings.robots is None:
        return None
    try:
        return make_reader(settings)(settings.robots)
    except RobotsError as e:
        raise StartError(f"--robots {e}") from None


def make_reader(settings: Settings) -> Callable[[Path], Robots]:
    """Return what reads the file, and raises RobotsError. Without a store it refuses `keep`, as nothing would
    be kept; a gateway keeps nothing in any case.
    """

    def read(path: Path) -> Robots:
        robots = read_robots(path)
        if settings.archive is None and settings.role != "gateway":
            refuse_keep(robots, path)
        return robots

    return read
