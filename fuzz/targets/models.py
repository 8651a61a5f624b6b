"""Robots' bodies as an edge reads them: URDF (as the page does), SDF, MuJoCo, xacro, and meshes."""

from __future__ import annotations

import dis
import html
import io
import math
import re
import struct
import tempfile
import unicodedata
from collections.abc import Callable
from pathlib import Path
from types import CodeType
from typing import Any

from posecast_edge.cli.profile_new import make_profile_text
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.collada import read_collada
from posecast_edge.model.meshes.gltf import MALFORMED, read_gltf
from posecast_edge.model.meshes.mesh import Mesh, validate_mesh
from posecast_edge.model.meshes.obj import read_obj
from posecast_edge.model.meshes.reader import read_stl, split_all_by_colour
from posecast_edge.model.mjcf.compiled import read_model
from posecast_edge.model.mjcf.files import list_names
from posecast_edge.model.mjcf.reader import make_robot
from posecast_edge.model.sdf.reader import load_sdf, read_sdf
from posecast_edge.model.urdf.reader import read_urdf
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import Inertial, Joint, Shape, Urdf
from posecast_edge.model.xacro.child import ExpressionRefused, compile_expression
from posecast_edge.profile.reader import ProfileError, parse_profile

from fuzz.differ import agree, plain
from fuzz.page_reader import ask
from fuzz.target import Differs, Target

INCLUDING = "<sdf><model name='m'><link name='l'/><include><uri>a.urdf</uri></include></model></sdf>"
ENCODING = re.compile(rb"<\?xml[^>]*encoding\s*=\s*[\"'](?!utf-8)", re.IGNORECASE)


def urdf(data: bytes) -> None:
    """The same verdict, and the same robot. Not in older encodings: browsers and Python disagree about their
    rarest letters."""
    if ENCODING.search(data) or b"\0" in data:
        read_urdf(io.BytesIO(data))
        return
    try:
        agree(lambda: read_urdf(io.BytesIO(data)), lambda: ask("urdf", data), (ModelRefused,), shown_urdf)
    except Differs:
        if not _is_new(html.unescape(data.decode(errors="replace"))):
            raise


def _is_new(text: str) -> bool:
    """Whether it has characters that this Python's Unicode does not know yet: Node's may, and shows them."""
    return any(unicodedata.category(letter) == "Cn" for letter in text)


def sdf(data: bytes) -> None:
    """What is made of an SDF: a tree whose links stand somewhere, and what the doctor says."""
    found = read_sdf(data)
    tree = build_tree(found)
    for finding in examine_model(found, tree, {}):
        said = finding.format_line("robot.sdf")
        if not said.isprintable() or len(said) > 900:
            raise Differs(f"the doctor says {said[:100].encode('ascii', 'backslashreplace').decode()}")
    if not all(math.isfinite(v) for joint in found.joints for v in (*joint.pose.xyz, *joint.pose.rpy)):
        raise Differs("a joint stands nowhere")


def included(data: bytes) -> None:
    """A URDF that an SDF includes: where it stands, as long as it stands somewhere by itself."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "a.urdf").write_bytes(data)
        path = Path(folder) / "a.sdf"
        path.write_text(INCLUDING)
        found, _ = load_sdf(path, Resolver(path))
    build_tree(found)
    if not all(math.isfinite(v) for joint in found.joints for v in (*joint.pose.xyz, *joint.pose.rpy)):
        raise Differs("a joint stands nowhere")


def body(data: bytes) -> None:
    """What is made of a URDF: its tree, what the doctor says, a profile that can be read."""
    found = read_urdf(io.BytesIO(data))
    tree = build_tree(found)
    for finding in examine_model(found, tree, {}):
        said = finding.format_line("robot.urdf")
        if not said.isprintable() or len(said) > 600:
            raise Differs(f"the doctor says {said[:100].encode('ascii', 'backslashreplace').decode()}")
    try:
        text = make_profile_text(found, "robot.urdf")
    except (ModelRefused, ProfileError):
        return
    parse_profile(text)


def mesh_of(read: Callable[[bytes], Mesh]) -> Callable[[bytes], None]:
    """A case of a mesh, looked at as a build does."""

    def call(data: bytes) -> None:
        split_all_by_colour(validate_mesh(read(data)).surfaces)

    return call


def nothing(name: str) -> bytes:
    """The files beside a mesh: there is a material library, else none."""
    if name.endswith(".mtl"):
        return b"newmtl m\nKd 1 0.5 0\nd 0.5\nmap_Kd -s 1 1 1 a.png\n"
    raise ModelRefused("no such file")


def as_glb(data: bytes) -> bytes:
    """JSON, a zero byte and the data it names, put into one file with the right lengths."""
    text, zero, binary = data.partition(b"\0")
    if not zero or data[:4] == b"glTF":
        return data
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def library(data: bytes) -> Mesh:
    """A material library."""
    cube = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n"
    return read_obj(cube, lambda _: data)


def shown_urdf(found: Urdf) -> dict[str, Any]:
    """As the page's reader has it."""
    return {
        "name": found.name,
        "links": [
            {
                "name": link.name,
                "visuals": [_shape(shape) for shape in link.visuals],
                "inertial": link.inertial and _inertial(link.inertial),
                "line": link.line,
            }
            for link in found.links
        ],
        "joints": [_with_pose(joint) for joint in found.joints],
        "materials": plain(found.materials),
        "sensors": [{"name": one.name, "link": one.link, "line": one.line} for one in found.sensors],
        "references": plain(found.references),
        "findings": plain(found.findings),
    }


