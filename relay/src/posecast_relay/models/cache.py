"""Fetches robots' models from their agents on request, verifies them, and caches them in bounded memory.

The SHA-256 of its manifest names a model, and each file has its own SHA-256. So cached files never change,
and robots with the same file share one copy. But a robot could name the hash of a file that it does not have.
So its own agent must deliver each file once before the relay serves it as that robot's.

Files are fetched in small ranges, one by one at low priority, because one large reply would break a thin
uplink's connection. A fetch is cancelled when nobody waits for it anymore.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import time
import weakref
from collections.abc import AsyncIterator, Callable, Coroutine
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, TypeVar, cast

from posecast_relay.kit import REFUSED_S, RefusalMemory
from posecast_relay.logging import visible
from posecast_relay.models.manifest import (
    BYTES_MAX,
    SHA256,
    Entry,
    ManifestError,
    read_manifest,
)
from posecast_relay.models.memory import ENTRY_BYTES, Claim, ModelMemory

RANGE_BYTES = 250_000
TRIES = 3  # of a range
AT_ONCE = 4  # files fetched from one robot in parallel; more have to wait
WAIT_S = 20.0  # for memory, while other robots use all of it
RETRY_S = 5.0  # when a client may ask again for a model that is unavailable now
READ_TIMES = 4  # memory for a parsed manifest, as a multiple of its bytes
# Allowed media types. A model comes from a robot, so nothing in it may act as a web page.
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
    """There is no such model or file."""


class Unavailable(RuntimeError):
    """The model is unavailable now. The message is one line with the reason."""

    def __init__(self, why: str, retry_s: float = RETRY_S) -> None:
        """`retry_s`: how long to wait before asking again, in seconds."""
        super().__init__(why)
        self.retry_s = retry_s


class Refused(Unavailable):
    """The robot sent something that can't be served. The relay does not ask again for REFUSED_S seconds."""

    def __init__(self, why: str, retry_s: float = REFUSED_S) -> None:
        """`retry_s`: when the relay asks the robot again, in seconds."""
        super().__init__(why, retry_s)


