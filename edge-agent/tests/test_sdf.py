"""SDF: what Gazebo places in frames stands and moves the same as a body of ours."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from model_stage import cube_stl, resolver_at
from posecast_edge.cli.model_command import CLEAN, PROBLEMS, UNUSABLE, run_command
from posecast_edge.model.builder.manifest import make_skeleton
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.kinematics import Matrix, compute_link_poses
from posecast_edge.model.robot_file import find_format, load_robot_file
from posecast_edge.model.sdf.reader import load_sdf, read_sdf
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import Geometry, Urdf

BOX = "<visual name='v'><geometry><box><size>0.2 0.2 0.2</size></box></geometry></visual>"


def sdf(*parts: str, version: str = "1.9") -> str:
    return f"<sdf version='{version}'>\n" + "\n".join(parts) + "\n</sdf>\n"


def model(*parts: str, name: str = "m", more: str = "") -> str:
    return f"<model name='{name}'{more}>\n" + "\n".join(parts) + "\n</model>"


def link(name: str, pose: str = "0 0 0 0 0 0", inside: str = BOX, relative: str = "") -> str:
    return f"<link name='{name}'><pose{relative}>{pose}</pose>{inside}</link>"


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", xyz: str = "<xyz>0 0 1</xyz>", more: str = ""
) -> str:
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f"<joint name='{name}' type='{kind}'>{ends}<axis>{xyz}</axis>{more}</joint>"


def read(*parts: str, version: str = "1.9") -> Urdf:
    return read_sdf(sdf(*parts, version=version).encode())


def poses(urdf: Urdf, **readings: float) -> dict[str, Matrix]:
    return compute_link_poses(make_skeleton(urdf, build_tree(urdf)), readings)


def place(pose: Matrix) -> tuple[float, ...]:
    return tuple(round(pose[i][3], 7) + 0.0 for i in range(3))


def codes(urdf: Urdf) -> list[str]:
    return [f.code for f in (*urdf.findings, *build_tree(urdf).findings)]


def geometry(urdf: Urdf, of: int = 0) -> Geometry:
    found = urdf.links[of].visuals[0].geometry
    assert found is not None
    return found


# ---- frames and joints


def test_links_stand_where_their_model_has_them() -> None:
    found = read(
        model(
            link("base", "5 0 1 0 0 0"),
            link("arm", "5 0 2 0 0 1.5707963267948966"),
            link("hand", "5 1 2 0 0 0"),
            joint("shoulder", "base", "arm"),
            joint("wrist", "arm", "hand", "prismatic", "<xyz>1 0 0</xyz>"),
        )
    )
    at = poses(found)
    assert {name: place(pose) for name, pose in at.items()} == {
        "base": (0.0, 0.0, 0.0),
        "arm": (0.0, 0.0, 1.0),
        "hand": (0.0, 1.0, 1.0),
    }
    at = poses(found, shoulder=math.pi / 2, wrist=0.5)
    assert place(at["hand"]) == (-1.0, 0.5, 1.0)
    assert [(j.name, j.type) for j in found.joints] == [("shoulder", "continuous"), ("wrist", "prismatic")]


def test_a_joint_that_is_not_at_its_link() -> None:
    found = read(
        model(link("a"), link("b", "2 0 0 0 0 0"), joint("j", "a", "b", more="<pose>-1 0 0 0 0 0</pose>"))
    )
    assert [x.name for x in found.links] == ["a", "j::joint", "b"]
    assert place(poses(found)["b"]) == (2.0, 0.0, 0.0)
    assert place(poses(found, j=math.pi / 2)["b"]) == (1.0, 1.0, 0.0)


TURNED = "0 0 0 1.5707963267948966 0 0"
AXES = {
    "the joint's": ("1.9", "<xyz>0 0 1</xyz>", (0.0, 0.0, 1.0)),
    "the model's, named": ("1.9", "<xyz expressed_in='__model__'>0 0 1</xyz>", (0.0, 1.0, 0.0)),
    "another link's": ("1.9", "<xyz expressed_in='a'>0 0 1</xyz>", (0.0, 1.0, 0.0)),
    "the model's, by a flag": (
        "1.6",
        "<xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame>",
        (0.0, 1.0, 0.0),
    ),
    "the model's, of old": ("1.4", "<xyz>0 0 1</xyz>", (0.0, 1.0, 0.0)),
    "of length two": ("1.6", "<xyz>0 0 2</xyz>", (0.0, 0.0, 2.0)),
}


@pytest.mark.parametrize("name", AXES)
def test_the_frame_of_an_axis(name: str) -> None:
    version, xyz, expected = AXES[name]
    found = read(model(link("a"), link("b", TURNED), joint("j", "a", "b", xyz=xyz)), version=version)
    assert found.joints[0].axis == pytest.approx(expected)


def test_frames_and_units_of_poses() -> None:
    half = math.sqrt(0.5)
    found = read(
        model(
            link("by_frame", "0 0 1 0 0 0", relative=" relative_to='mark'"),
            link("a"),
            "<frame name='mark' attached_to='turned'><pose>1 0 0 0 0 0</pose></frame>",
            "<link name='turned'><pose degrees='true'>0 0 1 0 0 90</pose></link>",
            "<link name='quat'><pose rotation_format='quat_xyzw' relative_to='turned'>"
            f"0 1 0 0 0 {half} {half}</pose></link>",
            *(joint(f"to_{x}", "a", x) for x in ("turned", "quat")),
            joint("to_frame", "mark", "by_frame"),
        )
    )
    at = poses(found)
    assert place(at["turned"]) == (0.0, 0.0, 1.0)
    assert place(at["by_frame"]) == (0.0, 1.0, 2.0)
    assert place(at["quat"]) == (-1.0, 0.0, 1.0)
    assert at["quat"][0][0] == pytest.approx(-1)
    assert place(poses(found, to_turned=math.pi / 2)["by_frame"]) == (-1.0, 0.0, 2.0), "the mark moves along"


def test_a_visual_in_another_frame() -> None:
    visual = BOX.replace("<geometry>", "<pose relative_to='b'>0 0 1 0 0 0</pose><geometry>")
    found = read(model(link("a", "1 0 0 0 0 0", visual), link("b", "0 2 0 0 0 0"), joint("j", "a", "b")))
    assert found.links[0].visuals[0].pose.xyz == pytest.approx((-1.0, 2.0, 1.0))


def test_fixed_to_the_world() -> None:
    found = read(
        model("<pose>0 0 3 0 0 0</pose>", link("a", "1 0 0 0 0 0"), joint("j", "world", "a", "fixed"))
    )
    assert [x.name for x in found.links] == ["world", "a"]
    assert place(poses(found)["a"]) == (1.0, 0.0, 3.0)


def test_a_link_called_world_is_a_link() -> None:
    found = read(
        model("<pose>0 0 3 0 0 0</pose>", link("world", inside=""), link("a"), joint("j", "world", "a"))
    )
    assert [x.name for x in found.links] == ["world", "a"]
    assert place(poses(found)["a"]) == (0.0, 0.0, 0.0)


def test_a_loop_is_cut_at_the_joint_that_is_named() -> None:
    parts = [link("a"), link("b", "1 0 0 0 0 0"), link("c", "0 1 0 0 0 0")]
    found = read(model(*parts, joint("rod", "c", "b", "ball"), joint("ab", "a", "b"), joint("ac", "a", "c")))
    [cut] = [f for f in found.findings if f.code == "loop-cut"]
    assert cut.text == "joint 'rod' closes a loop: 'c' and 'b' may part there"
    assert [j.name for j in found.joints] == ["ab", "ac"]
    assert codes(found) == ["loop-cut"]


def test_a_link_that_two_joints_hold_hangs_on_one_and_carries_the_other() -> None:
    """Cassie's rods: parent of a link that has another parent."""
    parts = [link("a"), link("b", "1 0 0 0 0 0"), link("rod", "2 0 0 0 0 0")]
    found = read(model(*parts, joint("ab", "a", "b"), joint("rb", "rod", "b")))
    assert place(poses(found)["rod"]) == (2.0, 0.0, 0.0)
    assert place(poses(found, rb=math.pi / 2)["rod"]) == (1.0, -1.0, 0.0), "b seen from the rod turns left"
    assert place(poses(found, ab=math.pi / 2)["rod"]) == (1.0, 1.0, 0.0)