def _inertial(found: Inertial) -> dict[str, Any]:
    return {"mass": found.mass, "moments": found.inertia, "line": found.line, **plain(found.pose)}


def _with_pose(posed: Joint | Shape) -> dict[str, Any]:
    members: dict[str, Any] = plain(posed)
    return {**members.pop("pose"), **members}


def _shape(shape: Shape) -> dict[str, Any]:
    members = _with_pose(shape)
    geometry = members.pop("geometry")
    for name in ("part", "isCentred") if geometry else ():
        del geometry[name]
    return members | {"shape": geometry}


def mjcf(data: bytes) -> None:
    """What is looked for beside a model."""
    for _, name in list_names(data):
        if "\0" in name or not name:
            raise Differs("no name for a file")


def mjcf_answer(data: bytes) -> None:
    """What a compiler that went wrong may write."""
    build_tree(make_robot(read_model(io.BytesIO(data)), Path("model.xml")).urdf)


# what a guarded expression may not have been compiled to
ASKING = {"LOAD_ATTR", "LOAD_METHOD", "STORE_ATTR", "DELETE_ATTR", "IMPORT_NAME", "IMPORT_FROM"}


def expression(data: bytes) -> None:
    """An expression of xacro: what is let through asks for no attribute but by way of our guard, and for none
    of Python's own names. It is compiled and not run: that is done in a process of its own, bounded."""
    text = data.decode("utf-8", "replace")
    try:
        waiting = [compile_expression(text)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return
    while waiting:
        code = waiting.pop()
        waiting += [one for one in code.co_consts if isinstance(one, CodeType)]
        before: object = None
        for step in dis.get_instructions(code):
            # how Python's compiler itself puts an f-string of many parts together
            is_fstring = step.argval == "join" and before == ""
            before = step.argval
            if step.opname in ASKING and not is_fstring:
                raise Differs(f"{step.opname} {step.argval!a} is let through")
        if any(name.startswith("__") for name in code.co_names):
            raise Differs("a name of Python's own is let through")


REFUSES = (ModelRefused,)

TARGETS = (
    Target("urdf", urdf, REFUSES, stretched=1 << 17, page=True),
    Target("body", body, REFUSES, corpus="urdf"),
    Target("sdf", sdf, REFUSES),
    Target("sdf-urdf", included, REFUSES, corpus="urdf"),
    Target("stl", mesh_of(read_stl), REFUSES),
    Target("obj", mesh_of(lambda data: read_obj(data, nothing, True)), REFUSES),
    Target("mtl", mesh_of(library), REFUSES),
    Target("gltf", mesh_of(lambda data: read_gltf(as_glb(data), nothing)), (*REFUSES, *MALFORMED)),
    Target("collada", mesh_of(lambda data: read_collada(data, nothing)), REFUSES),
    Target("mjcf", mjcf),
    Target("mjcf-answer", mjcf_answer, REFUSES),
    Target("xacro", expression, (ExpressionRefused,)),
)
