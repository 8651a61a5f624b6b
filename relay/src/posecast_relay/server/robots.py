"""Reads the file of robots as a process of these settings may take it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from posecast_relay.config.robots_file import read_robots
from posecast_relay.config.robots_reader import Robots, RobotsError
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
    return partial(read_robots, has_store=settings.archive is not None or settings.role == "gateway")
