"""Reads a mesh file of any format, recognised by its content."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from posecast_edge.model.content import MESH, STL_HEADER, find_mesh_kind, measure_stl, refuse_foreign
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.collada import read_collada
from posecast_edge.model.meshes.gltf import MALFORMED, read_gltf
from posecast_edge.model.meshes.mesh import (
    FILE_MAX,
    TEXT_MAX,
    TRIANGLES_MAX,
    Load,
    Mesh,
    Paint,
    Surface,
    validate_mesh,
)
from posecast_edge.model.meshes.obj import read_obj
from posecast_edge.model.meshes.texture import Pictures
from posecast_edge.model.text import read_text
from posecast_edge.model.urdf.resolver import Resolver, read_bounded

NAMES = {"stl": "STL", "collada": "Collada", "obj": "OBJ"}  # of formats, in a sentence


def read_mesh(path: Path, resolver: Resolver, keep_uv: bool = False, shelf: SideFiles | None = None) -> Mesh:
    """Read and check a mesh. Raises ModelRefused, which says why it can't be shown.

    `keep_uv`: the URDF has a picture for it, so texture coordinates are needed even if the file has no
    picture. `shelf`: files that the robot's meshes share.
    """
    data = read_bounded(path, FILE_MAX)
    refuse_foreign(data, MESH)
    kind = find_mesh_kind(data)
    try:
        mesh = validate_mesh(_read(kind, data, path, resolver, keep_uv, shelf or SideFiles()))
    except MALFORMED:  # what an exception says is no sentence for people
        raise ModelRefused(f"its {NAMES.get(kind or '', 'glTF')} is broken; export it again") from None
    return replace(mesh, surfaces=tuple(split_all_by_colour(mesh.surfaces)))


def _read(
    kind: str | None, data: bytes, path: Path, resolver: Resolver, keep_uv: bool, shelf: SideFiles
) -> Mesh:
    load = shelf.make_loader(path, resolver)
    if kind is None:
        if path.suffix.lower() == ".stl" and b"\0" in data[:STL_HEADER]:
            return read_stl(data)  # it says what is wrong
        raise ModelRefused("not STL, Collada, OBJ or glTF")
    if kind == "stl":
        return read_stl(data)
    if kind == "glb":
        return read_gltf(data, load, shelf.pictures)
    if len(data) > TEXT_MAX:
        raise ModelRefused(f"a text mesh over {TEXT_MAX >> 20} MiB")
    text = read_text(data)
    if kind == "gltf":
        mesh = read_gltf(text.utf8, load, shelf.pictures)
    else:
        mesh = (read_obj if kind == "obj" else read_collada)(text.utf8, load, keep_uv, shelf.pictures)
    return replace(mesh, notes=(*((f.code, f.text) for f in text.findings), *mesh.notes))


# --- files that meshes refer to: buffers, material libraries, pictures

TEXTURE_MAX = 64 << 20  # bytes of one picture
NAMES_MAX = 1000  # files named by one mesh; further ones are ignored


@dataclass(frozen=True)
class Bound:
    """Limits in bytes for one file and for all files of a robot's meshes; files beyond them are left out."""

    one: int
    all: int


PICTURE = ".png"  # stands for every kind of picture
BOUNDS = {
    ".bin": Bound(FILE_MAX, 1 << 30),  # counted each time it is read
    ".mtl": Bound(8 << 20, 64 << 20),  # counted each time
    PICTURE: Bound(TEXTURE_MAX, 512 << 20),  # counted once: it is cached and checked once
}


class SideFiles:
    """The files that the meshes of one robot refer to. Sizes are bounded per file and per robot, because a
    thousand meshes may name the same large file."""

    def __init__(self) -> None:
        self.pictures = Pictures()
        self._held: dict[Path, bytes] = {}
        self._left = {kind: bound.all for kind, bound in BOUNDS.items()}

    def make_loader(self, mesh: Path, resolver: Resolver) -> Load:
        """A function that loads the files this mesh names. It raises ModelRefused when one can't be used."""
        read: dict[str, bytes | ModelRefused] = {}

        def load(name: str) -> bytes:
            if name not in read and len(read) >= NAMES_MAX:
                raise ModelRefused(f"it names more than {NAMES_MAX} files")
            if name not in read:
                try:
                    read[name] = self._read(resolver.find_beside(mesh, name))
                except ModelRefused as e:
                    read[name] = e
            found = read[name]
            if isinstance(found, ModelRefused):
                raise ModelRefused(found.reason)
            return found

        return load

    def get_picture(self, path: Path) -> bytes:
        """The bytes of a picture file. Raises ModelRefused when it can't be read or shown."""
        return self.pictures.validate(self._read(path))

    def _read(self, path: Path) -> bytes:
        if path in self._held:
            return self._held[path]
        suffix = path.suffix.lower()
        kind = suffix if suffix in BOUNDS else PICTURE
        bound, left = BOUNDS[kind], self._left[kind]
        try:
            data = read_bounded(path, min(bound.one, left))
        except ModelRefused:
            if left == bound.all:
                raise
            both = f"over {bound.one >> 20} MiB, or the robot's over {bound.all >> 20} MiB"
            raise ModelRefused(both) from None
        self._left[kind] = left - len(data)
        if kind == PICTURE:
            self._held[path] = data
        return data


