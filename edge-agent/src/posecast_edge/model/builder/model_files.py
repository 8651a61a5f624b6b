"""Finds and reads the files that a URDF names, each once."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from posecast_edge.model.doctor.meshes import MeshFacts
from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.meshes.mesh import Mesh, turn_upright
from posecast_edge.model.meshes.reader import SideFiles, read_mesh
from posecast_edge.model.robot_file import RobotFile
from posecast_edge.model.urdf.resolver import Resolver
from posecast_edge.model.urdf.types import find_material

TRIANGLES_MAX = 10_000_000  # of all meshes

Progress = Callable[[int, int, str], None]  # done, of how many, what


@dataclass(frozen=True)
class MeshFile:
    """The mesh of a URI, or the reason why there is none. `path`: None if it needs no file; `hint`: how it
    was found despite a wrong URI."""

    uri: str
    path: Path | None
    mesh: Mesh | None
    reason: str | None
    hint: str | None
    size: int  # bytes, 0 when there is none


class Files:
    """The meshes and pictures that one URDF names, read on demand, with at most TRIANGLES_MAX triangles in
    total."""

    def __init__(
        self,
        resolver: Resolver,
        textured: Collection[str] = (),
        meshes: Mapping[str, Mesh] | None = None,
    ) -> None:
        """`textured`: URIs of meshes with a texture in the URDF; `meshes`: those without a file, by URI."""
        self._resolver = resolver
        self._meshes = meshes or {}
        self._textured = textured
        self._by_uri: dict[str, MeshFile] = {}
        self._by_path: dict[tuple[Path, bool], Mesh | str] = {}
        self._pictures: dict[str, bytes | str] = {}
        self._shelf = SideFiles()
        self._turned: set[bool] = set()  # formats, by is_up_certain
        self.triangles = 0  # of all meshes read so far

    def __getitem__(self, uri: str) -> MeshFile:
        if uri not in self._by_uri:
            self._by_uri[uri] = self._read(uri)
        return self._by_uri[uri]

    def __iter__(self) -> Iterator[MeshFile]:
        return iter(self._by_uri.values())

    def _read(self, uri: str) -> MeshFile:
        if uri in self._meshes:
            return self._take(uri, self._meshes[uri])
        try:
            found = self._resolver.find_file(uri)
        except ModelRefused as e:
            return MeshFile(uri, None, None, e.reason, None, 0)
        key = (found.path, uri in self._textured)
        if key not in self._by_path:
            self._by_path[key] = self._load(*key)
        loaded = self._by_path[key]
        size = found.path.stat().st_size
        if isinstance(loaded, str):
            return MeshFile(uri, found.path, None, loaded, found.hint, size)
        return MeshFile(uri, found.path, loaded, None, found.hint, size)

    def _take(self, uri: str, mesh: Mesh) -> MeshFile:
        """Take a mesh that needs no file."""
        if self.triangles > TRIANGLES_MAX:
            return MeshFile(uri, None, None, _too_many(), None, 0)
        self.triangles += mesh.triangles
        return MeshFile(uri, None, mesh, None, None, 0)

    def find_picture(self, uri: str) -> bytes | None:
        """The picture of a URI; None if there is none, and then `list_missing` has the reason."""
        if uri not in self._pictures:
            try:
                self._pictures[uri] = self._shelf.get_picture(self._resolver.find_file(uri).path)
            except ModelRefused as e:
                self._pictures[uri] = e.reason
        found = self._pictures[uri]
        return found if isinstance(found, bytes) else None

    def list_missing(self) -> dict[str, str]:
        """Map each URI that can't be used to the reason."""
        reasons = {file.uri: file.reason for file in self if file.reason}
        return reasons | {uri: why for uri, why in self._pictures.items() if isinstance(why, str)}

    def turn_upright(self, is_certain: bool) -> None:
        """Turn every mesh of a format (Collada, or with `is_certain` glTF) whose up axis is not z, also those
        that are read later."""
        self._turned.add(is_certain)
        self._by_path = {
            key: self._orient(mesh) if isinstance(mesh, Mesh) else mesh for key, mesh in self._by_path.items()
        }
        for uri, file in self._by_uri.items():
            if file.path is not None:
                self._by_uri[uri] = self._read(uri)

    def _load(self, path: Path, keep_uv: bool) -> Mesh | str:
        if self.triangles > TRIANGLES_MAX:
            return _too_many()
        try:
            mesh = read_mesh(path, self._resolver, keep_uv, self._shelf)
        except ModelRefused as e:
            return e.reason if e.line is None else f"line {e.line}: {e.reason}"
        except MemoryError:
            return "needs more memory than this machine has"
        self.triangles += mesh.triangles
        return self._orient(mesh)

    def _orient(self, mesh: Mesh) -> Mesh:
        return turn_upright(mesh) if mesh.is_up_certain in self._turned else mesh


def _too_many() -> str:
    return f"left out: the robot already has more than {TRIANGLES_MAX:,} triangles"


def read_visual_files(robot: RobotFile, resolver: Resolver, progress: Progress) -> Files:
    """Read all files that visuals need, and report progress."""
    urdf = robot.urdf
    pictures: dict[str, None] = {}
    textured: set[str] = set()
    for shape in (s for link in urdf.links for s in link.visuals):
        material = find_material(shape, urdf.materials)
        if shape.geometry is not None and material is not None and material.texture:
            pictures[material.texture] = None
            textured.add(shape.geometry.uri)
    files = Files(resolver, textured, robot.meshes)
    for uri in pictures:
        files.find_picture(uri)
    shapes = [s.geometry for link in urdf.links for s in link.visuals if s.geometry is not None]
    uris = list(dict.fromkeys(g.uri for g in shapes if g.kind == "mesh"))
    for number, uri in enumerate(uris):
        progress(number, len(uris), uri)
        files[uri]
    return files


def collect_facts(files: Files) -> dict[str, MeshFacts]:
    """The facts about each mesh that the doctor needs, by URI."""
    lost = {uri: MeshFacts(uri, reason) for uri, reason in files.list_missing().items()}
    return lost | {file.uri: _facts(file) for file in files}


def _facts(file: MeshFile) -> MeshFacts:
    if file.mesh is None:
        return MeshFacts(file.uri, file.reason or "can't be read", file.hint, file.size)
    low, high = (tuple(float(v) for v in corner) for corner in file.mesh.compute_box())
    return MeshFacts(
        file.uri,
        None,
        file.hint,
        file.size,
        file.mesh.triangles,
        (low[0], low[1], low[2]),
        (high[0], high[1], high[2]),
        file.mesh.notes,
        all(s.uv is not None for s in file.mesh.surfaces),
    )
