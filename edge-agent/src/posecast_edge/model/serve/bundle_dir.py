"""Stores a bundle as a folder. The manifest is written last, so a folder with a manifest is complete."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from posecast_edge.model.finding import ModelRefused, has_simplifier
from posecast_edge.model.urdf.resolver import Resolver, open_file, resolve_links
from posecast_edge.model.urdf.types import AUTO

MANIFEST = "manifest.json"
MANIFEST_MAX = 1 << 20
FILE_MAX = 256 << 20
FILES_MAX = 64
CHUNK = 1 << 18  # the agent beside the robot stays small
PATH = re.compile(r"[a-z0-9][a-z0-9.-]{0,99}")
SHA256 = re.compile(r"[0-9a-f]{64}")


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write a bundle's files and remove those of an older bundle. All are written under temporary names first
    and then moved into place, the manifest last.

    Raises ModelRefused when the folder contains something else than a bundle, or OSError; the folder is then
    unchanged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    old = _names_in(folder)
    names = sorted(files, key=lambda n: n == MANIFEST)
    parts = {name: folder / f"{name}.part" for name in names}
    try:
        for name in names:
            parts[name].write_bytes(files[name])
    except OSError as e:
        for part in parts.values():
            _remove(part)
        e.filename = e.filename or str(folder)  # a full disk names none
        raise
    for name in names:
        os.replace(parts[name], folder / name)
    for name in old - set(files):
        _remove(folder / name)


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()


class BundleEntry(NamedTuple):
    """A file as the manifest names it."""

    path: str
    size: int
    sha256: str


def read_folder(folder: Path) -> dict[str, bytes]:
    """Read a bundle's files and its manifest. Raises ModelRefused unless each matches the manifest, or
    OSError."""
    manifest, entries = check_folder(folder)
    return {MANIFEST: manifest} | {e.path: _read(folder / e.path, e.size) for e in entries}


def check_folder(folder: Path) -> tuple[bytes, list[BundleEntry]]:
    """Return the manifest and its entries. Raises ModelRefused unless each file matches the manifest, or
    OSError."""
    manifest = _read(folder / MANIFEST, MANIFEST_MAX)
    entries = list_entries(manifest)
    for path, size, digest in entries:
        sha, length = hashlib.sha256(), 0
        for chunk in _chunks(folder / path, size):
            sha.update(chunk)
            length += len(chunk)
        if length != size or sha.hexdigest() != digest:
            raise ModelRefused(f"{path} does not match the manifest")
    return manifest, entries


def list_entries(manifest: bytes) -> list[BundleEntry]:
    """The files that a version 2 manifest names. Raises ModelRefused when it is not such a manifest."""
    try:
        document: dict[str, Any] = json.loads(manifest)
        if document["v"] != 2:
            raise ModelRefused(f"a bundle of version {document['v']!r:.20}; this is for version 2")
        entries = [BundleEntry(f["path"], f["size"], f["sha256"]) for f in document["files"]]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ModelRefused("its manifest is invalid") from None
    if len(entries) > FILES_MAX or not all(map(_fits, entries)):
        raise ModelRefused("its manifest has invalid file entries")
    if len({entry.path for entry in entries}) < len(entries):
        raise ModelRefused("its manifest names a file twice")
    return entries


def _fits(entry: BundleEntry) -> bool:
    path, size, digest = cast(tuple[object, object, object], entry)  # a stranger's
    return (
        isinstance(path, str)
        and PATH.fullmatch(path) is not None
        and path != MANIFEST
        and isinstance(size, int)
        and 0 <= size <= FILE_MAX
        and isinstance(digest, str)
        and SHA256.fullmatch(digest) is not None
    )


def _names_in(folder: Path) -> set[str]:
    """The files of the bundle that lies there, none in an empty folder."""
    try:
        return {path for path, _, _ in list_entries(_read(folder / MANIFEST, MANIFEST_MAX))}
    except FileNotFoundError:
        if any(folder.iterdir()):
            raise ModelRefused("the folder is not empty and holds no bundle; nothing was written") from None
        return set()


def _read(path: Path, most: int) -> bytes:
    return b"".join(_chunks(path, most))


def _chunks(path: Path, most: int) -> Iterator[bytes]:
    if path.is_symlink():
        raise ModelRefused(f"{path.name} is a link")
    left = most
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            left -= len(chunk)
            if left < 0:
                raise ModelRefused(f"{path.name} is larger than the manifest says")
            yield chunk


# --- the cache

ENTRIES = 16
INPUTS = "inputs.json"
BUILDER = 10  # goes up when the same input gives another bundle


def find_cache_folder(environment: Mapping[str, str]) -> Path | None:
    """The folder of the entries (XDG base directories); None for a user without a home folder."""
    base = environment.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base, "posecast", "models") if os.path.isabs(base) else None


class Cache:
    """The cache entry for one robot's file, its package folders and xacro's arguments: a folder with the
    bundle's files and `inputs.json`. It is used only if every input file is still the same: each name is
    resolved again, and the file it leads to is compared by SHA-256. The newest ENTRIES are kept."""

    def __init__(
        self,
        folder: Path,
        urdf: Path,
        packages: Sequence[Path],
        xacro_arguments: Mapping[str, str] | None = None,
        up_axis: str = AUTO,
    ) -> None:
        self._urdf = resolve_links(urdf)
        self._packages = packages
        given = sorted(f"{name}:={value}" for name, value in (xacro_arguments or {}).items())
        name = "\0".join(
            map(str, (BUILDER, has_simplifier(), up_axis, self._urdf, *map(resolve_links, packages), *given))
        )
        self._entry = folder / hashlib.sha256(os.fsencode(name)).hexdigest()[:32]

    def get(self) -> dict[str, bytes] | None:
        """The bundle's files including `manifest.json`; None when there is no entry or an input has
        changed."""
        try:
            inputs = json.loads((self._entry / INPUTS).read_bytes())
            if any(_digest(Path(path)) != digest for path, digest in inputs["read"].items()):
                return None
            if not self._same(inputs["asked"]):
                return None
            files = read_folder(self._entry)
            os.utime(self._entry)
        except (OSError, ValueError, KeyError, TypeError, RecursionError, ModelRefused):
            return None
        return files

    def put(self, files: Mapping[str, bytes], resolver: Resolver, inputs: Sequence[Path] = ()) -> None:
        """Store a bundle. `inputs`: the files that were read besides those that `resolver` found. Does
        nothing if the cache can't be written."""
        asked = [[*name, str(path) if path else None, _digest(path)] for name, path in resolver.asked.items()]
        read = {str(path): _digest(path) for path in (self._urdf, *inputs)}
        content = json.dumps({"read": read, "asked": asked}).encode()
        with contextlib.suppress(OSError):
            self._entry.parent.mkdir(parents=True, exist_ok=True)
            part = Path(tempfile.mkdtemp(prefix="part-", dir=self._entry.parent))
            write_folder(part, files)
            (part / INPUTS).write_bytes(content)
            shutil.rmtree(self._entry, ignore_errors=True)
            part.rename(self._entry)
            self._prune()

    def _same(self, asked: list[list[str | None]]) -> bool:
        resolver = Resolver(self._urdf, self._packages)
        for name, beside, path, digest in asked:
            try:
                found = (
                    resolver.find_beside(Path(name or ""), beside)
                    if beside
                    else resolver.find_file(name or "").path
                )
            except ModelRefused:
                found = None
            if (str(found) if found else None) != path or _digest(found) != digest:
                return False
        return True

    def _prune(self) -> None:
        entries = sorted(self._entry.parent.iterdir(), key=lambda p: p.stat().st_mtime, reverse=True)
        for old in entries[ENTRIES:]:
            shutil.rmtree(old, ignore_errors=True)


def _digest(path: Path | None) -> str | None:
    if path is None:
        return None
    sha = hashlib.sha256()
    with open_file(path) as file:
        while chunk := file.read(1 << 20):
            sha.update(chunk)
    return sha.hexdigest()
