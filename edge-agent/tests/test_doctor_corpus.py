"""The doctor's list for the corpus: a file that holds the page's doctor to it.

`python edge-agent/tests/test_doctor_corpus.py` writes the file anew after a rule has changed.
"""

from __future__ import annotations

import io
import json
import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))  # when run by itself

from model_stage import joint, link, mesh, robot
from posecast_edge import model
from posecast_edge.model.doctor.meshes import MeshFacts
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import SEVERITIES
from posecast_edge.model.kinematics import quaternion_from_rpy
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree
from test_doctor import CORPUS, box

FILE = Path(__file__).parent / "doctor_corpus.json"

A, B = link("a"), link("b")
MORE = [
    robot(A, B, joint("ab", "a", "b")),  # nothing wrong
    robot(A, "<!-- <link name='c'/> -->", "<link name='b'\n/>", "", "<joint name='j'/>"),
    robot(link("몸통"), link("몸통"), link(" spaced "), link("x" * 201), link("é" * 90), link("é" * 90)),
    robot(A, B, joint("j", "a", "b", inside='<axis xyz="1e-3 0 -1.0005"/><origin rpy="0 0 6.4"/>')),
    robot(A, B, joint("j", "a", "b", limit='<limit lower="-1234567" upper="0.00001234"/>')),
    robot(A, B, joint("j", "a", "b", limit='<limit lower="x" upper="1 2"/>')),
    robot(link("a", mesh("a.stl", ' scale="2"') + mesh("b.stl", ' scale="-1 1e-7 1"'))),
    robot(link("a", box("1 1 1", '<material name="m"><color rgba="-1 0 2 300"/></material>'))),
    robot(A, '<sensor name="s" type="imu"><parent link="b"/></sensor>', "<sensor/>"),
    robot(A, B, joint("ab", "a", "b"), '<sensor name="s"><parent joint="ab"/></sensor>'),
    robot(A, B, joint("ab", "a", "b"), '<gazebo reference="ab"><sensor name="s"/></gazebo>'),
    robot(A, '<sensor name="s"><parent joint="gone"/></sensor>'),
    robot(A, B, joint("j", "a", "b", "fixed", '<mimic joint="k" multiplier="two"/>', "")),
    f"<robot>\n{A}\n</robot>\n",
    robot(link("a", '<inertial><origin xyz="0 0"/><mass value="nan"/></inertial>')),
    robot(link("a", '<inertial><origin xyz="0 inf 0"/><mass value="1"/><inertia ixx="a"/></inertial>')),
    robot('<link name="a"><collision><geometry><box size="1 1 1"/></geometry></collision></link>'),
]


def turned(attributes: str, version: str | None = "1.1") -> str:
    """A robot whose shapes, mass and joint have an origin with these attributes."""
    origin = f'<origin xyz="0.1 -0.2 0.3" {attributes}/>'
    text = robot(
        link("a"),
        link("b", f'<inertial>{origin}<mass value="1"/></inertial>{box("1 2 3", origin)}'),
        joint("ab", "a", "b", inside=origin + '<axis xyz="0 0 1"/>'),
    )
    return text if version is None else text.replace("<robot", f'<robot version="{version}"')


