"""Reads the past of an object store: what one audience could see of it live."""

from __future__ import annotations

import hashlib
from collections.abc import AsyncIterator

from posecast_wire.schema import TEXT_BYTES_MAX as SCHEMA_BYTES_MAX
from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX

from posecast_relay.archive.deletion import get_tombstone, list_tombstones
from posecast_relay.archive.index import list_days, list_pages
from posecast_relay.archive.models import MANIFEST, make_model_key
from posecast_relay.archive.names import ArchivedName, make_page_folder, make_schema_key, read_segment_key
from posecast_relay.archive.store import ObjectStore
from posecast_relay.core.policy import Audience
from posecast_relay.models.manifest import BYTES_MAX as MANIFEST_BYTES_MAX
from posecast_relay.past.deletions import Deletion
from posecast_relay.past.segment import DAY_MS, PAGE_MS
from posecast_relay.recording.source import ListedSegment, SourceSpan


class StoreSource:
    """The past of a robot's view in a store, as far as `audience` could see all of it live. What is deleted
    is not there, also where nobody has carried that out yet. What is foreign is passed over.

    Calls raise ArchiveError, when the store does not do what it is asked to.
    """

    def __init__(self, store: ObjectStore, robot: str, view: str, audience: Audience) -> None:
        self.robot = robot
        self.view = view
        self._store = store
        self._audience = audience
        self._keys: dict[tuple[int, int], str] = {}
        self._deletions: list[Deletion] | None = None

    async def close(self) -> None:
        """Nothing is held open."""

    async def find_span(self) -> SourceSpan | None:
        """Return from when to when there is something, by the first and the last day."""
        days = await list_days(self._store, self.robot, self.view)
        ends: list[ArchivedName] = []
        for order in (days, days[::-1]):
            for day_ms in order:
                found = [each async for each in self._list_names(day_ms, day_ms + DAY_MS)]
                if found:
                    ends += found
                    break
        if not ends:
            return None
        return SourceSpan(min(each.from_ms for each in ends), max(each.to_ms for each in ends))

    async def list_segments(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """List what begins in a span, by the names of objects."""
        days = set(await list_days(self._store, self.robot, self.view))
        listed: list[ListedSegment] = []
        for day_ms in range(from_ms - from_ms % DAY_MS, to_ms, DAY_MS):
            if day_ms not in days:
                continue
            async for each in self._list_names(max(from_ms, day_ms), min(to_ms, day_ms + DAY_MS)):
                name = each.name.take, each.name.index
                if name not in self._keys:
                    listed.append(ListedSegment(*name, each.from_ms, each.to_ms, None))
                self._keys[name] = each.key
        return listed

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """Read a segment that was listed."""
        return await self._read(self._keys[segment.take, segment.index], ENVELOPE_BYTES_MAX)

    async def load_schema(self, sha256: str) -> str | None:
        """Read a schema; None also for one that is damaged."""
        data = await self._read(make_schema_key(self.robot, bytes.fromhex(sha256)), SCHEMA_BYTES_MAX)
        return None if data is None or _hash(data) != sha256 else data.decode(errors="replace")

    async def load_manifest(self, model: str) -> bytes | None:
        """Read a manifest; None also for one that is damaged."""
        data = await self._read(make_model_key(self.robot, model, MANIFEST), MANIFEST_BYTES_MAX)
        return None if data is None or _hash(data) != model else data

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """Read a model's file; None also for one that is damaged."""
        data = await self._read(make_model_key(self.robot, model, path), size)
        return None if data is None or _hash(data) != sha256 else data

    async def _list_names(self, from_ms: int, to_ms: int) -> AsyncIterator[ArchivedName]:
        """What begins within a span of one day and is for the audience."""
        if self._deletions is None:
            self._deletions = await self._load_deletions()
        day_ms = from_ms - from_ms % DAY_MS
        for page_ms in await list_pages(self._store, self.robot, self.view, day_ms):
            if not from_ms - PAGE_MS < page_ms < to_ms:
                continue
            async for part in self._store.list_objects(make_page_folder(self.robot, self.view, page_ms)):
                for each in map(read_segment_key, (found.key for found in part)):
                    if each is not None and from_ms <= each.from_ms < to_ms and self._may_show(each):
                        yield each

    def _may_show(self, each: ArchivedName) -> bool:
        span = self.robot, self.view, each.from_ms, each.to_ms
        return self._audience in each.audiences and not any(
            deletion.covers(*span) for deletion in self._deletions or ()
        )

    async def _load_deletions(self) -> list[Deletion]:
        deletions: list[Deletion] = []
        for stem in (await list_tombstones(self._store)).all:
            try:
                deletion = await get_tombstone(self._store, stem)
            except ValueError:
                continue  # foreign
            if deletion is not None and deletion.robot == self.robot:
                deletions.append(deletion)
        return deletions

    async def _read(self, key: str, bytes_max: int) -> bytes | None:
        data = await self._store.get_range(key, 0, bytes_max + 1)
        return None if data is None or len(data) > bytes_max else data


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
