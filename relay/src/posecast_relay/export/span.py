"""What is exported: a recording (SPEC §12) that lies on this machine, read part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from posecast_wire.recording import (
    PastRecording,
    RecordedSegment,
    RecordingError,
    check_segment,
    model_path,
    segment_path,
    unpack_segment,
)
from posecast_wire.segment import SegmentError
from posecast_wire.segment.envelope import ENVELOPE_BYTES_MAX
from posecast_wire.segment.reader import read_until_frame

from posecast_relay.export.recording_files import FileUnreadable, RecordingFiles

MANIFEST_BYTES_MAX = 1 << 20  # as the relay accepts them from robots


@dataclass(frozen=True)
class ExportedSpan:
    """A span of a recording whose files are `files`, for writers of other formats. What they need of it is
    read when they ask, so memory does not grow with its length.

    `from_ms`, `to_ms`: the span that was asked for, unix; the recording holds whole segments, and so begins a
    little before and ends a little after it.
    `report` is told how many segments of how many have been read, after each.
    """

    files: RecordingFiles
    recording: PastRecording
    from_ms: int
    to_ms: int
    report: Callable[[int, int], None] = lambda _done, _total: None

    def read_segments(self) -> Iterator[tuple[str, bytes | SegmentError]]:
        """Yield a name to tell of each segment, and its bytes or why it can't be read, by the moment at which
        they begin."""
        total = len(self.recording.segments)
        for done, each in enumerate(self.recording.segments, 1):
            path = segment_path(each.take, each.index)
            try:
                yield path, self._read_segment(path, each)
            except SegmentError as e:
                yield path, e
            self.report(done, total)

    def _read_segment(self, path: str, expected: RecordedSegment) -> bytes:
        try:
            data = self.files.read(path, ENVELOPE_BYTES_MAX)
            if data is None:
                raise SegmentError("missing")
            data = unpack_segment(data)
            check_segment(self.recording, expected, read_until_frame(data)[0])
        except FileUnreadable as e:
            raise SegmentError(str(e)) from None
        except RecordingError as e:
            raise SegmentError(str(e).removeprefix(f"{path}: ")) from None
        return data

    def find_model_file(self, model: str) -> bytes | None:
        """Return the manifest of a model, by its SHA-256; None where the recording lacks it, or it can't be
        read."""
        try:
            return self.files.read(model_path(model, "manifest.json"), MANIFEST_BYTES_MAX)
        except FileUnreadable:
            return None