# --- STL, binary and text; a binary file may begin with "solid", so only the length tells them apart

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(data: bytes) -> Mesh:
    """Read a file. Raises ModelRefused when header and length disagree or the text is not STL."""
    count, room, rest = measure_stl(data)
    notes: list[tuple[str, str]] = []
    if rest == 0 and count in (room, 0):
        if count != room:
            notes.append(("stl-count", f"its header claims no triangles; the file's {room:,} are shown"))
        return _binary(data, room, notes)
    if find_mesh_kind(data) == "stl" and not 0 < count <= room:
        return _text(data)
    if count == 0 or count > room:
        held = f"has room for {max(room, 0):,}"
        raise ModelRefused(f"the STL's header claims {count:,} triangles, the file {held}")
    notes.append(
        ("stl-tail", f"{len(data) - STL_HEADER - count * RECORD.itemsize} bytes after the last triangle")
    )
    return _binary(data, count, notes)


def _binary(data: bytes, count: int, notes: list[tuple[str, str]]) -> Mesh:
    if count > TRIANGLES_MAX:
        raise ModelRefused(f"more than {TRIANGLES_MAX:,} triangles")
    corners = np.frombuffer(data, RECORD, count, STL_HEADER)["corners"].reshape(-1, 3)
    return Mesh((Surface(corners, _corners(len(corners))),), tuple(notes))


def _text(data: bytes) -> Mesh:
    if len(data) > TEXT_MAX:
        raise ModelRefused(f"a text STL over {TEXT_MAX >> 20} MiB")
    try:
        words = (float(word) for match in VERTEX.finditer(read_text(data).utf8) for word in match.groups())
        with np.errstate(over="ignore"):  # overflows to infinity, which is refused later
            numbers = np.fromiter(words, np.float64).astype("<f4")
    except ValueError:
        raise ModelRefused("a vertex of the text STL is not a number") from None
    if len(numbers) % 9:
        raise ModelRefused("the text STL ends within a triangle")
    return Mesh((Surface(numbers.reshape(-1, 3), _corners(len(numbers) // 3)),))


def _corners(count: int) -> np.ndarray[tuple[int, int], np.dtype[np.int32]]:
    return np.arange(count, dtype=np.int32).reshape(-1, 3)


# --- vertex colours become paints: a few colours, each on its own triangles. Levels of detail have no vertex
# colours (docs/reference/model-bundle.md). Exporters use them to mark parts of a body, so a few are kept; the
# many colours of a scan are replaced by their mean

COLOURS_MAX = 16
CLOSE = 8 / 255  # colours nearer than this count as one: rounding, or slight shading
DARK = 0.02
FEW = 1000  # triangles: up to this many are always split
RAGGED = 0.3  # of all edges lying between colours: beyond it, the colours are an image, not parts


def split_all_by_colour(surfaces: Sequence[Surface]) -> list[Surface]:
    """Split into surfaces of one paint each. If a file without materials gives all vertices the same colour,
    it becomes the spare paint: that is usually an exporter's default and not the robot's colour, and RViz
    ignores it."""
    parts = [part for surface in surfaces for part in split_by_colour(surface)]
    if any(surface.paint for surface in surfaces) or len({part.paint for part in parts}) > 1:
        return parts
    return [replace(part, paint=None, spare=part.paint) for part in parts]


def split_by_colour(surface: Surface) -> Iterator[Surface]:
    """Split a surface into surfaces of one paint each. It is left as it is if it has no colours or only
    black, which is an unused layer."""
    if surface.colours is None or surface.colours.max() < DARK:
        yield replace(surface, colours=None)
        return
    paint = surface.paint or Paint((1.0, 1.0, 1.0, 1.0))
    colours = surface.colours[surface.faces].mean(1).astype(np.float64)  # of a triangle
    sort = _sorts(colours)
    if _ragged(surface, sort):
        sort = np.zeros(len(colours), np.int64)
    for number in range(int(sort.max()) + 1):
        own = sort == number
        r, g, b = (float(v) for v in np.round(colours[own].mean(0), 4))
        rgba = (paint.rgba[0] * r, paint.rgba[1] * g, paint.rgba[2] * b, paint.rgba[3])
        yield Surface(
            surface.positions, surface.faces[own], surface.uv, Paint(rgba, paint.texture), names=surface.names
        )


def _sorts(colours: NDArray[np.float64]) -> NDArray[np.int64]:
    """The number of each triangle's colour, from 0: median cut (Heckbert 1982), the widest box first."""
    sort = np.zeros(len(colours), np.int64)
    for new in range(1, COLOURS_MAX):
        boxes = [colours[sort == k] for k in range(new)]
        spans = np.array([np.ptp(box, axis=0) for box in boxes])
        widest, channel = np.unravel_index(int(spans.argmax()), spans.shape)
        if spans[widest, channel] <= CLOSE:
            break
        values = boxes[widest][:, channel]
        middle = (values.min() + values.max()) / 2
        sort[(sort == widest) & (colours[:, channel] > middle)] = new
    return sort


def _ragged(surface: Surface, sort: NDArray[np.int64]) -> bool:
    """Whether the colours mark no parts, because too many edges separate different colours."""
    if not sort.any() or len(sort) < FEW:
        return False
    _, place = np.unique(surface.positions, axis=0, return_inverse=True)
    corners = place.reshape(-1)[surface.faces]
    edges = np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]]), axis=1)
    key = edges[:, 0].astype(np.int64) << 32 | edges[:, 1]
    order = np.argsort(key, kind="stable")
    key, of = key[order], np.tile(sort, 3)[order]
    shared = key[1:] == key[:-1]
    return bool(shared.any()) and bool((of[1:] != of[:-1])[shared].mean() > RAGGED)
