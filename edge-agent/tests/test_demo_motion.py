"""The demo's minute is a motion a robot could make, and shows every display something."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from demo_stage import Floats, Minute

SOLE = [(x, y, -0.078) for x in (-0.07, 0.14) for y in (-0.047, 0.047)]  # corners in the foot's link, m
WEIGHT_N = 42.0 * 9.81


def sole(minute: Minute, side: str) -> Floats:
    """(n, 4, 3): the corners of a sole in the world."""
    pose = minute.link(f"Body_{side}AR")
    return np.asarray(np.einsum("nij,kj->nki", pose[:, :3, :3], np.array(SOLE)) + pose[:, None, :3, 3])


def stances(minute: Minute, side: str) -> list[slice]:
    """Runs of samples in which the foot bears over a tenth of the weight."""
    bears = minute.channel("ftf", f"{side}F.fz") > 0.1 * WEIGHT_N
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bears, [False]]).astype(int)))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@pytest.mark.parametrize("side", ["L", "R"])
def test_a_stance_foot_slides_under_5_mm_and_stays_on_the_floor(minute: Minute, side: str) -> None:
    corners = sole(minute, side)
    runs = stances(minute, side)
    assert len(runs) >= 8
    for run in runs:
        slide = np.linalg.norm(np.ptp(corners[run, :, :2], axis=0), axis=1).max()
        assert slide < 0.005, (run, slide)
        assert abs(corners[run, :, 2]).max() < 0.003, run


@pytest.mark.parametrize("side", ["L", "R"])
def test_no_foot_enters_the_floor_and_a_swing_clears_it(minute: Minute, side: str) -> None:
    corners = sole(minute, side)
    assert corners[:, :, 2].min() > -0.003
    lowest = corners[:, :, 2].min(axis=1)
    up = lowest > 0.004
    edges = np.flatnonzero(np.diff(np.concatenate([[False], up, [False]]).astype(int))).reshape(-1, 2)
    assert len(edges) >= 8
    assert all(lowest[a:b].max() > 0.025 for a, b in edges)


def test_forces_of_the_feet_are_the_weight_while_standing(minute: Minute) -> None:
    total = minute.channel("ftf", "LF.fz") + minute.channel("ftf", "RF.fz")
    mode = [minute.motion.make_sample(k).info["mode"] for k in range(minute.motion.samples)]
    still = np.isin(mode, ["standing", "waving", "reaching", "knee test", "homing fingers"])
    assert still.sum() > 1500
    assert abs(total[still] / WEIGHT_N - 1).max() < 0.05
    assert abs(total.mean() / WEIGHT_N - 1) < 0.02


@pytest.mark.parametrize("name", ["ref", "pos"])
def test_limits_hold_and_nothing_jumps_also_at_the_seam(minute: Minute, name: str) -> None:
    for joint, angle in minute.angles(name).items():
        if joint not in minute.skeleton.joints:
            continue
        low, high = minute.skeleton.limits(joint)
        assert low <= angle.min(), joint
        assert angle.max() <= high, joint
        ring = np.concatenate([angle, angle[:2]])
        speed = np.diff(ring) * minute.motion.rate_hz
        assert abs(speed).max() < 6, joint
        assert abs(np.diff(speed)).max() < 2, joint  # rad/s from sample to sample: 120 rad/s²
    base = minute.field("base")
    assert np.linalg.norm(base[0] - base[-1]) < 0.001, "it ends where it began"


def test_an_obstacle_parts_ref_and_pos_of_the_left_arm(minute: Minute) -> None:
    apart = abs(minute.channel("ref", "LSP") - minute.channel("pos", "LSP")) > 0.15
    assert 2 < apart.sum() / minute.motion.rate_hz < 6
    force = minute.channel("ftf", "LH.fz")
    limit = minute.profile.mapping.thresholds["ftf"]["LH.fz"]
    levels = {limit.find_level(f) for f in force}
    assert levels == {"ok", "caution", "fault"}
    assert minute.flag("LSP", "comply").any()


def test_the_right_knee_jams_in_the_air_and_comes_free(minute: Minute) -> None:
    jam = minute.flag("RKN", "jam")
    assert 2 < jam.sum() / minute.motion.rate_hz < 5
    assert not jam[0] and not jam[-1]  # noqa: PT018
    off = abs(minute.channel("ref", "RKN") - minute.channel("pos", "RKN"))
    assert off[jam].max() > 0.3
    assert off[jam].min() > 0.1
    assert abs(minute.channel("cur", "RKN")[jam]).min() > 5
    assert minute.flag("RKN", "bigError").any()
    assert minute.channel("ftf", "RF.fz")[jam].max() < 10, "the foot is in the air"
    limit = minute.profile.mapping.find_threshold("temp", "RKN")
    assert limit is not None
    assert {limit.find_level(c) for c in minute.channel("temp", "RKN")} == {"ok", "caution"}


def test_some_readings_are_missing_for_a_while_some_for_ever(minute: Minute) -> None:
    dead = np.isnan(minute.channel("quat", "LF.w"))
    assert 4 < dead.sum() / minute.motion.rate_hz < 10
    assert np.array_equal(dead, np.isnan(minute.channel("acc", "LF.z")))
    assert np.isnan(minute.channel("temp", "LF1")).all()
    assert not np.isnan(minute.field("pos")).any()
    quat = minute.field("quat")
    assert not np.isnan(quat[:, :8]).any()


def test_fingers_find_their_zero_one_by_one(minute: Minute) -> None:
    found = []
    for i in range(1, 6):
        homed = minute.flag(f"LF{i}", "homed")
        lost: npt.NDArray[np.int64] = np.flatnonzero(~homed)
        assert 0 < lost.size < homed.size / 4
        found.append(int(lost[-1]))
    assert found == sorted(set(found))
    assert not minute.flag("RWR", "enabled").all()


def test_the_sensors_make_physical_sense(minute: Minute) -> None:
    acc = minute.field("acc")[:, :3]
    assert abs(np.linalg.norm(acc, axis=1)[:180].mean() - 9.81) < 0.05, "gravity while it stands"
    quat = minute.field("quat")[:, :4]
    assert abs(np.linalg.norm(quat, axis=1) - 1).max() < 1e-3
    assert 48 < minute.field("volt").mean() < 50
    assert minute.field("amp").min() > 1
