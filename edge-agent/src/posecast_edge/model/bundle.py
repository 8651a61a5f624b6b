"""A robot's model as a manifest and ranges of bytes: a URDF with the files it names, or a built folder.
Only meshes and pictures inside the model's own folders are served: a URDF from a stranger must not publish
what else lies on this machine.

The manifest keeps every URI exactly as the URDF spells it, so the browser resolves nothing itself.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit
from xml.parsers import expat

from posecast_edge.model.finding import ModelRefused
from posecast_edge.model.folder import MANIFEST, read_folder

RANGE_MAX = 250_000  # bytes of one reply: a larger one closes a thin uplink's connection
URDF_MAX = 16 << 20
FILE_MAX = 256 << 20
FILES_MAX = 1000
DEPTH_MAX = 64
LEVELS_UP = 4  # parents of the URDF's folder in which a package is looked for

# what is served, by suffix
TYPES = {
    ".stl": "model/stl",
    ".dae": "model/vnd.collada+xml",
    ".obj": "model/obj",
    ".mtl": "model/mtl",
    ".glb": "model/gltf-binary",
    ".gltf": "model/gltf+json",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
}


class ModelError(Exception):
    """A URDF that cannot be served: `file: reason`, one line."""


@dataclass(frozen=True)
class BundleFile:
    """One file: where it lies, and what the manifest says of it."""

    source: Path
    path: str
    uri: str
    size: int
    sha256: str


class Bundle:
    """A model as it was when the agent started."""

    def __init__(self, manifest: bytes, files: list[BundleFile], missing: list[str]) -> None:
        self.manifest = manifest
        self.files = tuple(files)
        self.missing = tuple(missing)
        self.hash = hashlib.sha256(self.manifest).hexdigest()
        self._by_hash = {f.sha256: f for f in files}

    def read(self, part: str, offset: int, length: int) -> bytes:
        """A range of `manifest` or of the file with that SHA-256.

        KeyError: no such file. ValueError: no such range. OSError: the file is gone.
        """
        file = None if part == "manifest" else self._by_hash.get(part)
        if file is None and part != "manifest":
            raise KeyError("no such file")
        size = len(self.manifest) if file is None else file.size
        if not (0 <= offset <= size and 0 < length <= RANGE_MAX):
            raise ValueError(f"no range {offset}+{length} in {size} bytes")
        if file is None:
            return self.manifest[offset : offset + length]
        with file.source.open("rb") as f:
            f.seek(offset)
            return f.read(min(length, size - offset))


def load_bundle(urdf: Path) -> Bundle:
    """Read a URDF and find the files it names. ModelError when the URDF cannot be used; a file that cannot be
    found, or lies outside the model's folders, stands in `missing`."""
    try:
        if urdf.stat().st_size > URDF_MAX:
            raise ModelError(f"{urdf}: over {URDF_MAX >> 20} MiB")
        text = urdf.read_bytes()
    except OSError as e:
        raise ModelError(f"{urdf}: {e.strerror or e}") from None
    uris = list(dict.fromkeys(_mesh_uris(text, urdf)))
    resolver = _Resolver(urdf.resolve())
    files = [_file(urdf.resolve(), urdf.name, urdf.name)]
    missing: list[str] = []
    taken = {urdf.name}
    for uri in uris:
        found = resolver.find(uri)
        if found is None or len(files) >= FILES_MAX:
            missing.append(uri)
            continue
        try:
            files.append(_file(found, _free_path(uri, taken), uri))
        except OSError:
            missing.append(uri)
    return Bundle(_manifest(files, missing), files, missing)


def load_built(folder: Path) -> Bundle:
    """What `posecast-edge model build` made. ModelError unless every file is what its manifest says."""
    try:
        read = read_folder(folder)
    except FileNotFoundError as e:
        raise ModelError(f"{folder}: no built model, {Path(e.filename).name} is missing") from None
    except (ModelRefused, OSError) as e:
        raise ModelError(f"{folder}: {e}") from None
    manifest = read.pop(MANIFEST)
    files = [
        BundleFile(folder / path, path, path, len(data), hashlib.sha256(data).hexdigest())
        for path, data in read.items()
    ]
    return Bundle(manifest, files, [])


