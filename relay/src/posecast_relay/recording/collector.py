"""Collects a span of the past from a source into a folder, as a recording without a page."""

from __future__ import annotations

import asyncio
import re
import shutil
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from posecast_wire.checked import loads, make_visible
from posecast_wire.key_page import KeyPose, encode_key_page, pick_pose
from posecast_wire.recording import (
    RECORDING_FILE,
    PastRecording,
    RecordedEvent,
    RecordedSegment,
    RecordedWord,
    RecordingError,
    RecordingNote,
    encode_recording,
    key_page_path,
    model_path,
    pack_segment,
    segment_path,
)
from posecast_wire.recording.contents import HASHES_MAX, SEGMENTS_MAX
from posecast_wire.segment import (
    EventRecord,
    ModelRecord,
    Segment,
    SegmentError,
    WordRecord,
    decode_segment,
)

from posecast_relay.models.manifest import ManifestError, read_manifest
from posecast_relay.past.segment import PAGE_MS
from posecast_relay.recording.source import ListedSegment, PartAway, PastDamaged, RecordingSource

AHEAD = 16  # segments that are asked for ahead of their turn
SEGMENT_MS_MAX = 600_000  # a segment that reaches into a span begins at most so long before it
KEY_PAGE_BYTES_MAX = 100_000
# the files of a model; anything else that a robot names, as HTML, would be served beside the page
MODEL_SUFFIXES = frozenset(
    (
        *(".glb", ".gltf", ".bin", ".stl", ".obj", ".mtl", ".dae", ".ply", ".urdf", ".json"),
        *(".png", ".jpg", ".jpeg", ".webp", ".bmp", ".gif", ".tga", ".tif", ".tiff", ".dds", ".ktx2"),
    )
)
ACTIVE = re.compile(  # a suffix before the last: a host that does not know the last one goes by it
    r"\.(?:[sxp]?html?|php\d?|phar|cgi|pl|py|aspx?|jspx?|svgz?|xml|xslt?|m?js|css)\.", re.IGNORECASE
)
LOST_SHOWN = 5  # lines about what is not in it


class NothingThere(Exception):
    """The span is empty. The message is one line that says what there is."""


class Description(NamedTuple):
    """What somebody says about a recording. `place_notes` is told its beginning and end, unix ms."""

    title: str | None
    author: str | None
    licence: str | None
    place_notes: Callable[[int, int], Sequence[RecordingNote]]


@dataclass
class Collection:
    """What has been collected so far: `done` segments of `total`, `size` bytes in all. `lost`: one line for
    each thing that is not in it, and why; of many the first few, and `lost_count` how many they are.
    `damaged`: why a segment is not in it, until that is told; `awaited`: what is asked for just now.
    """

    total: int = 0
    done: int = 0
    segments: list[RecordedSegment] = field(default_factory=list)
    schemas: dict[str, str] = field(default_factory=dict)
    models: dict[str, None] = field(default_factory=dict)
    size: int = 0
    lost: list[str] = field(default_factory=list)
    lost_count: int = 0
    damaged: dict[tuple[int, int], str] = field(default_factory=dict)
    awaited: str = ""

    def lose(self, what: str, why: str) -> None:
        """Note that something is not in it."""
        self.lost_count += 1
        if len(self.lost) < LOST_SHOWN:
            self.lost.append(f"{what}: {make_visible(why)}")


