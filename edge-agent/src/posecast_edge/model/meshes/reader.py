"""Reads a mesh file of any format, recognised by its first bytes, then by its name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from posecast_edge.model.finding import ModelRefused, quote_name
from posecast_edge.model.meshes.collada import read_collada
from posecast_edge.model.meshes.gltf import read_gltf
from posecast_edge.model.meshes.mesh import FILE_MAX, Mesh, validate_mesh
from posecast_edge.model.meshes.obj import read_obj
from posecast_edge.model.meshes.side_files import SideFiles, read_bounded
from posecast_edge.model.meshes.stl import read_stl
from posecast_edge.model.meshes.vertex_colour import split_all_by_colour
from posecast_edge.model.urdf.resolver import Resolver


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
