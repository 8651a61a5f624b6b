from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest
from model_stage import shared_robot
from posecast_edge.model.serve.bundle import RANGE_MAX, Bundle, ModelError, load_built, load_bundle


def urdf(path: Path, *uris: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    links = "".join(f'<visual><geometry><mesh filename="{u}"/></geometry></visual>' for u in uris)
    path.write_text(f'<?xml version="1.0"?><robot name="r"><link name="l">{links}</link></robot>')
    return path


def mesh(path: Path, data: bytes = b"solid") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return path


def found(bundle: Bundle) -> dict[str, str]:
    return {f.uri: str(f.source) for f in bundle.files[1:]}


def test_manifest_says_what_there_is(tmp_path: Path) -> None:
    a = mesh(tmp_path / "meshes/a.stl", b"aaaa")
    bundle = load_bundle(urdf(tmp_path / "robot.urdf", "meshes/a.stl", "meshes/a.stl", "meshes/gone.stl"))
    manifest = json.loads(bundle.manifest)
    assert bundle.hash == hashlib.sha256(bundle.manifest).hexdigest()
    assert manifest["v"] == 1
    assert manifest["urdf"] == "robot.urdf"
    assert manifest["missing"] == ["meshes/gone.stl"]
    assert [(f["path"], f["uri"], f["size"], f["type"]) for f in manifest["files"]] == [
        ("robot.urdf", "robot.urdf", (tmp_path / "robot.urdf").stat().st_size, "application/xml"),
        ("meshes/a.stl", "meshes/a.stl", 4, "model/stl"),
    ]
    assert manifest["files"][1]["sha256"] == hashlib.sha256(a.read_bytes()).hexdigest()


def test_every_way_to_name_a_mesh(tmp_path: Path) -> None:
    a = mesh(tmp_path / "ws/foo/meshes/a.stl")
    b = mesh(tmp_path / "ws/bar/b.DAE")
    for package in ("foo", "bar"):
        (tmp_path / "ws" / package / "package.xml").write_text("<package/>")
    uris = [
        "../meshes/a.stl",
        "package://foo/meshes/a.stl",
        "package:///foo/meshes/a.stl",
        "package://renamed/meshes/a.stl",
        "package://old_ws/src/foo/meshes/a.stl",
        "package://bar/b.DAE",
        f"file://{a}",
    ]
    bundle = load_bundle(urdf(tmp_path / "ws/foo/urdf/r.urdf", *uris))
    assert bundle.missing == ()
    assert found(bundle) == {u: str(b if "bar" in u else a) for u in uris}
    paths = [f.path for f in bundle.files]
    assert len(set(paths)) == len(paths)


def test_same_names_get_paths_of_their_own(tmp_path: Path) -> None:
    mesh(tmp_path / "one/a b.stl", b"1")
    mesh(tmp_path / "two/a b.stl", b"2")
    bundle = load_bundle(urdf(tmp_path / "r.urdf", "one/a%20b.stl", "two/a b.stl"))
    assert [f.path for f in bundle.files] == ["r.urdf", "meshes/a_b.stl", "meshes/2/a_b.stl"]


def test_nothing_outside_is_served(tmp_path: Path) -> None:
    home = tmp_path / "home"
    outside = mesh(tmp_path / "secret.stl")
    key = mesh(home / ".ssh/id_rsa")
    mesh(home / "robot/notes.txt")
    (home / "robot").mkdir(exist_ok=True)
    (home / "robot/link.stl").symlink_to(outside)
    (home / "robot/loop.stl").symlink_to(home / "robot/loop.stl")
    uris = [
        "../../secret.stl",
        f"file://{outside}",
        str(outside),
        "link.stl",
        "loop.stl",
        "notes.txt",
        "package://.ssh/id_rsa",
        f"file://{key}",
        "package://robot/../../secret.stl",
        "package://../secret.stl",
        "package://x/../secret.stl",
        "package://[bad/x.stl",
        "http://example.org/a.stl",
        "",
        "a\u0000.stl".replace("\u0000", "%00"),
    ]
    bundle = load_bundle(urdf(home / "robot/r.urdf", *uris))
    assert found(bundle) == {}
    assert set(bundle.missing) == {u for u in uris if u}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot><link></robot>", "line 1: not XML: mismatched tag"),
        ("", "the file is empty"),
        (" ", "line 1: not XML: no element found"),
        ("<sdf/>", "line 1: this is SDF, not URDF"),
        ('<!DOCTYPE r [<!ENTITY a "b">]><robot>&a;</robot>', "line 1: a document type (DTD) is not accepted"),
        (
            "<robot>" + "".join(f"<p{i}:a/>" for i in range(1001)) + "</robot>",
            "line 1: more than 1000 prefixes",
        ),
        ("<robot>" + "<a>" * 70 + "</a>" * 70 + "</robot>", "line 1: nested more than 64 deep"),
        ("\x00\x01", "binary data, not a robot description"),
    ],
)
def test_a_urdf_that_does_not_parse(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "r.urdf"
    path.write_text(text)
    with pytest.raises(ModelError) as caught:
        load_bundle(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_a_urdf_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"x\.urdf: No such file"):
        load_bundle(tmp_path / "x.urdf")


def test_ranges(tmp_path: Path) -> None:
    data = bytes(range(256)) * 2000
    mesh(tmp_path / "a.stl", data)
    bundle = load_bundle(urdf(tmp_path / "r.urdf", "a.stl"))
    sha = bundle.files[1].sha256
    parts = [bundle.read(sha, o, RANGE_MAX) for o in range(0, len(data), RANGE_MAX)]
    assert b"".join(parts) == data
    assert bundle.read(sha, len(data), 1) == b""
    assert bundle.read("manifest", 0, RANGE_MAX) == bundle.manifest
    assert bundle.read("manifest", 7, 5) == bundle.manifest[7:12]
    assert bundle.read("manifest", len(bundle.manifest), 5) == b""
    for offset, length in ((-1, 1), (len(data) + 1, 1), (0, 0), (0, RANGE_MAX + 1)):
        with pytest.raises(ValueError, match="no range"):
            bundle.read(sha, offset, length)
    with pytest.raises(KeyError):
        bundle.read("0" * 64, 0, 1)


@pytest.mark.parametrize(
    ("name", "files", "missing"),
    [("hubo2plus-stl", 31, 20), ("drchubo", 38, 0), ("hubo2plus-collada", 86, 0), ("g1", 36, 0)],
)
def test_real_robots(name: str, files: int, missing: int) -> None:
    bundle = load_bundle(shared_robot(name))
    assert (len(bundle.files), len(bundle.missing)) == (files, missing)


def test_a_built_model_is_offered_as_it_is(tmp_path: Path) -> None:
    shells = b"glTF" * 100
    digest = hashlib.sha256(shells).hexdigest()
    named = {"path": "low.glb", "size": len(shells), "sha256": digest}
    (tmp_path / "manifest.json").write_text(json.dumps({"v": 2, "files": [named], "links": ["a", "b"]}))
    (tmp_path / "low.glb").write_bytes(shells)
    bundle = load_built(tmp_path)
    assert bundle.links == {"a", "b"}
    assert bundle.manifest == (tmp_path / "manifest.json").read_bytes()
    assert bundle.hash == hashlib.sha256(bundle.manifest).hexdigest()
    assert bundle.read(digest, 4, 8) == shells[4:12]
    (tmp_path / "low.glb").write_bytes(shells + b"x")
    with pytest.raises(ModelError, match=r"low\.glb is larger than the manifest says"):
        load_built(tmp_path)
    (tmp_path / "low.glb").unlink()
    with pytest.raises(ModelError, match=r"not a built model, low\.glb is missing"):
        load_built(tmp_path)


def test_a_file_where_the_folder_should_be_is_named_once(tmp_path: Path) -> None:
    (tmp_path / "bundle").touch()
    with pytest.raises(ModelError) as refused:
        load_built(tmp_path / "bundle")
    assert str(refused.value) == f"{tmp_path}/bundle/manifest.json: Not a directory"


def test_a_bundle_knows_its_links_and_which_joints_slide(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    joints = "".join(
        f'<joint name="{kind} one" type="{kind}"><parent link="a"/><child link="{kind}"/>'
        '<limit lower="0" upper="1" velocity="1" effort="1"/></joint><link name="' + kind + '"/>'
        for kind in ("prismatic", "revolute")
    )
    path.write_text(f'<robot name="r"><link name="a"/>{joints}</robot>')
    assert load_bundle(path).sliding == {"prismatic one"}
    assert load_bundle(path).links == {"a", "prismatic", "revolute"}
    built: list[object] = [{"name": "x", "type": "prismatic"}, {"name": "y", "type": "fixed"}, 7]
    for of_manifest, sliding in ((built, {"x"}), (3, set())):
        manifest = {"v": 2, "links": ["a"], "joints": of_manifest, "files": []}
        (tmp_path / "manifest.json").write_text(json.dumps(manifest))
        assert load_built(tmp_path).sliding == sliding
