"""The demo's physics holds: its masses, how they move, and what its feet and hands feel agree.

Everything is worked out anew from the bundle (demo_balance.py); nothing of the builder is imported.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import trimesh
from demo_balance import Balance, margin, pressure
from demo_stage import Floats, Minute
from model_stage import build_robot

WEIGHT_N = 42.0 * 9.81
SLOW = ("standing", "waving", "bowing", "reaching", "knee test", "homing fingers", "leaning")
AMBER_MM, RED_MM = 20, 0


@pytest.fixture(scope="module")
def balance(minute: Minute, bundle: Path) -> Balance:
    return Balance(minute, bundle)


def during(minute: Minute, *modes: str) -> npt.NDArray[np.bool_]:
    mode = [minute.motion.make_sample(k).info["mode"] for k in range(minute.motion.samples)]
    return np.isin(mode, modes)


def test_every_link_weighs_something_that_can_be(balance: Balance, bundle: Path) -> None:
    assert set(balance.inertias) == set(balance.minute.skeleton.links)
    assert balance.mass_kg == pytest.approx(42)
    for link, inertia in balance.inertias.items():
        a, b, c = np.linalg.eigvalsh(inertia.about_centre)
        assert 0.01 <= inertia.mass_kg < 12, link
        assert 0 < a <= b <= c < a + b, link
        radius = np.sqrt(c / inertia.mass_kg)
        assert 0.003 < radius < 0.15, link
        other = link.replace("Body_L", "Body_R").replace("left", "right")
        assert inertia.mass_kg == balance.inertias[other].mass_kg
    legs = sum(i.mass_kg for link, i in balance.inertias.items() if link[:6] in ("Body_L", "Body_R"))
    assert 0.4 < legs / balance.mass_kg < 0.65


def test_the_mass_of_a_link_lies_within_its_shells(balance: Balance, bundle: Path) -> None:
    meshes = {path.stem: trimesh.load_mesh(path) for path in (bundle / "meshes").glob("*.stl")}
    for link, shells in balance.minute.skeleton.shells.items():
        corners = np.concatenate([meshes[stem].bounds for stem in shells])
        centre = balance.inertias[link].centre
        assert (corners.min(0) < centre).all(), link
        assert (centre < corners.max(0)).all(), link


def test_a_shell_filled_evenly_has_that_inertia(balance: Balance, bundle: Path) -> None:
    """trimesh integrates on its own. The shin link: a knee, its rims, the shin, the knee cap."""
    for link in ("Body_LKN", "Body_Head", "rightThumbMedial"):
        volume, first, about_origin = 0.0, np.zeros(3), np.zeros((3, 3))
        for stem in balance.minute.skeleton.shells[link]:
            for part in trimesh.load_mesh(bundle / f"meshes/{stem}.stl").split():
                volume, first = volume + part.volume, first + part.volume * part.center_mass
                about_origin += part.moment_inertia_frame(np.eye(4))
        inertia = balance.inertias[link]
        c = first / volume
        about = about_origin * inertia.mass_kg / volume
        about -= inertia.mass_kg * (c @ c * np.eye(3) - np.outer(c, c))
        assert inertia.centre == pytest.approx(c, abs=2e-5)
        assert inertia.about_centre == pytest.approx(about, rel=0.01, abs=1e-7 * inertia.mass_kg)


def test_the_built_model_has_these_masses_and_two_soles(balance: Balance, bundle: Path) -> None:
    built = build_robot(bundle / "robot.urdf").document
    links = built["links"]
    assert [links[i["link"]] for i in built["inertials"]] == links
    assert sum(i["mass_kg"] for i in built["inertials"]) == pytest.approx(42)
    assert "findings" not in built
    assert {links[sole["link"]] for sole in built["soles"]} == {"Body_LAR", "Body_RAR"}
    for sole in built["soles"]:
        outline = np.array(sole["points"])
        away = [margin(balance.sole[:, :2], corner) for corner in outline[:, :2]]
        assert max(map(abs, away)) < 0.001, "corners of the shell's own outline"


def test_the_feet_carry_the_weight_in_every_slow_scene(balance: Balance) -> None:
    slow = during(balance.minute, *SLOW)
    feet, push = balance.floor()[0], balance.push()[0]
    assert abs(feet[slow, 2] / WEIGHT_N - 1).max() < 0.03
    assert abs(balance.smooth(feet + push)[slow, 2] / WEIGHT_N - 1).max() < 0.015
    assert feet[:, 2].mean() + push[:, 2].mean() == pytest.approx(WEIGHT_N, rel=0.002)


def test_feet_and_hands_push_just_as_the_body_moves(balance: Balance) -> None:
    """Newton and Euler over the whole minute, walking too."""
    force, moment = (a + b for a, b in zip(balance.floor(), balance.push(), strict=True))
    needed_force, needed_moment = balance.needed()
    assert abs(balance.smooth(force - needed_force)).max() < 2  # N
    assert abs(balance.smooth(moment - needed_moment)).max() < 1.5  # N m


def test_the_centre_of_pressure_is_the_zero_moment_point(balance: Balance) -> None:
    floor_force, floor_moment = (balance.smooth(v) for v in balance.floor())
    needed = [balance.smooth(a - b) for a, b in zip(balance.needed(), balance.push(), strict=True)]
    apart = np.linalg.norm(pressure(floor_force, floor_moment) - pressure(needed[0], needed[1]), axis=1)
    assert apart.max() < 0.0008  # 0.0011 without the inertia of links that turn
    still = during(balance.minute, "waving", "homing fingers")
    beneath = np.linalg.norm(pressure(floor_force, floor_moment) - balance.centre[:, :2], axis=1)
    assert beneath[still].max() < 0.012, "what barely moves pushes beneath its centre of mass"


def test_each_foot_pushes_within_its_sole_and_never_pulls(balance: Balance) -> None:
    for side in "LR":
        normal, at = balance.foot_pressure(side)
        assert normal.min() > -4, "noise"
        within = [margin(balance.sole[:, :2], p) for p in at[normal > 0.05 * WEIGHT_N, :2]]
        assert min(within) > 0.005
        force, _, _ = balance.wrench(f"{side}F")
        bearing = force[normal > 0.2 * WEIGHT_N]
        assert (np.linalg.norm(bearing[:, :2], axis=1) < 0.35 * bearing[:, 2]).all(), "it would slip"


def test_two_feet_share_the_load_as_the_centre_of_pressure_lies(balance: Balance) -> None:
    force, moment = balance.floor()
    both = pressure(force, moment)
    (left, at_left), (right, at_right) = (balance.foot_pressure(side) for side in "LR")
    shared = np.minimum(left, right) > 0.1 * WEIGHT_N
    assert shared.sum() > 1500
    feet = [
        (balance.links[f"Body_{side}AR"][shared] @ np.column_stack([at, np.ones(len(at))])[shared, :, None])
        for side, at in (("L", at_left), ("R", at_right))
    ]
    on_left, on_right = (foot[:, :2, 0] for foot in feet)
    across = on_left - on_right
    part = ((both[shared] - on_right) * across).sum(1) / (across**2).sum(1)
    assert abs(part - (left / (left + right))[shared]).max() < 0.02


def test_it_leans_until_the_margin_is_amber_and_recovers(balance: Balance) -> None:
    margin_mm = balance.margins * 1e3
    leaning = np.flatnonzero(during(balance.minute, "leaning"))
    amber = leaning[margin_mm[leaning] < AMBER_MM]
    assert 1 < len(amber) / balance.hz < 2
    assert (np.diff(amber) == 1).all(), "once"
    jam_ends = np.flatnonzero(balance.minute.flag("RKN", "jam"))[-1] + 1
    lesson = jam_ends + 14.5 * balance.hz  # docs/tutorials/balance-lesson.md
    assert amber[0] + 0.3 * balance.hz < lesson < amber[-1] - 0.3 * balance.hz, "by hand, give or take"
    assert 14 < margin_mm[leaning].min() < 18
    assert margin_mm[leaning[0]] > 80
    assert margin_mm[-1] > 80
    front = balance.centre[amber, 0] - balance.links["Body_LAR"][amber, 0, 3]
    assert (front > 0.1).all(), "over the toes"
    assert during(balance.minute, "leaning")[58 * 60 : 59 * 60].all()


def test_in_other_slow_scenes_the_margin_is_green(balance: Balance) -> None:
    margin_mm = balance.margins * 1e3
    assert not np.isnan(margin_mm).any(), "some foot always bears"
    on_two = during(balance.minute, *(set(SLOW) - {"leaning", "knee test"}))
    assert margin_mm[on_two].min() > 50
    assert margin_mm[during(balance.minute, "knee test")].min() > AMBER_MM + 5
    walking = during(balance.minute, "walking", "turning")
    assert margin_mm[walking].min() < RED_MM, "a walk is a fall that is caught"


def test_an_obstacle_is_leaned_against(balance: Balance) -> None:
    """What pushes the hand back would tip the robot; its centre of mass goes ahead of where it pushes."""
    push, _ = balance.push()
    k = int(np.argmax(np.linalg.norm(balance.smooth(push), axis=1)))
    assert during(balance.minute, "reaching")[k]
    force, moment = (balance.smooth(v) for v in balance.floor())
    ahead = balance.centre[k, :2] - pressure(force, moment)[k]
    assert np.linalg.norm(ahead) > 0.02
    assert ahead @ balance.smooth(push)[k, :2] < 0
    assert abs((force + balance.smooth(push))[k, :2]).max() < 3


def test_no_foot_raises_an_alarm(minute: Minute) -> None:
    for field in ("ftf", "ftm"):
        for label, limit in minute.profile.mapping.thresholds[field].items():
            if label[1] == "F":
                assert {limit.find_level(v) for v in minute.channel(field, label)} == {"ok"}, label


# --- MuJoCo's inverse dynamics of the demo's URDF and encoders say what its feet and hands feel

FREE = (
    '<link name="nowhere"/>',
    '<joint name="free" type="floating"><parent link="nowhere"/><child link="{}"/></joint>',
)
FIRST_S = 0.04  # poses are smoothed so much; what comes of them, and what was felt, as much as elsewhere


def load_floating(mujoco: Any, urdf: Path, root: str) -> Any:
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
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    model = load_floating(mujoco, bundle / "robot.urdf", balance.minute.skeleton.root)
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
