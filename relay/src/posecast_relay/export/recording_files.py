"""Where the files of a recording are (SPEC §12): a folder, or one `.posecast` file, which is a ZIP of it.

Both may come from anybody, so a file is read up to a limit, and a ZIP is unpacked no further than that.
"""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Protocol

from posecast_wire.recording import RECORDING_FILE

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
            reason = str(e) if isinstance(e, FileUnreadable) else "not a .posecast file, or cut short"
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