HALF = 0.7071067811865476
QUATERNIONS = [
    "0 0 0 1",
    f"0 0 {HALF} {HALF}",
    f"0 {HALF} 0 {HALF}",  # pitch of 90°, where roll and yaw turn about one axis
    f"0 -{HALF} 0 {HALF}",
    f"{HALF} 0 0 -{HALF}",
    "0.5 0.5 0.5 0.5",
    "0.5 -0.5 0.5 0.5",
    "0 1 0 0",
    "1 0 0 0",
    "-0.1 0.2 -0.3 0.4",
    "0 0 3 4",
    "0.2705980501 0.6532814824 0.2705980501 0.6532814824",
    "0 0 1e-9 1e-9",
]
# in one version or another, each with the rotation that urdfdom (Pinocchio 4.1) reads
VERSIONED = [
    *(turned(f'quat_xyzw="{quat}"') for quat in QUATERNIONS),
    *(
        turned('quat_xyzw="0 0 1 1"', version)
        for version in (None, "", "1.0", "1", " 1.1", "1.2", "1.3", "2.0", "x", "1.1.0", "-1", "1.12345")
    ),
    turned('quat_xyzw="0 0 1 1" rpy="1 0 0"'),
    turned('quat_xyzw="0 0 1 1" rpy="1 0 0"', None),
    turned('rpy="1 -0.5 2"'),
    *(
        turned(f'quat_xyzw="{quat}"')
        for quat in ("0 0 0 0", "0 0 1", "a 0 0 1", "0,0,1,1", "nan 0 0 1", "", "1e300 0 0 0")
    ),
    *(
        robot(A, B, joint("ab", "a", "b", inside=inside, limit=limit))
        for inside, limit in (
            ('<axis xyz="0 0 1" rpy="0 0 0"/>', "d"),
            ('<axis x="0" y="0" z="1"/>', "d"),
            ('<axis xyz="0 0 1"/><origin pos="1 0 0" drake:pos="1"/>', "d"),
            ('<axis xyz="0 0 1"/><origin xyz="1 0 0" RPY="1 0 0"/>', "d"),
            (
                '<axis xyz="0 0 1"/>',
                '<limit lower="-1" upper="1" velocity="1" effort="1" acceleration="1" jerk="2"/>',
            ),
            ('<axis xyz="0 0 1"/>', '<limit min="-1" max="1" lower="-1" upper="1" velocity="1" effort="1"/>'),
            ('<axis xyz="0 0 1"/><mimic joint="ab" ratio="2"/>', "d"),
        )
    ),
    robot(link("a", mesh("a.stl", ' scale="1 1 1" unit="mm" xmlns="x"'))),
    robot(link("a", mesh("a.stl", ' Scale="2 2 2"'))),
]


# what only the edge can say: it reads profiles and folders of packages, and looks into a mesh's corners
EDGE_ONLY = {
    "profile-foot",
    "profile-joint",
    "profile-sensor",
    "profile-sole",
    "texture-coordinates",
}

Notes = tuple[tuple[str, str], ...]
AXIS: Notes = (("collada-axis", "it says Y_UP; ignored, as RViz does"),)
UNIT: Notes = (("collada-unit", "its unit is 0.01 m; applied"),)
FAR = '<origin xyz="9 0 0" rpy="0.3 0 1.6"/><axis xyz="0 0 1"/>'
PICTURED = '<material name="m"><texture filename="t.png"/></material>'
LEVER = [joint(a + b, a, b, inside=FAR) for a, b in ("ab", "bc", "cd")]


def cube(
    uri: str, edge_m: float = 0.2, reason: str | None = None, notes: Notes = (), hint: str | None = None
) -> MeshFacts:
    """What a reader tells of a cube with a corner at 0."""
    return MeshFacts(uri, reason, hint, 684, 12, (0, 0, 0), (edge_m, edge_m, edge_m), notes, has_uv=True)