def test_joints_of_other_kinds() -> None:
    parts = [link(x) for x in "abcdefg"]
    two = "<axis2><xyz>0 1 0</xyz></axis2>"
    found = read(
        model(
            *parts,
            joint("ball", "a", "b", "ball"),
            joint("cardan", "a", "c", "universal", more=two),
            joint("screw", "a", "d", "screw"),
            joint("odd", "a", "e", "hinge"),
            joint("gear", "b", "c", "gearbox"),
            joint(
                "limited", "a", "f", xyz="<xyz>1 0 0</xyz><limit><lower>-1</lower><upper>2</upper></limit>"
            ),
            joint(
                "follower",
                "a",
                "g",
                xyz="<xyz>1 0 0</xyz><mimic joint='limited'><multiplier>2</multiplier><offset>1</offset>"
                "<reference>0.5</reference></mimic>",
            ),
        )
    )
    kinds = {j.name: j.type for j in found.joints}
    turning = dict.fromkeys(("cardan", "cardan/axis2", "screw", "follower"), "continuous")
    assert kinds == {"ball": "floating", "odd": "fixed", "limited": "revolute", **turning}
    follower = next(j.mimic for j in found.joints if j.mimic)
    assert (follower.joint, follower.multiplier, follower.offset) == ("limited", 2.0, 0.0)
    assert codes(found) == ["joint-two-axes", "joint-screw", "joint-type", "joint-gearbox"]
    at = poses(found, **{"cardan": math.pi / 2, "cardan/axis2": math.pi / 2})["c"]
    assert [round(at[i][2], 9) for i in range(3)] == [0.0, 1.0, 0.0]


