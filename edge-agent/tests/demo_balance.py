"""What holds the demo robot: a second opinion, worked out from its URDF, shells, encoders and wrenches alone.

Arrays over time (n, …), metres, newtons, the world's axes.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh
from demo_stage import Floats, Minute

GRAVITY = 9.81
SITES = {"RF": "Body_RAR", "LF": "Body_LAR", "RH": "Body_RWP", "LH": "Body_LWP"}


class Inertia:
    """One link's <inertial>. The demo's are written along the link's axes."""

    def __init__(self, inertial: ET.Element) -> None:
        def of(tag: str, name: str) -> str:
            found = inertial.find(tag)
            assert found is not None
            return found.get(name) or "0 0 0"

        self.mass_kg = float(of("mass", "value"))
        self.centre = np.array([float(word) for word in of("origin", "xyz").split()])
        assert of("origin", "rpy") == "0 0 0"
        xx, xy, xz, yy, yz, zz = (float(of("inertia", f"i{a}")) for a in ("xx", "xy", "xz", "yy", "yz", "zz"))
        self.about_centre = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertias(urdf: Path) -> dict[str, Inertia]:
    """By link."""
    links = ET.parse(urdf).getroot().findall("link")
    return {str(link.get("name")): Inertia(i) for link in links if (i := link.find("inertial")) is not None}


def hull(points: Floats) -> Floats:
    """Convex hull of (k, 2), counter-clockwise (Andrew's monotone chain)."""

    def half(ordered: Sequence[Floats]) -> list[Floats]:
        chain: list[Floats] = []
        for p in ordered:
            while len(chain) > 1 and _cross(chain[-1] - chain[-2], p - chain[-2]) <= 0:
                chain.pop()
            chain.append(p)
        return chain[:-1]

    ordered = [points[i] for i in np.lexsort((points[:, 1], points[:, 0]))]
    return np.array(half(ordered) + half(ordered[::-1]))


def margin(polygon: Floats, point: Floats) -> float:
    """Distance of a point to the polygon's nearest edge, + inside, - outside."""
    start, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    part = np.clip(((point - start) * along).sum(1) / (along**2).sum(1), 0, 1)
    distance = np.linalg.norm(start + part[:, None] * along - point, axis=1).min()
    inside = all(_cross(a, point - p) >= 0 for a, p in zip(along, start, strict=True))
    return float(distance if inside else -distance)


def pressure(force: Floats, moment: Floats) -> Floats:
    """Where on the floor a wrench has no moment but about the vertical."""
    return np.stack([-moment[:, 1], moment[:, 0]], axis=1) / force[:, 2:]


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


