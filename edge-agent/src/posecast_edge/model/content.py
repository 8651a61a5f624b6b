"""Tells what a file is by its content, whatever its name says, as the page does (spa/src/urdf/content.ts)."""

from __future__ import annotations

import codecs
import re

from posecast_edge.model.finding import ModelRefused

HEAD = 64 << 10  # bytes in which a text says what it is
LOOKED_AT = 1 << 20  # in which its first vertex or facet stands
STL_HEADER, STL_FACE = 84, 50  # bytes

ROBOT, MESH = "a robot description", "a mesh"
EXPORT = "export it as STL, Collada, OBJ or GLB"
NAMES = "give the URDF that names it"
AS_URDF = "export the robot as URDF"
UNPACK = "unpack it"
WEBOTS = "in Webots, right-click the robot and export it as URDF"
# how a file begins: what it is, and what to do where a robot is wanted, and where a mesh is
FOREIGN = tuple(
    (re.compile(begin, re.IGNORECASE | re.DOTALL), what, robot, mesh)
    for begin, what, robot, mesh in (
        (
            rb"\s*<!doctype html|\s*<head[\s>]|.{0,500}<html[\s>]",
            "an HTML page",
            "a server answered with a page",
            "a server answered with a page",
        ),
        (rb"\s*version https://git-lfs", "a Git LFS pointer", "run git lfs pull", "run git lfs pull"),
        (rb"pxr-usdc|\s*#usda|pk\x03\x04.{26,200}\.usd[ac]?", "a USD file", AS_URDF, EXPORT),
        (rb"pk\x03\x04", "a zip archive", UNPACK, UNPACK),
        (rb"\x1f\x8b|bzh[1-9]|7z\xbc\xaf|rar!|\xfd7zxz|\x28\xb5\x2f\xfd", "a packed file", UNPACK, UNPACK),
        (rb"\s*#vrml_sim|\s*(?:extern)?proto\s", "a Webots file", WEBOTS, EXPORT),
        (rb"\s*#vrml v", "a VRML mesh", NAMES, EXPORT),
        (rb"ply\s", "a PLY mesh", NAMES, EXPORT),
        (rb"kaydara fbx|; fbx", "an FBX mesh", NAMES, EXPORT),
        (rb"\s*iso-10303-21", "a STEP file", AS_URDF, EXPORT),
        (rb"blender", "a Blender file", AS_URDF, EXPORT),
        (
            rb"\x00\x05\x16\x07",
            "what a Mac notes about a file",
            "give the file without ._ before its name",
            "",
        ),
        (rb"\x89png|\xff\xd8\xff|gif8|riff.{4}webp", "a picture", "", ""),
        (rb"%pdf", "a PDF", "", ""),
    )
)
MESHES = {"stl": "an STL mesh", "obj": "an OBJ mesh", "glb": "a glTF mesh", "gltf": "JSON"}
COLLADA = re.compile(rb"<(?:\w+:)?COLLADA[\s>]")
FACET = re.compile(rb"\bfacet\s+normal|\bendsolid\b", re.IGNORECASE)
VERTEX = re.compile(rb"^[ \t]*v[ \t]+\S", re.MULTILINE)
# how UTF-16 begins, with its byte order mark, and XML also without it
WIDE = {
    mark: codec
    for codec in ("utf-16-le", "utf-16-be")
    for mark in ("\ufeff".encode(codec), "<".encode(codec))
}


def refuse_foreign(data: bytes, wanted: str) -> None:
    """Raises ModelRefused, which names the file and what to do, when it is known to be something else than
    what is wanted, ROBOT or MESH."""
    if not data:
        raise ModelRefused("the file is empty")
    head = _text_of(data[:1024])
    for begin, what, robot, mesh in FOREIGN:
        if begin.match(head):
            advice = robot if wanted == ROBOT else mesh
            why = "which is not supported" if advice == EXPORT else f"not {wanted}"
            raise ModelRefused(f"{what}, {why}" + (f": {advice}" if advice else ""))
    if wanted == ROBOT and (what := MESHES.get(find_mesh_kind(data) or "", "")):
        raise ModelRefused(f"{what}, not {wanted}: {NAMES}")
    if wanted == ROBOT and b"\0" in head and not head.lstrip().startswith(b"<"):
        raise ModelRefused(f"binary data, not {wanted}")


def find_mesh_kind(data: bytes) -> str | None:  # noqa: PLR0911 - one line for each kind
    """`stl`, `collada`, `obj`, `glb` (binary) or `gltf` (JSON); None for what is none of them."""
    if data[:4] == b"glTF":
        return "glb"
    count, room, rest = measure_stl(data)
    if rest == 0 and count in (room, 0):
        return "stl"
    text = _text_of(data[:LOOKED_AT])
    if COLLADA.search(text, 0, HEAD):
        return "collada"
    start = text[:HEAD].lstrip()
    if start[:1] == b"{":
        return "gltf"
    if start[:5].lower() == b"solid" and FACET.search(text):
        return "stl"
    if 0 < count <= room:
        return "stl"
    return "obj" if b"\0" not in text[:HEAD] and VERTEX.search(text) else None


def measure_stl(data: bytes) -> tuple[int, int, int]:
    """Of a binary STL: the triangles that its header claims, those for which it has room, and the bytes that
    are left over; -1 bytes when it is too short for a header."""
    if len(data) < STL_HEADER:
        return 0, 0, -1
    room, rest = divmod(len(data) - STL_HEADER, STL_FACE)
    return int.from_bytes(data[80:84], "little"), room, rest


def _text_of(start: bytes) -> bytes:
    """The beginning of a text, without its byte order mark; UTF-16 as UTF-8."""
    if codec := WIDE.get(start[:2]):
        return start.decode(codec, "replace").removeprefix("\ufeff").encode()
    return start.removeprefix(codecs.BOM_UTF8)
