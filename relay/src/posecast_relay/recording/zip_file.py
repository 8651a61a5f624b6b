"""Packs a recording's folder into one `.posecast` file. The same recording always gives the same bytes."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

from posecast_wire.recording import RECORDING_FILE, PastRecording, segment_path

WORTH_IT = 0.95  # an entry is deflated if that leaves less than this share of its bytes, else stored
DEFLATE_UP_TO_BYTES = 64 << 20
UNIX, PLAIN_FILE = 3, 0o100644 << 16


def pack_recording(
    folder: Path,
    recording: PastRecording,
    file: Path,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write the ZIP. First comes `recording.json`, then segments in their order, then all else by name.

    `report` is told how many files of how many are in it, after each. Raises OSError.
    """
    segments = [segment_path(each.take, each.index) for each in recording.segments]
    known = {RECORDING_FILE, *segments}
    others = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    names = (RECORDING_FILE, *segments, *sorted(name for name in others if name not in known))
    with zipfile.ZipFile(file, "w") as packed:
        for done, name in enumerate(names, 1):
            data = (folder / name).read_bytes()
            entry = zipfile.ZipInfo(name)  # of 1980: nothing of the clock
            entry.create_system, entry.external_attr = UNIX, PLAIN_FILE
            packed.writestr(entry, data, zipfile.ZIP_DEFLATED if _shrinks(data) else zipfile.ZIP_STORED, 6)
            report(done, len(names))


def _shrinks(data: bytes) -> bool:
    if len(data) > DEFLATE_UP_TO_BYTES:
        return False
    return len(zlib.compress(data, 6)) < WORTH_IT * len(data)