class Balance:
    """Of a built bundle's minute."""

    def __init__(self, minute: Minute, bundle: Path) -> None:
        self.minute, self.hz = minute, minute.motion.rate_hz
        self.inertias = inertias(bundle / "robot.urdf")
        self.mass_kg = sum(i.mass_kg for i in self.inertias.values())
        self.links = minute.skeleton.poses(minute.angles("pos"), minute.world_from_root)
        shell = np.asarray(trimesh.load_mesh(bundle / "meshes/sole.stl").vertices)
        lowest = shell[shell[:, 2] < shell[:, 2].min() + 0.005]
        flat = hull(lowest[:, :2])
        self.sole = np.column_stack([flat, np.full(len(flat), shell[:, 2].min())])  # in either foot's link

    @cached_property
    def centre(self) -> Floats:
        """(n, 3) of mass."""
        carried = [inertia.mass_kg * self.centre_of(link) for link, inertia in self.inertias.items()]
        return np.asarray(np.sum(carried, axis=0) / self.mass_kg)

    def centre_of(self, link: str) -> Floats:
        """(n, 3) of one link's mass."""
        pose = self.links[link]
        return np.asarray(pose[:, :3, :3] @ self.inertias[link].centre + pose[:, :3, 3])

    def wrench(self, site: str) -> tuple[Floats, Floats, Floats]:
        """Force, moment (n, 3) and where the sensor is, in the world."""
        mount, pose = self.minute.profile.mapping.sensors[site], self.links[SITES[site]]
        turn = pose[:, :3, :3]
        force, moment = (
            np.stack([self.minute.channel(field, f"{site}.{kind}{a}") for a in "xyz"], axis=1)
            for field, kind in (("ftf", "f"), ("ftm", "m"))
        )
        at = np.asarray(turn @ np.array(mount.xyz) + pose[:, :3, 3])
        return (turn @ force[..., None])[..., 0], (turn @ moment[..., None])[..., 0], at

    def floor(self) -> tuple[Floats, Floats]:
        """Force and moment about the world's origin of both feet together."""
        force, moment = np.zeros((2, len(self.minute.t), 3))
        for site in ("RF", "LF"):
            f, m, at = self.wrench(site)
            force, moment = force + f, moment + m + np.cross(at, f)
        return force, moment

    def push(self) -> tuple[Floats, Floats]:
        """The same of what pushes the hands: what they feel beyond their own weight and inertia."""
        force, moment = np.zeros((2, len(self.minute.t), 3))
        for site, side in (("RH", "right"), ("LH", "left")):
            f, m, at = self.wrench(site)
            beyond = [SITES[site], *(k for k in self.inertias if k.startswith(side))]
            need_f, need_m = self.needed(beyond)
            force, moment = force + f + need_f, moment + m + np.cross(at, f) + need_m
        return force, moment

    def needed(self, links: Sequence[str] | None = None) -> tuple[Floats, Floats]:
        """What must push these links, gravity aside, so that they move so; moment about the world's origin.
        Newton and Euler for each link, motion by differences."""
        force, moment = np.zeros((2, len(self.minute.t), 3))
        for link in links or self.inertias:
            inertia, turn, centre = self.inertias[link], self.links[link][:, :3, :3], self.centre_of(link)
            pull = inertia.mass_kg * (self.rate(self.rate(centre)) + np.array([0, 0, GRAVITY]))
            w = self.rate(turn) @ np.swapaxes(turn, 1, 2)
            omega = np.stack([w[:, 2, 1], w[:, 0, 2], w[:, 1, 0]], axis=1)
            spin = (turn @ inertia.about_centre @ np.swapaxes(turn, 1, 2) @ omega[..., None])[..., 0]
            force, moment = force + pull, moment + np.cross(centre, pull) + self.rate(spin)
        return force, moment

    def rate(self, values: Floats) -> Floats:
        """Per second, the minute closed to a ring."""
        return np.asarray((np.roll(values, -1, 0) - np.roll(values, 1, 0)) * self.hz / 2)

    def smooth(self, values: Floats, sigma_s: float = 0.08) -> Floats:
        """By a Gaussian: noise of encoders, twice differentiated, is greater than what is looked for."""
        omega = 2 * np.pi * np.fft.rfftfreq(len(values), 1 / self.hz)
        gain = np.exp(-((omega * sigma_s) ** 2) / 2).reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(np.fft.irfft(np.fft.rfft(values, axis=0) * gain, len(values), axis=0))

    def foot_pressure(self, side: str) -> tuple[Floats, Floats]:
        """(n,) force along the sole's normal, (n, 3) where in the foot's link it pushes."""
        mount = self.minute.profile.mapping.sensors[f"{side}F"]
        fx, fy, fz = (self.minute.channel("ftf", f"{side}F.f{a}") for a in "xyz")
        mx, my, _ = (self.minute.channel("ftm", f"{side}F.m{a}") for a in "xyz")
        h = mount.xyz[2] - self.sole[0, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            x, y = mount.xyz[0] + (-my - fx * h) / fz, mount.xyz[1] + (mx - fy * h) / fz
        return fz, np.stack([x, y, np.full_like(x, self.sole[0, 2])], axis=1)

    def bears(self, side: str) -> npt.NDArray[np.bool_]:
        """A foot bears from 5 % of the weight on, and until it falls below 3 %."""
        share = self.minute.channel("ftf", f"{side}F.fz") / (self.mass_kg * GRAVITY)
        bears, now = np.zeros(len(share), bool), True
        for k, s in enumerate(share):
            now = s >= (0.03 if now else 0.05)
            bears[k] = now
        return bears

    @cached_property
    def margins(self) -> Floats:
        """(n,) of the centre of mass' plumb foot within the hull of the soles that bear, m."""
        feet = {side: self.bears(side) for side in "LR"}
        corners = {
            side: np.einsum("nij,kj->nki", self.links[f"Body_{side}AR"][:, :3, :3], self.sole)
            + self.links[f"Body_{side}AR"][:, None, :3, 3]
            for side in "LR"
        }
        result = np.full(len(self.minute.t), np.nan)
        for k, point in enumerate(self.centre[:, :2]):
            standing = [corners[side][k, :, :2] for side in "LR" if feet[side][k]]
            if standing:
                result[k] = margin(hull(np.concatenate(standing)), point)
        return result
