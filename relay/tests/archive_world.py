"""An archive in a folder, its writer, indexer and reader, over segments that a test makes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from posecast_relay.archive.joined import JoinedPast
from posecast_relay.archive.reader import ArchiveReader
from posecast_relay.archive.store import ObjectStore, open_object_store
from posecast_relay.archive.upkeep import Indexer
from posecast_relay.archive.writer import ArchiveWriter
from posecast_relay.past.memory import MemoryPast, MemoryPastSource
from posecast_relay.past.segment import KeptSegment
from posecast_relay.past.source import PastSource
from posecast_testing import until_async

from .past_doors import PAGE_MS, PastDoors, Rules, make_kept

QUICK_S = (0.01, 0.05)  # pauses after a failure
KEEP_S = 30 * 86400.0


class ArchiveWorld:
    """A store, what writes it and what reads it. `unix_ms`: the time."""

    def __init__(self, folder: Path, robots: Iterable[str] = ("r",), **writer: Any) -> None:
        self.folder = folder
        self.unix_ms = PAGE_MS
        self.store = open_object_store(f"file://{folder}")
        self.indexer = Indexer(self.store, lambda: self.unix_ms / 1000)
        self.writer = ArchiveWriter(
            writer.pop("store", self.store), self.indexer.mend, backoff_s=QUICK_S, **writer
        )
        self.indexer.writer = self.writer
        self.keep(dict.fromkeys(robots, KEEP_S))
        self.now = 0.0
        self.reader = self.make_reader()

    def keep(self, keeps_s: dict[str, float]) -> None:
        """Another file of robots."""
        self.writer.set_keeps(keeps_s)
        self.indexer.set_keeps(keeps_s)

    def make_reader(self) -> ArchiveReader:
        """A reader that knows nothing yet."""
        return ArchiveReader(
            open_object_store(f"file://{self.folder}"),
            lambda: self.now,
            lambda: self.unix_ms / 1000,
            mend=self.indexer.mend,
        )

    def make_doors(self, rules: Rules | None, front: PastSource | None = None) -> PastDoors:
        """Routes of a process that has just begun: nothing is recent, all is in the store."""
        doors = PastDoors(
            rules, JoinedPast(front or MemoryPastSource(MemoryPast(1 << 26)), self.make_reader())
        )
        doors.unix_ms = self.unix_ms
        return doors

    async def write(self, *segments: KeptSegment) -> None:
        """Write segments as they are closed, and wait until they are there."""
        for segment in segments:
            self.writer.keep(segment)
        await self.written()

    async def written(self) -> None:
        """Wait until nothing waits."""
        await until_async("all is written", lambda: not self.writer.waiting_bytes)

    async def index(self) -> None:
        """Write all indexes, as at a stop."""
        await self.indexer.stop()

    def list_files(self, ending: str = "") -> list[str]:
        """All files in the store."""
        files = (path for path in self.folder.rglob("*") if path.is_file())
        return sorted(
            path.relative_to(self.folder).as_posix() for path in files if path.name.endswith(ending)
        )


class GatedStore(ObjectStore):
    """A store whose writes wait until they are let through, one by one or all."""

    def __init__(self, folder: Path) -> None:
        under = open_object_store(f"file://{folder}")
        super().__init__(under._store, folder=folder)
        self.gate = asyncio.Event()
        self.puts: list[str] = []
        self.at_once = self.most_at_once = 0

    async def put(self, key: str, data: bytes) -> None:
        """Wait, then write."""
        self.at_once += 1
        self.most_at_once = max(self.most_at_once, self.at_once)
        await self.gate.wait()
        await super().put(key, data)
        self.puts.append(key)
        self.at_once -= 1


def make_run(count: int, from_ms: int = PAGE_MS, step_ms: int = 4000, **more: Any) -> list[KeptSegment]:
    """So many segments, one after the other."""
    return [make_kept(n, from_ms + n * step_ms, **more) for n in range(count)]


def break_store(folder: Path) -> Callable[[], None]:
    """Make a store unusable, whoever writes; returns what mends it."""
    aside = folder.with_name(folder.name + ".aside")
    folder.rename(aside)
    folder.write_text("no folder")

    def mend() -> None:
        folder.unlink()
        aside.rename(folder)

    return mend
