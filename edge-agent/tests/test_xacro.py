"""xacro is expanded as ROS does it, and a file from a stranger reaches nothing else of this machine."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from model_stage import cube_stl
from posecast_edge.cli.model_command import CLEAN, UNUSABLE, run_command
from posecast_edge.cli.settings import UsageError, parse_settings
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.robot_file import find_format, load_robot_file
from posecast_edge.model.xacro import child, expander
from posecast_edge.model.xacro.child import ExpressionRefused, evaluate_expression
from posecast_wire.command_line.installation import advise_extra

HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
MAIN = f"""{HEAD}
<xacro:arg name="arms" default="1"/>
<xacro:include filename="$(find parts)/urdf/arm.xacro"/>
<xacro:property name="sizes" value="${{xacro.load_yaml('sizes.yaml')}}"/>
<link name="base"/>
<xacro:arm i="1" parent="base"/>
<xacro:if value="${{int(xacro.arg('arms')) > 1}}"><xacro:arm i="2" parent="arm1"/></xacro:if>
</robot>"""
ARM = f"""{HEAD}
<xacro:macro name="arm" params="i parent">
<link name="arm${{i}}"><visual><geometry><mesh filename="file://$(find parts)/meshes/a.stl"/></geometry></visual></link>
<joint name="j${{i}}" type="continuous"><origin xyz="${{sizes.length * i}} 0 ${{sin(pi / 2)}}"/>
<parent link="${{parent}}"/><child link="arm${{i}}"/><axis xyz="0 0 1"/></joint>
</xacro:macro>
</robot>"""  # noqa: E501


def workspace(folder: Path) -> Path:
    """A robot of two packages that lie side by side; the file's path."""
    for package in ("mine", "parts"):
        (folder / package / "urdf").mkdir(parents=True)
        (folder / package / "package.xml").write_text(f"<package><name>{package}</name></package>")
    (folder / "parts/meshes").mkdir()
    (folder / "parts/meshes/a.stl").write_bytes(cube_stl())
    (folder / "parts/urdf/arm.xacro").write_text("\ufeff" + ARM)
    (folder / "mine/urdf/sizes.yaml").write_text("length: 0.5\n")
    path = folder / "mine/urdf/robot.urdf.xacro"
    path.write_text("\ufeff" + MAIN)
    return path


def one_file(folder: Path, inside: str) -> Path:
    path = folder / "robot.xacro"
    path.write_text(f'{HEAD}<link name="a"/>{inside}</robot>')
    return path


def test_macros_packages_and_parameters(tmp_path: Path) -> None:
    path = workspace(tmp_path)
    assert find_format(path) == "xacro"
    found = load_robot_file(path, [], {"arms": "2"})
    assert [x.name for x in found.urdf.links] == ["base", "arm1", "arm2"]
    assert [j.pose.xyz for j in found.urdf.joints] == [(0.5, 0.0, 1.0), (1.0, 0.0, 1.0)]
    [arm, _] = [s.geometry for x in found.urdf.links for s in x.visuals]
    assert arm is not None
    assert arm.uri == "package://parts/meshes/a.stl", "no path of this machine"
    assert {str(p.relative_to(tmp_path)) for p in found.inputs} == {
        "mine/urdf/robot.urdf.xacro",
        "mine/urdf/sizes.yaml",
        "parts/urdf/arm.xacro",
    }
    assert len(load_robot_file(path).urdf.links) == 2


def test_it_is_built_and_the_cache_knows_what_was_included(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, out = workspace(tmp_path / "ws"), tmp_path / "out"
    environment = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    build = ["model", "build", str(path), "-o", str(out)]

    def links() -> int:
        assert run_command([*build, "--xacro-arg", "arms:=2"], environment) == CLEAN
        said = capfd.readouterr()
        assert said.err == ""
        return int(said.out.split()[1])

    assert links() == 3
    assert links() == 3
    arm = tmp_path / "ws/parts/urdf/arm.xacro"
    arm.write_text(ARM.replace("</xacro:macro>", '<link name="more${i}"/></xacro:macro>'))
    assert run_command([*build, "--xacro-arg", "arms:=2"], environment) == CLEAN
    assert "is not connected to the root" in capfd.readouterr().err
    assert run_command(build, environment) == CLEAN
    assert "2 links" in capfd.readouterr().out, "other arguments, another model"


def test_a_package_elsewhere_is_named(tmp_path: Path) -> None:
    path = workspace(tmp_path / "ws")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "ws/parts").rename(tmp_path / "elsewhere/parts")
    with pytest.raises(ModelRefused, match=r"no package 'parts' .*--package-path"):
        load_robot_file(path)
    assert len(load_robot_file(path, [tmp_path / "elsewhere"]).urdf.links) == 2
    out = str(tmp_path / "out")
    for flags, more in (
        (["--package-path", f"/nowhere:{tmp_path / 'elsewhere'}"], {}),
        (["--packages", str(tmp_path / "elsewhere")], {}),
        ([], {"ROS_PACKAGE_PATH": str(tmp_path / "elsewhere")}),
        ([], {"GAZEBO_MODEL_PATH": str(tmp_path / "elsewhere")}),
    ):
        assert run_command(["model", "build", "--no-cache", str(path), "-o", out, *flags], more) == CLEAN
        assert run_command(["doctor", "--urdf", str(path), *flags], more) == CLEAN


