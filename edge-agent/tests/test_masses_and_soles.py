"""What a manifest tells of masses and soles: read alike from each format, and nothing of what can't be."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_stage import build_robot, joint, link, mesh, robot, written
from numpy.typing import NDArray
from posecast_edge.model.builder.build import make_inertials
from posecast_edge.model.builder.soles import CORNERS_MAX, compute_area, find_corners
from posecast_edge.model.doctor.masses import compute_principal_moments
from posecast_edge.model.kinematics import compute_link_poses
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.urdf.tree import build_tree

WEIGHT = """<inertial><origin xyz="0.1 0.2 0.3" rpy="0 0 1.5707963267948966"/><mass value="2"/>
<inertia ixx="1" ixy="0.1" ixz="0" iyy="2" iyz="0" izz="2.5"/></inertial>"""
SDF = """<sdf version="1.9"><model name="r"><link name="a"><pose>5 6 7 0 0 1</pose>
<inertial><pose>0.1 0.2 0.3 0 0 1.5707963267948966</pose><mass>2</mass>
<inertia><ixx>1</ixx><ixy>0.1</ixy><iyy>2</iyy><izz>2.5</izz></inertia></inertial></link></model></sdf>"""
MJCF = """<mujoco><worldbody><body name="a"><freejoint/><geom size=".1"/>
<inertial pos="0.1 0.2 0.3" mass="2" fullinertia="2 1 2.5 -0.1 0 0"/></body></worldbody></mujoco>"""
TURNED = [2, -0.1, 0, 1, 0, 2.5]  # by a quarter about z: x becomes y, y becomes −x


def masses_of(path: Path) -> list[dict[str, Any]]:
    urdf = load_robot_file(path).urdf
    return make_inertials(build_tree(urdf), urdf.findings)


@pytest.mark.parametrize(
    ("name", "text"), [("r.urdf", robot(link("a", WEIGHT))), ("r.sdf", SDF), ("r.xml", MJCF)]
)
def test_each_format_says_it_in_the_links_own_axes(name: str, text: str, tmp_path: Path) -> None:
    if name.endswith("xml"):
        pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    (tmp_path / name).write_text(text)
    (entry,) = masses_of(tmp_path / name)
    assert entry["link"] == 0
    assert entry["mass_kg"] == 2
    assert entry["xyz"] == pytest.approx([0.1, 0.2, 0.3])
    assert entry["inertia"] == pytest.approx(TURNED, abs=1e-6)


def test_a_urdf_that_an_sdf_includes_keeps_its_masses(tmp_path: Path) -> None:
    (tmp_path / "robot.urdf").write_text(robot(link("a", WEIGHT)))
    (tmp_path / "r.sdf").write_text(
        '<sdf version="1.9"><model name="m"><include><uri>robot.urdf</uri><name>n</name></include>'
        "</model></sdf>"
    )
    entry = masses_of(tmp_path / "r.sdf")[-1]
    assert entry["xyz"] == pytest.approx([0.1, 0.2, 0.3])
    assert entry["inertia"] == pytest.approx(TURNED, abs=1e-6)


def test_the_centre_of_mass_is_mujocos(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    path = tmp_path / "r.xml"
    path.write_text(
        """<mujoco><worldbody><body name="a"><freejoint/><geom type="box" size=".1 .2 .3" pos=".1 0 0"/>
        <body name="b" pos="0 0 .5"><joint name="j" axis="0 1 0"/><geom size=".1" pos="0 .3 0"/>
        <geom type="capsule" size=".1 .2" pos=".2 0 0" euler="30 40 50"/></body></body>
        </worldbody></mujoco>"""
    )
    built = build_robot(path)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[7] = 0.7
    mujoco.mj_forward(model, data)
    poses = [np.array(p) for p in compute_link_poses(built.document, {"j": 0.7}).values()]
    entries = built.document["inertials"]
    assert [e["mass_kg"] for e in entries] == pytest.approx(model.body_mass[1:], rel=1e-6)
    weighed = sum(e["mass_kg"] * (poses[e["link"]] @ [*e["xyz"], 1])[:3] for e in entries)
    assert weighed / sum(e["mass_kg"] for e in entries) == pytest.approx(data.subtree_com[1], abs=1e-6)


def test_a_mass_that_follows_from_a_mesh_is_said_not_to_be_known(tmp_path: Path) -> None:
    """Its mesh is read apart from the model, in which a box of another size stands in for it."""
    pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    corners = "0 0 0 1 0 0 0 1 0 0 0 1"
    (tmp_path / "a.obj").write_text(
        "\n".join(f"v {' '.join(corners.split()[i : i + 3])}" for i in (0, 3, 6, 9))
        + "\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    path = tmp_path / "r.xml"

    def write(geom: str, body: str = "", compiler: str = "") -> list[dict[str, Any]]:
        path.write_text(
            f'<mujoco><compiler {compiler}/><asset><mesh name="m" file="a.obj"/></asset><worldbody>'
            f'<body name="a"><freejoint/>{body}<geom type="mesh" mesh="m" {geom}/></body>'
            '<body name="b"><geom size=".1"/></body></worldbody></mujoco>'
        )
        return masses_of(path)

    assert write("") == []
    found = [f for f in load_robot_file(path).urdf.findings if f.code == "mass-of-mesh"]
    assert len(found) == 1
    assert "the mass of body 'a' is derived from a mesh; no balance is shown" in found[0].text
    own = '<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/>'
    assert [e["mass_kg"] for e in write("", own)] == [3]
    assert write("", own, 'inertiafromgeom="true"') == [], "it is made of the geoms all the same"
    assert [e["mass_kg"] for e in write('density="0"', '<geom size=".1" mass="5"/>')] == [5]
    assert write("", "", 'settotalmass="9"') == []


@pytest.mark.parametrize(
    ("inertial", "code"),
    [
        ('<inertial><mass value="-1"/></inertial>', "mass-negative"),
        ('<inertial><mass value="0"/></inertial>', "mass-zero"),
        ('<inertial><mass value="400"/></inertial>', "mass-heavy"),
        ('<inertial><mass value="2"/><inertia ixx="1" iyy="0.2" izz="0.2"/></inertial>', "mass-moments"),
    ],
)
def test_one_mass_that_cant_be_and_none_is_told(inertial: str, code: str, tmp_path: Path) -> None:
    box = '<visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual>'
    path = written(
        tmp_path, robot(link("body", box + WEIGHT), link("head", box + inertial), joint("j", "body", "head"))
    )
    built = build_robot(path)
    assert built.document["inertials"] == []
    (said,) = [f for f in built.findings if f.code.startswith("mass-")]
    assert said.code == code
    assert "link 'head'" in said.text
    assert said.text in [f["text"] for f in built.document["findings"]]


WRONG = [
    ("mass", "2", "nan"),
    ("centre", "0.2", "inf"),
    ("inertia", "0.1", "a"),
    ("axes", "0 0 1.57", "0 nan 1.57"),
]


@pytest.mark.parametrize(
    ("name", "text"),
    [("r.urdf", robot(link("a", WEIGHT), link("b", WEIGHT), joint("j", "a", "b"))), ("r.sdf", SDF)],
)
@pytest.mark.parametrize(("what", "good", "bad"), WRONG)
def test_a_mass_that_is_no_number_is_one_that_cant_be(
    what: str, good: str, bad: str, name: str, text: str, tmp_path: Path
) -> None:
    """Without it the others would have a centre of mass that is false."""
    if what == "mass":
        good, bad = ('value="2"', 'value="nan"') if name == "r.urdf" else ("<mass>2<", "<mass>nan<")
    elif what == "inertia":
        good, bad = ('ixy="0.1"', 'ixy="a"') if name == "r.urdf" else ("<ixy>0.1<", "<ixy>a<")
    assert good in text
    path = tmp_path / name
    path.write_text(text[::-1].replace(good[::-1], bad[::-1], 1)[::-1])  # of the last link
    assert masses_of(path) == []
    (found,) = load_robot_file(path).urdf.findings
    assert (found.severity, found.code) == ("error", "mass-number")
    assert found.text.endswith("; no balance is shown")


def test_none_is_a_value(tmp_path: Path) -> None:
    document = build_robot(written(tmp_path, robot(link("a")))).document
    assert document["inertials"] == []
    assert document["soles"] == []
    assert "findings" not in document


ANKLE = '<origin xyz="0 0 -.8" rpy="0 0 .5"/><axis xyz="0 1 0"/>'


def leg(side: str, y: float, foot: str, kind: str = "revolute") -> list[str]:
    thigh = '<visual><origin xyz="0 0 -.4"/><geometry><box size=".1 .1 .8"/></geometry></visual>'
    return [
        link(f"{side}_leg", thigh),
        link(f"{side}_foot", foot),
        joint(f"{side}_hip", "hip", f"{side}_leg", inside=f'<origin xyz="0 {y} 0"/><axis xyz="0 1 0"/>'),
        joint(f"{side}_ankle", f"{side}_leg", f"{side}_foot", kind, ANKLE),
    ]


FOOT = '<visual><origin xyz=".05 0 -.05"/><geometry><box size=".2 .1 .04"/></geometry></visual>'
WHEEL = '<visual><origin rpy="1.57 0 0"/><geometry><cylinder radius=".1" length=".05"/></geometry></visual>'


def soles_of(folder: Path, *parts: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = build_robot(written(folder, robot(link("hip"), *parts))).document["soles"]
    return found


def test_two_feet_have_two_soles(tmp_path: Path) -> None:
    parts = [*leg("left", 0.1, FOOT), *leg("right", -0.1, FOOT)]
    soles = soles_of(tmp_path, *parts)
    assert [s["link"] for s in soles] == [2, 4]
    for sole in soles:
        corners = np.array(sole["points"])
        assert sorted(corners.tolist()) == [[x, y, -0.07] for x in (-0.05, 0.15) for y in (-0.05, 0.05)]
        assert compute_area([(x, y) for x, y, _ in corners]) == pytest.approx(0.02), "counter-clockwise"
    assert soles == soles_of(tmp_path, *parts), "the same bytes each time"


def test_a_foot_that_is_fixed_to_the_leg_is_the_legs(tmp_path: Path) -> None:
    soles = soles_of(tmp_path, *leg("left", 0.1, FOOT, "fixed"), *leg("right", -0.1, FOOT, "fixed"))
    assert [s["link"] for s in soles] == [2, 4], "in the frame of the link that has the shell"


def test_toes_have_a_sole_of_their_own_and_ankles_none(tmp_path: Path) -> None:
    toes = [
        part
        for side in ("left", "right")
        for part in (
            link(f"{side}_toe", FOOT),
            joint(f"{side}_ball", f"{side}_foot", f"{side}_toe", inside='<origin xyz=".2 0 0"/>'),
        )
    ]
    ankle = '<visual><origin xyz="0 0 -.05"/><geometry><box size=".05 .05 .028"/></geometry></visual>'
    assert len(soles_of(tmp_path, *leg("left", 0.1, FOOT), *leg("right", -0.1, FOOT), *toes)) == 4
    assert len(soles_of(tmp_path, *leg("left", 0.1, ankle), *leg("right", -0.1, ankle), *toes)) == 2


def both(foot: str, kind: str = "revolute") -> list[str]:
    return [*leg("left", 0.1, foot, kind), *leg("right", -0.1, foot, kind)]


TIP = FOOT.replace(".2 .1 .04", ".005 .005 .04")
STAND = [link("stand", FOOT.replace(".05 0 -.05", "0 0 -1")), joint("post", "hip", "stand", "fixed")]
NO_FEET = {
    "nothing": [],
    "an arm that hangs down": leg("left", 0, FOOT),
    "wheels": both(WHEEL, "continuous"),
    "tips": both(TIP),
    "a robot on a stand": [*both(FOOT), *STAND],
}


@pytest.mark.parametrize("parts", NO_FEET.values(), ids=NO_FEET)
def test_others_have_none(parts: list[str], tmp_path: Path) -> None:
    assert soles_of(tmp_path, *parts) == []


@pytest.mark.parametrize("foot", ["", mesh("gone.stl")])
def test_without_shells_on_its_feet_a_robot_stands_on_its_shins(foot: str, tmp_path: Path) -> None:
    assert [s["link"] for s in soles_of(tmp_path, *both(foot))] == [1, 3]


def test_a_round_sole_has_sixteen_corners_inside_it() -> None:
    angles = np.linspace(0, 2 * math.pi, 5000, endpoint=False)
    points: NDArray[np.float64] = np.stack([np.cos(angles), np.sin(angles)], 1) * 0.1
    corners = find_corners(np.concatenate([points, points * 0.5]))
    assert len(corners) == CORNERS_MAX
    assert 0.96 * math.pi * 0.01 < compute_area(corners) < math.pi * 0.01
    line = find_corners(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]))
    assert sorted(line) == [(0, 0), (2, 0)]
    assert compute_area(find_corners(np.array([[1.0, 1.0]]))) == 0


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e200])
def test_principal_moments_are_eigenvalues(scale: float) -> None:
    random = np.random.default_rng(7)
    for _ in range(200):
        m = random.normal(size=(3, 3))
        m = (m + m.T) * scale
        ours = compute_principal_moments((m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]))
        assert ours == pytest.approx(np.linalg.eigvalsh(m), rel=1e-4, abs=1e-5 * scale)
    assert compute_principal_moments((0, 0, 0, 0, 0, 0)) == (0, 0, 0)
    assert compute_principal_moments((1, 1, 1, 1, 1, 1)) == pytest.approx((0, 0, 3))
