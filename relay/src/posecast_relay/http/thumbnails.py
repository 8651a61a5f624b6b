"""Finds and checks the small picture in a robot's model, the manifest's `thumbnail`."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from posecast_wire.checked import loads

from posecast_relay.models.cache import Absent, ModelCache, ModelFile, Unavailable
from posecast_relay.models.manifest import Entry
from posecast_relay.models.picture import PICTURE_TYPES, PictureError, PictureSize, read_picture_size
from posecast_relay.models.refusal_memory import RefusalMemory

PICTURE_BYTES_MAX = 500_000
KEPT = 1000  # cached names and sizes of pictures; beyond this, the cache starts over
LOADING_MAX = 64  # pictures loaded for previews at once; further robots have none until a place is free


class Thumbnails:
    """Finds the pictures of models. Reads each manifest once and checks each picture once."""

    def __init__(self, models: ModelCache, now: Callable[[], float] = time.monotonic) -> None:
        """`now` is a clock in seconds."""
        self._models = models
        self._now = now
        self._paths: dict[str, str] = {}  # by the model's digest
        self._checked: dict[Entry, PictureSize | str] = {}  # or why it is refused
        self._loading: dict[tuple[str, str], tuple[asyncio.Task[PictureSize], float]] = {}  # begun when
        self._away = RefusalMemory(now)  # pictures that failed to load lately, so that nobody waits for them

    async def load_picture(self, robot: str, digest: str) -> ModelFile:
        """Fetch the picture of a robot's model, unless it is kept. Raises Absent or Unavailable."""
        return (await self._load(robot, digest))[0]

    async def find_size(self, robot: str, digest: str, wait_s: float) -> PictureSize | None:
        """Return the size of a picture that can be served now; None when there is none that can.

        One that has to be fetched is waited for, `wait_s` seconds from when it was asked for first. Then it
        still comes, for who asks later.
        """
        name = robot, digest
        if self._away.find(name) is not None:
            return None
        if name not in self._loading:
            if len(self._loading) >= LOADING_MAX:
                return None
            self._loading[name] = asyncio.create_task(self._measure(*name), name="picture"), self._now()
            self._loading[name][0].add_done_callback(lambda done: self._loaded(name, done))
        task, begun_s = self._loading[name]
        # even with no time to wait, the task gets one turn: enough if the picture is cached
        await asyncio.wait({task}, timeout=max(0.0, begun_s + wait_s - self._now()))
        return task.result() if task.done() and not task.cancelled() and task.exception() is None else None

    async def _measure(self, robot: str, digest: str) -> PictureSize:
        return (await self._load(robot, digest))[1]

    def _loaded(self, name: tuple[str, str], task: asyncio.Task[PictureSize]) -> None:
        del self._loading[name]
        error = None if task.cancelled() else task.exception()
        if isinstance(error, Unavailable):
            self._away.keep(name, str(error))

    async def _load(self, robot: str, digest: str) -> tuple[ModelFile, PictureSize]:
        entries = await self._models.load_entries(robot, digest)
        entry = entries.get(self._find_path(digest))
        if entry is None or entry.type not in PICTURE_TYPES or entry.size > PICTURE_BYTES_MAX:
            raise Absent("no picture in this model")
        if isinstance(self._checked.get(entry), str):
            self._check(entry)  # from the cache, without another fetch
        found = await self._models.load_file(robot, digest, self._find_path(digest))
        return found, self._check(entry)

    def _check(self, entry: Entry) -> PictureSize:
        """Return the size of a cached picture. Raises Absent if it is not a picture, or too large."""
        size = self._checked.get(entry)
        if size is None:
            data = self._models.find_data(entry.sha256)
            if data is None:
                raise Unavailable("no memory for this model: other robots' models need it")
            try:
                size = read_picture_size(data, entry.type)
            except PictureError as e:
                size = f"the picture in this model can't be shown: {e}"
            if len(self._checked) >= KEPT:
                self._checked.clear()
            self._checked[entry] = size
        if isinstance(size, str):
            raise Absent(size)
        return size

    def _find_path(self, digest: str) -> str:
        """Return the picture's path in a model whose manifest is cached; "" without one."""
        path = self._paths.get(digest)
        if path is None:
            manifest = loads(bytes(self._models.find_data(digest) or b"{}").decode())
            named = manifest.get("thumbnail") if isinstance(manifest, dict) else None
            path = named if isinstance(named, str) else ""
            if len(self._paths) >= KEPT:
                self._paths.clear()
            self._paths[digest] = path
        return path
