"""What each link weighs, and how its mass lies: as if its shells were filled evenly. Together MASS_KG."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from demo_robot.robot import FINGERS, LINKS, MASS_KG
from demo_robot.shapes import Floats, Mesh

LEG = {"HY": 0.8, "HR": 1.0, "HP": 3.2, "KN": 2.2, "AP": 0.4, "AR": 1.2}
ARM = {"SP": 0.45, "SR": 0.40, "SY": 0.55, "EB": 0.45, "WY": 0.25, "WR": 0.10, "WP": 0.44}
PHALANX_KG = 0.014

KG: dict[str, float] = {  # aluminium, motors where they sit, the battery in the chest
    "Body_Hip": 5.2,
    "Body_Torso": 11.0,
    "Body_Neck": 0.35,
    "Body_HNP": 0.25,
    "Body_Head": 1.9,
    **{f"Body_{side}{joint}": kg for side in "LR" for joint, kg in (LEG | ARM).items()},
    **{
        f"{side}{finger}{part}": PHALANX_KG
        for side in ("left", "right")
        for finger in FINGERS
        for part in ("Proximal", "Medial", "Distal")
    },
}


@dataclass(frozen=True)
class Inertial:
    """Of one link, in its frame: kg; the centre (3,), m; the inertia (3, 3) about it, kg m²."""

    mass_kg: float
    centre: Floats
    inertia: Floats


def inertials(parts: Iterable[tuple[str, str, str, Mesh]]) -> dict[str, Inertial]:
    """Of every link, from its shells (link, mesh file, colour, shape)."""
    assert set(KG) == set(LINKS)
    assert abs(sum(KG.values()) - MASS_KG) < 1e-9, sum(KG.values())
    moments = {link: np.zeros((4, 4)) for link in LINKS}
    for link, _, _, mesh in parts:
        moments[link] += _moments(mesh)
    return {link: _filled(KG[link], moments[link]) for link in LINKS}


def _moments(mesh: Mesh) -> Floats:
    """(4, 4): ∫ p pᵀ dV of p = (x, y, z, 1) over a closed shell, the sum of tetrahedra at the origin."""
    corners = mesh.vertices[mesh.faces]
    six = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))  # times a volume
    total = corners.sum(axis=1)
    second = np.einsum("n,nki,nkj->ij", six, corners, corners) + np.einsum("n,ni,nj->ij", six, total, total)
    result = np.empty((4, 4))
    result[:3, :3] = second / 120
    result[:3, 3] = result[3, :3] = six @ total / 24
    result[3, 3] = six.sum() / 6
    return result


def _filled(mass_kg: float, moments: Floats) -> Inertial:
    density = mass_kg / moments[3, 3]
    centre = moments[:3, 3] / moments[3, 3]
    spread = density * moments[:3, :3] - mass_kg * np.outer(centre, centre)
    return Inertial(mass_kg, centre, np.trace(spread) * np.eye(3) - spread)
