"""The moments that the gallery shows: of which robot, from when to when, and what to look for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from posecast_edge.model.builder.raster import Vectors
from posecast_edge.model.builder.thumbnail import FRONT_LEFT_ABOVE

DEMO, DRONE = "demo", "drone"


@dataclass(frozen=True)
class Moment:
    """A stretch of a robot's motion. `name`: in addresses; `robot`: DEMO or DRONE; `from_s`, `to_s`, `poster_s`:
    seconds of the robot's motion, the last of the pose on the poster; `notes`: texts by seconds of the motion."""

    name: str
    robot: str
    title: str
    from_s: float
    to_s: float
    poster_s: float
    notes: Mapping[float, str] = field(default_factory=dict)
    look: str = "home"  # the view that the player begins with, as a page around a frame may ask for it
    eye: Vectors = field(default_factory=lambda: FRONT_LEFT_ABOVE)  # of the poster


# the demo's times are those of edge-agent/demo/demo_robot/programme.py, the drone's those of drone.py
MOMENTS = (
    Moment("walking", DEMO, "The demo robot walks", 3.6, 11.0, 6.6),
    Moment("knee", DEMO, "A knee jams", 38.6, 46.2, 41.5, {40.2: "The right knee stops. The command goes on."}),
    Moment("lean", DEMO, "The demo robot leans", 56.0, 60.6, 58.2, {57.6: "15 mm are left before it tips over."}),
    Moment("drone", DRONE, "A gust hits a drone", 0.0, 14.0, 9.4, {9.0: "A gust from the left, for a second."}),
)
