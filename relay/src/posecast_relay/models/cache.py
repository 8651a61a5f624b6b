"""Fetches robots' models from their edges when somebody asks, verifies them, keeps them in bounded memory.

A model is named by the SHA-256 of its manifest, each file by its own. So what is kept never changes, and the
same bytes of several robots are kept once. But a robot may name a hash whose file it does not have, so its
own edge has to deliver each file once before it is served as that robot's. Files are fetched in small ranges,
one by one at low priority: one large reply would cut a thin uplink's connection. A fetch that nobody waits
for any more is cancelled.
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

from posecast_relay.logging import visible
from posecast_relay.models.manifest import (
    BYTES_MAX,
    SHA256,
    Entry,
    ManifestError,
    read_manifest,
)
from posecast_relay.models.memory import ENTRY_BYTES, Claim, ModelMemory
from posecast_relay.models.refusal_memory import REFUSED_S, RefusalMemory

RANGE_BYTES = 250_000
TRIES = 3  # of a range
AT_ONCE = 4  # files under way from one robot; further ones wait their turn
WAIT_S = 20.0  # for room, while others use all there is
RETRY_S = 5.0  # when somebody who was told that a model can't be had now may ask again
READ_TIMES = 4  # a manifest takes so many times its bytes once more when it is read
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
    """There is no such model or file."""


class Unavailable(RuntimeError):
    """The model can't be had just now. The message is one line that says why."""

    def __init__(self, why: str, retry_s: float = RETRY_S) -> None:
        """`retry_s`: when it is worth asking again, in seconds."""
        super().__init__(why)
        self.retry_s = retry_s


class Refused(Unavailable):
    """What the robot has sent can't be served. It is not asked for it again for REFUSED_S seconds."""

    def __init__(self, why: str, retry_s: float = REFUSED_S) -> None:
        """`retry_s`: when the robot is asked again, in seconds."""
        super().__init__(why, retry_s)


class ModelSource(Protocol):
    """Where a ModelCache fetches models from. A `digest` names a model by the SHA-256 of its manifest."""

    def offers(self, robot: str, digest: str) -> bool:
        """Whether this model is worth asking for."""

    async def fetch_manifest(self, robot: str, digest: str) -> bytes:
        """Return the bytes of a model's manifest, not verified. Raises Absent or Unavailable."""

    async def read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Return `size` bytes of a file from `off` on, at most RANGE_BYTES. Raises Absent or Unavailable."""


class ModelFile(NamedTuple):
    """A file that is in memory now: its SHA-256 as its name, the type to serve it as, its size in bytes."""

    name: str
    type: str
    size: int


@dataclass
class _Shared:
    """A fetch that several wait for."""

    task: asyncio.Task[Any]
    askers: int = 0


class ModelCache:
    """Fetches models and keeps them: at most `cache_bytes` kept or being fetched, see ModelMemory."""

    def __init__(
        self, source: ModelSource, cache_bytes: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._source = source
        self.room = ModelMemory(cache_bytes, now)
        self._refused = RefusalMemory(now)
        self._under_way: dict[tuple[str, str], _Shared] = {}
        self._turns: weakref.WeakValueDictionary[str, asyncio.Semaphore] = weakref.WeakValueDictionary()

    async def load_manifest(self, robot: str, digest: str) -> ModelFile:
        """Fetch a model's manifest, unless it is kept. Raises Absent or Unavailable."""
        await self.load_entries(robot, digest)
        return ModelFile(digest, "application/json", len(self.find_data(digest) or b""))

    async def load_file(self, robot: str, digest: str, path: str) -> ModelFile:
        """Fetch a file by its path in the manifest, unless it is kept. Raises Absent or Unavailable."""
        entry = (await self.load_entries(robot, digest)).get(path)
        if entry is None:
            raise Absent(f"no file '{visible(path)}' in this model")
        if self.find_data(entry.sha256) is None or self.room.get(_delivered(robot, entry.sha256)) is None:
            name = robot, f"{entry.sha256}/{entry.size}"
            await self._once(name, lambda: self._fetch_file(robot, digest, entry))
        elif len(self.find_data(entry.sha256) or b"") != entry.size:  # another manifest has told the truth
            raise Unavailable(f"'{visible(path)}' does not have the size that the manifest gives")
        kind = entry.type if entry.type in TYPES else "application/octet-stream"
        return ModelFile(entry.sha256, kind, entry.size)

    def find_data(self, name: str) -> bytes | bytearray | None:
        """Return the bytes kept under a name, or None. Don't hold on to them: that memory is not counted."""
        return cast("bytes | bytearray | None", self.room.get(name))

    def copy_piece(self, name: str, off: int, size: int) -> bytes | None:
        """Copy up to `size` bytes, from `off` on, of what is kept under a name; None when it is not kept."""
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
        """Fetch once for all who ask at the same time, and only while one of them still waits.

        Raises Refused without fetching when what came lately was refused.
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
            error = task.exception()  # seen, also when nobody waits any more
            if isinstance(error, Refused):
                self._refused.keep(name, str(error))

    def _forget(self, name: tuple[str, str], task: asyncio.Task[Any]) -> None:
        shared = self._under_way.get(name)
        if shared is not None and shared.task is task:  # not one that has begun anew meanwhile
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
            data = bytearray()  # it grows as ranges come: a size that is only claimed takes no memory
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
                await asyncio.sleep(0)  # an edge nearby would keep the loop busy
            if digester.hexdigest() != entry.sha256:
                raise Refused("the file does not match its manifest")
        except BaseException:
            data.clear()  # the error holds it with its traceback
            raise

    async def _read(self, robot: str, digest: str, sha256: str, off: int, size: int) -> bytes:
        """Read a range, TRIES times if needed: one that a bad uplink loses should not cost the whole file."""
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
        """Claim room during a fetch. Raises Unavailable when there is none, or other robots need it more."""
        # weakly: a task that is held by its own error goes only with a collection, which is rare
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
    """Return the name under which is kept that this robot's edge has delivered this file."""
    return f"{robot}+{sha256}"