class Collector:
    """Collects the past of `source` into `folder`, which is empty. Each wait is reported, see `report_to`.

    `packs`: segments are written as gzip, where that makes them smaller: by a sixth.
    """

    def __init__(self, source: RecordingSource, folder: Path, *, packs: bool = False) -> None:
        self._packs = packs
        self._report: Callable[[Collection], None] = lambda _: None
        self._source = source
        self._folder = folder
        self._poses: list[KeyPose] = []
        self._page_ms = 0
        self.found = Collection()

    def report_to(self, listener: Callable[[Collection], None]) -> None:
        """Call `listener` around each wait, from now on."""
        self._report = listener

    async def collect(self, from_ms: int, to_ms: int, about: Description) -> PastRecording:
        """Write every segment that lies at least partly within the span (unix ms), and what they need.

        Raises NothingThere, PastUnreadable, RecordingError, and OSError when it can't be written.
        """
        listed = await self._list(from_ms, to_ms)
        found = self.found
        found.total = len(listed)
        begin_ms, end_ms = listed[0].from_ms, max(each.to_ms for each in listed)
        notes = tuple(about.place_notes(begin_ms, end_ms))
        async for each, data in self._load(listed):
            if data is None:
                why = found.damaged.pop((each.take, each.index), "gone before it could be read")
                found.lose(segment_path(each.take, each.index), why)
            else:
                await self._take(each, data)
            found.done += 1
            self._report(found)
        self._write_key_page()
        if not found.segments:
            raise NothingThere(f"no segment of {found.total:,} could be read; the first: {found.lost[0]}")
        for model in list(found.models):
            before = found.size
            try:
                await self._take_model(model)
            except PastDamaged as e:
                found.lose(model_path(model, ""), f"left out: {e}")
                found.size = before
                shutil.rmtree(self._folder / model_path(model, ""), ignore_errors=True)
        recording = PastRecording(
            robot=self._source.robot,
            view=self._source.view,
            from_ms=begin_ms,
            to_ms=end_ms,
            segments=tuple(found.segments),
            schemas=found.schemas,
            models=tuple(found.models),
            notes=notes,
            title=about.title,
            author=about.author,
            licence=about.licence,
        )
        self._write(RECORDING_FILE, encode_recording(recording))
        return recording

    async def _list(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """The segments of a span, by beginning, take and index: at least one."""
        begin_ms = max(0, from_ms - SEGMENT_MS_MAX)
        all_of = await self._source.list_segments(begin_ms, to_ms) if begin_ms < to_ms else []
        listed = [each for each in all_of if each.to_ms > from_ms or each.from_ms >= from_ms]
        if len(listed) > SEGMENTS_MAX:
            raise RecordingError(f"segments: {len(listed)}, {SEGMENTS_MAX} allowed: export a shorter span")
        if listed:
            return sorted(listed, key=lambda each: (each.from_ms, each.take, each.index))
        raise NothingThere("nothing was recorded in this span")

    async def _load(
        self, listed: Sequence[ListedSegment]
    ) -> AsyncIterator[tuple[ListedSegment, bytes | None]]:
        """Each segment with its bytes, in order; some are asked for ahead."""
        waiting: deque[tuple[ListedSegment, asyncio.Task[bytes | None]]] = deque()
        left = iter(listed)
        try:
            while True:
                for each in islice(left, AHEAD - len(waiting)):
                    waiting.append((each, asyncio.ensure_future(self._source.load_segment(each))))
                if not waiting:
                    return
                first, task = waiting[0]
                self._wait_for(segment_path(first.take, first.index))
                data: bytes | None = None
                try:
                    data = await task
                except PastDamaged as e:
                    self.found.damaged[first.take, first.index] = str(e)
                waiting.popleft()
                yield first, data
        finally:
            for _, task in waiting:
                task.cancel()
            await asyncio.gather(*(task for _, task in waiting), return_exceptions=True)

    async def _take(self, listed: ListedSegment, data: bytes) -> None:
        """Write a segment, unless it can't be read or is not the one that was listed."""
        found, path = self.found, segment_path(listed.take, listed.index)
        try:
            segment = decode_segment(data)
        except SegmentError as e:
            found.lose(path, str(e))
            return
        start = segment.start
        name = (start.take, start.index, start.from_ms, segment.to_ms)
        named = (start.robot, start.view, ListedSegment(*name, listed.sha256))
        if named != (self._source.robot, self._source.view, listed):
            found.lose(path, f"is of {start.robot}/{start.view}, take {start.take:016x}, index {start.index}")
            return
        if start.schema is not None and start.schema not in found.schemas:
            text = await self._source.load_schema(start.schema)
            if text is None:
                found.lose(path, "its schema is missing")
                return
            found.schemas[start.schema] = text
        found.models.update(dict.fromkeys(_list_models(segment)))
        for what, hashes in (("schemas", found.schemas), ("models", found.models)):
            if len(hashes) > HASHES_MAX:  # the index would be refused at the end, and they are in memory
                raise RecordingError(f"{what}: more than {HASHES_MAX}: export a shorter span")
        found.segments.append(_describe(segment, len(data)))
        self._write(path, pack_segment(data) if self._packs else data)
        pose = pick_pose(segment)
        if pose is not None:
            page_ms = start.from_ms - start.from_ms % PAGE_MS
            if page_ms != self._page_ms:
                self._write_key_page()
            self._page_ms = page_ms
            self._poses.append(pose)

    def _write_key_page(self) -> None:
        """Write the page of KEYs of the ten minutes that are over."""
        poses, self._poses = self._poses, []
        if not poses:
            return
        every, data = 1, b""
        while not data or (len(data) > KEY_PAGE_BYTES_MAX and every < len(poses)):
            data = encode_key_page(self._source.robot, self._source.view, self._page_ms, poses, every)
            every *= 2
        self._write(key_page_path(self._page_ms), data)

    async def _take_model(self, model: str) -> None:
        """Write those files of a model that there are."""
        found = self.found
        self._wait_for(model_path(model, "manifest.json"))
        manifest = await self._load_or_lose(
            model_path(model, "manifest.json"), self._source.load_manifest(model)
        )
        if manifest is None:
            return
        try:
            entries = read_manifest(manifest)
        except ManifestError as e:
            found.lose(model_path(model, "manifest.json"), str(e))
            return
        self._write(model_path(model, "manifest.json"), manifest)
        strange = [path for path in entries if not _is_of_a_model(path)]
        if strange:
            more = f" and {len(strange) - 1} more" if len(strange) > 1 else ""
            found.lose(model_path(model, strange[0]), f"not a file of a model{more}")
        entries = {path: entry for path, entry in entries.items() if _is_of_a_model(path)}
        for path, entry in entries.items():
            if path == "manifest.json" or any(
                part.as_posix() in entries for part in PurePosixPath(path).parents
            ):
                found.lose(model_path(model, path), "its path collides with another file's")
                continue
            self._wait_for(model_path(model, path))
            loading = self._source.load_model_file(model, path, entry.sha256, entry.size)
            data = await self._load_or_lose(model_path(model, path), loading)
            if data is not None:
                self._write(model_path(model, path), data)

    async def _load_or_lose(self, path: str, loading: Awaitable[bytes | None]) -> bytes | None:
        """Wait for one of a model's files; if the source does not have it, note why."""
        try:
            data = await loading
        except PartAway as e:
            self.found.lose(path, str(e))
            return None
        if data is None:
            self.found.lose(path, "no longer kept")
        return data

    def _wait_for(self, path: str) -> None:
        self.found.awaited = path
        self._report(self.found)

    def _write(self, path: str, data: bytes) -> None:
        file = self._folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
        self.found.size += len(data)


def _is_of_a_model(path: str) -> bool:
    """Whether a file is of a kind that models are made of, by its name, by which hosts tell what it is."""
    name = PurePosixPath(path)
    return name.suffix.lower() in MODEL_SUFFIXES and not ACTIVE.search(name.name)


def _list_models(segment: Segment) -> list[str]:
    named = [segment.start.model]
    named += [record.model for record in segment.records if isinstance(record, ModelRecord)]
    return [model for model in named if model is not None]


def _describe(segment: Segment, size: int) -> RecordedSegment:
    """What an index tells of a segment."""
    start, frames = segment.start, segment.frames
    words = [RecordedWord(start.from_ms, start.word)]
    events: list[RecordedEvent] = []
    for record in segment.records:
        at_ms = start.from_ms + record.at_us // 1000
        if isinstance(record, WordRecord):
            words.append(RecordedWord(at_ms, record.word))
        elif isinstance(record, EventRecord):
            event = _read_event(record.text)
            if event is not None:
                events.append(RecordedEvent(at_ms, event))
    return RecordedSegment(
        take=start.take,
        run_id=start.run_id,
        index=start.index,
        from_ms=start.from_ms,
        to_ms=segment.to_ms,
        frames=len(frames),
        first_seq=frames[0].seq if frames else 0,
        last_seq=frames[-1].seq if frames else 0,
        size=size,
        schema=start.schema,
        model=start.model,
        missing=start.missing,
        words=tuple(words),
        events=tuple(events),
    )


def _read_event(text: str) -> dict[str, object] | None:
    """An event's members; None for a text that no viewer could read either."""
    try:
        event = loads(text)
    except ValueError:
        return None
    return event if isinstance(event, dict) else None
