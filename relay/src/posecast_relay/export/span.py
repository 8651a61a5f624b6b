"""What is exported: a recording (SPEC §12) that lies on this machine, read part by part, and written as one
file of another format, CSV or MCAP.

Its files are in a folder, or in one `.posecast` file, which is a ZIP of it. Both may come from anybody, so
a file is read up to a limit, and a ZIP is unpacked no further than that.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

from posecast_wire.recording import (
    RECORDING_FILE,
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

from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.table import HeldTime, TableReader

LIST_BYTES_MAX = 40_000_000  # of a ZIP's list of entries: 250,000 with the longest names of a recording
ENTRIES_MAX = 250_000  # 200,000 segments, pages of KEYs, and the files of models
METHODS = frozenset((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))  # others, as LZMA, may take gigabytes
# what `zipfile` raises for damaged archives
ZIP_ERRORS = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError),
    *(RuntimeError, OverflowError, LookupError),
)


class FileUnreadable(ValueError):
    """A file can't be read. The message is one line with the reason."""


class RecordingFiles(Protocol):
    """Gives the files of a recording by their paths, such as `recording.json`."""

    def read(self, path: str, most: int) -> bytes | None:
        """Return a file's bytes; None if there is no such file. Raises FileUnreadable, also if it has more
        than `most` bytes."""


class RecordingFolder:
    """The files in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def read(self, path: str, most: int) -> bytes | None:
        """See RecordingFiles."""
        place = self._folder / path
        try:
            if not place.is_file():  # opening a named pipe would wait for a writer
                return None
            with place.open("rb") as file:
                return _check_size(file.read(most + 1), most)
        except OSError as e:
            raise FileUnreadable((e.strerror or str(e)).lower()) from None


class RecordingZip:
    """The entries of a ZIP file, relative to the entry `recording.json` with the shortest path: somebody may
    have zipped the folder itself."""

    def __init__(self, file: BinaryIO) -> None:
        """Raises FileUnreadable."""
        try:
            self._zip = zipfile.ZipFile(_ShortReader(file))
            entries = self._zip.infolist()
        except (OSError, *ZIP_ERRORS) as e:
            if isinstance(e, FileUnreadable):
                raise
            is_empty = file.seek(0, os.SEEK_END) == 0
            reason = "the file is empty" if is_empty else "not a .posecast file, or cut short"
            raise FileUnreadable(reason) from None
        if len(entries) > ENTRIES_MAX:
            raise FileUnreadable(f"{len(entries)} entries, {ENTRIES_MAX} allowed")
        if sum(entry.compress_size for entry in entries) > file.seek(0, os.SEEK_END):
            # entries that share bytes would make a small file cost without limit
            raise FileUnreadable("its entries overlap")
        names = [name for name in self._zip.namelist() if f"/{name}".endswith(f"/{RECORDING_FILE}")]
        self._root = min(names, key=len, default="").removesuffix(RECORDING_FILE)

    def read(self, path: str, most: int) -> bytes | None:
        """See RecordingFiles."""
        try:
            entry = self._zip.getinfo(self._root + path)
        except KeyError:
            return None
        if entry.compress_type not in METHODS:
            raise FileUnreadable("compressed in a way that no recording is")
        if entry.file_size > most:
            raise FileUnreadable(f"over {most} bytes")
        try:
            with self._zip.open(entry) as opened:
                return _check_size(opened.read(most + 1), most)
        except FileUnreadable:
            raise
        except (OSError, *ZIP_ERRORS):
            raise FileUnreadable("damaged or cut short") from None


@contextmanager
def open_recording_files(place: Path) -> Iterator[RecordingFiles]:
    """Open a recording's folder, or the ZIP of one. Raises FileUnreadable."""
    if place.is_dir():
        yield RecordingFolder(place)
        return
    if os.path.lexists(place) and not place.is_file():
        raise FileUnreadable("neither a file nor a folder")
    try:
        file = place.open("rb")
    except OSError as e:
        raise FileUnreadable((e.strerror or str(e)).lower()) from None
    with file:
        yield RecordingZip(file)


class _ShortReader(io.BufferedIOBase):
    """Reads a file in pieces of limited size: `zipfile` asks for a whole list of entries at once."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int | None = -1) -> bytes:
        """Raises FileUnreadable for too large a piece."""
        wanted = LIST_BYTES_MAX + 1 if size is None or size < 0 else min(size, LIST_BYTES_MAX + 1)
        data = self._file.read(wanted)
        if len(data) > LIST_BYTES_MAX:
            raise FileUnreadable(f"its list of entries has over {LIST_BYTES_MAX} bytes")
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """As that file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """As that file."""
        return self._file.tell()

    def seekable(self) -> bool:
        """It is."""
        return True


def _check_size(data: bytes, most: int) -> bytes:
    if len(data) > most:
        raise FileUnreadable(f"over {most} bytes")
    return data


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


# suffix of a file → what writes a table to it, and returns the number of frames
WRITERS: Mapping[str, Callable[[BinaryIO, TableReader, ExportedSpan], int]] = {
    ".csv": lambda file, table, _span: write_csv(file, table),
    ".mcap": lambda file, table, span: write_mcap(file, table, span.find_model_file),
}


@dataclass(frozen=True)
class WrittenTable:
    """What was written. `frames`: how many; `held`: of which time; `warnings`: a line for what was passed
    over, and one for each other thing that is not in the file, without a full stop."""

    frames: int
    held: HeldTime
    warnings: Sequence[str]


def write_table(file: BinaryIO, suffix: str, span: ExportedSpan) -> WrittenTable:
    """Write the frames that were accepted in the span (and in MCAP the events) as WRITERS has it for the
    suffix, and return what there was. What can't be read is passed over. Raises OSError,
    TooManyColumnsError, TooManyTopicsError, and McapMissingError without the extra `export`."""
    table = TableReader(span.read_segments(), span.recording.schemas, span.from_ms, span.to_ms)
    return WrittenTable(WRITERS[suffix](file, table, span), table.held, table.losses.describe())
