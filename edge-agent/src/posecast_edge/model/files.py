"""Every file a URDF names, found and read once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mesh import Mesh
from posecast_edge.model.mesh_reader import read_mesh
from posecast_edge.model.resolve import Resolver
from posecast_edge.model.urdf import Geometry, Shape, Urdf

TRIANGLES_MAX = 10_000_000  # of all meshes

Progress = Callable[[int, int, str], None]  # done, of how many, what


@dataclass(frozen=True)
class MeshFile:
    """What a URI led to: a mesh, or the reason why there is none. `hint`: how it was found all the same."""

    uri: str
    path: Path | None
    mesh: Mesh | None
    reason: str | None
    hint: str | None
    size: int  # bytes, 0 when there is none


class Files:
    """The meshes of one URDF, read when asked for. Bounded by TRIANGLES_MAX in all."""

    def __init__(self, resolver: Resolver) -> None:
        self._resolver = resolver
        self._by_uri: dict[str, MeshFile] = {}
        self._by_path: dict[Path, Mesh | str] = {}
        self._triangles = 0

    def __getitem__(self, uri: str) -> MeshFile:
        if uri not in self._by_uri:
            self._by_uri[uri] = self._read(uri)
        return self._by_uri[uri]

    def __iter__(self) -> Iterator[MeshFile]:
        return iter(self._by_uri.values())

    def _read(self, uri: str) -> MeshFile:
        try:
            found = self._resolver.find(uri)
        except ModelRefused as e:
            return MeshFile(uri, None, None, e.reason, None, 0)
        if found.path not in self._by_path:
            self._by_path[found.path] = self._load(found.path)
        loaded = self._by_path[found.path]
        size = found.path.stat().st_size
        if isinstance(loaded, str):
            return MeshFile(uri, found.path, None, loaded, found.hint, size)
        return MeshFile(uri, found.path, loaded, None, found.hint, size)

    def _load(self, path: Path) -> Mesh | str:
        if self._triangles > TRIANGLES_MAX:
            return f"left out: the robot has more than {TRIANGLES_MAX:,} triangles already"
        try:
            mesh = read_mesh(path, self._resolver)
        except ModelRefused as e:
            return e.reason if e.line is None else f"line {e.line}: {e.reason}"
        except MemoryError:
            return "takes more memory than there is"
        self._triangles += mesh.triangles
        return mesh


def shapes_of(urdf: Urdf, kind: str) -> Iterator[tuple[str, Shape]]:
    """Link names with their `visual` or `collision` shapes, in the file's order."""
    for link in urdf.links:
        for shape in link.visuals if kind == "visual" else link.collisions:
            yield link.name, shape


def read_visual_meshes(urdf: Urdf, files: Files, progress: Progress) -> None:
    """Read what is drawn, with word of how far it is."""
    geometries: list[Geometry] = [s.geometry for _, s in shapes_of(urdf, "visual") if s.geometry is not None]
    uris = list(dict.fromkeys(g.uri for g in geometries if g.kind == "mesh"))
    for number, uri in enumerate(uris):
        progress(number, len(uris), uri)
        files[uri]


def digest(path: Path) -> str:
    """SHA-256 of a file."""
    sha = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(1 << 20):
            sha.update(chunk)
    return sha.hexdigest()
