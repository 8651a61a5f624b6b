"""Reads a mesh file of any format, recognised by its first bytes, then by its name."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.meshes.collada import read_collada
from posecast_edge.model.meshes.gltf import read_gltf
from posecast_edge.model.meshes.mesh import FILE_MAX, Load, Mesh, validate_mesh
from posecast_edge.model.meshes.obj import read_obj
from posecast_edge.model.meshes.stl import read_stl
from posecast_edge.model.meshes.texture import Pictures
from posecast_edge.model.meshes.vertex_colour import split_all_by_colour
from posecast_edge.model.urdf.resolver import Resolver, open_file


def read_mesh(path: Path, resolver: Resolver, keep_uv: bool = False, shelf: SideFiles | None = None) -> Mesh:
    """Read and check a mesh. Raises ModelRefused, which says why it can't be shown.

    `keep_uv`: the URDF has a picture for it, so texture coordinates are needed even if the file has no
    picture. `shelf`: files that the robot's meshes share.
    """
    mesh = validate_mesh(_read(path, resolver, keep_uv, shelf or SideFiles()))
    return replace(mesh, surfaces=tuple(split_all_by_colour(mesh.surfaces)))


def _read(path: Path, resolver: Resolver, keep_uv: bool, shelf: SideFiles) -> Mesh:
    data = read_bounded(path, FILE_MAX)
    _refuse_the_obvious(data)
    suffix, load = path.suffix.lower(), shelf.make_loader(path, resolver)
    if data[:4] == b"glTF" or suffix == ".gltf":
        return read_gltf(data, load, shelf.pictures)
    if suffix == ".stl":
        return read_stl(data)
    if suffix == ".dae":
        return read_collada(data, load, keep_uv, shelf.pictures)
    if suffix == ".obj":
        return read_obj(data, load, keep_uv, shelf.pictures)
    if suffix == ".glb":
        raise ModelRefused("not a glTF 2.0 binary")
    raise ModelRefused(f"{quote_name(suffix)} is not a supported mesh format")


def _refuse_the_obvious(data: bytes) -> None:
    """Refuse files that are not meshes despite their name, as servers and tools leave them."""
    start = data[:512].lstrip().lower()
    if not data:
        raise ModelRefused("the file is empty")
    if start.startswith((b"<!doctype html", b"<html", b"<head")) or b"<html" in start:
        raise ModelRefused("an HTML page, not a mesh: a server answered with a page")
    if start.startswith(b"version https://git-lfs"):
        raise ModelRefused("a Git LFS pointer, not the mesh: run git lfs pull")
    if start.startswith(b"pk\x03\x04"):
        raise ModelRefused("a zip archive, not a mesh")
    if start.startswith(b"\x1f\x8b"):
        raise ModelRefused("a gzip file, not a mesh")


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


def read_bounded(path: Path, most: int) -> bytes:
    """Read a file. Raises ModelRefused when it is larger than `most` bytes or can't be read."""
    try:
        if path.stat().st_size > most:
            raise ModelRefused(f"over {most >> 20} MiB")
        with open_file(path) as file:
            data = file.read(most + 1)
    except OSError as e:
        raise ModelRefused(e.strerror or "can't be read") from None
    if len(data) > most:
        raise ModelRefused(f"over {most >> 20} MiB")
    return data