def heavy(uri: str, size: int) -> MeshFacts:
    """A mesh of that many bytes."""
    return MeshFacts(uri, None, None, size, size // 50, (0, 0, 0), (0.2, 0.2, 0.2), (), has_uv=True)


def scaled(uri: str, by: str) -> str:
    """A link with a mesh of another size."""
    return link("a", mesh(uri, f' scale="{by}"'))


def shape(geometry: str) -> str:
    """A robot of one shape."""
    return robot(link("a", f"<visual><geometry><{geometry}/></geometry></visual>"))


# robots of which the meshes were looked at as well
LOOKED_AT = [
    (robot(link("a", mesh("a.stl"))), [cube("a.stl")]),  # nothing wrong
    (robot(link("a", mesh("a.stl"))), [cube("a.stl", 300)]),
    (robot(link("a", mesh("b/a.stl"))), [cube("b/a.stl", hint="not where it says")]),
    (robot(scaled("a.stl", "0.001 0.001 -0.001")), [cube("a.stl", 300)]),
    (robot(scaled("a.stl", "0.001 0.001 0.001")), [cube("a.stl")]),
    (robot(scaled("a.stl", "1e-4 1e-4 1e-4"), link("b", box("25 1 1")), LEVER[0]), [cube("a.stl")]),
    (
        robot(link("a", mesh("a.stl")), B, link("c", mesh("a.stl")), link("d", box("9 2 3")), *LEVER),
        [cube("a.stl", 3)],
    ),
    (robot(A, B, link("c"), link("d"), *LEVER), []),
    *((robot(*case.parts), []) for case in CORPUS if case.code == "centre-outside"),
    (shape("sphere radius='0.02'"), []),
    (shape("cylinder radius='0.01' length='30'"), []),
    (shape("capsule radius='0.01' length='0.02'"), []),
    (
        robot(
            link("a", mesh("a.stl") + mesh("b.stl") + mesh("c.dae")),
            link("b", mesh("b.stl")),
            joint("ab", "a", "b"),
        ),
        [
            cube("a.stl", reason="no such file"),
            cube("b.stl", reason="no triangles"),
            cube("c.dae", notes=UNIT),
        ],
    ),
    (
        robot(link("a", mesh("a.dae") + mesh("b.dae"))),
        [cube("a.dae", notes=AXIS), cube("b.dae", notes=UNIT + AXIS)],
    ),
    (
        robot(link("a", mesh("a.stl") + mesh("b.stl"))),
        [heavy("a.stl", 17_654_321), heavy("b.stl", 9_000_000)],
    ),
    (robot(link("a", mesh("a.stl")), link("loose", box("30 1 1"))), [cube("a.stl")]),
    (
        robot(*(link(name, box("1 1 1", PICTURED)) for name in "ab"), joint("ab", "a", "b")),
        [cube("t.png", reason="no such file")],
    ),
]


def urdfs() -> list[str]:
    """Every robot of the corpus, and more that two readers may see differently."""
    return list(dict.fromkeys([*(robot(*case.parts) for case in CORPUS), *MORE, *VERSIONED]))


def expected(text: str, meshes: list[MeshFacts] | None = None) -> dict[str, Any]:
    """The robot with its list; None: no mesh was looked at."""
    urdf = read_urdf(io.BytesIO(text.encode()))
    facts = None if meshes is None else {fact.uri: fact for fact in meshes}
    findings = [[f.severity, f.code, f.text, f.line] for f in examine_model(urdf, build_tree(urdf), facts)]
    if meshes is None:
        poses = [*(j.pose for j in urdf.joints), *(s.pose for link in urdf.links for s in link.visuals)]
        poses += [link.inertial.pose for link in urdf.links if link.inertial is not None]
        placed = [[*pose.xyz, *quaternion_from_rpy(pose.rpy)] for pose in poses]
        return {"urdf": text, "findings": findings} | ({"poses": placed} if "quat_xyzw" in text else {})
    return {"urdf": text, "meshes": {fact.uri: told(fact) for fact in meshes}, "findings": findings}


def told(fact: MeshFacts) -> dict[str, Any]:
    """In the page's words."""
    same = {name: getattr(fact, name) for name in ("reason", "triangles", "low", "high", "notes")}
    return same | {"bytes": fact.size} | ({"hint": fact.hint} if fact.hint else {})


def corpus() -> str:
    """The file's text."""
    rows = [*(expected(text) for text in urdfs()), *(expected(text, meshes) for text, meshes in LOOKED_AT)]
    lines = [json.dumps(row, ensure_ascii=False) for row in rows]
    return "[\n" + ",\n".join(lines) + "\n]\n"


def test_the_page_is_held_to_what_the_doctor_says() -> None:
    assert FILE.read_text(encoding="utf-8") == corpus(), f"run python {Path(__file__).name}"


def test_every_rule_of_the_doctor_is_in_the_file_or_the_edge_s_alone() -> None:
    folder = Path(model.__file__).parent
    files = ("doctor/skeleton", "doctor/meshes", "urdf/reader", "urdf/tree", "urdf/xml_tree")
    rules = {
        code
        for name in files
        for code in re.findall(
            rf'"(?:{"|".join(SEVERITIES)})",\s*"([a-z-]+)"', (folder / f"{name}.py").read_text("utf-8")
        )
    }
    shown = {finding[1] for row in json.loads(corpus()) for finding in row["findings"]}
    assert len(rules) > 45
    assert rules - shown == EDGE_ONLY


if __name__ == "__main__":
    FILE.write_text(corpus(), encoding="utf-8")
