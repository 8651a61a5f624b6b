"""The profiles that come with the agent fit their robots."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from demo_stage import Floats, Skeleton, joint_angles
from model_stage import ROBOTS, SHARED
from posecast_edge.profile.reader import load_profile
from posecast_edge.sources import demo
from posecast_edge.sources.files.trajectory import TrajectorySource
from posecast_edge.sources.registry import open_source

PROFILES = demo.PROFILE.parent
HUBO_URDF = SHARED / "robots" / ROBOTS["hubo2plus-collision"]
HUBO_WALK = SHARED / "trajectories/hubo2plus_walk/walking_traj/walkFiveSteps0p2m.traj"
DRC_URDF = SHARED / "robots" / ROBOTS["drchubo"]
G1_URDF = SHARED / "robots" / ROBOTS["g1"]
G1_MOVE = SHARED / "trajectories/g1_moves_60hz/karate/M_Move7/retarget/M_Move7.csv"

shared = pytest.mark.skipif(not SHARED.is_dir(), reason="no robot models beside this checkout")


@pytest.mark.parametrize("path", sorted(PROFILES.glob("*.toml")), ids=lambda p: p.stem)
def test_it_parses_and_names_every_joint(path: Path) -> None:
    profile = load_profile(path)
    assert set(profile.labels["joint"]) <= set(profile.mapping.names)
    assert {k: set(v) for k, v in profile.mapping.translated_names.items()} == {
        "ko": set(profile.mapping.names)
    }
    assert profile.root
    assert profile.mapping.find_tolerance("anything") == pytest.approx(0.055, abs=0.01)


@pytest.mark.parametrize("path", sorted(PROFILES.glob("*.toml")), ids=lambda p: p.stem)
def test_each_bit_of_a_joint_has_sentences_in_both_languages(path: Path) -> None:
    profile = load_profile(path)
    flags = profile.find_field("flags")
    told = profile.mapping.sentences.get("flags", {})
    assert set(told) == set(flags.bits if flags else ())
    for bit, by_language in told.items():
        assert set(by_language) == {"en", "ko"}, bit
        assert all(s.say.startswith("{joint}") and s.why for s in by_language.values()), bit


def test_the_same_bit_means_the_same_in_each_profile() -> None:
    told = [load_profile(path).mapping.sentences.get("flags", {}) for path in PROFILES.glob("*.toml")]
    for bit in {bit for of in told for bit in of}:
        assert len({str(of[bit]) for of in told if bit in of}) == 1, bit


@shared
@pytest.mark.parametrize(("name", "urdf"), [("hubo2plus", HUBO_URDF), ("g1", G1_URDF)])
def test_it_fits_the_model(name: str, urdf: Path) -> None:
    profile, skeleton = load_profile(PROFILES / f"{name}.toml"), Skeleton(urdf)
    assert profile.root == skeleton.root
    assert set(profile.mapping.joints) <= set(skeleton.joints)
    assert {m.link for m in profile.mapping.sensors.values()} <= set(skeleton.links)
    moving = {n for n, j in skeleton.joints.items() if j.get("type") != "fixed"}
    driven = set(profile.mapping.joints) | set(profile.labels["joint"])
    assert moving <= driven, "a joint nothing drives"


@shared
def test_drc_hubo_fits_its_model_but_for_fingers_nobody_reports() -> None:
    profile, skeleton = load_profile(PROFILES / "drchubo.toml"), Skeleton(DRC_URDF)
    assert set(profile.labels["joint"]) <= set(skeleton.joints)
    assert {m.link for m in profile.mapping.sensors.values()} <= set(skeleton.links)
    moving = {n for n, j in skeleton.joints.items() if j.get("type") != "fixed"}
    assert all(name[1] == "F" for name in moving - set(profile.labels["joint"]))


def test_hubos_offsets_and_couplings() -> None:
    joints = load_profile(PROFILES / "hubo2plus.toml").mapping.joints
    degrees = {name: round(math.degrees(joints[name].offset), 6) for name in ("LSR", "RSR", "LEB", "REB")}
    assert degrees == {"LSR": 15, "RSR": -15, "LEB": -10, "REB": -10}
    assert joints["rightThumbKnuckle3"].terms == (("RF1", 1.0),)
    lengths = {"NK1": 85.0 + 20, "NK2": 85.0}  # mm; home is 95
    pitch = sum(g * (lengths[c] - 95) for c, g in joints["HNP"].terms) + joints["HNP"].offset
    roll = sum(g * (lengths[c] - 95) for c, g in joints["HNR"].terms) + joints["HNR"].offset
    assert math.degrees(pitch) == pytest.approx(-294.4 + 1.55 * 190, abs=0.01)
    assert math.degrees(roll) == pytest.approx(-1.3197 * 20, abs=0.01)


@shared
def test_hubo_walks_five_steps() -> None:
    profile, skeleton = load_profile(PROFILES / "hubo2plus.toml"), Skeleton(HUBO_URDF)
    source = open_source(f"trajectory:{HUBO_WALK}", profile)
    assert isinstance(source, TrajectorySource)
    rows = [source.advance(k / 200) for k in range(1193)]
    assert all(row is not None for row in rows)
    labels = profile.labels["joint"]
    channels = {
        label: np.array([0.0 if (v := row.values["pos"][i]) is None else v for row in rows])  # type: ignore[union-attr,index]
        for i, label in enumerate(labels)
    }
    assert min(channels["RKN"].min(), channels["LKN"].min()) > 0.3, "knees bend backwards"
    angles = joint_angles(profile, channels)
    root = np.broadcast_to(np.eye(4), (len(rows), 4, 4))
    feet = {s: skeleton.pose(f"Body_{s}AR", angles, root)[:, :3, 3] for s in "LR"}
    for s in "LR":
        hip = skeleton.pose(f"Body_{s}HP", angles, root)[:, :3, 3]
        knee = skeleton.pose(f"Body_{s}KN", angles, root)[:, :3, 3]
        ankle = skeleton.pose(f"Body_{s}AP", angles, root)[:, :3, 3]
        assert (knee[:, 0] > (hip[:, 0] + ankle[:, 0]) / 2).all(), "knees point forward"
        assert abs(np.linalg.norm(knee - hip, axis=1) - 0.2835).max() < 0.001, "no limb is detached"
    higher = feet["L"][:, 2] - feet["R"][:, 2]
    swings = _alternations(higher, 0.02)
    assert len(swings) >= 5
    assert all(a != b for a, b in pairwise(swings)), "feet alternate"
    assert abs(higher).max() < 0.1


def _alternations(higher: Floats, over: float) -> list[str]:
    """Which foot is up, in order."""
    sides = ["L" if h > over else "R" if h < -over else "" for h in higher]
    return [s for k, s in enumerate(sides) if s and (k == 0 or sides[k - 1] != s)]


@shared
def test_g1_moves_with_its_base() -> None:
    profile, skeleton = load_profile(PROFILES / "g1.toml"), Skeleton(G1_URDF)
    source = open_source(f"trajectory:{G1_MOVE}", profile)
    assert isinstance(source, TrajectorySource)
    lowest = []
    for k in range(0, 600, 20):
        sample = source.advance(k / 60)
        assert sample is not None
        base, quat, ref = sample.values["base"], sample.values["baseq"], sample.values["ref"]
        assert isinstance(base, list)
        assert isinstance(quat, list)
        assert isinstance(ref, list)
        w, x, y, z = (float(v) for v in quat)
        assert math.hypot(w, x, y, z) == pytest.approx(1, abs=1e-3)
        root = np.eye(4)[None].copy()
        root[0, :3, 3] = base
        root[0, :3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
        angles = {j: np.array([v]) for j, v in zip(profile.labels["joint"], ref, strict=True)}
        feet = [skeleton.pose(f"{s}_ankle_roll_link", angles, root)[0, 2, 3] for s in ("left", "right")]
        lowest.append(min(feet))
    assert min(lowest) > 0
    assert max(lowest) < 0.25, "a foot stays near the floor"
