"""Keeps models in an object store: each model that a kept segment names, fetched once, in the background.

    {robot}/models/{sha256}/manifest.json   written last: if it exists, all files do
    {robot}/models/{sha256}/{path}          each file that the manifest names

`sha256` is that of the manifest. MODELS_BYTES limits the models of one robot. A model beyond that is not
kept, and the log says so once.

They are read from the robot that currently offers them, otherwise from the store.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
import time
from collections import OrderedDict
from collections.abc import Awaitable, Callable, Collection
from functools import partial

from posecast_relay.archive.names import MODELS
from posecast_relay.archive.store import ArchiveError, ObjectStore
from posecast_relay.kit import RecentDict, write_count
from posecast_relay.models.cache import Absent, ModelCache, ModelSource, Unavailable
from posecast_relay.models.manifest import BYTES_MAX, ManifestError, read_manifest
from posecast_relay.past.segment import KeptSegment

log = logging.getLogger("posecast_relay")

MODELS_BYTES = 64 << 20  # of one robot
RETRY_S = 15.0  # after a failed fetch or write; then the next segment triggers a new attempt
KNOWN_MAX = 10_000  # models that are stored, or that can't be
WAITING_MAX = 1000
MANIFEST = "manifest.json"

ModelName = tuple[str, str]  # robot, SHA-256 of the manifest


def make_model_key(robot: str, digest: str, path: str) -> str:
    """Return the key of a model's file, or of its manifest, by its path."""
    return f"{robot}/{MODELS}/{digest}/{path}"