# ---- models


def test_several_models_and_a_floor() -> None:
    floor = model("<static>true</static>", link("floor"), name="ground")
    arm = model("<pose>0 0 1 0 0 0</pose>", link("a"), link("b"), joint("j", "a", "b"), name="arm")
    assert [x.name for x in read("<world name='w'>", floor, arm, "</world>").links] == ["a", "b"]
    assert [x.name for x in read(floor).links] == ["floor"]
    found = read("<world name='w'>", arm, floor, arm, "</world>")
    assert [x.name for x in found.links] == ["world", "arm::a", "arm_2::a", "arm::b", "arm_2::b"]
    assert place(poses(found)["arm_2::a"]) == (0.0, 0.0, 1.0)
    assert codes(found) == ["several-roots"]


def test_models_within_models() -> None:
    inner = model(
        "<pose relative_to='b'>0 0 1 0 0 0</pose>",
        link("a"),
        link("tip", "1 0 0 0 0 0"),
        joint("j", "a", "tip"),
        name="inner",
        more=" placement_frame='tip'",
    )
    found = read(
        model(link("b", "0 0 1 0 0 0"), inner, joint("mount", "b", "inner::a", "fixed"), name="outer")
    )
    assert [x.name for x in found.links] == ["b", "inner::a", "inner::tip"]
    assert place(poses(found)["inner::tip"]) == (0.0, 0.0, 1.0)
    assert place(poses(found)["inner::a"]) == (-1.0, 0.0, 1.0)
    assert place(poses(found, **{"inner::j": math.pi / 2})["inner::tip"]) == (0.0, 0.0, 1.0)


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\ufeff" + text)
    return path


HAND = model(
    "<pose>9 9 9 0 0 0</pose>",
    link(
        "palm", inside="<visual name='v'><geometry><mesh><uri>meshes/a.stl</uri></mesh></geometry></visual>"
    ),
    name="hand",
)


def include(uri: str, more: str = "", merge: str = "") -> str:
    return f"<include{merge}><uri>{uri}</uri>{more}</include>"


