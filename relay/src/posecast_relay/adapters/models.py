"""Robots' models, fetched from their edges when somebody asks, verified, kept in bounded memory.

A model is named by the SHA-256 of its manifest, each file by its own; so what is here never changes. Files
come in small ranges one by one at low priority: one large reply would cut a thin uplink's connection.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import re
from collections import OrderedDict
from collections.abc import Callable, Coroutine
from typing import Any, NamedTuple, Protocol, TypeVar, cast

RANGE_BYTES = 250_000
TRIES = 3  # of a range
MANIFEST_BYTES_MAX = 1 << 20
FILES_MAX = 4096
MANIFESTS_MAX = 32
SHA256 = re.compile("[0-9a-f]{64}")
# What a browser may be told a file is. A model comes from a robot: nothing in it may act as a page.
TYPES = {
    "application/json",
    "application/octet-stream",
    "application/xml",
    "image/jpeg",
    "image/png",
    "image/webp",
    "model/gltf+json",
    "model/gltf-binary",
    "model/mtl",
    "model/obj",
    "model/stl",
    "model/vnd.collada+xml",
    "text/plain",
}

T = TypeVar("T")


class Absent(LookupError):
    """No such model or file."""


class Unavailable(RuntimeError):
    """The edge does not deliver it just now: one line."""


class ModelSource(Protocol):
    """Where models come from."""

    def offers(self, robot: str, digest: str) -> bool:
        """Whether it is worth asking for."""

    async def manifest(self, robot: str, digest: str) -> bytes:
        """Its bytes. Absent, Unavailable."""

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """`size` ≤ RANGE_BYTES bytes of a file. Absent, Unavailable."""


class ModelFile(NamedTuple):
    """A file's bytes, the type to serve them as, and their SHA-256."""

    data: bytes
    type: str
    sha256: str


class _Entry(NamedTuple):
    sha256: str
    size: int
    type: str


class _Manifest(NamedTuple):
    data: bytes
    files: dict[str, _Entry]


class Models:
    """Fetches and keeps. When memory is full the file asked for longest ago goes."""

    def __init__(self, source: ModelSource, cache_bytes: int) -> None:
        self._source = source
        self._cache_bytes = cache_bytes
        self._kept_bytes = 0
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._manifests: OrderedDict[tuple[str, str], _Manifest] = OrderedDict()
        self._under_way: dict[tuple[str, str], asyncio.Task[Any]] = {}

    async def manifest(self, robot: str, digest: str) -> bytes:
        """The manifest's exact bytes. Absent, Unavailable."""
        return (await self._manifest(robot, digest)).data

    async def file(self, robot: str, digest: str, path: str) -> ModelFile:
        """One file of a model by its path in the manifest. Absent, Unavailable."""
        entry = (await self._manifest(robot, digest)).files.get(path)
        if entry is None:
            raise Absent(f"no file {path!r} in this model")
        data = self._kept.get(entry.sha256)
        if data is None:
            data = await self._once((robot, entry.sha256), lambda: self._fetch_file(robot, digest, entry))
        else:
            self._kept.move_to_end(entry.sha256)
        kind = entry.type if entry.type in TYPES else "application/octet-stream"
        return ModelFile(data, kind, entry.sha256)

    async def _manifest(self, robot: str, digest: str) -> _Manifest:
        known = self._manifests.get((robot, digest))
        if known is not None:
            return known
        if not SHA256.fullmatch(digest) or not self._source.offers(robot, digest):
            raise Absent("no such model")
        return await self._once((robot, digest), lambda: self._fetch_manifest(robot, digest))

    async def _once(self, name: tuple[str, str], fetch: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """However many ask at once, the edge is asked once; one who goes away does not stop the others."""
        task = self._under_way.get(name)
        if task is None:
            task = self._under_way[name] = asyncio.create_task(fetch())
            task.add_done_callback(lambda done: self._done(name, done))
        return cast(T, await asyncio.shield(task))

    def _done(self, name: tuple[str, str], task: asyncio.Task[Any]) -> None:
        del self._under_way[name]
        if not task.cancelled():
            task.exception()  # seen, also when nobody waits any more

    async def _fetch_manifest(self, robot: str, digest: str) -> _Manifest:
        data = await self._source.manifest(robot, digest)
        if len(data) > MANIFEST_BYTES_MAX or hashlib.sha256(data).hexdigest() != digest:
            raise Unavailable("the edge's manifest is another one by now, or too large")
        manifest = _Manifest(data, _files(data))
        self._manifests[robot, digest] = manifest
        if len(self._manifests) > MANIFESTS_MAX:
            self._manifests.popitem(last=False)
        return manifest

    async def _fetch_file(self, robot: str, digest: str, entry: _Entry) -> bytes:
        if entry.size > self._cache_bytes:
            raise Unavailable(f"a file of {entry.size} bytes, more than this relay keeps")
        parts, off = [], 0
        while off < entry.size:
            size = min(RANGE_BYTES, entry.size - off)
            part = await self._read(robot, digest, entry.sha256, off, size)
            if not 0 < len(part) <= RANGE_BYTES:
                raise Unavailable(f"the edge answered {len(part)} bytes at {off} of {entry.size}")
            parts.append(part)
            off += len(part)
        data = b"".join(parts)
        if hashlib.sha256(data).hexdigest() != entry.sha256:
            raise Unavailable("the file is not what its manifest says")
        self._keep(entry.sha256, data)
        return data

    async def _read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """A range: on a bad uplink one that is lost should not cost the whole file."""
        for _ in range(TRIES - 1):
            with contextlib.suppress(Unavailable):
                return await self._source.read(robot, digest, sha256, off, size)
        return await self._source.read(robot, digest, sha256, off, size)

    def _keep(self, sha256: str, data: bytes) -> None:
        self._kept[sha256] = data
        self._kept_bytes += len(data)
        while self._kept_bytes > self._cache_bytes:
            _, gone = self._kept.popitem(last=False)
            self._kept_bytes -= len(gone)

    async def entries(self, robot: str, digest: str) -> dict[str, tuple[str, int]]:
        """The model's files by path: SHA-256 and size. Absent, Unavailable."""
        found = (await self._manifest(robot, digest)).files
        return {path: (entry.sha256, entry.size) for path, entry in found.items()}


def _files(manifest: bytes) -> dict[str, _Entry]:
    """The files a manifest names, by path. Unavailable when it is none."""
    try:
        doc = json.loads(manifest)
        found = {
            str(f["path"]): _Entry(str(f["sha256"]), int(f["size"]), str(f.get("type", "")))
            for f in doc["files"][: FILES_MAX + 1]
        }
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise Unavailable("the edge's manifest is none") from None
    if len(found) > FILES_MAX or not all(SHA256.fullmatch(e.sha256) and e.size >= 0 for e in found.values()):
        raise Unavailable("the edge's manifest is none")
    return found
