"""A robot's model as a manifest and ranges of bytes: a URDF with the files it names, or a built folder.
Only meshes and pictures inside the model's own folders are served: an untrusted URDF must not publish other
files of this machine.

The manifest keeps every URI exactly as the URDF spells it, so the browser resolves nothing itself.
"""

from __future__ import annotations

import hashlib
import json
import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from posecast_edge.model.doctor.meshes import find_lost_files
from posecast_edge.model.doctor.skeleton import examine_model
from posecast_edge.model.finding import Finding, ModelRefused, make_printable
from posecast_edge.model.kinematics import VARIABLES, list_variables
from posecast_edge.model.moving_joints import SLIDING_TYPE, MovingJoint, list_built_joints, list_moving_joints
from posecast_edge.model.serve.bundle_dir import check_folder
from posecast_edge.model.urdf.reader import load_urdf
from posecast_edge.model.urdf.resolver import URI_MAX, Resolver, open_file, resolve_links
from posecast_edge.model.urdf.tree import build_tree
from posecast_edge.model.urdf.types import Urdf

log = logging.getLogger("posecast_edge.model")

RANGE_MAX = 250_000  # bytes of one reply: a larger one breaks the connection on a slow uplink
FILE_MAX = 256 << 20
FILES_MAX = 1000
FINDINGS_MAX = 100

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
    """A URDF that can't be served: one line, `file: reason`."""


@dataclass(frozen=True)
class BundleFile:
    """One file: its path and its entry in the manifest."""

    source: Path
    path: str
    uri: str
    size: int
    sha256: str


class Bundle:
    """A model as it was when it was loaded."""

    def __init__(
        self,
        manifest: bytes,
        files: list[BundleFile],
        missing: list[str],
        links: frozenset[str],
        kinds: Sequence[tuple[str, str]] = (),
        joints: tuple[MovingJoint, ...] = (),
        findings: Sequence[Finding] = (),
    ) -> None:
        """`links`: the names of its links; `kinds`: name and type of its joints; `joints`: those that one
        value moves; `findings`: errors and warnings of the doctor, at most FINDINGS_MAX."""
        self.manifest = manifest
        self.links = links
        self.sliding = frozenset(name for name, kind in kinds if kind == SLIDING_TYPE)  # in metres
        self.joints = joints
        # what readings may be called: joints of several variables also have readings of the joint's own name
        self.readings = frozenset(
            n for j, kind in kinds for n in (j, *(v for v, _ in list_variables(j, kind)))
        )
        self.findings = tuple(findings)
        self.files = tuple(files)
        self.missing = tuple(missing)
        self.hash = hashlib.sha256(self.manifest).hexdigest()
        self._by_hash = {f.sha256: f for f in files}

    def log_missing(self) -> None:
        """Log the files that the model names but that are missing, in one line."""
        if self.missing:
            shown = ", ".join(self.missing[:3]) + (" …" if len(self.missing) > 3 else "")
            total = len(self.files) + len(self.missing)
            log.warning("model: %d of %d files missing: %s", len(self.missing), total, shown)

    def read(self, part: str, offset: int, length: int) -> bytes:
        """Read up to `length` bytes at `offset` of `manifest` or of the file with the SHA-256 `part`.

        Raises KeyError for an unknown file, ValueError for an invalid range, OSError when the file is gone.
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


def load_bundle(urdf: Path, packages: Sequence[Path] = ()) -> Bundle:
    """Read a URDF and find the files it names. Files that are missing or outside the model's folders
    (resolver.py) are listed in `missing`. Raises ModelError when the URDF can't be used."""
    try:
        read = load_urdf(urdf)
        uris = list(dict.fromkeys(_uris(read)))
        name = make_printable(urdf.name)
        files = [_file(resolve_links(urdf), name, name)]
    except ModelRefused as e:
        raise ModelError(
            f"{urdf}: {e.reason}" if e.line is None else f"{urdf}: line {e.line}: {e.reason}"
        ) from None
    except OSError as e:
        raise ModelError(f"{urdf}: {e.strerror or e}") from None
    resolver = Resolver(urdf, packages)
    missing: list[str] = []
    taken: Counter[str] = Counter()
    for uri in uris:
        file = _found(resolver, uri, taken) if len(files) < FILES_MAX else None
        if file is None:
            missing.append(uri[:URI_MAX])
        else:
            files.append(file)
    links = frozenset(link.name for link in read.links)
    manifest = _manifest(files, missing)
    kinds = [(j.name, j.type) for j in read.joints]
    return Bundle(manifest, files, missing, links, kinds, list_moving_joints(read), _examine(read, resolver))