def test_included_models(tmp_path: Path) -> None:
    written(tmp_path, "models/hand/model.config", "<model><sdf version='1.5'>old.sdf</sdf><sdf version='1.10'>new.sdf</sdf></model>")  # fmt: skip # noqa: E501
    written(tmp_path, "models/hand/new.sdf", sdf(HAND))
    (tmp_path / "models/hand/meshes").mkdir()
    (tmp_path / "models/hand/meshes/a.stl").write_bytes(cube_stl())
    written(tmp_path, "robot/parts/hand.sdf", sdf(HAND))
    path = written(
        tmp_path,
        "robot/robot.sdf",
        sdf(
            model(
                link("base"),
                include("model://hand", "<name>left</name><pose>0 1 0 0 0 0</pose>"),
                include("parts/hand.sdf", "<name>right</name><pose relative_to='left'>0 -2 0 0 0 0</pose>"),
                include("model://hand/new.sdf", merge=" merge='true'"),
                include("model://gone"),
                *(joint(f"j_{x}", "base", x) for x in ("left::palm", "right::palm", "palm")),
            )
        ),
    )
    found = load_robot_file(path, [tmp_path / "models"])
    at = {name: place(pose) for name, pose in poses(found.urdf).items()}
    assert at == {
        "base": (0.0, 0.0, 0.0),
        "left::palm": (0.0, 1.0, 0.0),
        "right::palm": (0.0, -1.0, 0.0),
        "palm": (9.0, 9.0, 9.0),
    }
    uris = [s.geometry.uri for x in found.urdf.links for s in x.visuals if s.geometry is not None]
    assert uris[1:] == ["model://hand/meshes/a.stl", "parts/meshes/a.stl", "model://hand/meshes/a.stl"]
    assert [p.name for p in found.inputs] == ["robot.sdf", "new.sdf", "hand.sdf", "new.sdf"]
    [lost] = [f for f in found.urdf.findings if f.code == "include"]
    assert (lost.line, "no package 'gone'" in lost.text) == (7, True)
    out = str(tmp_path / "out")
    arguments = ["model", "build", str(path), "-o", out, "--no-cache"]
    assert run_command(arguments, {"GZ_SIM_RESOURCE_PATH": str(tmp_path / "models")}) == CLEAN


def test_includes_that_never_end(tmp_path: Path) -> None:
    one = written(tmp_path, "one.sdf", sdf(model(link("a"), include("two.sdf"), name="one")))
    written(tmp_path, "two.sdf", sdf(model(link("b"), include("one.sdf"), name="two")))
    urdf, inputs = load_sdf(one, resolver_at(tmp_path))
    assert [f.text for f in urdf.findings if f.code == "include"] == [
        "include 'one.sdf': files include each other: 'one.sdf' → 'two.sdf' → 'one.sdf'"
    ]
    assert len(inputs) == 2
    for i in range(20):
        written(tmp_path, f"d{i}.sdf", sdf(model(link("a"), include(f"d{i + 1}.sdf"), name=f"d{i}")))
    urdf, inputs = load_sdf(tmp_path / "d0.sdf", resolver_at(tmp_path))
    assert len(inputs) == 9
    assert any("more than 8 includes within each other" in f.text for f in urdf.findings)
    many = "".join(include("leaf.sdf", f"<name>n{i}</name>") for i in range(300))
    written(tmp_path, "leaf.sdf", sdf(model(link("a"), name="leaf")))
    urdf, inputs = load_sdf(written(tmp_path, "many.sdf", sdf(model(link("a"), many))), resolver_at(tmp_path))
    assert len(inputs) == 201
    assert sum("more than 200 includes" in f.text for f in urdf.findings) == 100