class ModelKeeper:
    """Stores the models that segments name, one at a time. `models`: where they are fetched from."""

    def __init__(
        self,
        store: ObjectStore,
        models: ModelCache,
        now: Callable[[], float] = time.monotonic,
        bytes_max: int = MODELS_BYTES,
    ) -> None:
        self.stored = 0  # models, since the process started
        self._store = store
        self._models = models
        self._now = now
        self._bytes_max = bytes_max
        self._robots: Collection[str] = ()  # the robots that are kept
        self._known: RecentDict[ModelName, None] = RecentDict(KNOWN_MAX)  # stored, or too large
        self._waiting: OrderedDict[ModelName, None] = OrderedDict()
        self._again_at: RecentDict[ModelName, float] = RecentDict(KNOWN_MAX)
        self._storing: ModelName | None = None
        self._task: asyncio.Task[None] | None = None

    def set_robots(self, robots: Collection[str]) -> None:
        """Set which robots are kept."""
        self._robots = frozenset(robots)

    def keep(self, segment: KeptSegment) -> None:
        """Store the model that a segment names, in the background. Returns at once."""
        if segment.model is None or segment.name.robot not in self._robots:
            return
        name = segment.name.robot, segment.model
        if name in self._known or name in self._waiting or name == self._storing:
            return
        if self._now() < self._again_at.get(name, 0.0) or len(self._waiting) >= WAITING_MAX:
            return
        self._waiting[name] = None
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._work(), name="models to the archive")

    def forget(self, robot: str) -> None:
        """Store a robot's models again when they are named: some may have been deleted."""
        for name in [name for name in self._known if name[0] == robot]:
            del self._known[name]

    def find_storing(self, robot: str) -> set[str]:
        """Return the models of a robot that are being stored, or are waiting for it."""
        names = {*self._waiting, *(() if self._storing is None else (self._storing,))}
        return {digest for of, digest in names if of == robot}

    async def stop(self) -> None:
        """End at once, even in the middle of a model: the next process stores it."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def _work(self) -> None:
        while self._waiting:
            name, _ = self._waiting.popitem(last=False)
            self._storing, (robot, digest) = name, name
            try:
                await self._store_model(robot, digest)
                self._again_at.pop(name, None)
                self._known[name] = None
            except (ArchiveError, Absent, Unavailable) as e:  # the store and the robot report it themselves
                log.info("the archive: model %.12s of %s: %s", digest, robot, e)
                self._again_at[name] = self._now() + RETRY_S
            except Exception as e:  # a bug of ours, with this model
                log.error("the archive: model %.12s of %s", digest, robot, exc_info=e)
                self._again_at[name] = self._now() + RETRY_S
            finally:
                self._storing = None

    async def _store_model(self, robot: str, digest: str) -> None:
        """Store a model, its manifest last. Raises ArchiveError, Absent or Unavailable."""
        there = await self._store.get(make_model_key(robot, digest, MANIFEST))
        if there is not None and hashlib.sha256(there).hexdigest() == digest:
            return
        entries = await self._models.load_entries(robot, digest)
        paths = sorted(path for path in entries if path != MANIFEST)  # no route leads to a file of that name
        size = sum(entries[path].size for path in paths)
        others = await self._sum_others(robot, digest)
        if size + others > self._bytes_max:
            log.warning(
                "the archive: %s: a model of %.1f MB is not kept: with %.1f MB of its other models "
                "it exceeds %d MB",
                robot,
                size / (1 << 20),
                others / (1 << 20),
                self._bytes_max >> 20,
            )
            return
        for path in paths:
            found = await self._models.load_file(robot, digest, path)
            await self._put(make_model_key(robot, digest, path), found.name, found.size)
        manifest = await self._models.load_manifest(robot, digest)
        await self._put(make_model_key(robot, digest, MANIFEST), manifest.name, manifest.size)
        self.stored += 1
        log.info(
            "the archive: stored a model of %s: %s, %d bytes", robot, write_count(len(paths), "file"), size
        )

    async def _put(self, key: str, name: str, size: int) -> None:
        data = self._models.copy_piece(name, 0, size)
        if data is None:
            raise Unavailable("the relay needed its memory for other robots' models")
        await self._store.put(key, data)

    async def _sum_others(self, robot: str, digest: str) -> int:
        own, total = f"{robot}/{MODELS}/{digest}/", 0
        async for part in self._store.list_objects(f"{robot}/{MODELS}"):
            total += sum(each.size for each in part if not each.key.startswith(own))
        return total


HASHES_MAX = 4  # models whose file hashes are remembered: up to some megabytes each
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
        self._paths: RecentDict[ModelName, dict[str, str]] = RecentDict(HASHES_MAX)  # by SHA-256
        self._elsewhere: RecentDict[ModelName, float] = RecentDict(1000)  # until when `live` is not asked

    def offers(self, robot: str, digest: str) -> bool:  # noqa: ARG002
        """Return True: only the store knows what it has."""
        return True

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        """Return a model's manifest. Raises Absent or Unavailable."""

        async def fetch() -> bytes:
            data = await self._live.fetch_manifest(robot, digest)
            if hashlib.sha256(data).hexdigest() != digest:
                raise Absent("no such model")
            return data

        return await self._ask(robot, digest, fetch, partial(self._read_manifest, robot, digest))

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Return a range of a file, maybe fewer bytes. Raises Absent or Unavailable."""
        asked = robot, digest, sha256, off, size
        return await self._ask(
            robot, digest, partial(self._live.read, *asked), partial(self._read_stored, *asked)
        )

    def forget(self, robot: str) -> None:
        """Forget what the store has of a robot, because part of it was deleted."""
        for name in [name for name in self._paths if name[0] == robot]:
            del self._paths[name]

    async def _ask(
        self,
        robot: str,
        digest: str,
        live: Callable[[], Awaitable[bytes]],
        stored: Callable[[], Awaitable[bytes]],
    ) -> bytes:
        """Ask the robot, and the store for what it does not have. Raises Absent or Unavailable."""
        if not self._live.offers(robot, digest) or self._now() < self._elsewhere.get((robot, digest), 0.0):
            return await stored()
        try:
            return await live()
        except (Absent, Unavailable) as e:
            try:
                data = await stored()
            except (Absent, Unavailable):
                raise e from None
            self._elsewhere[robot, digest] = self._now() + ELSEWHERE_S
            return data

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
