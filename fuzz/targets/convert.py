"""What `posecast convert` reads: a recording in one file that anybody may have made."""

from __future__ import annotations

import io
import zipfile
from unittest.mock import patch

from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.span import ExportedSpan, FileUnreadable, RecordingZip
from posecast_relay.export.table import TableReader
from posecast_wire.recording import (
    RECORDING_FILE,
    PastRecording,
    RecordedSegment,
    RecordingError,
    decode_recording,
    encode_recording,
    model_path,
    segment_path,
)
from posecast_wire.recording.contents import RECORDING_BYTES_MAX
from posecast_wire.segment import decode_segment

from fuzz.target import Differs, Target
from fuzz.targets.export import MANIFEST, TEXT, make_seed


class _Nowhere(io.RawIOBase):
    """A file that is not kept."""

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        return len(data)  # type: ignore[arg-type]

    def tell(self) -> int:
        return 0


def converted(data: bytes) -> None:
    """A file once as it is and once without its checksums: CSV and MCAP have the same frames."""
    try:
        convert(data)
    except (FileUnreadable, RecordingError):
        with patch.object(zipfile.ZipExtFile, "_update_crc", lambda *_: None):
            convert(data)


def convert(data: bytes) -> None:
    """Both formats of all of it."""
    files = RecordingZip(io.BytesIO(data))
    index = files.read(RECORDING_FILE, RECORDING_BYTES_MAX)
    if index is None:
        raise FileUnreadable("no index")
    recording = decode_recording(index)
    span = ExportedSpan(files, recording, recording.from_ms, recording.to_ms)
    rows, messages = (
        TableReader(span.read_segments(), recording.schemas, span.from_ms, span.to_ms) for _ in range(2)
    )
    wanted = write_csv(io.BufferedWriter(_Nowhere()), rows)
    if write_mcap(io.BufferedWriter(_Nowhere()), messages, span.find_model_file) != wanted:
        raise Differs("CSV and MCAP have other frames")
    if any("\n" in line for table in (rows, messages) for line in table.losses.describe()):
        raise Differs("more than one line about a loss")


def make_file() -> bytes:
    """A recording of one segment with a model, stored, so that its bytes can be changed."""
    segment = make_seed()
    found = decode_segment(segment)
    start, frames = found.start, found.frames
    assert start.schema is not None
    assert start.model is not None
    row = RecordedSegment(
        *(start.take, start.run_id, start.index, start.from_ms, found.to_ms, len(frames)),
        *(frames[0].seq, frames[-1].seq, len(segment), start.schema, start.model, 0),
    )
    recording = PastRecording(
        robot=start.robot,
        view=start.view,
        from_ms=start.from_ms,
        to_ms=found.to_ms,
        segments=(row,),
        schemas={start.schema: TEXT},
        models=(start.model,),
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr(RECORDING_FILE, encode_recording(recording))
        packed.writestr(segment_path(start.take, start.index), segment)
        packed.writestr(model_path(start.model, "manifest.json"), MANIFEST)
    return file.getvalue()


REFUSES = (FileUnreadable, RecordingError)
TARGETS = (
    Target("converted", converted, REFUSES, corpus="page-zip", seeds=(make_file(),), ms=250, longest=1 << 14),
)
