"""What is exported: a recording (SPEC §12) that lies in a folder on this machine, read part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from posecast_wire.recording import PastRecording, model_path, segment_path, unpack_segment


@dataclass(frozen=True)
class ExportedSpan:
    """A recording in `folder`, for writers of other formats. What they need of it is read when they ask, so
    memory does not grow with its length.

    `from_ms`, `to_ms`: the span that was asked for, unix; the recording holds whole segments, and so begins a
    little before and ends a little after it.
    `report` is told how many segments of how many have been read, after each.
    """

    folder: Path
    recording: PastRecording
    from_ms: int
    to_ms: int
    report: Callable[[int, int], None] = lambda _done, _total: None

    def read_segments(self) -> Iterator[tuple[str, bytes]]:
        """Yield a name to tell of each segment, and its bytes, by the moment at which they begin."""
        total = len(self.recording.segments)
        for done, each in enumerate(self.recording.segments, 1):
            path = segment_path(each.take, each.index)
            yield path, unpack_segment((self.folder / path).read_bytes())
            self.report(done, total)

    def find_model_file(self, model: str, name: str = "manifest.json") -> bytes | None:
        """Return a file of a model, by the SHA-256 of its manifest; None where the recording lacks it.

        `name` is as the manifest has it, which whoever made the recording has checked.
        """
        path = self.folder / model_path(model, name)
        return path.read_bytes() if path.is_file() else None
