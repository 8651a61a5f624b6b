"""A model from somebody else lies in a person's home: whatever its format, it reaches only its own files."""

from __future__ import annotations

import os
import pwd
from pathlib import Path
from types import SimpleNamespace

import pytest
from model_stage import PICTURE, build_robot, cube_obj, cube_stl, link, mesh, robot
from posecast_edge.cli.model_command import CLEAN, UNUSABLE, run_command
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mjcf.files import collect_files
from posecast_edge.model.robot_file import load_robot_file
from posecast_edge.model.serve.bundle import load_bundle
from posecast_edge.model.urdf.resolver import HIDDEN, OUTSIDE, SHARED, Resolver, list_shared_folders
from posecast_edge.model.xacro.child import XacroRun

SECRET = "correct-horse-battery-staple"
PRIVATE = (".", "Pictures", "work", ".ssh", ".config/robot", "Downloads/other", "Downloads/cool/.git")
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def fill(folder: Path) -> None:
    """Put a private file of each kind there."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "me.png").write_bytes(PICTURE + SECRET.encode())
    (folder / "part.stl").write_bytes(cube_stl(header=SECRET.encode()))
    (folder / "part.mtl").write_text(f"newmtl {SECRET}\nKd 1 0 0\n")
    (folder / "part.sdf").write_text(f"<sdf><model name='s'><link name='{SECRET}'/></model></sdf>")
    (folder / "part.xml").write_text(f"<mujocoinclude><body name='{SECRET}'/></mujocoinclude>")
    (folder / "part.xacro").write_text(f"<robot {XACRO}><link name='{SECRET}'/></robot>")
    (folder / "key").write_text(f"-----BEGIN KEY-----\n{SECRET}\n")
    (folder / "broken.yaml").write_text(f"a: *{SECRET}\n")


@pytest.fixture
def cool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder Downloads/cool of a home with private files. Links in it lead to them, as in an archive."""
    home = tmp_path / "home/kim"
    for place in PRIVATE:
        fill(home / place)
    (home / ".config/robot/package.xml").write_text("<package><name>robot</name></package>")
    monkeypatch.setenv("HOME", str(home))
    cool = home / "Downloads/cool"
    (cool / "linked").symlink_to(home)
    for place in PRIVATE:
        (cool / f"{(home / place).name}.link").symlink_to(home / place)
    (cool.parent / "meshes").symlink_to(home / "Pictures")
    return cool


def spell(cool: Path, file: str) -> list[str]:
    """Every way in which a URI may name a private file of that name."""
    home, uris = cool.parents[1], []
    for place in PRIVATE:
        last = (home / place).name
        uris += [f"{scheme}://{last}/{file}" for scheme in ("package", "model")]
        uris += [
            f"package:///{last}/{file}",
            f"package://{last.upper()}/{file}",
            f"package://{last}.link/{file}",
        ]
        uris += [f"package://%{ord(last[0]):02X}{last[1:]}/{file}", f"package://{last}%2F{file}/{file}"]
        uris += [f"package://{name}/../../{place}/{file}" for name in ("cool", "Downloads", "nobody")]
        uris += [f"package://{name}/{place}/{file}" for name in ("kim", "home/kim", "..", "cool/linked")]
        uris += [f"{scheme}{home}/{place}/{file}" for scheme in ("", "file://", "file://localhost")]
        uris += [f"../../{place}/{file}", f"..\\..\\{place}\\{file}", f"%2E%2E/%2e%2e/{place}/{file}"]
        uris += [f"meshes/../../../{place}/{file}", f"linked/{place}/{file}", f"{last}.link/{file}"]
    return list(dict.fromkeys([*uris, f"../meshes/{file}", f"package://Downloads/meshes/{file}"]))


def test_a_urdf_and_its_meshes(cool: Path) -> None:
    pictures, meshes = spell(cool, "me.png"), spell(cool, "part.stl")
    path = cool / "r.urdf"
    resolver = Resolver(path)
    for uri in (*pictures, *meshes):
        with pytest.raises(ModelRefused, match=r"--package-path|^not a file name in a package$"):
            resolver.find_file(uri)
    pictures, meshes = pictures[::7], meshes[::7]
    shapes = [
        f'<visual><geometry><box size="1 1 1"/></geometry><material name="m{i}"><texture filename="{uri}"/>'
        "</material></visual>"
        for i, uri in enumerate(pictures)
    ]
    path.write_text(robot(link("a", "".join([*shapes, *map(mesh, meshes)]))))
    built = build_robot(path)
    assert SECRET.encode() not in built.manifest + b"".join(built.files.values())
    assert {m["uri"] for m in built.document["missing"]} == {*pictures, *meshes}
    raw = load_bundle(path)
    assert [file.path for file in raw.files] == ["r.urdf"]
    assert set(raw.missing) == {*pictures, *meshes}


