"""Parsers of a robot's description, its bundle and its pictures, with the worst input that is known."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

from mesh_parsers import png
from model_stage import PICTURE, ROBOT_OF_ALL, cube_stl, joint, link, mesh, robot
from parser_stage import Input, Parser, Work, Worst, written
from PIL import Image
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.texture import Pictures, compute_mean_colour, fit_picture
from posecast_edge.model.serve.bundle import ModelError, load_bundle
from posecast_edge.model.serve.bundle_dir import list_entries
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.tree import build_tree


def urdf_work(given: Input, folder: Path) -> Work:
    """Read, hung together, examined."""

    def work() -> None:
        urdf = read_urdf(io.BytesIO(given.data))
        examine_model(urdf, build_tree(urdf), {})

    return work


def bundle_work(given: Input, folder: Path) -> Work:
    """The files it names, found."""
    path = written(given, folder, "robot.urdf")
    return lambda: load_bundle(path)


def picture_work(given: Input, folder: Path) -> Work:
    """As a texture."""

    def work() -> None:
        fit_picture.cache_clear()
        compute_mean_colour.cache_clear()
        Pictures().validate(given.data)
        fit_picture(given.data, 128)
        compute_mean_colour(given.data)

    return work


def saved(kind: str, side: int = 8, frames: int = 1, **more: object) -> bytes:
    """Pictures that differ, in one file."""
    out = io.BytesIO()
    first, *others = (Image.new("L", (side, side), i % 256) for i in range(frames))
    if others:
        more |= {"save_all": True, "append_images": others}
    first.save(out, kind, **more)
    return out.getvalue()


def jpeg_scans(n: int) -> bytes:
    """A progressive picture that grows, and scans which change none of its pixels."""
    scan = b"\xff\xda\x00\x08\x01\x01\x00\x01\x3f\x00"
    return saved("JPEG", 40 * round(n**0.5), progressive=True)[:-2] + scan * n + b"\xff\xd9"


def png_chunks(n: int) -> bytes:
    said = b"tEXta\0b"
    chunk = struct.pack(">I", len(said) - 4) + said + struct.pack(">I", zlib.crc32(said))
    whole = png(8)
    return whole[:33] + chunk * n + whole[33:]  # behind its head


def tiff_tags(n: int) -> bytes:
    """Its directory with tags that nobody knows, before and behind the known ones."""
    whole = saved("TIFF")
    at = int.from_bytes(whole[4:8], "little")
    count = int.from_bytes(whole[at : at + 2], "little")
    known = whole[at + 2 : at + 2 + 12 * count]
    own = b"".join(struct.pack("<HHII", 60_000 + i % 5000, 4, 1, i) for i in range(n))
    end = len(whole).to_bytes(4, "little")
    return whole[:4] + end + whole[8:] + struct.pack("<H", count + n) + known + own + bytes(4)


def links(n: int, joints: Callable[[int], str]) -> bytes:
    """Links in a chain; LINKS_MAX of them."""
    return robot(link("l0"), *(link(f"l{i}") + joints(i) for i in range(1, n))).encode()


def urdf_mimics(n: int) -> bytes:
    """Each joint mimics the next one."""
    inside = '<axis xyz="0 0 1"/><mimic joint="j{}"/>'
    return links(n, lambda i: joint(f"j{i}", f"l{i - 1}", f"l{i}", inside=inside.format(i + 1)))


def urdf_expressions(n: int, value: str = "${x}") -> bytes:
    """Where xacro should have put numbers."""
    return robot(*(link(f"l{i}", f'<inertial><mass value="{value}"/></inertial>') for i in range(n))).encode()


def urdf_one_name(n: int) -> Input:
    """One file under ever new addresses."""
    parts = [mesh(f"package://p/a.stl?{i}") for i in range(n)]
    return Input(robot(link("a", "".join(parts))).encode(), {"a.stl": cube_stl()})


ENTRY = {"path": "high.glb", "size": 12, "sha256": "a" * 64, "type": "model/gltf-binary"}


def manifest(files: list[dict[str, object]]) -> bytes:
    return json.dumps({"v": 2, "files": files}).encode()


REFUSED = (ModelRefused,)
PARSERS = (
    Parser(
        "urdf",
        (
            "model.urdf.reader.read_urdf",
            "model.urdf.reader.load_urdf",
            "model.urdf.xml_tree.parse_xml",
            "model.urdf.xml_tree.read_at_most",
            "model.urdf.xml_tree.read_root_tag",
            "model.text.read_robot_text",
            "model.robot_file.load_robot_file",
        ),
        urdf_work,
        REFUSED,
        (ROBOT_OF_ALL,),
        {
            "shapes in one geometry": Worst(
                lambda n: robot(link("a", f"<visual><geometry>{'<x/>' * n}</geometry></visual>")).encode(),
                500,
            ),
            "mimics in a chain": Worst(urdf_mimics, 62),
            "links in a chain": Worst(lambda n: links(n, lambda i: joint(f"j{i}", f"l{i - 1}", f"l{i}")), 62),
            "joints of one name": Worst(
                lambda n: robot(*(joint("j", "a", "b") for _ in range(n))).encode(), 100
            ),
            "blanks": Worst(lambda n: b" " * n + ROBOT_OF_ALL, 60_000),
            "comments": Worst(lambda n: b"<!---->" * n + ROBOT_OF_ALL, 5000),
            "a comment": Worst(lambda n: b"<!--" + b"-x" * n + b"-->" + ROBOT_OF_ALL, 30_000),
            "one attribute": Worst(lambda n: robot(link("x" * n)).encode(), 50_000),
            "texts": Worst(lambda n: robot("<a>x</a>" * n).encode(), 1000),
            "macros of xacro": Worst(lambda n: robot("<xacro:a/>" * n).encode(), 500),
            "expressions of xacro": Worst(urdf_expressions, 60),
            "a long expression": Worst(lambda n: urdf_expressions(1, "${" * n), 20_000),
        },
    ),
    Parser(
        "bundle",
        ("model.serve.bundle.load_bundle",),
        bundle_work,
        (ModelError,),
        (ROBOT_OF_ALL,),
        {"files of one name": Worst(urdf_one_name, 60)},
    ),
    Parser(
        "manifest",
        (
            "model.serve.bundle.load_built",
            "model.serve.bundle.Bundle.read",
            "model.serve.bundle_dir.read_folder",
        ),
        lambda given, folder: lambda: list_entries(given.data),
        REFUSED,
        (manifest([ENTRY]),),
        {"entries": Worst(lambda n: manifest([ENTRY] * n), 500), "brackets": Worst(lambda n: b"[" * n, 5000)},
    ),
    Parser(
        "picture",
        ("model.meshes.texture.Pictures.validate", "model.meshes.texture.fit_picture"),
        picture_work,
        REFUSED,
        (PICTURE, png(3)),
        {
            "one colour": Worst(lambda n: png(round(n**0.5)), 200_000),
            "empty scans": Worst(jpeg_scans, 90),
            "chunks": Worst(png_chunks, 1000),
            "frames": Worst(lambda n: saved("GIF", frames=n), 20),
            "tags": Worst(tiff_tags, 1000),
        },
    ),
)