@pytest.mark.parametrize(
    "uri",
    ["/etc/passwd", "../outside.sdf", "file:///etc/passwd", "https://h/model", "model://..", "link.sdf"],
)
def test_includes_stay_in_the_model_s_folders(uri: str, tmp_path: Path) -> None:
    written(tmp_path, "outside.sdf", sdf(model(link("secret"))))
    folder = tmp_path / "robot"
    path = written(folder, "robot.sdf", sdf(model(link("a"), include(uri))))
    (folder / "link.sdf").symlink_to(tmp_path / "outside.sdf")
    urdf, inputs = load_sdf(path, resolver_at(folder))
    assert inputs == (path,)
    assert [f.code for f in urdf.findings if f.severity == "warning"] == ["include"]


# ---- what is drawn


def test_shapes_and_colours() -> None:
    shapes = {
        "<box><size>1 2 3</size></box>": ("box", (1.0, 2.0, 3.0), (1.0, 1.0, 1.0)),
        "<cylinder><radius>1</radius><length>2</length></cylinder>": (
            "cylinder",
            (1.0, 2.0),
            (1.0, 1.0, 1.0),
        ),
        "<sphere><radius>1</radius></sphere>": ("sphere", (1.0,), (1.0, 1.0, 1.0)),
        "<capsule><radius>1</radius><length>2</length></capsule>": ("capsule", (1.0, 2.0), (1.0, 1.0, 1.0)),
        "<ellipsoid><radii>1 2 3</radii></ellipsoid>": ("sphere", (1.0,), (1.0, 2.0, 3.0)),
        "<mesh><uri> a.stl </uri><scale>1 2 3</scale></mesh>": ("mesh", (), (1.0, 2.0, 3.0)),
    }
    for text, (kind, dims, scale) in shapes.items():
        found = read(model(link("a", inside=f"<visual name='v'><geometry>{text}</geometry></visual>")))
        shape = geometry(found)
        assert (shape.kind, shape.dims, shape.scale) == (kind, dims, scale)
        assert found.findings == []
    paints = {
        "<material><diffuse>1 0 0 1</diffuse></material>": (1.0, 0.0, 0.0, 1.0),
        "<material><ambient>0.5 0.5 0.5</ambient></material>": (0.5, 0.5, 0.5, 1.0),
        "<material><script><name>Gazebo/Orange</name></script></material>": (1.0, 0.5088, 0.0468, 1.0),
        "<material><diffuse>2 0 -1 1</diffuse></material><transparency>0.5</transparency>": (
            1.0,
            0.0,
            0.0,
            0.5,
        ),
    }
    for text, rgba in paints.items():
        found = read(model(link("a", inside=BOX.replace("<geometry>", text + "<geometry>"))))
        [visual] = found.links[0].visuals
        assert visual.material is not None
        assert visual.material.rgba == rgba


def test_collisions_are_shown_where_nothing_else_is() -> None:
    found = read(model(link("a", inside=BOX.replace("visual", "collision"))))
    assert geometry(found).kind == "box"
    assert codes(found) == ["collisions-shown"]


def test_sensors_of_links_and_joints() -> None:
    imu = "<sensor name='imu' type='imu'><pose>0 0 1 0 0 0</pose></sensor>"
    force = "<pose>0 1 0 0 0 0</pose><sensor name='ft' type='force_torque'/>"
    found = read(model(link("a", inside=imu), link("b"), joint("j", "a", "b", more=force)))
    assert [(s.name, s.kind, s.link, s.pose.xyz) for s in found.sensors] == [
        ("imu", "imu", "a", (0.0, 0.0, 1.0)),
        ("ft", "force_torque", "b", (0.0, 1.0, 0.0)),
    ]


# ---- what is wrong


