"""Who holds the robot up: what the floor and an obstacle do to it, and what its four wrench sensors feel.

Each sensor feels what acts on the links beyond it from outside, in its link's axes. The foot's sensor sits in
the sole: nothing weighs beneath it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from demo_robot.dynamics import Dynamics, Wrench, at, of_links, pressure
from demo_robot.gait import Gait
from demo_robot.masses import Inertial
from demo_robot.robot import FINGERS
from demo_robot.shapes import Floats

SITES = {"RF": "Body_RAR", "LF": "Body_LAR", "RH": "Body_RWP", "LH": "Body_LWP"}
SENSOR_Z = -0.03  # in its link, as profiles/demo.toml has it
PALM_Z = -0.06  # where an obstacle pushes


def obstacle(links: Mapping[str, Floats], lost: Mapping[str, Floats]) -> Wrench:
    """What pushes the left hand back, by how far (rad) it holds the arm: along the hand, and across it."""
    hand = links[SITES["LH"]]
    push = np.stack([24.0 * lost["LEB"], np.zeros(len(hand)), -78.0 * lost["LSP"]], axis=1)
    return at(_point(hand, PALM_Z), np.einsum("nij,nj->ni", hand[:, :3, :3], push))


def floor(body: Dynamics, lost: Mapping[str, Floats]) -> Wrench:
    """What the floor must do, all else considered."""
    return body.needed.plus(obstacle(body.links, lost), -1)


def feel(
    body: Dynamics, gait: Gait, lost: Mapping[str, Floats], inertials: Mapping[str, Inertial], hz: float
) -> dict[str, Floats]:
    """fx fy fz mx my mz (n, 6) by site."""
    felt = {"RH": _hand(body, "R", inertials, hz), "LH": _hand(body, "L", inertials, hz)}
    felt["LH"] = felt["LH"].plus(obstacle(body.links, lost))
    felt |= _feet(floor(body, lost), gait)
    return {site: _at_sensor(felt[site], body.links[SITES[site]]) for site in ("RH", "LH", "RF", "LF")}


def _hand(body: Dynamics, side: str, inertials: Mapping[str, Inertial], hz: float) -> Wrench:
    """Its weight and its inertia pull at the wrist."""
    finger = "left" if side == "L" else "right"
    beyond = [
        SITES[side + "H"],
        *(f"{finger}{name}{part}" for name in FINGERS for part in ("Proximal", "Medial", "Distal")),
    ]
    needed = of_links(body.links, {link: inertials[link] for link in beyond}, hz)
    return Wrench(-needed.force, -needed.moment)


def _feet(total: Wrench, gait: Gait) -> dict[str, Wrench]:
    """Shared by the gait's load. Where both push is the total's pressure; each is as far off its centre as
    the other."""
    where, mean = pressure(total), sum(gait.load[s][:, None] * gait.centre[s] for s in "LR")
    feet = {}
    for side in "LR":
        point = np.zeros_like(total.force)
        point[:, :2] = gait.centre[side] + where - mean
        feet[side] = at(point, gait.load[side][:, None] * total.force)
    twist = total.plus(feet["L"], -1).plus(feet["R"], -1).moment[:, 2]  # all else is accounted for
    return {
        f"{side}F": Wrench(foot.force, foot.moment + np.outer(gait.load[side] * twist, [0, 0, 1]))
        for side, foot in feet.items()
    }


def _at_sensor(wrench: Wrench, link: Floats) -> Floats:
    moment = wrench.about(_point(link, SENSOR_Z))
    turn = link[:, :3, :3]
    return np.concatenate([np.einsum("nji,nj->ni", turn, v) for v in (wrench.force, moment)], axis=1)


def _point(link: Floats, z: float) -> Floats:
    return np.asarray(link[:, :3, 3] + z * link[:, :3, 2])
