"""Every file a URDF names, found and read once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.doctor_meshes import MeshFacts
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.mesh import Mesh
from posecast_edge.model.mesh_reader import read_mesh
from posecast_edge.model.resolve import Resolver
from posecast_edge.model.urdf import Urdf

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


def read_visual_meshes(urdf: Urdf, files: Files, progress: Progress) -> None:
    """Read what is drawn, with word of how far it is."""
    shapes = [s.geometry for link in urdf.links for s in link.visuals if s.geometry is not None]
    uris = list(dict.fromkeys(g.uri for g in shapes if g.kind == "mesh"))
    for number, uri in enumerate(uris):
        progress(number, len(uris), uri)
        files[uri]


def facts_of(files: Files) -> dict[str, MeshFacts]:
    """For the doctor."""
    return {file.uri: _facts(file) for file in files}


def _facts(file: MeshFile) -> MeshFacts:
    if file.mesh is None:
        return MeshFacts(file.uri, file.reason or "can't be read", file.hint, file.size)
    low, high = (tuple(float(v) for v in corner) for corner in file.mesh.box())
    return MeshFacts(
        file.uri,
        None,
        file.hint,
        file.size,
        file.mesh.triangles,
        (low[0], low[1], low[2]),
        (high[0], high[1], high[2]),
        file.mesh.notes,
    )