def test_what_a_mesh_names(cool: Path) -> None:
    resolver = Resolver(cool / "r.urdf")
    for file in ("me.png", "part.mtl"):
        for uri in spell(cool, file):
            with pytest.raises(ModelRefused):
                resolver.find_beside(cool / "a.obj", uri)
    names = "".join(f"mtllib {uri}\n" for uri in spell(cool, "part.mtl") if " " not in uri)
    (cool / "a.obj").write_bytes(cube_obj(f"{names}usemtl {SECRET}\n"))
    (cool / "r.urdf").write_text(robot(link("a", mesh("a.obj"))))
    [visual] = build_robot(cool / "r.urdf").document["visuals"]
    assert "placeholder" not in visual
    assert visual["color"] != "#ff0000"


def test_an_sdf(cool: Path) -> None:
    uris = [uri for file in ("part.sdf", "") for uri in spell(cool, file)]
    shape = "<visual name='v'><geometry><mesh><uri>{}</uri></mesh></geometry></visual>"
    for some in (uris[i : i + 150] for i in range(0, len(uris), 150)):
        includes = "".join(f"<include><uri>{uri}</uri></include>" for uri in some)
        meshes = "".join(map(shape.format, spell(cool, "part.stl")))
        path = cool / "r.sdf"
        inside = f"<link name='a'>{meshes}</link>{includes}"
        path.write_text(f"<sdf version='1.9'><model name='m'>{inside}</model></sdf>")
        found = load_robot_file(path)
        assert found.inputs == (path,)
        assert [x.name for x in found.urdf.links] == ["a"]
        assert SECRET not in str(found.urdf.findings)
    assert all("placeholder" in v for v in build_robot(path).document["visuals"])


def test_an_mjcf(cool: Path) -> None:
    """MuJoCo gets what is collected, and can open nothing itself."""
    for base in ("", f' meshdir="../../Pictures" texturedir="{cool}/linked"'):
        assets = [f'<include file="{uri}"/>' for uri in spell(cool, "part.xml")]
        assets += [f'<mesh file="{uri}"/>' for uri in spell(cool, "part.stl")]
        assets += [f'<hfield file="{uri}"/>' for uri in spell(cool, "me.png")]
        path = cool / "r.xml"
        path.write_text(f"<mujoco><compiler{base}/><asset>{''.join(assets)}</asset></mujoco>")
        found = collect_files(path)
        assert list(found.contents) == [str(path)]
        assert list(found.inputs) == [path]


def test_a_xacro(cool: Path) -> None:
    """Each way to a file, as the process that expands it sees them; without its hook, which would stay."""
    path = cool / "r.xacro"
    path.write_text(f"<robot {XACRO}/>")
    run = XacroRun(path, [], {})
    names = ("Pictures", "work", ".ssh", ".config", "other", "kim", "home", "meshes", ".git", "work.link")
    for name in names:
        with pytest.raises(ModelRefused, match=r"^no package .* near the robot's file; give its folder with"):
            run._find(name)
    run._find("cool")  # the model's own
    for uri in spell(cool, "key"):
        try:
            file = run._locate(uri) if "://" in uri else cool / uri
        except ModelRefused:
            continue
        for event, arguments in (("open", (str(file), "r", 0)), ("os.scandir", (str(file.parent),))):
            if file.exists():
                with pytest.raises(PermissionError, match="--package-path"):
                    run._audit(event, arguments)
    assert run.inputs == {}


EXPRESSIONS = [
    "<a x=\"${xacro.load_yaml('$(find .ssh)/key')}\"/>",
    "<a x=\"${xacro.load_yaml('package://Pictures/key')}\"/>",
    "<a x=\"${xacro.load_yaml('$(find cool)/../../Pictures/key')}\"/>",
    "<a x=\"${xacro.load_yaml('../../work/broken.yaml')}\"/>",
    "<a x=\"${load_yaml('linked/key')}\"/>",
    "<xacro:include filename='$(find robot)/part.xacro'/>",
    "<xacro:include filename='../../P*/part.xacro'/>",
    "<xacro:include filename='$(arg where)/part.xacro'/>",
    "<xacro:include filename='Pictures.link/part.xacro'/>",
]


