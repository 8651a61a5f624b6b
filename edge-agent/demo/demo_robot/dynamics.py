"""Newton and Euler for the whole body: what must act on it from outside so that it moves as it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from demo_robot.kinematics import forward
from demo_robot.masses import Inertial
from demo_robot.robot import LINKS
from demo_robot.shapes import Floats

GRAVITY = 9.81


@dataclass(frozen=True)
class Wrench:
    """Force (n, 3) in N and moment (n, 3) about the world's origin in N m, in the world's axes."""

    force: Floats
    moment: Floats

    def plus(self, other: Wrench, sign: int = 1) -> Wrench:
        """Both together, or this one less the other."""
        return Wrench(self.force + sign * other.force, self.moment + sign * other.moment)

    def about(self, point: Floats) -> Floats:
        """The moment (n, 3) about a point (n, 3)."""
        return np.asarray(self.moment - np.cross(point, self.force))


@dataclass(frozen=True)
class Dynamics:
    """Of a motion that is repeated: world_from_link by link; the wrench that must come from outside, gravity
    aside."""

    links: dict[str, Floats]
    needed: Wrench


def rate(values: Floats, hz: float) -> Floats:
    """Per second, the motion closed to a ring."""
    return np.asarray((np.roll(values, -1, axis=0) - np.roll(values, 1, axis=0)) * (hz / 2))


def at(point: Floats, force: Floats) -> Wrench:
    """A force (n, 3) that acts at a point (n, 3)."""
    return Wrench(force, np.cross(point, force))


def solve(
    joints: Mapping[str, Floats], world_from_root: Floats, inertials: Mapping[str, Inertial], hz: float
) -> Dynamics:
    """Of joint angles (n,) and the root's poses (n, 4, 4), `hz` of them a second."""
    links = forward(joints, world_from_root, frozenset(LINKS))
    return Dynamics(links, of_links(links, inertials, hz))


def of_links(links: Mapping[str, Floats], inertials: Mapping[str, Inertial], hz: float) -> Wrench:
    """What must act on these links together, gravity aside: change of momentum less weight."""
    n = len(next(iter(links.values())))
    momentum, spin = np.zeros((n, 3)), np.zeros((n, 3))
    pull = Wrench(np.zeros((n, 3)), np.zeros((n, 3)))
    for link, inertial in inertials.items():
        pose = links[link]
        centre = _centre(pose, inertial)
        carried = inertial.mass_kg * rate(centre, hz)
        momentum += carried
        spin += np.cross(centre, carried) + _spin(pose[:, :3, :3], inertial.inertia, hz)
        pull = pull.plus(at(centre, np.array([[0, 0, -inertial.mass_kg * GRAVITY]])))
    return Wrench(rate(momentum, hz), rate(spin, hz)).plus(pull, -1)


def pressure(floor: Wrench) -> Floats:
    """(n, 2): where the floor, z = 0, pushes: the zero-moment point (Vukobratović & Borovac 2004)."""
    return np.stack([-floor.moment[:, 1], floor.moment[:, 0]], axis=1) / floor.force[:, 2:]


def _centre(pose: Floats, inertial: Inertial) -> Floats:
    return np.asarray(pose[:, :3, :3] @ inertial.centre + pose[:, :3, 3])


def _spin(turn: Floats, inertia: Floats, hz: float) -> Floats:
    """Angular momentum about the link's own centre, in the world's axes."""
    w = rate(turn, hz) @ np.swapaxes(turn, 1, 2)
    omega = np.stack([w[:, 2, 1] - w[:, 1, 2], w[:, 0, 2] - w[:, 2, 0], w[:, 1, 0] - w[:, 0, 1]], axis=1) / 2
    return np.asarray((turn @ inertia @ np.swapaxes(turn, 1, 2) @ omega[..., None])[..., 0])
