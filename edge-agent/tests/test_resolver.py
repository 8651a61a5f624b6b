"""Every way that robots in the wild name their meshes."""

from __future__ import annotations

from pathlib import Path

import pytest
from model_stage import cube_stl, link, robot, written
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.urdf.resolver import Resolver, list_package_folders


def placed(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cube_stl())
    return path


def named(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "package.xml").write_text(f"<package format='3'><name> {name} </name></package>")
    return folder


def test_beside_and_above(tmp_path: Path) -> None:
    arm = placed(tmp_path / "ws/foo_description/meshes/arm.STL")
    bar = placed(named(tmp_path / "ws/bar", "bar") / "b.stl")
    placed(tmp_path / "ws/no_package/b.stl")
    named(tmp_path / "ws/foo_description", "foo_description")
    urdf = written(tmp_path / "ws/foo_description/urdf", robot(link("a")))
    resolver = Resolver(urdf)
    for uri in (
        "../meshes/arm.STL",
        "package://foo_description/meshes/arm.STL",
        "package:///foo_description/meshes/arm.STL",
        "package://foo_description/meshes/../meshes/arm.STL",
        "package://foo_description//meshes/arm%2ESTL",
        f"file://{arm}",
        str(arm),
        "model://foo_description/meshes/arm.STL",
        " ../meshes/arm.STL".strip(),
    ):
        assert resolver.find_file(uri).path == arm, uri
        assert resolver.find_file(uri).hint is None
    assert resolver.find_file("package://bar/b.stl").path == bar
    with pytest.raises(
        ModelRefused, match=r"no package 'no_package' with a package\.xml or model\.config near"
    ):
        resolver.find_file("package://no_package/b.stl")


def test_a_relative_name_may_start_from_a_folder_that_is_given(tmp_path: Path) -> None:
    ring = placed(tmp_path / "data/gear/ring.stl")
    placed(tmp_path / "data/gear/meshes/ring.stl")
    urdf = written(tmp_path / "data/gear", robot(link("a")))
    assert "not where it says" in (Resolver(urdf).find_file("gear/ring.stl").hint or "")
    assert Resolver(urdf, [tmp_path, tmp_path / "data"]).find_file("gear/ring.stl").path == ring
    with pytest.raises(ModelRefused, match="no such file"):
        Resolver(urdf, [tmp_path / "data"]).find_file("gear/none.stl")
    assert (
        Resolver(urdf, [tmp_path / "data"]).find_file("meshes/ring.stl").path != ring
    )  # its own comes first


def test_found_with_leniency(tmp_path: Path) -> None:
    arm = placed(tmp_path / "model/meshes/Arm.STL")
    resolver = Resolver(written(tmp_path / "model", robot(link("a"))))
    for uri, words in (
        ("meshes/arm.stl", "upper and lower case"),
        ("MESHES/ARM.STL", "upper and lower case"),
        ("meshes\\Arm.STL", "backslashes"),
        ("package://renamed/meshes/Arm.STL", "model's own folder"),
        ("package://old/deep/path/meshes/Arm.STL", "model's own folder"),
    ):
        found = resolver.find_file(uri)
        assert found.path == arm, uri
        assert found.hint is not None
        assert words in found.hint


def test_package_folders_of_the_user(tmp_path: Path) -> None:
    urdf = written(tmp_path / "robots", robot(link("a")))
    one = placed(tmp_path / "one/arm_pkg/meshes/a.stl")
    two = placed(named(tmp_path / "two/src/other-name", "arm_two") / "a.stl")
    direct = placed(tmp_path / "three/arm_three/a.stl")
    with pytest.raises(ModelRefused, match=r"no package 'arm_pkg'.*--package-path"):
        Resolver(urdf).find_file("package://arm_pkg/meshes/a.stl")
    resolver = Resolver(
        urdf, [tmp_path / "one", tmp_path / "two", tmp_path / "three/arm_three", tmp_path / "gone"]
    )
    assert resolver.find_file("package://arm_pkg/meshes/a.stl").path == one
    assert resolver.find_file("package://arm_two/a.stl").path == two
    assert resolver.find_file("package://arm_three/a.stl").path == direct
    assert resolver.find_file(f"file://{one}").path == one
    with pytest.raises(ModelRefused, match="no such file"):
        resolver.find_file("package://arm_pkg/meshes/gone.stl")


def test_ros_says_where_packages_are() -> None:
    environment = {"AMENT_PREFIX_PATH": "/opt/ros/x:/ws/install", "ROS_PACKAGE_PATH": "/src:/more"}
    expected = ["/opt/ros/x/share", "/ws/install/share", "/src", "/more"]
    assert [str(p) for p in list_package_folders(environment)] == expected
    assert list_package_folders({}) == []


FILES = ("meshes/a.stl", "meshes/deep/b.obj", "meshes/deep/b.mtl", "textures/t.png", "urdf/r.urdf", "arm.dae")


def installed(folder: Path, name: str = "arm", source_name: str = "arm") -> tuple[Path, Path]:
    """A package as `colcon build --symlink-install` leaves it: (its share folder, its source)."""
    source = named(folder / "ws/src" / source_name, name)
    share = folder / "ws/install" / name / "share"
    for file in (*FILES, "package.xml"):
        if file != "package.xml":
            placed(source / file)
        (share / name / file).parent.mkdir(parents=True, exist_ok=True)
        (share / name / file).symlink_to(source / file)
    return share, source


