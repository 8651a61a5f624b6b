# ruff: noqa: E501 - the corpus is a table: one file, one line
"""Hostile files: refused early, for little memory, in one line, and the rest of the robot is shown."""

from __future__ import annotations

import gc
import io
import json
import os
import struct
import time
import xml.etree.ElementTree as ElementTree
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from model_stage import build_robot, cube_collada, cube_glb, cube_obj, cube_stl, link, mesh, robot, written
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.reader import read_mesh
from posecast_edge.model.serve.bundle import ModelError, load_bundle
from posecast_edge.model.serve.bundle_dir import read_folder, write_folder
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import OUTSIDE, Resolver

HONEST_READINGS = 100  # the worst takes 20; `pytest -s` shows seconds, of which the goal is 0.5
SURELY_LITTLE_S = 0.2
MEGABYTES = 50

HONEST = "<honest>" + '<a b="c">d</a>' * 20_000 + "</honest>"


@contextmanager
def bounded() -> Iterator[None]:
    """What happens inside takes little time and little memory (peak of the process's resident set)."""
    gc.collect()
    try:
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
    except OSError:
        pytest.skip("no way to measure memory here")
    before, start = _kilobytes("VmRSS"), time.thread_time()
    yield
    seconds, grown = time.thread_time() - start, (_kilobytes("VmHWM") - before) / 1024
    print(f"{seconds:.3f} s, {grown:.1f} MB")
    if seconds > SURELY_LITTLE_S:
        assert seconds < HONEST_READINGS * (honest_s := honest_reading_s()), (
            f"{seconds:.2f} s, honest: {honest_s:.3f} s"
        )
    assert grown < MEGABYTES, f"{grown:.0f} MB"


def honest_reading_s() -> float:
    """What a harmless XML file of 20,000 elements takes the standard library, now: what shares the core slows it too."""
    start = time.thread_time()
    ElementTree.fromstring(HONEST)
    return time.thread_time() - start


