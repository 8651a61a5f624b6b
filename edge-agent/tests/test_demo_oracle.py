"""MuJoCo's inverse dynamics of the demo's URDF and encoders say what its feet and hands feel."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from demo_balance import Balance, pressure
from demo_stage import Floats, Minute

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

FREE = (
    '<link name="nowhere"/>',
    '<joint name="free" type="floating"><parent link="nowhere"/><child link="{}"/></joint>',
)
FIRST_S = 0.04  # poses are smoothed so much; what comes of them, and what was felt, as much as elsewhere


@pytest.fixture(scope="module")
def balance(minute: Minute, bundle: Path) -> Balance:
    return Balance(minute, bundle)


def load_floating(urdf: Path, root: str) -> Any:
    """The URDF without its shells, its root free to go anywhere."""
    robot = ET.parse(urdf).getroot()
    for link in robot.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    robot.extend(ET.fromstring(text.format(root)) for text in FREE)
    return mujoco.MjModel.from_xml_string(ET.tostring(robot, encoding="unicode"))


def poses(model: Any, balance: Balance) -> Floats:
    """(n, nq), smoothed a little: they are differentiated twice."""
    minute = balance.minute
    q = np.zeros((len(minute.t), model.nq))
    q[:, :7] = np.concatenate([minute.field("base"), minute.field("baseq")], axis=1)
    for joint, angle in minute.angles("pos").items():
        if joint in minute.skeleton.joints:
            q[:, model.joint(joint).qposadr[0]] = angle
    q = balance.smooth(q, FIRST_S)
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    return q


def test_mujoco_needs_the_same_wrench_at_the_same_place(balance: Balance, bundle: Path) -> None:
    model = load_floating(bundle / "robot.urdf", balance.minute.skeleton.root)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
    data, q, hz = mujoco.MjData(model), poses(model, balance), balance.hz
    assert model.body_mass.sum() == pytest.approx(balance.mass_kg)
    speed = np.zeros((len(q), model.nv))
    for k, twist in enumerate(speed):
        mujoco.mj_differentiatePos(model, twist, 2 / hz, q[k - 1], q[(k + 1) % len(q)])
    force, moment, centre = np.zeros((3, len(q), 3))
    for k, acceleration in enumerate(balance.rate(speed)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], speed[k], acceleration
        mujoco.mj_inverse(model, data)
        root = data.body(balance.minute.skeleton.root).xmat.reshape(3, 3)
        force[k] = data.qfrc_inverse[:3]
        moment[k] = root @ data.qfrc_inverse[3:6] + np.cross(q[k, :3], force[k])
        centre[k] = data.subtree_com[0]
    feet, push = balance.floor(), balance.push()
    felt = (balance.smooth(balance.smooth(v, FIRST_S)) for v in (*feet, *push))
    floor_force, floor_moment, push_force, push_moment = felt
    force, moment = balance.smooth(force), balance.smooth(moment)
    assert abs(centre - balance.smooth(balance.centre, FIRST_S)).max() < 0.0005
    assert abs(force - floor_force - push_force).max() < 2  # N
    assert abs(moment - floor_moment - push_moment).max() < 1.5  # N m
    needed = pressure(force - push_force, moment - push_moment)
    apart = np.linalg.norm(needed - pressure(floor_force, floor_moment), axis=1)
    assert apart.max() < 0.001