def test_an_include_of_a_package_that_was_taken_apart(tmp_path: Path) -> None:
    path = workspace(tmp_path)
    (tmp_path / "parts/urdf/arm.xacro").rename(tmp_path / "mine/urdf/arm.xacro")
    found = load_robot_file(path)
    assert [x.name for x in found.urdf.links] == ["base", "arm1"]
    assert [f.text for f in found.urdf.findings if f.code == "include-found"] == [
        "include 'urdf/arm.xacro' not found; taken from beside the file"
    ]
    (tmp_path / "mine/urdf/passwd").write_text("<robot/>")
    with pytest.raises(ModelRefused, match="'/etc/passwd': is outside"):
        load_robot_file(one_file(tmp_path / "mine/urdf", "<xacro:include filename='/etc/passwd'/>"))


def test_macros_left_in_a_urdf_are_no_reason_to_show_nothing(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(f'{HEAD}<link name="a"/><xacro:gone/></robot>')
    found = load_robot_file(path)
    assert [x.name for x in found.urdf.links] == ["a"]
    assert any("not expanded: xacro: unknown macro name" in f.text for f in found.urdf.findings)


def test_a_urdf_that_xacro_made_is_a_urdf(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(f'<!-- <xacro:include filename="$(find x)"/> -->{HEAD}<link name="a"/></robot>')
    assert find_format(path) == "urdf"


REFUSED = {
    "<xacro:include filename='/etc/passwd'/>": "'/etc/passwd': is outside the model's folders; give its",
    "<xacro:include filename='../other.xacro'/>": "is outside the model's folders",
    "<xacro:include filename='.hidden/a.xacro'/>": "has a name on its path that begins with a dot; give its",
    "<a x=\"${xacro.load_yaml('/etc/hosts')}\"/>": "is outside the model's folders",
    "<xacro:include filename='link.xacro'/>": "is outside the model's folders",
    "<xacro:include filename='http://h/a.xacro'/>": "files are not downloaded",
    "<xacro:include filename='gone.xacro'/>": "xacro: 'gone.xacro': No such file or directory",
    "<xacro:include filename='robot.xacro'/>": "a macro or a file that includes itself",
    '<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>': "includes itself, in macro 'm'",
    '<a x="${(lambda: ().__class__.__base__.__subclasses__())()}"/>': "can't use the attribute '__class__'",
    '<a x="${(x for x in [1]).gi_frame.f_back.f_globals}"/>': "can't use the attribute 'gi_frame'",
    '<a x="$(eval [x for x in [1]].__class__)"/>': "can't use the attribute '__class__'",
    "<a x=\"${'0'.format(xacro)}\"/>": "can't use the attribute 'format'",
    '<a x="${python.vars(xacro)}"/>': "'vars' is not defined",
    '<a x="${python.type(python.type(1))}"/>': "can't make types",
    '<a x="${__import__}"/>': "can't use the name '__import__'",
    "<a x=\"${'a' * 10 ** 10}\"/>": "it takes more than 256 MiB to expand",
    '<a x="${len([0 for i in range(10 ** 9)])}"/>': "it takes more than 256 MiB to expand",
    '<a x="$(env HOME)"/>': "the environment variable 'HOME': a robot's file can't read your environment",
    '<a x="$(arg gone)"/>': "it needs the argument 'gone': --xacro-arg gone:=VALUE",
    '<a x="$(find gone)"/>': "no package 'gone' with a package.xml or model.config near the robot's file",
    '<a x="${gone}"/>': "name 'gone' is not defined when evaluating expression 'gone'",
    "<a x=\"${xacro.fatal('my\nown\u202e words')}\"/>": "my own",
    "<b": "not XML: not well-formed",
}


@pytest.mark.parametrize("inside", REFUSED)
def test_what_is_refused_is_one_line(inside: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "robot"
    (folder / ".hidden").mkdir(parents=True)
    (tmp_path / "other.xacro").write_text("<robot/>")
    (folder / ".hidden/a.xacro").write_text("<robot/>")
    (folder / "link.xacro").symlink_to(tmp_path / "other.xacro")
    path = one_file(folder, inside)
    assert run_command(["doctor", "--urdf", str(path)], {}) == UNUSABLE
    said = capfd.readouterr()
    assert said.out == ""
    [line] = said.err.splitlines()
    assert line.isprintable()
    assert line.startswith(f"posecast-edge: {path}:")
    assert REFUSED[inside] in line


def test_it_knows_nothing_of_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SECRET", "hunter2")
    path = one_file(
        tmp_path, '<link name="$(optenv SECRET nothing)"/><link name="${len(\'$(optenv HOME)\')}"/>'
    )
    assert [x.name for x in load_robot_file(path).urdf.links] == ["a", "nothing", "0"]


def test_what_takes_too_long_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expander, "WAIT_S", 1.0)
    path = one_file(tmp_path, '<a x="${10 ** 10 ** 9}"/>')
    with pytest.raises(ModelRefused, match="it takes too long to expand"):
        load_robot_file(path)


def test_what_grows_too_large_is_cut(tmp_path: Path) -> None:
    path = one_file(tmp_path, "".join("<link name=\"${'a' * 3000000}\"/>" for _ in range(4)))
    with pytest.raises(ModelRefused, match="expands to more than 8 MiB"):
        load_robot_file(path)


def test_without_xacro_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expander, "NEEDED", ("no_such_module",))
    with pytest.raises(ModelRefused, match=re.escape(advise_extra("posecast-edge", "model"))):
        load_robot_file(one_file(tmp_path, ""))


@pytest.mark.parametrize("what", ["open", "os.system", "subprocess.Popen", "socket.connect", "os.remove"])
def test_the_second_line_holds_by_itself(what: str, tmp_path: Path) -> None:
    """Whatever came past the expressions."""
    expansion = child.XacroRun(one_file(tmp_path, ""), [], {})
    with pytest.raises(PermissionError):
        expansion._audit(what, (str(tmp_path / "new"), "w", os.O_WRONLY))
    expansion._audit("open", (str(tmp_path / "robot.xacro"), "r", 0))
    with pytest.raises(PermissionError):
        expansion._audit("open", ("/etc/hostname", "r", 0))
    with pytest.raises(PermissionError):
        expansion._audit("open", (str(tmp_path / "robot.xacro"), None, os.O_RDWR))
    expansion._audit("open", (str(child.PYTHON / "base64.py"), "r", 0))
    with pytest.raises(PermissionError):  # it may be the owner's own program
        expansion._audit("open", (str(child.PYTHON / "site-packages/mine.py"), "r", 0))


@pytest.mark.parametrize(
    ("text", "value"),
    [("1 + x", 3), ("x.real", 2), ("'a b'.split()", ["a", "b"]), ("[i * x for i in (1, 2)][1]", 4)],
)
def test_expressions(text: str, value: object) -> None:
    assert evaluate_expression(text, {"x": 2}) == value


@pytest.mark.parametrize("text", ["x.__class__", "x.gone", "__import__", "y.a", "x" * 30_000])
def test_expressions_that_ask_for_more(text: str) -> None:
    with pytest.raises(ExpressionRefused):
        evaluate_expression(text, {"x": 2, "y": len})


RUN = ("run", "--robot", "r", "--source", "demo", "--relay", "tcp/h:1")


def test_run_takes_the_same_flags() -> None:
    flags = ("--package-path", "/a:/b", "--packages", "/c", "--xacro-arg", "n:=1", "--xacro-arg", "m:=x y")
    settings = parse_settings([*RUN, *flags], {})
    assert settings.packages == (Path("/a"), Path("/b"), Path("/c"))
    assert settings.list_model_options() == [
        *("--package-path=/a", "--package-path=/b", "--package-path=/c"),
        *("--xacro-arg=n:=1", "--xacro-arg=m:=x y"),
        "--up-axis=auto",
    ]
    given = {"POSECAST_PACKAGE_PATH": "/d:/e", "POSECAST_XACRO_ARG": "n:=1 m:=2"}
    settings = parse_settings(RUN, given)
    assert settings.packages == (Path("/d"), Path("/e"))
    assert settings.xacro_arguments == (("n", "1"), ("m", "2"))
    with pytest.raises(UsageError, match=r"'n=1' is not NAME:=VALUE \[POSECAST_XACRO_ARG\]"):
        parse_settings(RUN, {"POSECAST_XACRO_ARG": "n=1"})
