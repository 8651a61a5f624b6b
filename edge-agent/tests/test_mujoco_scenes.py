"""Scenes of a robot beside other things that move: what counts as the robot, and that the shown body is where
MuJoCo has it, while it moves."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from mjcf_stage import MILLIMETRE, make_manifest  # noqa: E402
from posecast_edge.model.kinematics import compute_link_poses, matrix_from_quaternion  # noqa: E402
from posecast_edge.model.mjcf.compiler import compile_model  # noqa: E402
from posecast_edge.model.mjcf.reader import make_robot  # noqa: E402
from posecast_edge.pipeline.inferred_channels import InferredChannels  # noqa: E402
from posecast_edge.sample import Sample  # noqa: E402
from posecast_edge.sources.mujoco.model import Simulation, load_simulation  # noqa: E402

ROBOTS = {  # name → its bodies, and the links of its model
    "walker": (
        '<body name="trunk" pos="0 0 .5" euler="0 0 40"><freejoint name="root"/>'
        '<geom type="box" size=".15 .1 .05"/>'
        '<body name="left" pos="0 .1 0"><joint name="hip" axis="0 1 0" range="-60 60"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/></body>'
        '<body name="right" pos="0 -.1 0"><joint axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 0 0 -.3" size=".03"/>'
        "</body></body>",
        ["trunk", "left", "right"],
    ),
    "arm": (
        '<body name="base" pos="0 0 .2"><geom size=".1"/>'
        '<body name="upper"><joint name="lift" axis="0 1 0"/>'
        '<geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/><body name="lower" pos=".3 0 0">'
        '<joint name="bend" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>'
        '<body name="hand" pos=".3 0 0"><joint name="wrist" type="ball"/>'
        '<geom size=".04" pos=".1 0 0"/></body>'
        "</body></body></body>",
        ["world", "base", "upper", "lower", "hand"],
    ),
}
CUBE = (
    '<body name="cube{0}" pos="{0} 1 .6" euler="20 30 {0}"><freejoint name="cube{0}"/>'
    '<geom type="box" size=".05 .06 .07"/></body>'
)
THINGS = {  # what stands beside: name → bodies, and the links that they become beside a fixed robot
    "nothing": ("", []),
    "a cube": (CUBE.format(1), ["cube1"]),
    "cubes": ("".join(map(CUBE.format, range(1, 5))), [f"cube{i}" for i in range(1, 5)]),
    "a cabinet": (
        '<body name="cabinet" pos="1 0 .4"><geom type="box" size=".2 .2 .4"/>'
        '<body name="top"><joint name="drawer1" type="slide" axis="1 0 0"/>'
        '<geom size=".05" pos="-.3 0 .2"/></body>'
        '<body name="low"><joint name="drawer2" type="slide" axis="1 0 0"/>'
        '<geom size=".05" pos="-.3 0 0"/></body>'
        "</body>",
        ["cabinet", "top", "low"],
    ),
}
FLEX = '<body name="held" pos="1 0 .9"><flexcomp name="sheet" mass=".1" spacing=".05 .05 .05" {}/></body>'
CLOTH = FLEX.replace("/></body>", '><pin id="0"/></flexcomp></body>')
SOFT = {
    "no": "",
    "a small cloth": CLOTH.format('type="grid" dim="2" count="4 4 1" radius=".01"'),
    "a cloth of 400": CLOTH.format('type="grid" dim="2" count="20 20 1" radius=".01"'),
    "a net": FLEX.format('type="grid" dim="2" count="5 5 1" dof="2d"'),
    "a jelly": FLEX.format('type="grid" dim="3" count="4 4 4" dof="trilinear"'),
    "a balloon": FLEX.format('type="ellipsoid" dim="3" count="5 5 5" dof="radial"'),
    "a cushion": FLEX.format('type="box" dim="3" count="3 3 3" rigid="true"'),
}
MOTOR = '<actuator><motor name="m" joint="{}"/></actuator>'
SCENES = [
    *itertools.product(ROBOTS, THINGS, ("no", "a small cloth"), (False, True)),
    *(("walker", "a cabinet", soft, first) for soft, first in itertools.product(SOFT, (False, True))),
]


def write(folder: Path, *bodies: str, after: str = "") -> Path:
    path = folder / "scene.xml"
    path.write_text(
        '<mujoco><option timestep="0.005"/><worldbody><geom type="plane" size="4 4 .1"/>'
        f"{''.join(bodies)}</worldbody>{after}</mujoco>"
    )
    return path


def compare_poses(simulation: Simulation, path: Path, seconds: float = 0.3) -> list[str]:
    """Assert that every link of the shown model is where MuJoCo has the body of its name, at the end of this
    time. Returns the links."""
    manifest = make_manifest(make_robot(compile_model(path, ()), path))
    simulation.advance(seconds)
    sample = simulation.make_sample()
    model, data = simulation._model, simulation._data
    mujoco.mj_kinematics(model, data)
    world = np.eye(4)
    if "base" in sample.values:
        base, turn = (list(read(sample, field).values()) for field in ("base", "baseq"))
        world = np.array(matrix_from_quaternion(base, turn))
    poses = compute_link_poses(manifest, read(sample, "pos"))
    for name in manifest["links"]:
        body = model.body(name).id
        pose = world @ np.array(poses[name])
        assert np.linalg.norm(pose[:3, 3] - data.xpos[body]) < MILLIMETRE, name
        assert np.abs(pose[:3, :3] - data.xmat[body].reshape(3, 3)).max() < MILLIMETRE, name
    return list(manifest["links"])


def read(sample: Sample, field: str) -> dict[str, float]:
    found = sample.values[field]
    assert isinstance(found, dict)
    return found


@pytest.mark.parametrize(("robot", "thing", "soft", "first"), SCENES)
def test_a_robot_beside_other_things(robot: str, thing: str, soft: str, first: bool, tmp_path: Path) -> None:
    bodies, links = ROBOTS[robot]
    things, beside = THINGS[thing]
    path = write(tmp_path, *((bodies, things, SOFT[soft]) if first else (SOFT[soft], things, bodies)))
    simulation = load_simulation(path)
    shown = compare_poses(simulation, path)
    held = ["held"] if soft == "a cushion" else []  # a rigid one has no vertices of its own
    assert set(shown) == {*links, *((*beside, *held) if robot == "arm" else ())}
    sample = simulation.make_sample()
    joints = set(read(sample, "pos"))
    assert not any("sheet" in name for name in joints)
    assert set(read(sample, "ref")) <= joints
    if robot == "walker":
        before = 0 if first else things.count("joint name=")
        assert f"unnamed joint {before + 2}" in joints, "soft parts take no numbers"
        assert read(sample, "base")["base.z"] < 0.4, "it falls: no servo holds it up"
    else:
        assert "base" not in sample.values


def test_whose_joints_have_actuators_is_the_robot(tmp_path: Path) -> None:
    """Of two walkers, and of a walker beside a wardrobe with many drawers."""
    drawers = "".join(
        f'<body name="d{i}"><joint name="drawer{i}" type="slide"/><geom size=".05"/></body>' for i in range(9)
    )
    wardrobe = f'<body name="wardrobe" pos="2 0 1">{drawers}</body>'
    walker = ROBOTS["walker"][0]
    driven = write(tmp_path, wardrobe, walker, after=MOTOR.format("hip"))
    assert compare_poses(load_simulation(driven), driven) == ["trunk", "left", "right"]
    # without actuators the wardrobe is the root, and the walker moves beside it
    undriven = write(tmp_path, wardrobe, walker)
    simulation = load_simulation(undriven)
    assert {"world", "trunk", "left"} <= set(compare_poses(simulation, undriven))
    labels = [
        f"root/{part}" for part in ("trans_x", "trans_y", "trans_z", "rot_w", "rot_x", "rot_y", "rot_z")
    ]
    assert [name for name in read(simulation.make_sample(), "pos") if "/" in name] == labels


@pytest.mark.parametrize(
    "actuator",
    [
        '<motor joint="hip"/>',
        '<motor jointinparent="hip"/>',
        '<motor site="toe" gear="0 0 1 0 0 0"/>',
        '<motor tendon="string"/>',
        '<motor tendon="rope"/>',
        '<adhesion body="left" ctrlrange="0 1" gain="1"/>',
    ],
)
def test_whatever_drives_the_robot(actuator: str, tmp_path: Path) -> None:
    walker = ROBOTS["walker"][0].replace('<joint name="hip"', '<site name="toe"/><joint name="hip"')
    walker = walker.replace('size=".15 .1 .05"/>', 'size=".15 .1 .05"/><site name="back" pos="0 0 .1"/>')
    tendons = (
        '<tendon><fixed name="string"><joint joint="hip" coef="1"/></fixed>'
        '<spatial name="rope"><site site="back"/><site site="toe"/></spatial></tendon>'
    )
    crane = '<body pos="3 0 1"><joint/><geom size=".1"/><body><joint/><geom size=".1"/>{}</body></body>'
    after = f"{tendons}<actuator>{actuator}</actuator>"
    path = write(tmp_path, THINGS["a cabinet"][0], crane.format(crane), walker, after=after)
    assert compare_poses(load_simulation(path), path) == ["trunk", "left", "right"]


def test_a_drone_and_a_cube_alone_are_robots(tmp_path: Path) -> None:
    """They have no joint but the free one."""
    path = write(tmp_path, CUBE.format(1))
    simulation = load_simulation(path)
    manifest = make_manifest(make_robot(compile_model(path, ()), path))
    simulation.advance(0.1)
    sample = simulation.make_sample()
    assert manifest["links"] == ["cube1"]
    assert set(sample.values) == {"base", "baseq"}
    assert read(sample, "base")["base.z"] < 0.6


def test_the_units_of_what_floats(tmp_path: Path) -> None:
    path = write(tmp_path, ROBOTS["arm"][0], CUBE.format(1))
    channels = InferredChannels("r", print)
    channels.take(load_simulation(path).make_sample(), 0.0)
    profile = channels.profile
    assert profile is not None
    pos = profile.find_field("pos")
    assert pos is not None
    units = {label: profile.mapping.units["pos"].get(label, pos.unit) for label in pos.labels}
    assert {unit: [label for label in units if units[label] == unit] for unit in set(units.values())} == {
        "rad": ["lift", "bend"],
        "m": [f"cube1/trans_{c}" for c in "xyz"],
        "1": [f"wrist/rot_{c}" for c in "wxyz"] + [f"cube1/rot_{c}" for c in "wxyz"],
    }
    assert pos.scale * max(pos.strides.get(label, 1) for label in pos.labels if "/" in label) < MILLIMETRE


def test_bodies_that_a_flex_names_but_that_show_something_stay(tmp_path: Path) -> None:
    points = "".join(
        f'<body name="p{i}" pos="{i % 2} {i // 2} 1"><joint name="s{i}" type="slide"/>{geom}</body>'
        for i, geom in enumerate(
            ('<geom size=".05"/>', '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>') * 2
        )
    )
    flex = '<deformable><flex name="f" dim="2" body="p0 p1 p2 p3" element="0 1 2 1 2 3"/></deformable>'
    path = write(tmp_path, points, after=flex)
    simulation = load_simulation(path)
    assert compare_poses(simulation, path) == ["world", "p0", "p2"]
    assert list(read(simulation.make_sample(), "pos")) == ["s0", "s2"]