def _manifest(files: list[BundleFile], missing: list[str]) -> bytes:
    document = {
        "v": 1,
        "urdf": files[0].path,
        "files": [
            {"path": f.path, "uri": f.uri, "size": f.size, "sha256": f.sha256, "type": _type(f.path)}
            for f in files
        ],
        "missing": missing,
    }
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()


def _file(source: Path, path: str, uri: str) -> BundleFile:
    digest = hashlib.sha256()
    size = 0
    with source.open("rb") as f:
        while chunk := f.read(1 << 18):
            digest.update(chunk)
            size += len(chunk)
            if size > FILE_MAX:
                raise OSError(f"over {FILE_MAX >> 20} MiB")
    return BundleFile(source, path, uri, size, digest.hexdigest())


def _type(path: str) -> str:
    return TYPES.get(PurePosixPath(path).suffix.lower(), "application/xml")


def _free_path(uri: str, taken: set[str]) -> str:
    """A unique path inside the bundle that still reads like the file's name."""
    parts = [p for p in PurePosixPath(unquote(urlsplit(uri).path)).parts if p not in ("/", "..", ".")]
    name = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in parts[-1])
    path = f"meshes/{name}"
    number = 2
    while path in taken:
        path = f"meshes/{number}/{name}"
        number += 1
    taken.add(path)
    return path


def _mesh_uris(text: bytes, urdf: Path) -> Iterator[str]:
    """`filename` of every <mesh> and <texture>. expat alone, so that entities are refused unexpanded."""
    uris: list[str] = []
    depth = 0
    root = ""

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth, root
        depth += 1
        root = root or name
        if depth > DEPTH_MAX:
            raise ModelError(f"{urdf}: line {parser.CurrentLineNumber}: nested over {DEPTH_MAX} deep")
        if name in ("mesh", "texture") and attributes.get("filename"):
            uris.append(attributes["filename"])

    def end(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise ModelError(f"{urdf}: line {parser.CurrentLineNumber}: a document type (DTD) is not accepted")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    parser.EntityDeclHandler = doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as e:
        raise ModelError(f"{urdf}: line {e.lineno}: {expat.ErrorString(e.code)}") from None
    if root != "robot":
        raise ModelError(f"{urdf}: the root element is <{root}>, not <robot>")
    return iter(uris)


class _Resolver:
    """Finds the file behind a URI, inside the folders that belong to the model."""

    def __init__(self, urdf: Path) -> None:
        self._folder = folder = urdf.parent
        self._above = list(urdf.parents)[: LEVELS_UP + 1]
        # The model's own folder: its ROS package, else the one that holds meshes/ beside the URDF's folder.
        package = next((p for p in self._above if (p / "package.xml").is_file()), None)
        beside = (folder.parent / "meshes").is_dir() and not (folder / "meshes").is_dir()
        self._root = package or (folder.parent if beside else folder)

    def find(self, uri: str) -> Path | None:
        """The file; None when there is none, it is no mesh or picture, or lies outside (links resolved)."""
        try:
            parts = urlsplit(uri)
        except ValueError:
            return None
        path = unquote(parts.path)
        if parts.scheme == "package":
            return self._in_package(unquote(parts.netloc), path.strip("/"))
        if parts.scheme == "file":
            return self._inside(Path(path), self._root)
        return None if parts.scheme else self._inside(self._folder / path, self._root)

    def _in_package(self, package: str, rest: str) -> Path | None:
        if not package:  # package:///name/rest
            package, _, rest = rest.partition("/")
        if package in ("", ".", "..") or "/" in package:
            return None
        for folder in self._above:
            for root in (folder, folder / package):
                # a package called like the user would be all that the user has
                private = Path.home().is_relative_to(root)
                if root.name == package and not private and (found := self._inside(root / rest, root)):
                    return found
        # A package whose folder was renamed or taken apart: the tail of the path in the model's own folder.
        names = PurePosixPath(rest).parts
        tails = (self._inside(self._root.joinpath(*names[i:]), self._root) for i in range(len(names)))
        return next((found for found in tails if found), None)

    @staticmethod
    def _inside(path: Path, root: Path) -> Path | None:
        try:
            real, inside = path.resolve(), root.resolve()
            served = real.suffix.lower() in TYPES and real.is_relative_to(inside) and real.is_file()
        except (OSError, RuntimeError, ValueError):  # links in a circle, a NUL in the name
            return None
        return real if served else None