def _examine(urdf: Urdf, resolver: Resolver) -> list[Finding]:
    """What can be found out without a look into the meshes."""
    found = examine_model(urdf, build_tree(urdf), None, lost=find_lost_files(urdf, resolver))
    return [f for f in found if f.severity != "hint"][:FINDINGS_MAX]


def find_sliding(urdf: Urdf) -> frozenset[str]:
    """The names of a model's prismatic joints: their values are metres."""
    return frozenset(joint.name for joint in urdf.joints if joint.type == SLIDING_TYPE)


def _found(resolver: Resolver, uri: str, taken: Counter[str]) -> BundleFile | None:
    try:
        path = resolver.find_file(uri).path
        return _file(path, _free_path(path.name, taken), uri) if path.suffix.lower() in TYPES else None
    except (ModelRefused, OSError):
        return None


def _uris(urdf: Urdf) -> Iterator[str]:
    """Of meshes and pictures, in the file's order of links."""
    for link in urdf.links:
        for shape in (*link.visuals, *link.collisions):
            if shape.geometry is not None and shape.geometry.uri:
                yield shape.geometry.uri
            if shape.material is not None and shape.material.texture:
                yield shape.material.texture
    for material in urdf.materials.values():
        if material.texture:
            yield material.texture


def load_built(folder: Path) -> Bundle:
    """Load the output of `posecast-edge model build`. Raises ModelError unless every file matches the
    manifest."""
    try:
        manifest, entries = check_folder(folder)
    except FileNotFoundError as e:
        raise ModelError(f"{folder}: not a built model, {Path(e.filename).name} is missing") from None
    except ModelRefused as e:
        raise ModelError(f"{folder}: {e}") from None
    except OSError as e:
        raise ModelError(f"{e.filename or folder}: {e.strerror or e}") from None
    files = [BundleFile(folder / e.path, e.path, e.path, *e[1:]) for e in entries]
    document = json.loads(manifest)
    links = document.get("links")
    names = frozenset(map(str, links if isinstance(links, list) else ()))
    kinds, findings = list(_read_kinds(document.get("joints"))), _read_findings(document.get("findings"))
    return Bundle(manifest, files, [], names, kinds, list_built_joints(manifest), findings)


def _read_kinds(joints: object) -> Iterator[tuple[str, str]]:
    """(name, type) of each joint of a manifest, as far as there are any."""
    for joint in joints if isinstance(joints, list) else ():
        if isinstance(joint, dict) and joint.get("type") in VARIABLES:
            yield str(joint.get("name")), joint["type"]


def _read_findings(findings: object) -> list[Finding]:
    """A manifest's errors and warnings. What a manifest should not hold is left out."""
    return [
        Finding(f["severity"], str(f.get("code")), str(f.get("text")), line if type(line) is int else None)
        for f in (findings if isinstance(findings, list) else ())[:FINDINGS_MAX]
        if isinstance(f, dict) and f.get("severity") in ("error", "warning")
        for line in (f.get("line"),)
    ]


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
    with open_file(source) as f:
        while chunk := f.read(1 << 18):
            digest.update(chunk)
            size += len(chunk)
            if size > FILE_MAX:
                raise OSError(f"over {FILE_MAX >> 20} MiB")
    return BundleFile(source, path, uri, size, digest.hexdigest())


def _type(path: str) -> str:
    return TYPES.get(PurePosixPath(path).suffix.lower(), "application/xml")


def _free_path(last: str, taken: Counter[str]) -> str:
    """A unique path inside the bundle that still reads like the file's name. `taken`: how often a name is."""
    name = "".join(c if c.isascii() and (c.isalnum() or c in "._-") else "_" for c in last)
    taken[name] += 1
    return f"meshes/{name}" if taken[name] == 1 else f"meshes/{taken[name]}/{name}"
