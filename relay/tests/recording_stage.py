"""A source of the past for tests of recordings, a page to put beside one, and what a folder then says."""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from posecast_relay.past.segment import KeptSegment
from posecast_relay.recording.collector import Collection, Collector, Description
from posecast_relay.recording.source import ListedSegment, SourceSpan
from posecast_wire.recording import PastRecording, RecordingNote

NO_WORDS = Description(None, None, None, lambda _from_ms, _to_ms: [])
INDEX = """<!doctype html>
<html lang="en">
  <head>
    <meta name="description" content="Put a robot on a URL." />
    <meta property="og:title" content="Posecast" />
    <meta property="og:image" content="./icon-512.png" />
    <link rel="icon" href="./favicon.svg" type="image/svg+xml" />
    <title>Posecast</title>
    <script type="module" async src="./assets/early-1.js"></script>
    <script type="module" crossorigin src="./assets/index-1.js"></script>
  </head>
  <body></body>
</html>
"""


class KeptModel:
    """A model as a source has it: its manifest and its files by path."""

    def __init__(self, files: dict[str, tuple[bytes, str]], **more: object) -> None:
        self.files = {path: data for path, (data, _) in files.items()}
        listed = [
            {"path": path, "size": len(data), "sha256": hashlib.sha256(data).hexdigest(), "type": kind}
            for path, (data, kind) in files.items()
        ]
        self.manifest = json.dumps({"v": 2, "files": listed} | more).encode()
        self.name = hashlib.sha256(self.manifest).hexdigest()


class KeptSource:
    """The past of the robot `r` in memory. What a test takes out of `data` is gone, what it changes there is
    damaged."""

    robot, view = "r", "public"

    def __init__(self, segments: Iterable[KeptSegment], models: Sequence[KeptModel] = ()) -> None:
        self.segments = [*segments]
        self.data = {(each.name.take, each.name.index): each.data for each in self.segments}
        self.schemas = {
            each.schema.hex(): each.schema_text or "" for each in self.segments if each.schema is not None
        }
        self.models = {model.name: model for model in models}

    async def find_span(self) -> SourceSpan | None:
        """As a relay."""
        if not self.segments:
            return None
        return SourceSpan(min(s.from_ms for s in self.segments), max(s.to_ms for s in self.segments))

    async def list_segments(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """As a relay, in an order that says nothing."""
        return [
            ListedSegment(each.name.take, each.name.index, each.from_ms, each.to_ms, each.sha256.hex())
            for each in reversed(self.segments)
            if from_ms <= each.from_ms < to_ms
        ]

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """As a relay."""
        await asyncio.sleep(0)
        return self.data.get((segment.take, segment.index))

    async def load_schema(self, sha256: str) -> str | None:
        """As a relay."""
        return self.schemas.get(sha256)

    async def load_manifest(self, model: str) -> bytes | None:
        """As a relay."""
        found = self.models.get(model)
        return None if found is None else found.manifest

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """As a relay."""
        return self.models[model].files.get(path)

    async def close(self) -> None:
        """Nothing is held open."""


def collect(
    source: KeptSource,
    folder: Path,
    from_ms: int = 0,
    to_ms: int = 1 << 52,
    about: Description = NO_WORDS,
    packs: bool = False,
) -> tuple[PastRecording, Collection]:
    """Collect a span into a new folder."""
    folder.mkdir()
    collector = Collector(source, folder, packs=packs)
    return asyncio.run(collector.collect(from_ms, to_ms, about)), collector.found


def describe(title: str | None = None, notes: Sequence[RecordingNote] = ()) -> Description:
    """What somebody says about a recording."""
    return Description(title, "A. Kim", "CC BY 4.0", lambda _from_ms, _to_ms: notes)


def make_page(folder: Path) -> Path:
    """A small built page, with all that has to be left out."""
    for path, text in {
        "index.html": INDEX,
        "index.html.br": "packed",
        "index.html.gz": "packed",
        "embed/index.html": INDEX.replace("./", "../").replace("<html ", '<html data-page="embed" '),
        "assets/index-1.js": "1",
        "assets/index-1.js.br": "packed",
        "assets/index-1.js.gz": "packed",
        "assets/early-1.js": "2",
        "icon-512.png": "icon",
        "config.json": '{"relay": "https://relay.example"}',
        "docs/swagger-ui.css": "3",
        ".vite/manifest.json": "{}",
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


def list_files(folder: Path) -> list[str]:
    """The paths of all files, sorted."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
