"""Reads models from the robot that currently offers them, otherwise from an object store."""

from __future__ import annotations

import hashlib
import time
from collections import OrderedDict
from collections.abc import Callable

from posecast_relay.archive.models.keeper import MANIFEST, ModelName, make_model_key
from posecast_relay.archive.object_store import ArchiveError, ObjectStore
from posecast_relay.models.cache import Absent, ModelSource, Unavailable
from posecast_relay.models.manifest import BYTES_MAX, ManifestError, read_manifest

KNOWN_MAX = 4  # models whose file hashes are remembered: up to some megabytes each
ELSEWHERE_S = 60.0  # how long not to ask a source again for a model it did not have
NOT_READ = "this part of the past can't be read right now: retry"


class JoinedModelSource:
    """A ModelSource that combines `live` models with those in a store. What it returns is not verified."""

    def __init__(
        self, live: ModelSource, store: ObjectStore, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._live = live
        self._store = store
        self._now = now
        self._paths: OrderedDict[ModelName, dict[str, str]] = OrderedDict()  # a model's paths, by SHA-256
        self._elsewhere: OrderedDict[ModelName, float] = OrderedDict()  # until when `live` is not asked

    def offers(self, robot: str, digest: str) -> bool:  # noqa: ARG002
        """Return True: only the store knows what it has."""
        return True

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        """Return a model's manifest. Raises Absent or Unavailable."""
        failed: Absent | Unavailable | None = None
        if self._may_ask(robot, digest):
            try:
                data = await self._live.fetch_manifest(robot, digest)
                if hashlib.sha256(data).hexdigest() == digest:
                    return data
            except (Absent, Unavailable) as e:
                failed = e
        try:
            data = await self._read_manifest(robot, digest)
        except (Absent, Unavailable):
            if failed is not None:
                raise failed from None
            raise
        self._note_elsewhere(robot, digest)
        return data

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Return a range of a file, maybe fewer bytes. Raises Absent or Unavailable."""
        if self._may_ask(robot, digest):
            try:
                return await self._live.read(robot, digest, sha256, off, size)
            except (Absent, Unavailable) as e:
                try:
                    data = await self._read_stored(robot, digest, sha256, off, size)
                except (Absent, Unavailable):
                    raise e from None
                self._note_elsewhere(robot, digest)
                return data
        return await self._read_stored(robot, digest, sha256, off, size)

    def forget(self, robot: str) -> None:
        """Forget what the store has of a robot, because part of it was deleted."""
        for name in [name for name in self._paths if name[0] == robot]:
            del self._paths[name]

    def _may_ask(self, robot: str, digest: str) -> bool:
        return self._live.offers(robot, digest) and self._now() >= self._elsewhere.get((robot, digest), 0.0)

    def _note_elsewhere(self, robot: str, digest: str) -> None:
        self._elsewhere[robot, digest] = self._now() + ELSEWHERE_S
        while len(self._elsewhere) > 1000:
            self._elsewhere.popitem(last=False)

    async def _read_manifest(self, robot: str, digest: str) -> bytes:
        """Read it from the store, and remember its files."""
        try:
            data = await self._store.get_range(make_model_key(robot, digest, MANIFEST), 0, BYTES_MAX + 1)
        except ArchiveError:
            raise Unavailable(NOT_READ) from None
        if data is None or hashlib.sha256(data).hexdigest() != digest:
            raise Absent("no such model")
        try:
            entries = read_manifest(data)
        except ManifestError:
            raise Absent("no such model") from None
        self._paths[robot, digest] = {entry.sha256: path for path, entry in entries.items()}
        while len(self._paths) > KNOWN_MAX:
            self._paths.popitem(last=False)
        return data

    async def _read_stored(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        if (robot, digest) not in self._paths:
            await self._read_manifest(robot, digest)
        path = self._paths[robot, digest].get(sha256)
        if path is None:
            raise Absent("no such file in this model")
        try:
            data = await self._store.get_range(make_model_key(robot, digest, path), off, size)
        except ArchiveError:
            raise Unavailable(NOT_READ) from None
        if data is None:
            raise Absent("no such file in this model")
        return data
