"""The moments that the gallery shows: of which robot, from when to when, and what to look for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from posecast_edge.model.builder.thumbnail import FRONT_LEFT_ABOVE, Vectors

DEMO, DRONE = "demo", "drone"


@dataclass(frozen=True)
class Moment:
    """A stretch of a robot's motion; all seconds are the motion's. `name`: in addresses; `robot`: DEMO or
    DRONE; `poster_s`: when it has the pose on the poster; `notes`: texts by their moments; `eye`: from the
    body to the camera of the poster.
    """

    name: str
    robot: str
    title: str
    from_s: float
    to_s: float
    poster_s: float
    notes: Mapping[float, str] = field(default_factory=dict)
    eye: Vectors = field(default_factory=lambda: FRONT_LEFT_ABOVE)


SIDE = np.array([0.25, -1.0, 0.25])
FRONT_RIGHT_ABOVE = np.array([1.0, -0.55, 0.42])

# The demo's times are those of edge-agent/demo/demo_robot/programme.py, the drone's those of drone.py.
MOMENTS = (
    Moment("walking", DEMO, "The demo robot walks", 3.6, 11.0, 6.6),
    Moment(
        *("knee", DEMO, "A knee jams", 38.6, 46.2, 41.5),
        notes={40.2: "The right knee stops. The command goes on."},
        eye=FRONT_RIGHT_ABOVE,
    ),
    Moment(
        *("lean", DEMO, "The demo robot leans", 54.6, 60.6, 58.2),
        notes={57.6: "The margin is under 20 mm and turns amber."},
        eye=SIDE,
    ),
    Moment(
        *("drone", DRONE, "A gust hits a drone", 0.0, 14.0, 9.4),
        notes={9.0: "A gust from the left, for a second."},
    ),
)
