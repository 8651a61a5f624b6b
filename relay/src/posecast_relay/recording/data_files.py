"""Writes a recording as a table and as messages beside its page, for people who want its numbers."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from posecast_relay.export.csv_file import TooManyColumnsError
from posecast_relay.export.mcap_file import McapMissingError, TooManyTopicsError
from posecast_relay.export.span import ExportedSpan, write_table
from posecast_relay.recording.output import DATA_FILES

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

MEGABYTE = 1_000_000
DATA_MAX_MB = 100  # GitHub and others refuse larger files; an hour of a humanoid takes more as CSV


class DataFiles(NamedTuple):
    """The size in bytes of each file that was written, and lines about the others and what is not in them."""

    sizes: Mapping[str, int]
    warnings: Sequence[str]


class _TooLarge(Exception):
    """A file would have more bytes than allowed."""


def write_data_files(folder: Path, span: ExportedSpan, most_mb: int) -> DataFiles:
    """Write them into a folder. One that would have over `most_mb` MB is left out; with 0 both are. Raises
    OSError."""
    sizes: dict[str, int] = {}
    warnings: list[str] = []
    for name in DATA_FILES if most_mb else ():
        path = folder / name
        try:
            with _LimitedFile(path, most_mb) as file:
                table = write_table(file, path.suffix, span)
        except (_TooLarge, McapMissingError, TooManyColumnsError, TooManyTopicsError) as e:
            why = str(e)
        else:
            why = "" if table.frames else "there are no frames"
            warnings += [f"{name}: {line}" for line in table.warnings]
        if why:
            warnings.append(f"{name}: left out: {why}")
            path.unlink()
        else:
            sizes[name] = path.stat().st_size
    return DataFiles(sizes, warnings)


class _LimitedFile(io.BufferedWriter):
    """A file that grows no further than `most_mb` MB."""

    def __init__(self, path: Path, most_mb: int) -> None:
        super().__init__(io.FileIO(path, "wb"))
        self._left = most_mb * MEGABYTE
        self._most_mb = most_mb

    def write(self, data: ReadableBuffer) -> int:
        """Raises _TooLarge."""
        count = super().write(data)
        self._left -= count
        if self._left < 0:
            raise _TooLarge(f"over {self._most_mb} MB; --data-max allows more")
        return count