@pytest.mark.parametrize("inside", EXPRESSIONS)
def test_a_xacro_that_is_expanded(inside: str, cool: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path, argument = cool / "r.xacro", '<xacro:arg name="where" default="../../work"/>'
    path.write_text(f"<robot {XACRO}>{argument}{link('a')}{inside}</robot>")
    finds_nothing = "*" in inside  # a pattern, to which a person's files are not there
    status = run_command(["doctor", "--urdf", str(path)], {})
    said = capfd.readouterr()
    assert SECRET not in said.out + said.err
    assert (status, "--package-path" in said.err) == ((CLEAN, False) if finds_nothing else (UNUSABLE, True))


# ---- folders in which files of every kind lie together ----


@pytest.mark.parametrize("place", [".", "Downloads", "내려받기"])
def test_a_model_that_is_loose_among_other_files(place: str, cool: Path) -> None:
    home = cool.parents[1]
    (home / ".config/user-dirs.dirs").write_text('# of the desktop\nXDG_DOWNLOAD_DIR="$HOME/내려받기"\n')
    fill(home / place)
    (home / place / "package.xml").write_text("<package><name>mine</name></package>")
    names = ("part.stl", "package://mine/part.stl", "me.png", f"package://{(home / place).name}/part.stl")
    path = home / place / "r.urdf"
    path.write_text(robot(link("a"), *(link(f"l{i}", mesh(name)) for i, name in enumerate(names))))
    for name in names:
        with pytest.raises(ModelRefused) as refused:
            Resolver(path).find_file(name)
        assert "--package-path" in refused.value.reason
    with pytest.raises(ModelRefused) as refused:
        Resolver(path).find_file("part.stl")
    assert refused.value.reason == SHARED
    assert "a" in [x.name for x in load_robot_file(path).urdf.links], "itself it is read"
    assert Resolver(path, [home / place]).find_file("part.stl").path == home / place / "part.stl"
    xacro = home / place / "r.xacro"
    xacro.write_text(f"<robot {XACRO}><link name='a'/></robot>")
    assert len(load_robot_file(xacro).urdf.links) == 1
    xacro.write_text(f"<robot {XACRO}><xacro:include filename='part.xacro'/></robot>")
    with pytest.raises(ModelRefused, match="move the robot to a folder of its own"):
        load_robot_file(xacro)


def test_the_home_is_known_without_an_environment(cool: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that expands a xacro has none; and a service may have another one than its user."""
    home = cool.parents[1]
    path = home / "r.xacro"
    path.write_text(f"<robot {XACRO}><link name=\"${{xacro.load_yaml('key')}}\"/></robot>")
    with pytest.raises(ModelRefused, match="move the robot"):
        load_robot_file(path)
    monkeypatch.setattr(pwd, "getpwuid", lambda _uid: SimpleNamespace(pw_dir=str(home)))
    for environment in ({}, {"HOME": "/root"}, {"HOME": ""}):
        assert home in list_shared_folders(environment)
        with pytest.raises(ModelRefused) as refused:
            Resolver(path, shared=list_shared_folders(environment)).check(home / "key")
        assert refused.value.reason == SHARED
    assert os.environ["HOME"] == str(home)


# ---- what is no secret is still found ----


def test_a_hidden_folder_that_the_user_chose(cool: Path) -> None:
    hidden = cool.parents[1] / ".gazebo/models"
    fill(hidden / "arm/meshes")
    (hidden / "arm/.git").mkdir()
    fill(hidden / "arm/.git/x")
    own = Resolver(hidden / "arm/model.sdf")
    assert own.find_file("meshes/part.stl").path == hidden / "arm/meshes/part.stl"
    given = Resolver(cool / "r.urdf", [hidden])
    assert given.find_file("model://arm/meshes/part.stl").path == hidden / "arm/meshes/part.stl"
    for resolver, uri in ((own, ".git/x/part.stl"), (given, "model://arm/.git/x/part.stl")):
        with pytest.raises(ModelRefused) as refused:
            resolver.find_file(uri)
        assert refused.value.reason == HIDDEN


@pytest.mark.parametrize("place", ["cool_robot", "Downloads/cool_robot"])
def test_a_folder_without_a_package(place: str, cool: Path) -> None:
    """NAME/urdf and NAME/meshes, as people unpack them; also a direct child of the home folder."""
    folder = cool.parents[1] / place
    for part in ("meshes", "textures", "notes"):
        fill(folder / part)
    fill(folder)
    (folder / "urdf").mkdir()
    resolver = Resolver(folder / "urdf/r.urdf")
    for part in ("meshes", "textures"):
        for uri in (f"package://cool_robot/{part}/part.stl", f"../{part}/part.stl"):
            found = resolver.find_file(uri)
            assert (found.path, found.hint) == (folder / part / "part.stl", None)
        assert resolver.find_file(f"package://other/{part}/part.stl").path == folder / part / "part.stl"
    for uri in ("package://cool_robot/part.stl", "package://cool_robot/notes/part.stl", "../part.stl"):
        with pytest.raises(ModelRefused) as refused:
            resolver.find_file(uri)
        assert refused.value.reason == OUTSIDE
    given = Resolver(folder / "urdf/r.urdf", [folder.parent])
    assert given.find_file("package://cool_robot/notes/part.stl").path == folder / "notes/part.stl"
    path = folder / "urdf/r.xacro"
    path.write_text(f"<robot {XACRO}><xacro:include filename='$(find cool_robot)/urdf/arm.xacro'/></robot>")
    (folder / "urdf/arm.xacro").write_text(f"<robot {XACRO}><link name='a'/></robot>")
    assert len(load_robot_file(path).urdf.links) == 1


@pytest.mark.parametrize("marker", ["package.xml", "model.config"])
def test_packages_beside_each_other(marker: str, cool: Path) -> None:
    source = cool.parents[1] / "ws/src"
    for name in ("arm", "hand"):
        fill(source / name / "meshes")
        (source / name / marker).write_text("<package/>")
    fill(cool.parents[1] / "elsewhere/leg")
    (cool.parents[1] / "elsewhere/leg/package.xml").write_text("<package/>")
    (source / "leg").symlink_to(cool.parents[1] / "elsewhere/leg")
    (source / "arm/urdf").mkdir()
    resolver = Resolver(source / "arm/urdf/r.urdf")
    for uri in (
        "package://hand/meshes/part.stl",
        "model://hand/meshes/part.stl",
        "../../hand/meshes/part.stl",
    ):
        assert resolver.find_file(uri).path == source / "hand/meshes/part.stl"
    with pytest.raises(ModelRefused, match="--package-path"):
        resolver.find_file("package://leg/part.stl")
    given = Resolver(source / "arm/urdf/r.urdf", [source])
    assert given.find_file("package://leg/part.stl").path == cool.parents[1] / "elsewhere/leg/part.stl"


def test_a_link_to_somebody_elses_package(cool: Path) -> None:
    """As in an archive: the link's name and the package's are the stranger's choice."""
    work = cool.parents[1] / "work/private"
    fill(work)
    (work / "package.xml").write_text("<package><name>op</name></package>")
    (cool / "op").symlink_to(work)
    (cool.parent / "private").symlink_to(work)
    resolver = Resolver(cool / "r.urdf")
    for name in ("op", "private"):
        for uri in (f"package://{name}/part.stl", f"model://{name}/part.stl", f"../{name}/part.stl"):
            with pytest.raises(ModelRefused, match="--package-path"):
                resolver.find_file(uri)
        with pytest.raises(ModelRefused, match="--package-path"):
            resolver.find_package(name)
    path = cool / "r.xacro"
    path.write_text(f"<robot {XACRO}><link name=\"${{xacro.load_yaml('$(find op)/key')}}\"/></robot>")
    with pytest.raises(ModelRefused, match="no package 'op'") as refused:
        load_robot_file(path)
    assert SECRET not in refused.value.reason


PIPE_XACRO = {
    "include": "<xacro:include filename='pipe'/>",
    "data": "<link name=\"${xacro.load_yaml('pipe')}\"/>",
}


@pytest.mark.parametrize("what", ["robot.urdf", "package.xml", "model.config", *PIPE_XACRO])
def test_a_pipe_holds_nothing_up(what: str, cool: Path) -> None:
    path = cool / "r.urdf"
    path.write_text(robot(link("a")))
    if what in PIPE_XACRO:
        path = cool / "r.xacro"
        path.write_text(f"<robot {XACRO}><link name='a'/>{PIPE_XACRO[what]}</robot>")
        os.mkfifo(cool / "pipe")
    else:
        os.mkfifo(cool / what)
    if what == "robot.urdf":
        path = cool / what
    if what in ("package.xml", "model.config"):
        with pytest.raises(ModelRefused, match="--package-path"):
            Resolver(path).find_package("other")
    else:
        with pytest.raises(ModelRefused, match="is not a file"):
            load_robot_file(path)


@pytest.mark.parametrize(
    "folder",
    [
        *("/mnt", "/media/kim", "/run/media/kim/STICK", "/srv", "/opt", "/dev/shm", "/mnt/c", "/mnt/c/Users"),
        *("/mnt/c/Users/kim", "/mnt/c/Users/kim/Downloads", "/data/kim/Documents", "/home/other"),
    ],
)
def test_a_model_among_files_of_every_kind(folder: str) -> None:
    assert Resolver(Path(folder, "r.urdf")).roots == ()
    assert Resolver(Path(folder, "x/cool/r.urdf")).roots[0] == Path(folder, "x/cool")