def _kilobytes(name: str) -> int:
    status = Path("/proc/self/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith(name)).split()[1])


LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
URDFS = {
    "billion laughs": (f'<!DOCTYPE r [<!ENTITY l0 "ha">{LAUGHS}]><robot name="&l9;"/>', "DTD"),
    "quadratic": (f'<!DOCTYPE r [<!ENTITY a "{"a" * 100_000}">]><robot>{"&a;" * 5_000}</robot>', "DTD"),
    "external entity": ('<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]><robot name="&x;"/>', "DTD"),
    "external DTD": ('<!DOCTYPE robot SYSTEM "http://127.0.0.1:1/r.dtd"><robot/>', "DTD"),
    "parameter entity": ('<!DOCTYPE r [<!ENTITY % p SYSTEM "file:///etc/passwd"> %p;]><robot/>', "DTD"),
    "200,000 deep": ("<robot>" + "<a>" * 200_000, "nested"),
    "wide": ("<robot>" + '<link name="a"/>' * 100_000 + "</robot>", "more than"),
    "many attributes": ("<robot " + " ".join(f'a{i}=""' for i in range(700_000)) + "/>", "a tag larger"),
    "one long attribute": (f'<robot name="{"x" * 7_000_000}"/>', "a tag larger"),
    "long": (f"<robot>{'<!-- -->' * 2_000_000}</robot>", "larger than 8 MiB"),
    "many links": ("<robot>" + "".join(link(f"l{i}") for i in range(1_100)) + "</robot>", "1000 links"),
    "many visuals": (robot(link("a", "<visual/>" * 2_100)), "visuals"),
}


@pytest.mark.parametrize("name", URDFS)
def test_urdfs(name: str, tmp_path: Path) -> None:
    """Read for the mesh tools, and on the way that needs none."""
    text, reason = URDFS[name]
    with bounded(), pytest.raises(ModelRefused, match=reason) as refused:
        read_urdf(io.BytesIO(text.encode()))
    assert len(refused.value.reason) < 200
    (tmp_path / "robot.urdf").write_text(text)
    with bounded(), pytest.raises(ModelError, match=reason) as unsent:
        load_bundle(tmp_path / "robot.urdf")
    assert "\n" not in str(unsent.value)


def png_of(width: int, height: int) -> bytes:
    """A PNG that claims a size and holds nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b"")
    )


def stl_claiming(count: int) -> bytes:
    return bytes(80) + struct.pack("<I", count)


def stl_with(value: float) -> bytes:
    data = bytearray(cube_stl())
    struct.pack_into("<f", data, 84 + 12, value)
    return bytes(data)


def doubling(levels: int) -> bytes:
    """Collada nodes of which each shows the next one twice."""
    nodes = "".join(
        f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
        for i in range(levels)
    )
    last = f'<node id="n{levels}"><instance_geometry url="#g"/></node>'
    library = f"<library_nodes>{nodes}{last}</library_nodes>".encode()
    data = cube_collada(node='<instance_node url="#n0"/>')
    return data.replace(b"<library_visual_scenes>", library + b"<library_visual_scenes>")


def changed(key: str, index: int, **values: object) -> Callable[[dict[str, object]], None]:
    def change(document: dict[str, object]) -> None:
        document[key][index] |= values  # type: ignore[index]

    return change


def coloured(factor: list[object]) -> Callable[[dict[str, object]], None]:
    material = {"pbrMetallicRoughness": {"baseColorFactor": factor}}
    return lambda document: document.update(materials=[material])


def deep_json(data: bytes) -> bytes:
    text = b'{"asset":' + b"[" * 200_000
    text += b" " * (-len(text) % 4)
    return data[:12] + struct.pack("<I4s", len(text), b"JSON") + text


COLLADA_LAUGHS = f'<!DOCTYPE c [<!ENTITY l0 "ha">{LAUGHS}]><COLLADA>&l9;</COLLADA>'.encode()
MESHES: dict[str, tuple[str, bytes, str]] = {
    "four billion triangles": ("a.stl", stl_claiming(4_000_000_000), "claims 4,000,000,000 triangles"),
    "one triangle too many": ("a.stl", stl_claiming(13) + cube_stl()[84:], "claims 13 triangles, the file has room for 12"),
    "NaN": ("a.stl", stl_with(float("nan")), "not finite"),
    "infinite": ("a.stl", stl_with(float("inf")), "not finite"),
    "beyond the moon": ("a.stl", stl_with(1e30), "km away"),
    "a page": ("a.stl", b"<!doctype html>\n<html><body>not found</body></html>", "HTML"),
    "a page with a blank": ("a.dae", b"\n\n  <html>", "HTML"),
    "nothing": ("a.stl", b"", "empty"),
    "zeros": ("a.stl", bytes(84), "no triangles"),
    "text without end": ("a.stl", b"solid x\nfacet normal 0 0 0\nvertex 1 2 3\nvertex 1 2", "within a triangle"),
    "text of words": ("a.stl", b"solid x\nfacet normal 0 0 0\n" + b"vertex a b c\n" * 3, "not a number"),
    "laughs": ("a.dae", COLLADA_LAUGHS, "DTD"),
    "deep collada": ("a.dae", b"<COLLADA>" + b"<a>" * 200_000, "nested"),
    "wide collada": ("a.dae", b"<COLLADA>" + b"<p/>" * 250_000 + b"</COLLADA>", "more than 200000 elements"),
    "doubling nodes": ("a.dae", doubling(40), "nodes"),
    "stride of nothing": ("a.dae", cube_collada().replace(b'stride="3"', b'stride="0"'), "stride"),
    "corners beyond": ("a.dae", cube_collada().replace(b"<p>0 ", b"<p>99 "), "refers to a vertex"),
    "corners before": ("a.dae", cube_collada().replace(b"<p>0 ", b"<p>-9 "), "refers to a vertex"),
    "words for numbers": ("a.dae", cube_collada().replace(b"<p>0 ", b"<p>zero "), "other than numbers"),
    "huge polygon": (
        "a.dae",
        cube_collada().replace(b"<triangles", b"<polylist").replace(b"</triangles>", b"</polylist>")
        .replace(b"<p>", b"<vcount>4000000000</vcount><p>"),
        "more corners",
    ),
    "a zip": ("a.dae", b"PK\x03\x04" + bytes(100), "zip"),
    "gzip": ("a.stl", b"\x1f\x8b" + bytes(100), "unpack it"),
    "faces beyond": ("a.obj", cube_obj() + b"f 1 2 99\n", "refers to a vertex"),
    "faces before": ("a.obj", cube_obj() + b"f 1 2 -99\n", "refers to a vertex"),
    "obj of words": ("a.obj", b"v a b c\nf 1 1 1\n", "not a list of numbers"),
    "obj of nothing": ("a.obj", b"# only a comment\n", "not STL, Collada, OBJ or glTF"),
    "glb of four billion": ("a.glb", cube_glb(changed("accessors", 0, count=4_000_000_000)), "claims 4,000,000,000"),
    "glb of less than none": ("a.glb", cube_glb(changed("accessors", 0, count=-1)), "whole number"),
    "glb beyond its data": ("a.glb", cube_glb(cut=50), "more data than it has"),
    "glb in a circle": ("a.glb", cube_glb(changed("nodes", 0, children=[0, 0])), "nodes"),
    "glb with deep JSON": ("a.glb", deep_json(cube_glb()), "JSON"),
    "glb elsewhere": ("a.glb", cube_glb(changed("buffers", 0, uri="../../../etc/passwd")), "its file '../../../etc/passwd': no such"),
    "glb without type": ("a.glb", cube_glb(changed("accessors", 0, type="__proto__")), "broken"),
    "glb squeezed": ("a.glb", cube_glb(lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"])), "draco"),
    "glb with sparse": ("a.glb", cube_glb(changed("accessors", 0, sparse={"count": 10**9})), "sparse"),
    "data that are none": ("a.glb", cube_glb(changed("buffers", 0, uri="data:;base64,AAA")), "broken"),
    "data in words": ("a.glb", cube_glb(changed("buffers", 0, uri="data:text/plain,hello")), "not base64"),
    "glTF": ("a.gltf", b"{}", "no triangles"),
    "a vertex of 30 digits": ("a.obj", cube_obj() + b"f 1 2 " + b"9" * 30, "refers to a vertex"),
    "a texture of 30 digits": ("a.obj", cube_obj() + b"f 1/1 2/1 3/" + b"9" * 30, "refers to a vertex"),
    "a vertex of 5,000 digits": ("a.obj", cube_obj() + b"f 1 2 " + b"9" * 5000, "not a list of numbers"),
    "vertices of two numbers": ("a.obj", b"v 0 0\n" * 3 + b"f 1 2 1\n", "not a list of numbers"),
    "polygons whose sum is none": (
        "a.dae",
        cube_collada()
        .replace(b"triangles", b"polylist")
        .replace(b"<p>", b"<vcount>9223372036854775807 9223372036854775807 4</vcount><p>"),
        "more corners",
    ),
    "a need nested deep": ("a.glb", cube_glb(lambda d: d.update(extensionsRequired=[[]])), "broken"),
}  # fmt: skip


@pytest.mark.parametrize("name", MESHES)
def test_meshes(name: str, tmp_path: Path) -> None:
    file, data, reason = MESHES[name]
    (tmp_path / file).write_bytes(data)
    resolver = Resolver(tmp_path / "robot.urdf")
    with bounded(), pytest.raises(ModelRefused) as refused:
        read_mesh(tmp_path / file, resolver)
    assert reason in refused.value.reason
    assert len(refused.value.reason) < 200
    assert refused.value.reason.isprintable()


def test_the_rest_of_the_robot_is_shown(tmp_path: Path) -> None:
    parts = [link("base", mesh("meshes/good.stl"))]
    for i, (file, data, _) in enumerate(MESHES.values()):
        name = f"m{i}.{file.partition('.')[2]}"
        (tmp_path / "meshes").mkdir(exist_ok=True)
        (tmp_path / "meshes" / name).write_bytes(data)
        ends = f'<parent link="base"/><child link="l{i}"/><origin xyz="0 0 {i}"/>'
        parts += [link(f"l{i}", mesh(f"meshes/{name}")), f'<joint name="j{i}" type="fixed">{ends}</joint>']
    path = written(tmp_path, robot(*parts), good_stl=cube_stl())
    built = build_robot(path)
    visuals = built.document["visuals"]
    assert len(visuals) == 1 + len(MESHES)
    assert "placeholder" not in visuals[0]
    reasons = [v["placeholder"] for v in visuals[1:]]
    assert all(reason in said for said, (_, _, reason) in zip(reasons, MESHES.values(), strict=True))
    assert [m["reason"] for m in built.document["missing"]] == reasons
    codes = {f.code for f in built.findings if f.severity == "error"}
    assert codes == {"mesh-broken"}


OUTSIDERS = [
    "package://../../secret.stl",
    "package://model/../secret.stl",
    "package://model/%2e%2e/secret.stl",
    "package://other/../secret.stl",
    "package:///../secret.stl",
    "../secret.stl",
    "meshes/../../secret.stl",
    "..\\secret.stl",
    "meshes/link.stl",
    "linked/secret.stl",
    "file://{outside}/secret.stl",
    "{outside}/secret.stl",
    "file:///etc/passwd",
    "/etc/passwd",
    "meshes/loop.stl",
    "http://127.0.0.1:1/secret.stl",
    "ftp://127.0.0.1/secret.stl",
    "data:model/stl;base64,AAAA",
    "meshes/a.stl\0.png",
    "meshes/" + "x" * 5000 + ".stl",
    "meshes/" + "x/" * 2000 + "a.stl",
    "http://[bad/a.stl",
    "",
    ".",
    "meshes",
]


def test_nothing_outside_is_found(tmp_path: Path) -> None:
    folder = tmp_path / "ws" / "model"
    path = written(folder, robot(link("a")))
    (tmp_path / "ws" / "secret.stl").write_bytes(cube_stl())
    (folder / "meshes" / "link.stl").symlink_to("../../secret.stl")
    (folder / "linked").symlink_to("..")
    (folder / "meshes" / "loop.stl").symlink_to("loop.stl")
    resolver = Resolver(path)
    before = sorted(tmp_path.rglob("*"))
    with bounded():
        for uri in OUTSIDERS:
            with pytest.raises(ModelRefused):
                resolver.find_file(uri.format(outside=tmp_path / "ws"))
    for name in ("../../secret.stl", "../../../etc/passwd", "x\0.png", "http://127.0.0.1:1/t.png", ""):
        with pytest.raises(ModelRefused):
            resolver.find_beside(folder / "meshes" / "a.obj", name)
    assert sorted(tmp_path.rglob("*")) == before


def test_outside_says_nothing_of_what_is_there(tmp_path: Path) -> None:
    path = written(tmp_path / "model", robot(link("a")))
    (tmp_path / "there.stl").write_bytes(cube_stl())
    for name in ("there", "not-there"):
        with pytest.raises(ModelRefused) as refused:
            Resolver(path).find_file(f"../{name}.stl")
        assert refused.value.reason == OUTSIDE


def test_pictures(tmp_path: Path) -> None:
    """A hostile picture costs the texture, not the mesh."""
    pictures = {
        "bomb.png": png_of(100_000, 100_000),
        "large.png": png_of(9_000, 9_000),
        "empty.png": png_of(64, 64),
        "page.png": b"<html></html>",
        "../../secret.png": b"",
    }
    for name, data in pictures.items():
        if "/" not in name:
            (tmp_path / name).write_bytes(data)
        (tmp_path / "a.mtl").write_text(f"newmtl skin\nKd 1 0 0\nmap_Kd {name}\n")
        (tmp_path / "a.obj").write_bytes(cube_obj("mtllib a.mtl\nusemtl skin\n"))
        with bounded():
            read = read_mesh(tmp_path / "a.obj", Resolver(tmp_path / "robot.urdf"))
        [surface] = read.surfaces
        assert surface.paint is not None
        assert surface.paint.texture is None
        assert surface.paint.rgba == (1, 0, 0, 1)
        assert [code for code, _ in read.notes] == ["texture"]


def test_names_are_kept_as_text(tmp_path: Path) -> None:
    names = ["__proto__", "constructor", "<img src=x onerror=alert(1)>", "</script>", "a'b\"c"]
    parts = [link("base")]
    for i, name in enumerate(names):
        safe = name.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
        ends = f'<parent link="base"/><child link="{safe}"/>'
        parts += [link(safe), f'<joint name="{safe}{i}" type="fixed">{ends}</joint>']
    path = written(tmp_path, robot(*parts))
    built = build_robot(path)
    document = json.loads(built.manifest)
    assert document["links"] == ["base", *names]
    assert all(v["node"] == f"v{i}" for i, v in enumerate(document["visuals"]))
    assert {f.code for f in built.findings} == {"name-odd"}


def spoiled(folder: Path, change: Callable[[dict[str, object]], None]) -> None:
    manifest = json.loads((folder / "manifest.json").read_bytes())
    change(manifest)
    (folder / "manifest.json").write_text(json.dumps(manifest))


def test_bundles_that_are_not_whole(tmp_path: Path) -> None:
    path = written(tmp_path / "model", robot(link("a")))
    built = build_robot(path)
    files = {**built.files, "manifest.json": built.manifest}
    out = tmp_path / "bundle"

    def refused(reason: str) -> None:
        with bounded(), pytest.raises(ModelRefused, match=reason):
            read_folder(out)
        write_folder(out, files)
        assert read_folder(out) == files

    write_folder(out, files)
    data = bytearray(files["high.glb"])
    data[100] ^= 1
    (out / "high.glb").write_bytes(data)
    refused("high.glb does not match the manifest")
    (out / "high.glb").write_bytes(bytes(10_000_000))
    refused("larger than the manifest says")
    (out / "high.glb").unlink()
    (out / "high.glb").symlink_to("/etc/passwd")
    refused("is a link")
    for bad in ("../high.glb", "/etc/passwd", "a/b", "", "manifest.json", "x" * 200, 7, None):
        spoiled(out, lambda m, bad=bad: m["files"][0].update(path=bad))  # type: ignore[misc]
        with pytest.raises(ModelRefused, match="invalid file entries"):
            read_folder(out)
        write_folder_over(out, files)
    (out / "manifest.json").write_text("[" * 200_000)
    with bounded(), pytest.raises(ModelRefused, match="its manifest is invalid"):
        read_folder(out)
    (out / "manifest.json").write_bytes(b" " * 2_000_000)
    with bounded(), pytest.raises(ModelRefused, match="larger"):
        read_folder(out)


def write_folder_over(out: Path, files: dict[str, bytes]) -> None:
    for name, data in files.items():
        (out / name).write_bytes(data)


def test_numbers_without_end(tmp_path: Path) -> None:
    """A long list of numbers is read within bounds, not refused: it is a mesh."""
    corners = np.zeros((100_000, 3))
    corners[:, 0] = np.arange(100_000)
    text = (
        "".join(f"v {x:g} 0 0\n" for x in corners[:, 0]) + "f " + " ".join(map(str, range(1, 100_001))) + "\n"
    )
    (tmp_path / "a.obj").write_text(text)
    assert read_mesh(tmp_path / "a.obj", Resolver(tmp_path / "r.urdf")).triangles == 99_998
    assert os.path.getsize(tmp_path / "a.obj") > 1_000_000
