"""Makes the manifest's member `inertials`: the mass of each link, in the link's frame."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from posecast_edge.model.doctor.masses import has_impossible_masses
from posecast_edge.model.finding import Finding
from posecast_edge.model.kinematics import matrix_from_quaternion, quaternion_from_rpy
from posecast_edge.model.urdf.tree import Tree
from posecast_edge.model.urdf.types import Inertial


def make_inertials(tree: Tree, findings: Collection[Finding]) -> list[dict[str, Any]]:
    """An entry for each link that has a mass, in the links' order; [] if one of the findings reports an
    impossible mass."""
    if has_impossible_masses(findings):
        return []
    return [
        {
            "link": number,
            "mass_kg": _round(link.inertial.mass),
            "xyz": [_round(v) for v in link.inertial.pose.xyz],
            "inertia": [_round(v) for v in turn_inertia(link.inertial)],
        }
        for number, link in enumerate(tree.links)
        if link.inertial is not None and link.inertial.mass > 0
    ]


def turn_inertia(inertial: Inertial) -> tuple[float, ...]:
    """The inertia about the centre of mass as ixx, ixy, ixz, iyy, iyz, izz in the link's axes, kg·m²."""
    if inertial.pose.rpy == (0.0, 0.0, 0.0):
        return inertial.inertia
    turn = matrix_from_quaternion((0.0, 0.0, 0.0), quaternion_from_rpy(inertial.pose.rpy))
    xx, xy, xz, yy, yz, zz = inertial.inertia
    own = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))

    def at(i: int, j: int) -> float:
        return sum(turn[i][k] * own[k][m] * turn[j][m] for k in range(3) for m in range(3))

    return (at(0, 0), at(0, 1), at(0, 2), at(1, 1), at(1, 2), at(2, 2))


def _round(value: float) -> float:
    """Seven significant digits, more than can be measured, without negative zero."""
    return float(f"{value:.7g}") + 0.0