@pytest.mark.parametrize("file", FILES[:4])
@pytest.mark.parametrize("source_name", ["arm", "arm-main"])
def test_links_of_an_installed_package_lead_to_its_source(
    file: str, source_name: str, tmp_path: Path
) -> None:
    share, source = installed(tmp_path, source_name=source_name)
    resolver = Resolver(written(tmp_path / "elsewhere", robot(link("a"))), [share])
    if file.endswith(".mtl"):
        assert (
            resolver.find_beside(resolver.find_file("package://arm/meshes/deep/b.obj").path, "b.mtl")
            == source / file
        )
    elif file.endswith(".png"):
        mesh = resolver.find_file("package://arm/meshes/deep/b.obj").path
        assert resolver.find_beside(mesh, "../../textures/t.png") == source / file
    for uri in (f"package://arm/{file}", str(share / "arm" / file), f"file://{share}/arm/{file}"):
        assert resolver.find_file(uri).path == source / file


def test_other_links_that_lead_outside_are_refused_by_where_they_lead(tmp_path: Path) -> None:
    share, source = installed(tmp_path)
    other = placed(named(tmp_path / "ws/src/other", "other") / "meshes/a.stl")
    loose = placed(tmp_path / "loose/meshes/a.stl")
    hidden = placed(named(tmp_path / ".cache/arm", "arm") / "meshes/h.stl")
    secret = placed(source / "meshes/moved.stl")
    for name, target in (
        ("other.stl", other),  # of another package
        ("a_of_other.stl", placed(other.parent / "a_of_other.stl")),  # in the same place of another package
        ("a_of_none.stl", placed(loose.parent / "a_of_none.stl")),
        ("a_too.stl", source / "meshes/a.stl"),  # elsewhere in the same package
        ("deep/moved.stl", secret),
        ("loose.stl", loose),  # of none
        ("gone.stl", tmp_path / "gone.stl"),
    ):
        (share / "arm/meshes" / name).symlink_to(target)
        for uri in (f"package://arm/meshes/{name}", str(share / "arm/meshes" / name)):
            with pytest.raises(
                ModelRefused, match=r"is a link to '.*', which is outside .*--package-path"
            ) as refused:
                Resolver(written(tmp_path / "elsewhere", robot(link("a"))), [share]).find_file(uri)
            assert target.name in refused.value.reason
        if target.exists():  # and the advice helps
            given = Resolver(written(tmp_path / "elsewhere", robot(link("a"))), [share, target.parent])
            assert given.find_file(f"package://arm/meshes/{name}").path == target
    (share / "arm/meshes/h.stl").symlink_to(hidden)
    (share / "whole").symlink_to(tmp_path / "ws/src/other")
    for uri in ("package://arm/meshes/h.stl", f"{share}/whole/meshes/a.stl"):
        with pytest.raises(ModelRefused, match="--package-path"):
            Resolver(written(tmp_path / "elsewhere", robot(link("a"))), [share]).find_file(uri)


def test_what_is_not_found_says_where_was_looked(tmp_path: Path) -> None:
    urdf = written(named(tmp_path / "bot", "bot") / "urdf", robot(link("a")))
    placed(tmp_path / "bot/visual/one/x.stl")
    for uri, words in (
        (
            "package://bot/meshes/x.stl",
            "no such file; looked for 'bot/meshes/x.stl' and any 'x.stl' in the robot's folder",
        ),
        (
            "y%20z.stl",
            "no such file; looked for 'bot/urdf/y%20z.stl' and 'bot/urdf/y z.stl' and any 'y z.stl' in",
        ),
        ("../scan.step", "no such file"),
    ):
        with pytest.raises(ModelRefused) as refused:
            Resolver(urdf).find_file(uri)
        assert words in refused.value.reason
    with pytest.raises(ModelRefused) as refused:
        Resolver(urdf, [Path.home()]).find_file("package://bot/" + "long/" * 25 + "x.stl")
    assert len(refused.value.reason) < 250


def test_what_lies_beside_a_mesh(tmp_path: Path) -> None:
    urdf = written(tmp_path / "model", robot(link("a")))
    mesh = placed(tmp_path / "model/meshes/a.obj")
    picture = tmp_path / "model/textures/skin.PNG"
    picture.parent.mkdir()
    picture.write_bytes(b"x")
    near = tmp_path / "model/meshes/near.jpg"
    near.write_bytes(b"x")
    resolver = Resolver(urdf)
    assert resolver.find_beside(mesh, "../textures/skin.PNG") == picture
    assert resolver.find_beside(mesh, "..\\textures\\skin.png") == picture
    assert resolver.find_beside(mesh, "near.jpg") == near
    assert resolver.find_beside(mesh, "C:\\Users\\artist\\near.jpg") == near
    assert resolver.find_beside(mesh, "/home/artist/near.jpg") == near
    for name in ("gone.png", "a.obj", "robot.urdf"):
        with pytest.raises(ModelRefused):
            resolver.find_beside(mesh, name)


def test_a_home_is_no_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package called like the user would be all that the user has."""
    home = tmp_path / "home/ada"
    monkeypatch.setenv("HOME", str(home))
    placed(home / "private.stl")
    urdf = written(home / "robots/r", robot(link("a")))
    with pytest.raises(ModelRefused):
        Resolver(urdf).find_file("package://ada/private.stl")
    with pytest.raises(ModelRefused):
        Resolver(urdf).find_file("package://home/ada/private.stl")