class ModelSource(Protocol):
    """A source of models for a ModelCache. A model's `digest` is the SHA-256 of its manifest."""

    def offers(self, robot: str, digest: str) -> bool:
        """Whether this source may have the model."""

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        """Return the unverified bytes of a model's manifest. Raises Absent or Unavailable."""

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Return `size` bytes (at most RANGE_BYTES) of a file from `off`. Raises Absent or Unavailable."""


class ModelFile(NamedTuple):
    """A cached file: its SHA-256 as its name, its media type, its size in bytes."""

    name: str
    type: str
    size: int


@dataclass
class _Shared:
    """A fetch with several waiting clients."""

    task: asyncio.Task[Any]
    askers: int = 0


class ModelCache:
    """Fetches and caches models, within `cache_bytes` for files and running fetches: see ModelMemory."""

    def __init__(
        self, source: ModelSource, cache_bytes: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._source = source
        self.room = ModelMemory(cache_bytes, now)
        self._refused = RefusalMemory(now)
        self._under_way: dict[tuple[str, str], _Shared] = {}
        self._turns: weakref.WeakValueDictionary[str, asyncio.Semaphore] = weakref.WeakValueDictionary()

    async def load_manifest(self, robot: str, digest: str) -> ModelFile:
        """Fetch a model's manifest unless it is cached. Raises Absent or Unavailable."""
        await self.load_entries(robot, digest)
        return ModelFile(digest, "application/json", len(self.find_data(digest) or b""))

    async def load_file(self, robot: str, digest: str, path: str) -> ModelFile:
        """Fetch a file by its path in the manifest unless it is cached. Raises Absent or Unavailable."""
        entry = (await self.load_entries(robot, digest)).get(path)
        if entry is None:
            raise Absent(f"no file '{visible(path)}' in this model")
        if self.find_data(entry.sha256) is None or self.room.get(_delivered(robot, entry.sha256)) is None:
            name = robot, f"{entry.sha256}/{entry.size}"
            await self._once(name, lambda: self._fetch_file(robot, digest, entry))
        elif len(self.find_data(entry.sha256) or b"") != entry.size:  # another manifest gave the right size
            raise Unavailable(f"'{visible(path)}' does not have the size that the manifest gives")
        kind = entry.type if entry.type in TYPES else "application/octet-stream"
        return ModelFile(entry.sha256, kind, entry.size)

    def find_data(self, name: str) -> bytes | bytearray | None:
        """Return the cached bytes of a name, or None. Don't hold on to them: that memory is not counted."""
        return cast("bytes | bytearray | None", self.room.get(name))

    def copy_piece(self, name: str, off: int, size: int) -> bytes | None:
        """Copy up to `size` bytes from `off` of a cached file; None if it is not cached."""
        data = self.find_data(name)
        return None if data is None else bytes(memoryview(data)[off : off + size])

    async def load_entries(self, robot: str, digest: str) -> dict[str, Entry]:
        """Return a model's files by path; fetch the manifest if needed. Raises Absent or Unavailable."""
        known = cast("dict[str, Entry] | None", self.room.get(f"{robot}/{digest}"))
        if known is not None and self.find_data(digest) is not None:
            return known
        if not SHA256.fullmatch(digest) or not self._source.offers(robot, digest):
            raise Absent("no such model")
        return await self._once((robot, digest), lambda: self._fetch_manifest(robot, digest))

    async def _once(self, name: tuple[str, str], fetch: Callable[[], Coroutine[Any, Any, T]]) -> T:
        """Fetch once for all simultaneous requests; stop when none of them waits anymore.

        Raises Refused without a fetch if a recent one was refused.
        """
        shared = self._under_way.get(name)
        if shared is None:
            refused = self._refused.find(name)
            if refused is not None:
                raise Refused(*refused)
            shared = self._under_way[name] = _Shared(asyncio.create_task(fetch(), name="model"))
            shared.task.add_done_callback(lambda done: self._done(name, done))
        shared.askers += 1
        try:
            return cast(T, await asyncio.shield(shared.task))
        finally:
            shared.askers -= 1
            if not shared.askers and not shared.task.done():
                shared.task.cancel()
                self._forget(name, shared.task)

    def _done(self, name: tuple[str, str], task: asyncio.Task[Any]) -> None:
        self._forget(name, task)
        if not task.cancelled():
            error = task.exception()  # marks the error as retrieved even if nobody waits anymore
            if isinstance(error, Refused):
                self._refused.keep(name, str(error))

    def _forget(self, name: tuple[str, str], task: asyncio.Task[Any]) -> None:
        shared = self._under_way.get(name)
        if shared is not None and shared.task is task:  # not a new fetch of the same name
            del self._under_way[name]

    async def _fetch_manifest(self, robot: str, digest: str) -> dict[str, Entry]:
        most = min((1 + READ_TIMES) * BYTES_MAX + ENTRY_BYTES, self.room.most // 2)
        async with self._room_for(robot, most) as claim:
            data = await self._source.fetch_manifest(robot, digest)
            taken = (1 + READ_TIMES) * len(data) + ENTRY_BYTES
            if taken > most or hashlib.sha256(data).hexdigest() != digest:
                raise Refused("the robot's manifest has changed, or is too large")
            try:
                files = read_manifest(data)
            except ManifestError as e:
                raise Refused(f"the robot's manifest is invalid: {e}") from None
            self.room.keep(claim, digest, data, len(data))
            self.room.keep(claim, f"{robot}/{digest}", files, READ_TIMES * len(data))
        return files

    async def _fetch_file(self, robot: str, digest: str, entry: Entry) -> None:
        if entry.size + 2 * ENTRY_BYTES > self.room.most:
            raise Unavailable(
                f"a file of {entry.size} bytes is more than this relay keeps (--model-cache-mb)"
            )
        turn = self._turns.setdefault(robot, asyncio.Semaphore(AT_ONCE))
        async with turn, self._room_for(robot, entry.size + ENTRY_BYTES) as claim:
            data = bytearray()  # grows with each range, so that a false size takes no memory
            await self._fill(data, robot, digest, entry)
            self.room.keep(claim, entry.sha256, data, len(data))
            self.room.keep(claim, _delivered(robot, entry.sha256), True, 0)

    async def _fill(self, data: bytearray, robot: str, digest: str, entry: Entry) -> None:
        digester = hashlib.sha256()
        try:
            while len(data) < entry.size:
                off = len(data)
                size = min(RANGE_BYTES, entry.size - off)
                part = await self._read(robot, digest, entry.sha256, off, size)
                if len(part) != size:
                    raise Refused(f"the robot's agent answered {len(part)} bytes at {off} of {entry.size}")
                data += part
                digester.update(part)
                await asyncio.sleep(0)  # a nearby agent answers so fast that it would block the loop
            if digester.hexdigest() != entry.sha256:
                raise Refused("the file does not match its manifest")
        except BaseException:
            data.clear()  # the error's traceback still refers to it
            raise

    async def _read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Read a range, with up to TRIES attempts: one lost range should not fail the whole file."""
        for _ in range(TRIES - 1):
            try:
                return await self._source.read(robot, digest, sha256, off, size)
            except Refused:
                raise
            except Unavailable:
                continue
        return await self._source.read(robot, digest, sha256, off, size)

    @contextlib.asynccontextmanager
    async def _room_for(self, robot: str, size: int) -> AsyncIterator[Claim]:
        """Claim memory during a fetch. Raises Unavailable if none is free or other robots need it more."""
        # a weak reference avoids a cycle between a task and its error, which only rare collections would free
        fetching: weakref.ref[asyncio.Task[Any]] = weakref.ref(cast(Any, asyncio.current_task()))
        gave_way = False

        def give_up() -> None:
            nonlocal gave_way
            gave_way = True
            if (task := fetching()) is not None:
                task.cancel()

        try:
            async with asyncio.timeout(WAIT_S):
                while (claim := self.room.claim(robot, size, give_up)) is None:
                    await self.room.wait_for_release()
        except TimeoutError:
            raise Unavailable("no memory for this model now: try again later") from None
        try:
            yield claim
        except asyncio.CancelledError:
            if not gave_way:
                raise
            raise Unavailable("no memory for this model: other robots' models need it") from None
        finally:
            self.room.release(claim)


def _delivered(robot: str, sha256: str) -> str:
    """Return the cache name of the note that this robot's agent has delivered this file."""
    return f"{robot}+{sha256}"
