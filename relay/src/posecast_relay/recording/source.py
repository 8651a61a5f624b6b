"""The port through which an export reads the past: from a running relay, or an object store."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol


class PastUnreadable(Exception):
    """The past can't be read there. The message is one line that says what was asked and why not."""


class PastDamaged(PastUnreadable):
    """One part of the past is damaged; others may be fine."""


class PartAway(PastUnreadable):
    """The source answers, but can't deliver this part now; others may be available."""


class SourceSpan(NamedTuple):
    """From when to when there is something, unix ms."""

    from_ms: int
    to_ms: int


@dataclass(frozen=True, slots=True)
class ListedSegment:
    """A segment that there is. `take`: u64; `from_ms`, `to_ms`: unix; `sha256`: of its bytes, hexadecimal,
    where that is known."""

    take: int
    index: int
    from_ms: int
    to_ms: int
    sha256: str | None


class RecordingSource(Protocol):
    """The past of one robot and view, as one audience may see it. Every call raises PastUnreadable when it
    can't be read, or ArchiveError of a store; what is not there, or not there any more, is None."""

    @property
    def robot(self) -> str:
        """The robot's id."""

    @property
    def view(self) -> str:
        """The view's name."""

    async def find_span(self) -> SourceSpan | None:
        """Return from when to when there is something."""

    async def list_segments(self, from_ms: int, to_ms: int) -> list[ListedSegment]:
        """Return the segments that begin from `from_ms` up to `to_ms` (unix, the end not included), in any
        order, none twice."""

    async def load_segment(self, segment: ListedSegment) -> bytes | None:
        """Return a segment's bytes."""

    async def load_schema(self, sha256: str) -> str | None:
        """Return the text of a schema."""

    async def load_manifest(self, model: str) -> bytes | None:
        """Return the manifest of this SHA-256."""

    async def load_model_file(self, model: str, path: str, sha256: str, size: int) -> bytes | None:
        """Return a file that the manifest names with this path, SHA-256 and size in bytes."""

    async def close(self) -> None:
        """End what is left of connections."""
