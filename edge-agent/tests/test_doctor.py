# ruff: noqa: E501 - the corpus is a table: one robot, one line
"""A corpus of broken robots: each must get its own diagnosis, with the line, and nothing healthy may get one."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from model_stage import (
    PICTURE,
    ROBOTS,
    cube_collada,
    cube_stl,
    joint,
    link,
    mesh,
    robot,
    shared_robot,
    written,
)
from posecast_edge.model.builder.model_files import collect_facts, read_visual_files
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import Finding, ModelRefused
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.tree import build_tree
from posecast_wire.schema import JointMap, SensorMount
from posecast_wire.schema import Mapping as Meaning

A, B, C = link("a"), link("b"), link("c")
AB = joint("ab", "a", "b")


@dataclass(frozen=True)
class Case:
    """A broken robot and its diagnosis: code, severity, line (None: any), and words that must stand in it."""

    code: str
    severity: str
    line: int | None
    words: str
    parts: tuple[str, ...]
    files: dict[str, bytes] = field(default_factory=dict)


def box(size: str, more: str = "") -> str:
    return f'<visual>{more}<geometry><box size="{size}"/></geometry></visual>'


def inertial(mass: float, moments: str, xyz: str = "0 0 0") -> str:
    ixx, iyy, izz = moments.split()
    inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>'
    return f'<inertial><origin xyz="{xyz}"/><mass value="{mass:g}"/>{inertia}</inertial>'


CORPUS = [
    Case("attribute-unknown", "warning", 4, "<origin> has no attribute 'xzy'", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin xzy="1 0 0"/>'))),
    Case("quaternion", "warning", 4, 'only with <robot version="1.1">', (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin quat_xyzw="0 0 0 1"/>'))),
    Case("no-links", "error", None, "no link", ()),
    Case("joint-child", "error", 3, "its child link 'gone'", (A, joint("j", "a", "gone"))),
    Case("joint-parent", "error", 3, "its parent link 'gone'", (A, joint("j", "gone", "a"))),
    Case("joint-ends", "error", 3, "no child link", (A, '<joint name="j" type="fixed"><parent link="a"/></joint>')),
    Case("link-doubled", "error", 3, "first in line 2", (A, A)),
    Case("joint-doubled", "error", 6, "'ab' is defined twice", (A, B, C, AB, joint("ab", "b", "c"))),
    Case("two-parents", "error", 6, "has two parent joints", (A, B, C, joint("j", "a", "c"), joint("k", "b", "c"))),
    Case("no-root", "error", 2, "form a loop", (A, B, AB, joint("ba", "b", "a"))),
    Case("loop", "error", 3, "'b', 'c'", (A, B, C, joint("j", "b", "c"), joint("k", "c", "b"))),
    Case("loop", "error", 3, "to itself", (A, joint("j", "a", "a"))),
    Case("several-roots", "error", 4, "is not connected to the root", (A, B, C, AB)),
    Case("joint-type", "error", 4, "'hinge'", (A, B, joint("j", "a", "b", "hinge"))),
    Case("name-missing", "error", 3, "without a name", (A, "<link/>")),
    Case("name-unusable", "error", 2, "control characters", (link("a&#10;b"), A)),
    Case("name-odd", "warning", 2, "'__proto__'", (link("__proto__"),)),
    Case("name-odd", "warning", 2, "<img", (link("&lt;img src=x&gt;"),)),
    Case("number", "error", 4, "'1,5 0 0'", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin xyz="1,5 0 0"/>'))),
    Case("number", "error", 4, "by xacro", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin rpy="$(optenv RPY 0 0 0)"/>'))),
    Case("number-commas", "warning", 4, "'0.1, 0, -2'", (A, B, joint("j", "a", "b", inside='<axis xyz="0,0,1"/><origin xyz="0.1, 0, -2"/>'))),
    Case("number", "error", 4, "not finite", (A, B, joint("j", "a", "b", inside='<axis xyz="nan 0 1"/>'))),
    Case("number", "error", 4, "three numbers", (A, B, joint("j", "a", "b", inside='<axis xyz="1 0"/>'))),
    Case("axis-zero", "error", 4, "0 0 0", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 0"/>'))),
    Case("axis-length", "warning", 4, "length 2", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 2"/>'))),
    Case("axis-missing", "hint", 4, "x (1 0 0)", (A, B, joint("j", "a", "b", inside=""))),
    Case("limit-missing", "warning", 4, "no <limit>", (A, B, joint("j", "a", "b", limit=""))),
    Case("limit-empty", "warning", 4, "it can't move", (A, B, joint("j", "a", "b", limit='<limit effort="1"/>'))),
    Case("limit-reversed", "error", 4, "1 to -1", (A, B, joint("j", "a", "b", limit='<limit lower="1" upper="-1"/>'))),
    Case("limit-zero", "warning", 4, "the same", (A, B, joint("j", "a", "b", limit='<limit lower="1" upper="1"/>'))),
    Case("limit-without-zero", "hint", 4, "0.5 to 1", (A, B, joint("j", "a", "b", limit='<limit lower="0.5" upper="1"/>'))),
    Case("limit-degrees", "warning", 4, "degrees", (A, B, joint("j", "a", "b", limit='<limit lower="-90" upper="90"/>'))),
    Case("limit-millimetres", "warning", 4, "millimetres", (A, B, joint("j", "a", "b", "prismatic", limit='<limit upper="300"/>'))),
    Case("limit-negative", "warning", 4, "below 0", (A, B, joint("j", "a", "b", limit='<limit lower="-1" upper="1" velocity="-1"/>'))),
    Case("joint-free", "hint", 4, "'j/trans_x'", (A, B, joint("j", "a", "b", "floating", "", ""))),
    Case("joint-free", "hint", 4, "'j/x', 'j/y', 'j/theta'", (A, B, joint("j", "a", "b", "planar", '<axis xyz="0 0 1"/>', ""))),
    Case("axis-missing", "warning", 4, "for a floor, use 0 0 1", (A, B, joint("j", "a", "b", "planar", "", ""))),
    Case(
        "mimic-fixed", "error", 5, "more than one value",
        (A, B, C, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><mimic joint="k"/>'), joint("k", "b", "c", "floating", "", "")),
    ),
    Case("mimic-unknown", "error", 4, "'gone'", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><mimic joint="gone"/>'))),
    Case("mimic-loop", "error", 4, "in a loop", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><mimic joint="j"/>'))),
    Case(
        "mimic-loop", "error", 5, "in a loop",
        (A, B, C, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><mimic joint="k"/>'),
         joint("k", "b", "c", inside='<axis xyz="0 0 1"/><mimic joint="j"/>')),
    ),
    Case(
        "mimic-fixed", "error", 5, "fixed joint 'k'",
        (A, B, C, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><mimic joint="k"/>'), joint("k", "b", "c", "fixed", "", "")),
    ),
    Case("origin-degrees", "warning", 4, "degrees", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin rpy="0 0 90"/>'))),
    Case("origin-far", "warning", 4, "millimetres", (A, B, joint("j", "a", "b", inside='<axis xyz="0 0 1"/><origin xyz="0 0 250"/>'))),
    Case("mesh-missing", "error", 2, "no such file", (link("a", mesh("meshes/gone.stl")),)),
    Case("mesh-missing", "error", 2, "no package 'nowhere'", (link("a", mesh("package://nowhere/x.stl")),)),
    Case("mesh-outside", "error", 2, "outside", (link("a", mesh("../../../../etc/passwd.stl")),)),
    Case("mesh-unnamed", "error", 2, "without a filename", (link("a", mesh("")),)),
    Case("mesh-broken", "error", 2, "not a supported mesh", (link("a", mesh("meshes/a.step")),), {"a_step": b"x"}),
    Case("mesh-broken", "error", 2, "HTML", (link("a", mesh("meshes/a.stl")),), {"a_stl": b"<!DOCTYPE html><html></html>"}),
    Case("mesh-broken", "error", 2, "git lfs pull", (link("a", mesh("meshes/a.stl")),), {"a_stl": b"version https://git-lfs.github.com/spec/v1\n"}),
    Case("mesh-found", "hint", 2, "upper and lower case", (link("a", mesh("meshes/ARM.stl")),), {"arm_stl": cube_stl()}),
    Case("mesh-large", "warning", 2, "millimetres", (link("a", mesh("meshes/a.stl")),), {"a_stl": cube_stl(300)}),
    Case("robot-large", "warning", None, "300 m", (link("a", mesh("meshes/a.stl")),), {"a_stl": cube_stl(300)}),
    Case("robot-small", "warning", None, "scaled twice", (link("a", mesh("meshes/a.stl", ' scale="0.001 0.001 0.001"')),), {"a_stl": cube_stl()}),
    Case("mesh-small", "warning", 2, "only", (link("a", mesh("meshes/a.stl", ' scale="1e-4 1e-4 1e-4"')),), {"a_stl": cube_stl()}),
    Case("scale-mirrored", "hint", 2, "mirrored", (link("a", mesh("meshes/a.stl", ' scale="1 -1 1"')),), {"a_stl": cube_stl()}),
    Case("scale-uneven", "hint", 2, "stretched", (link("a", mesh("meshes/a.stl", ' scale="1 2 1"')),), {"a_stl": cube_stl()}),
    Case("scale-zero", "error", 2, "scaled by 0", (link("a", mesh("meshes/a.stl", ' scale="1 0 1"')),), {"a_stl": cube_stl()}),
    Case("collada-axis", "hint", 2, "Y_UP", (link("a", mesh("meshes/a.dae")),), {"a_dae": cube_collada(up="Y_UP")}),
    Case("collada-unit", "hint", 2, "0.5 m", (link("a", mesh("meshes/a.dae")),), {"a_dae": cube_collada(unit="0.5")}),
    Case(
        "collada-opacity", "hint", 2, "opaque", (link("a", mesh("meshes/a.dae")),),
        {"a_dae": cube_collada(effect="<transparency><float>0</float></transparency>"
                               "<diffuse><color>1 0 0 1</color></diffuse>")},
    ),
    Case("visual-empty", "warning", 2, "without a geometry", (link("a", "<visual/>"),)),
    Case("nothing-drawn", "warning", None, "only the skeleton", (link("a", ""),)),
    Case("shape-unknown", "warning", 2, "'cone'", (link("a", "<visual><geometry><cone/></geometry></visual>"),)),
    Case("shape-several", "warning", 2, "the first is used", (link("a", '<visual><geometry><sphere radius="1"/><sphere radius="2"/></geometry></visual>'),)),
    Case("shape-size", "error", 2, "above 0", (link("a", box("0 1 1")),)),
    Case("color", "warning", 2, "0 … 255", (link("a", box("1 1 1", '<material name="m"><color rgba="255 0 0 1"/></material>')),)),
    Case("color", "warning", 2, "four numbers", (link("a", box("1 1 1", '<material name="m"><color rgba="red"/></material>')),)),
    Case("material-colour", "hint", 2, "'steel'", (link("a", box("1 1 1", '<material name="steel"/>')),)),
    Case("texture-missing", "error", 2, "'t.png'", (link("a", box("1 1 1", '<material name="m"><texture filename="t.png"/></material>')),)),
    Case(
        "texture-coordinates", "hint", 2, "mean colour",
        (link("a", '<visual><geometry><mesh filename="meshes/a.stl"/></geometry><material name="m"><texture filename="meshes/t.png"/></material></visual>'),),
        {"a_stl": cube_stl(), "t_png": PICTURE},
    ),
    Case(
        "material-doubled", "hint", 3, "(line 2)",
        ('<material name="m"><color rgba="1 0 0 1"/></material>', link("a", box("1 1 1", '<material name="m"><color rgba="0 1 0 1"/></material>'))),
    ),
    Case("sensor-link", "warning", 3, "'gone'", (A, '<gazebo reference="gone"><sensor name="imu" type="imu"/></gazebo>')),
    Case("reference", "warning", 3, "<transmission>", (A, '<transmission name="t"><joint name="gone"/></transmission>')),
    Case("mass-negative", "warning", 2, "-1 kg", (link("a", box("1 1 1") + '<inertial><mass value="-1"/></inertial>'),)),
    Case("mass-moments", "warning", 2, "0, 0 and -1 kg·m²; no balance", (link("a", box("1 1 1") + inertial(1, "-1 0 0")),)),
    Case("inertia", "hint", 2, "simulators", (link("a", box("1 1 1") + inertial(1, "1 1 2.1")),)),
    Case("inertia", "hint", 2, "1, 0 and 0", (link("a", inertial(1, "1 0 0")), link("b", inertial(20, "1 1 1")), joint("ab", "a", "b"))),
    Case("mass-zero", "warning", 2, "0 kg; no balance", (link("a", box("1 1 1") + inertial(0, "0 0 0")),)),
    Case("massless", "hint", 2, "a mass of 0 kg", (link("a", box("0.2 0.2 0.2") + inertial(0, "0 0 0")), link("b", box("1 1 1") + inertial(1, "1 1 1")), joint("ab", "a", "b"))),
    Case("mass-heavy", "warning", 2, "400 kg in a box of 8 litres", (link("head", box("0.2 0.2 0.2") + inertial(400, "1 1 1")),)),
    Case("mass-heavy", "warning", 2, "1e+07 kg", (link("a", inertial(10000000, "1 1 1")),)),
    Case("dense", "hint", 2, "in a box of 8 litres", (link("a", box("0.2 0.2 0.2") + inertial(400, "1 1 1")), link("b", box("1 1 1") + inertial(2000, "99 99 99")), joint("ab", "a", "b"))),
    Case("mass-far", "warning", 2, "'a': a centre of mass 200 m away (millimetres?); no balance", (link("a", inertial(1, "1 1 1", "0 0 -200")),)),
    Case("mass-far", "warning", 2, "2e+07 m away", (link("a", inertial(1, "1 1 1", "2e7 0 0")),)),
    Case("mass-light", "warning", 2, "the total mass is 2e-300 kg; no balance", (link("a", inertial(1e-300, "0 0 0")), link("b", inertial(1e-300, "0 0 0")), AB)),
    Case("unweighed", "hint", 3, "2 links with shells have no mass: 'b', 'c'", (link("a", inertial(1, "1 1 1")), link("b", box("1 1 1")), link("c", box("1 1 1")), AB, joint("bc", "b", "c"))),
    Case("unweighed", "hint", 3, "8 links with shells have no mass: 'b0', 'b1', 'b2', 'b3', 'b4', 'b5' and 2 more", (link("a", inertial(1, "1 1 1")), *(link(f"b{i}", box("1 1 1")) for i in range(8)), *(joint(f"j{i}", "a", f"b{i}") for i in range(8)))),
    Case("inertial-empty", "warning", 2, "'a': an <inertial> without a <mass>", (link("a", box("1 1 1") + '<inertial><inertia ixx="1"/></inertial>'),)),
    Case("inertial-empty", "warning", 2, "without a <mass>", (link("a", box("1 1 1") + "<inertial><mass/></inertial>"),)),
    Case(
        "centre-outside", "warning", 3, "'b': its centre of mass is 4.25 m outside the robot, which measures 1.5 m",
        (link("a", box("0.5 0.5 1") + inertial(9, "1 1 1")), link("b", box("0.5 0.5 0.5") + inertial(9, "1 1 1", "0 4.5 0")), joint("ab", "a", "b", inside='<origin xyz="0 0 .75"/><axis xyz="0 1 0"/>')),
    ),
    Case("xacro", "error", 2, "xacro robot.xacro", ("<xacro:include/>", A)),
]  # fmt: skip


def diagnose(path: Path) -> list[Finding]:
    with path.open("rb") as source:
        urdf = read_urdf(source)
    files = read_visual_files(RobotFile(urdf), Resolver(path), lambda *_: None)
    return examine_model(urdf, build_tree(urdf), collect_facts(files))


@pytest.mark.parametrize("case", CORPUS, ids=[f"{i}-{c.code}" for i, c in enumerate(CORPUS)])
def test_each_gets_its_diagnosis(case: Case, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "down" / "model"
    findings = diagnose(written(folder, robot(*case.parts), **case.files))
    matching = [f for f in findings if f.code == case.code and case.words in f.text]
    assert matching, findings
    assert {f.severity for f in matching} == {case.severity}
    assert case.line is None or case.line in {f.line for f in matching}
    assert all(f.format_line("robot.urdf").isprintable() for f in findings)
    # nothing worse than the thing itself, and what follows from it
    worse = [f for f in findings if f.severity == "error" and f.code != case.code]
    follows = {"several-roots", "joint-ends", "loop"}
    assert {f.code for f in worse} <= follows, worse


def test_corpus_is_large() -> None:
    assert len(CORPUS) >= 30
    assert len({c.code for c in CORPUS}) >= 30


def test_the_healthy_are_healthy(tmp_path: Path) -> None:
    parts = (A, link("b", mesh("meshes/b.stl")), AB)
    assert diagnose(written(tmp_path, robot(*parts), b_stl=cube_stl())) == []


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"<sdf/>", "SDF"),
        (b"<mujoco/>", "MuJoCo"),
        (b"<html><body/></html>", "HTML"),
        (b"<robot><link</robot>", "not XML"),
        (b"", "the file is empty"),
        (b"PK\x03\x04", "a zip archive, not a robot description: unpack it"),
        (b"<other/>", "<other>"),
    ],
)
def test_what_is_no_urdf(text: bytes, reason: str) -> None:
    with pytest.raises(ModelRefused, match=reason):
        read_urdf(io.BytesIO(text))


def test_a_link_without_a_mass_that_is_fixed_to_one_with_a_mass_is_weighed_there(tmp_path: Path) -> None:
    weighed = link("a", box("0.2 0.2 0.2") + inertial(1, "1 1 1"))
    bare = link("b", box("0.2 0.2 0.2"))
    assert diagnose(written(tmp_path, robot(weighed, bare, joint("ab", "a", "b", "fixed", "", "")))) == []


def test_a_centre_less_outside_than_the_robot_is_large_is_no_finding(tmp_path: Path) -> None:
    """A shell may be drawn far from its link's origin, and its centre with it."""
    away = link("a", box("1 1 1", '<origin xyz="7 0 0"/>') + inertial(1, "1 1 1", "7 0 0"))
    assert diagnose(written(tmp_path, robot(away))) == []
    lost = link("a", mesh("meshes/a.stl") + inertial(1, "1 1 1", "7 0 0"))
    found = diagnose(written(tmp_path / "lost", robot(lost)))
    assert [f.code for f in found] == ["mesh-missing"], "nobody knows how large it is"


