"""A demo bundle built into a fresh folder, and forward kinematics read off any URDF for a whole motion."""

from __future__ import annotations

import fcntl
import math
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from posecast_edge.profile.reader import load_profile
from posecast_edge.profile.types import Profile
from posecast_edge.sources.demo import PROFILE, Motion, read_motion

Floats = npt.NDArray[np.float64]

BUILD = Path(__file__).parents[1] / "demo" / "build.py"


def build(out: Path) -> Path:
    """Build the demo bundle into a folder, as the Makefile does."""
    subprocess.run([sys.executable, str(BUILD), "--out", str(out)], check=True, capture_output=True)
    return out


@pytest.fixture(scope="session")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built once, also with several workers."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "demo_bundle"
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            build(folder.with_suffix(".part")).rename(folder)
    return folder


@pytest.fixture(scope="session")
def minute(bundle: Path) -> Minute:
    return Minute(read_motion((bundle / "motion.bin").read_bytes()), bundle / "robot.urdf")


def joint_angles(profile: Profile, channels: Mapping[str, Floats]) -> dict[str, Floats]:
    """Channels → URDF joints, as the profile maps them."""
    angles = dict(channels)
    for joint, how in profile.mapping.joints.items():
        angles[joint] = how.offset + sum((g * channels[c] for c, g in how.terms), np.zeros(1))
    return angles


class Skeleton:
    """A URDF's joints. Written on its own, so that it can judge the one the builder has."""

    def __init__(self, urdf: Path) -> None:
        root = ET.parse(urdf).getroot()
        self.links = [str(link.get("name")) for link in root.findall("link")]
        self.joints = {str(j.get("name")): j for j in root.findall("joint")}
        self.parent = {_attribute(j, "child", "link"): j for j in self.joints.values()}
        (self.root,) = set(self.links) - set(self.parent)
        self.shells = {  # mesh stems by link
            str(link.get("name")): [Path(str(m.get("filename"))).stem for m in link.iter("mesh")]
            for link in root.findall("link")
        }

    def limits(self, joint: str) -> tuple[float, float]:
        """Lower and upper, rad."""
        return float(_attribute(self.joints[joint], "limit", "lower")), float(
            _attribute(self.joints[joint], "limit", "upper")
        )

    def pose(self, link: str, angles: Mapping[str, Floats], world_from_root: Floats) -> Floats:
        """world_from_link (n, 4, 4)."""
        return self.poses(angles, world_from_root, link)[link]

    def poses(
        self, angles: Mapping[str, Floats], world_from_root: Floats, only: str | None = None
    ) -> dict[str, Floats]:
        """world_from_link (n, 4, 4) of all links, or of one and those it hangs on."""
        found = {self.root: world_from_root}

        def add(link: str) -> None:
            if link in found:
                return
            joint = self.parent[link]
            above = _attribute(joint, "parent", "link")
            add(above)
            found[link] = self._below(joint, found[above], angles)

        for link in self.links if only is None else [only]:
            add(link)
        return found

    @staticmethod
    def _below(joint: ET.Element, above: Floats, angles: Mapping[str, Floats]) -> Floats:
        fixed = np.eye(4)
        origin = joint.find("origin")
        if origin is not None:
            fixed[:3, 3] = _numbers(origin.get("xyz"))
            r, p, y = _numbers(origin.get("rpy"))
            fixed[:3, :3] = _turn((0, 0, 1), y)[0] @ _turn((0, 1, 0), p)[0] @ _turn((1, 0, 0), r)[0]
        moved = np.broadcast_to(np.eye(4), (1, 4, 4)).copy()
        if joint.get("type") != "fixed":
            angle = angles.get(str(joint.get("name")), np.zeros(1))
            moved = np.broadcast_to(np.eye(4), (len(angle), 4, 4)).copy()
            moved[:, :3, :3] = _turn(_numbers(_attribute(joint, "axis", "xyz")), angle)
        return np.asarray(above @ fixed @ moved)


def _attribute(joint: ET.Element, tag: str, name: str) -> str:
    found = joint.find(tag)
    assert found is not None
    return str(found.get(name))


def _numbers(text: str | None) -> tuple[float, float, float]:
    x, y, z = (float(word) for word in (text or "0 0 0").split())
    return x, y, z


def _turn(axis: tuple[float, float, float], angle: float | Floats) -> Floats:
    x, y, z = np.array(axis) / math.hypot(*axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = np.atleast_1d(np.asarray(angle, dtype=np.float64))[:, None, None]
    return np.asarray(np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * (k @ k))


class Minute:
    """The demo's motion as arrays over time: `field(name)` (n, labels), NaN where there is no reading."""

    def __init__(self, motion: Motion, urdf: Path) -> None:
        self.motion = motion
        self.profile = load_profile(PROFILE)
        self.skeleton = Skeleton(urdf)
        self.t = np.arange(motion.samples) / motion.rate_hz
        w, x, y, z = self.field("baseq").T
        self.world_from_root = np.zeros((motion.samples, 4, 4))
        self.world_from_root[:, :3, 3] = self.field("base")
        self.world_from_root[:, 3, 3] = 1
        self.world_from_root[:, :3, :3] = np.moveaxis(
            np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
                ]
            ),
            2,
            0,
        )

    def field(self, name: str) -> Floats:
        """All channels of a field in its unit."""
        track = next(t for t in self.motion.tracks if t.name == name)
        counts = np.array(track.columns, dtype=np.float64).T
        return np.where(counts == -32768, np.nan, counts * track.scale)

    def channel(self, name: str, label: str) -> Floats:
        """One channel over time."""
        spec = self.profile.find_field(name)
        assert spec is not None
        return np.asarray(self.field(name)[:, spec.labels.index(label)])

    def flag(self, channel: str, bit: str) -> npt.NDArray[np.bool_]:
        """One bit over time."""
        spec = self.profile.find_field("flags")
        assert spec is not None
        masks = self.channel("flags", channel).astype(int)
        return np.asarray((masks >> spec.bits.index(bit)) % 2 == 1)

    def angles(self, name: str) -> dict[str, Floats]:
        """URDF joints of `ref` or `pos`."""
        spec = self.profile.find_field(name)
        assert spec is not None
        return joint_angles(self.profile, dict(zip(spec.labels, self.field(name).T, strict=True)))

    def link(self, name: str) -> Floats:
        """world_from_link (n, 4, 4) as the encoders and the odometry have it."""
        return self.skeleton.pose(name, self.angles("pos"), self.world_from_root)
