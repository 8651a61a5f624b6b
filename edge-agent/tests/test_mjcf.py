"""MuJoCo models as bodies: links, joints, shapes and colours, against MuJoCo itself."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")

from mjcf_stage import assert_as_mujoco, make_manifest, write_everything  # noqa: E402
from model_stage import build_robot, cube_stl  # noqa: E402
from posecast_edge.model.kinematics import (  # noqa: E402
    compute_link_poses,
    matrix_from_quaternion,
    quaternion_from_rpy,
)
from posecast_edge.model.mjcf.reader import load_mjcf  # noqa: E402
from posecast_edge.model.robot_file import RobotFile  # noqa: E402
from posecast_edge.model.urdf.types import Shape  # noqa: E402
from posecast_edge.sources.mujoco.model import load_simulation  # noqa: E402

FLOATING = """<mujoco><worldbody>
<geom type="plane" size="1 1 1"/>
<body name="cube" pos="3 0 0"><freejoint/><geom size=".1"/></body>
<body name="trunk" pos="0 0 1"><freejoint name="free"/><geom size=".1"/>
<body name="arm"><joint name="j"/><geom size=".1"/></body></body>
</worldbody></mujoco>"""


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RobotFile]:
    path = write_everything(tmp_path_factory.mktemp("everything"))
    return path, load_mjcf(path)


def load(folder: Path, text: str) -> RobotFile:
    path = folder / "model.xml"
    path.write_text(text)
    return load_mjcf(path)


def geoms(text: str) -> str:
    return f'<mujoco><worldbody><body name="a"><joint name="j"/>{text}</body></worldbody></mujoco>'


def shapes(robot: RobotFile, link: str) -> tuple[Shape, ...]:
    return next(one.visuals for one in robot.urdf.links if one.name == link)


def codes(robot: RobotFile) -> set[str]:
    return {finding.code for finding in robot.urdf.findings}


def test_every_link_is_where_mujoco_has_its_body(everything: tuple[Path, RobotFile]) -> None:
    path, robot = everything
    assert assert_as_mujoco(robot, path, seed=2) == 10


def test_joints_have_their_type_limits_and_names(everything: tuple[Path, RobotFile]) -> None:
    path, robot = everything
    manifest = make_manifest(robot)
    joints = {j["name"]: j for j in manifest["joints"]}
    assert {n: j["type"] for n, j in joints.items() if j["type"] != "fixed"} == {
        "turn": "revolute",
        "lean": "continuous",
        "up": "prismatic",
        "around": "continuous",
        "in": "prismatic",
        "ball": "floating",
        "left/grip": "revolute",
        "joint7": "continuous",
        "joint8": "continuous",
        "joint9": "continuous",
        "box": "floating",
    }
    assert joints["turn"]["limits"] == pytest.approx({"lower": -1.57079633, "upper": 0.785398163})
    assert joints["up"]["limits"] == {"lower": -0.1, "upper": 0.4}
    assert "limits" not in joints["around"] or joints["around"]["limits"] == {}
    mimic = joints["around"]["mimic"]
    assert (manifest["joints"][mimic["joint"]]["name"], mimic["multiplier"]) == ("turn", -2)
    assert mimic["offset"] == pytest.approx(0.1)
    assert "mimic" not in joints["in"]  # a parabola
    assert {"trunk/turn", "trunk/lean", "lift/up", "wrist/ball"} <= set(manifest["links"])
    # the source sends the same names
    assert set(load_simulation(path).joints) <= set(joints)


def test_names_of_joints_without_one_are_the_sources(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(
        geoms('<geom size=".1"/><body><joint axis="0 1 0"/><geom size=".1"/></body>').replace(' name="j"', "")
    )
    names = [j.name for j in load_mjcf(path).urdf.joints if j.type != "fixed"]
    assert names == list(load_simulation(path).joints) == ["unnamed joint 0", "unnamed joint 1"]


def test_shapes_and_colours(everything: tuple[Path, RobotFile]) -> None:
    _, robot = everything
    box, ellipsoid = shapes(robot, "trunk")
    assert box.geometry is not None
    assert box.geometry.dims == pytest.approx((0.4, 0.2, 0.3))
    assert box.material is not None
    assert box.material.rgba == (1, 0, 0, 1)
    assert ellipsoid.geometry is not None
    assert (ellipsoid.geometry.dims, ellipsoid.geometry.scale) == ((0.2,), (0.5, 1.0, 0.25))
    cube, painted = shapes(robot, "lift")  # what is there to collide is not
    assert cube.geometry is not None
    assert painted.geometry is not None
    assert cube.material is not None
    assert cube.material.rgba == (0, 0, 1, 1)
    assert painted.material is None
    paint = robot.meshes[painted.geometry.uri].surfaces[0].paint
    assert paint is not None
    assert paint.texture is not None
    assert robot.meshes[cube.geometry.uri].triangles == 12
    assert len(shapes(robot, "wrist")) == 1  # of two, one can't be seen
    assert shapes(robot, "world") == ()
    assert codes(robot) == {"mocap", "geom-groups", "mass-of-mesh"}


def test_sensors_on_sites_have_the_sources_names(everything: tuple[Path, RobotFile]) -> None:
    _, robot = everything
    assert [(s.name, s.kind, s.link) for s in robot.urdf.sensors] == [
        ("imu_1", "imu", "trunk"),
        ("left/tip", "force_torque", "left/palm"),
    ]


def test_all_that_was_read_is_told(everything: tuple[Path, RobotFile]) -> None:
    path, robot = everything
    read = {str(p.relative_to(path.parent.resolve())) for p in robot.inputs}
    assert read == {"everything.xml", "hand.xml", "parts/looks.xml", "meshes/cube.stl", "meshes/painted.obj"}


def test_a_mesh_lies_where_mujoco_has_it(everything: tuple[Path, RobotFile]) -> None:
    """MuJoCo moves a mesh's origin to its centre and turns it; the geom makes good for that."""
    path, _ = everything
    built = build_robot(path)
    readings = {"lean": math.radians(20), "up": 0.05, "around": 0.0}  # its reference pose
    pose = np.array(compute_link_poses(built.document, readings)["lift"])
    number = built.document["links"].index("lift")
    visual = next(v for v in built.figure.visuals if v.link == number and v.source == "cube")
    shape = visual.pose
    turned = np.array(matrix_from_quaternion(shape.xyz, quaternion_from_rpy(shape.rpy)))
    ours = corners(built.figure.looks[visual.looks].mesh.surfaces[0].positions, pose @ turned)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mesh = model.mesh("cube")
    geom = next(i for i in range(model.ngeom) if model.geom_dataid[i] == mesh.id)
    place = np.eye(4)
    place[:3, :3], place[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    vertices = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
    assert np.abs(ours - corners(vertices, place)).max() < 1e-5
    assert {f["path"] for f in built.document["files"]} >= {"high.glb", "thumbnail.png"}


def corners(points: NDArray[Any], at: NDArray[Any]) -> NDArray[Any]:
    """Lowest and highest corner of points that lie at that."""
    moved = points @ at[:3, :3].T + at[:3, 3]
    return np.array([moved.min(0), moved.max(0)])


def test_a_robot_that_floats_is_moved_by_its_base(tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    path.write_text(FLOATING)
    robot = load_mjcf(path)
    manifest = make_manifest(robot)
    assert manifest["links"] == ["trunk", "arm"]
    assert codes(robot) == {"beside"}
    assert assert_as_mujoco(robot, path, seed=1) == 2
    base = load_simulation(path).make_sample().values["base"]  # of the robot, not of the cube before it
    assert base == {"base.x": 0.0, "base.y": 0.0, "base.z": pytest.approx(1.0)}


GROUPS = {
    "hidden": ('<geom size=".1" group="1"/><geom size=".2" group="4"/>', [0.1]),
    "only hidden": ('<geom size=".1" group="3"/><geom size=".2" group="4"/>', [0.1]),
    "to collide": (
        '<geom type="mesh" mesh="m" group="1" contype="0" conaffinity="0" mass="1"/><geom size=".2"/>',
        ["m"],
    ),
    "to collide, in one group": (
        '<geom type="mesh" mesh="m" contype="0" conaffinity="0"/><geom size=".2"/>',
        ["m", 0.2],
    ),
}


@pytest.mark.parametrize("case", GROUPS)
def test_what_is_shown(case: str, tmp_path: Path) -> None:
    inside, expected = GROUPS[case]
    (tmp_path / "m.stl").write_bytes(cube_stl())
    asset = '<asset><mesh name="m" file="m.stl"/></asset><worldbody>'
    robot = load(tmp_path, geoms(inside).replace("<worldbody>", asset))
    shown = [s.geometry for s in shapes(robot, "a")]
    assert [g.uri or g.dims[0] for g in shown if g is not None] == expected
    assert len(codes(robot) - {"mass-of-mesh"}) == (0 if "one group" in case else 1)


def test_only_a_world(tmp_path: Path) -> None:
    robot = load(tmp_path, '<mujoco><worldbody><geom size=".1"/></worldbody></mujoco>')
    assert len(shapes(robot, "world")) == 1


def test_a_constraint_that_is_off_couples_nothing(tmp_path: Path) -> None:
    two = geoms('<geom size=".1"/><body><joint name="k"/><geom size=".1"/></body>')
    tie = '<equality><joint joint1="k" joint2="j" active="false"/></equality></mujoco>'
    robot = load(tmp_path, two.replace("</mujoco>", tie))
    assert all(joint.mimic is None for joint in robot.urdf.joints)


# --- the robots of dm_control, Gymnasium-Robotics and robosuite, where these are installed: each becomes
# a body whose links are where MuJoCo has them

ROBOTS = {
    "dm_control": (
        *(
            f"suite/{name}.xml"
            for name in ("cheetah", "dog", "fish", "humanoid", "humanoid_CMU", "quadruped")
        ),
        *(f"suite/{name}.xml" for name in ("manipulator", "swimmer", "walker")),
        *(f"locomotion/walkers/assets/{name}.xml" for name in ("humanoid_CMU_V2020", "rodent")),
        *(f"third_party/{name}.xml" for name in ("ant/ant", "kinova/jaco_arm", "kinova/jaco_hand")),
    ),
    "gymnasium_robotics": tuple(
        f"envs/assets/{name}.xml" for name in ("adroit_hand/adroit_door", "fetch/reach", "hand/reach")
    ),
    "robosuite": (
        *(
            f"models/assets/robots/{name}/robot.xml"
            for name in (
                "baxter",
                "iiwa",
                "jaco",
                "kinova3",
                "panda",
                "sawyer",
                "spot",
                "tiago",
                "ur5e",
                "xarm7",
            )
        ),
        *(f"models/assets/grippers/{name}.xml" for name in ("inspire_left_hand", "robotiq_gripper_s")),
    ),
}


@pytest.mark.full
@pytest.mark.parametrize(
    ("package", "name"), [(package, name) for package, names in ROBOTS.items() for name in names]
)
def test_a_robot_of_others(package: str, name: str) -> None:
    found = importlib.util.find_spec(package)
    if found is None or found.origin is None:
        pytest.skip(f"{package} is not installed (its folder may stand in PYTHONPATH)")
    path = Path(found.origin).parent / name
    robot = load_mjcf(path)
    assert assert_as_mujoco(robot, path, seed=3) >= len(robot.urdf.links) / 4
    built = build_robot(path)
    assert not [f for f in built.findings if f.severity == "error"]
    assert not [v for v in built.document["visuals"] if "placeholder" in v]
    assert len(built.document["visuals"]) >= 3