WRONG = {
    model(link("a", "1 2 3")): "link 'a': <pose> needs 6 numbers: '1 2 3'",
    model(link("a", "0 0 1e9 0 0 0")): "link 'a': <pose> is more than 10,000 km away",
    model(link("a"), link("a")): "link 'a' is defined twice; the first is used",
    model(link("a"), joint("j", "a", "gone")): "joint 'j': there is no link 'gone'; left out",
    model(link("a"), link("b"), joint("j", "a", "b", xyz="<xyz>0 0 0</xyz>")): "joint 'j': its axis is 0 0 0",
    model(link("a"), "<joint name='j' type='fixed'><child>a</child></joint>"): "joint 'j': no parent link",
    model(link("a", relative=" rotation_format='wxyz'")): "the unknown rotation_format 'wxyz'; left out",
    model(link("a", relative=" reference='b'")): "<pose> has no attribute 'reference' in SDF; ignored",
    model(link("a", relative=" relative_to='gone'")): "its pose is relative to 'gone', which does not exist",
    model(
        link("a", relative=" relative_to='b'"), link("b", relative=" relative_to='a'"), joint("j", "a", "b")
    ): "its pose depends on itself",
    model("<frame name='f' attached_to='f'/>", link("a"), joint("j", "f", "a")): "there is no link 'f'",
    model(link("a", inside="<visual name='v'/>")): "link 'a': a visual without a geometry",
    model(link("a", inside=BOX.replace("0.2 0.2 0.2", "0 1 1"))): "link 'a': a box needs sizes above 0",
    model(link("a", inside=BOX.replace("box", "heightmap"))): "link 'a': shape 'heightmap' is not shown",
    model(link("a"), "<link/>"): "a link without a name; left out",
    model(link("a"), more=" placement_frame='gone'"): "'gone' is not a frame inside it",
}  # fmt: skip


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_said_and_the_rest_is_shown(text: str, tmp_path: Path) -> None:
    found = read(text)
    assert found.links
    assert any(WRONG[text] in f.text for f in found.findings), [f.text for f in found.findings]
    path = written(tmp_path, "robot.sdf", sdf(text))
    assert run_command(["doctor", "--urdf", str(path)], {}) == PROBLEMS


@pytest.mark.parametrize("version", ["1.4", "1.11", "1.12", "1.12.1", "1.13", "2.0", "new", ""])
def test_a_version_newer_than_known_is_said(version: str) -> None:
    findings = read_sdf(sdf(model(link("a")), version=version).encode()).findings
    newer = f"SDF {version} is newer than 1.12, the newest that is known; read as that"
    expected = [newer] if version in {"1.12.1", "1.13", "2.0"} else []
    assert [f.text for f in findings if f.code == "version"] == expected


REFUSED = {
    sdf(): "it has no <model>",
    sdf(include("model://gone")): ":2: include 'model://gone': no package 'gone'",
    sdf(
        include("model://a"), include("model://b")
    ): "none of the 2 files that it includes was found; name the folder",
    sdf(model()): "it has no links",
    "<sdf><model>": "not XML",
    "<!DOCTYPE sdf [<!ENTITY a 'b'>]>" + sdf(model(link("&a;"))): "a document type (DTD) is not accepted",
    sdf(model("<model name='m'>" * 70 + "</model>" * 70)): "nested more than 64 deep",
    sdf(model(*(link(f"l{i}", inside="") for i in range(1001)))): "more than 1000 links",
    sdf(model(link("a", inside=BOX * 2049))): "more than 2048 visuals and collisions",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_refused_is_one_line(text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, "robot.sdf", text)
    assert run_command(["model", "build", str(path), "-o", str(tmp_path / "out")], {}) == UNUSABLE
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"posecast-edge: {path}")
    assert REFUSED[text] in line


def test_the_name_of_the_file_does_not_matter(tmp_path: Path) -> None:
    path = written(tmp_path, "robot.urdf", sdf(model(link("a"))))
    assert find_format(path) == "sdf"
    assert [x.name for x in load_robot_file(path).urdf.links] == ["a"]


def test_an_sdf_with_macros(tmp_path: Path) -> None:
    text = sdf(model("<xacro:property name='n' value='3'/>", link("a${n}")))
    path = written(tmp_path, "robot.sdf.xacro", text.replace("<sdf ", "<sdf xmlns:xacro='http://x' "))
    assert [x.name for x in load_robot_file(path).urdf.links] == ["a3"]


def test_a_file_that_is_gone() -> None:
    with pytest.raises(ModelRefused, match="No such file"):
        load_sdf(Path("/nowhere/robot.sdf"), resolver_at(Path("/nowhere")))