def test_a_profile_that_does_not_fit() -> None:
    free = joint("cd", "c", "d", "floating", "", "")
    parts = (A, B, C, link("d"), AB, joint("bc", "b", "c", "fixed", "", ""), free)
    urdf = read_urdf(io.BytesIO(robot(*parts).encode()))
    meaning = Meaning(
        joints={name: JointMap(()) for name in ("gone", "bc", "ab", "cd", "cd/rot_w")},
        sensors={
            "RF": SensorMount("wrench", "right foot", "nowhere"),
            "torso": SensorMount("imu", "torso", "a"),
            "battery": SensorMount("power", "battery", None),
        },
    )
    findings = [
        f for f in examine_model(urdf, build_tree(urdf), None, meaning) if f.code.startswith("profile-")
    ]
    assert {f.severity for f in findings} == {"warning"}
    assert sorted(f.text for f in findings) == [
        "the profile maps joint 'bc', which is fixed",
        "the profile maps joint 'cd', which is floating: map "
        + ", ".join(
            f"'cd/{v}'" for v in ("trans_x", "trans_y", "trans_z", "rot_x", "rot_y", "rot_z", "rot_w")
        ),
        "the profile maps joint 'gone', which does not exist",
        "the profile mounts sensor 'RF' on link 'nowhere', which does not exist",
    ]


def test_heavy_meshes_are_named(tmp_path: Path) -> None:
    body = cube_stl()[84:]
    many = 34_000
    stl = bytes(80) + (12 * many).to_bytes(4, "little") + body * many
    findings = diagnose(written(tmp_path, robot(link("a", mesh("meshes/a.stl"))), a_stl=stl))
    assert [f.code for f in findings] == ["bundle-size"]


@pytest.mark.parametrize("name", ROBOTS)
def test_shared_robots(name: str) -> None:
    findings = diagnose(shared_robot(name))
    wanted = {
        "hubo2plus-stl": {"mesh-missing", "visual-empty"},
        "hubo2plus-collision": {"unweighed"},
        "hubo2plus-collada": {"visual-empty", "collada-axis", "bundle-size"},
        "g1-hands": {"bundle-size"},
    }
    assert {f.code for f in findings} == wanted.get(name, set())
