"""Caches built bundles. An entry is used only if every input file is still the same: each name is resolved
again, and the file it leads to is compared by SHA-256.

An entry is a folder with the bundle's files and `inputs.json`. The newest ENTRIES are kept.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from posecast_edge.model.finding import ModelRefused, has_simplifier
from posecast_edge.model.serve.bundle_dir import read_folder, write_folder
from posecast_edge.model.urdf.resolver import Resolver, open_file, resolve_links
from posecast_edge.model.urdf.types import AUTO

ENTRIES = 16
INPUTS = "inputs.json"
BUILDER = 9  # goes up when the same input gives another bundle


def find_cache_folder(environment: Mapping[str, str]) -> Path | None:
    """The folder of the entries (XDG base directories); None for a user without a home folder."""
    base = environment.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(base, "posecast", "models") if os.path.isabs(base) else None


class Cache:
    """The cache entry for one robot's file, its package folders and xacro's arguments."""

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
