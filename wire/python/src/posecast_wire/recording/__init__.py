"""The recording (SPEC §12): a time span of one robot and view in files, with its contents in
`recording.json`.

`posecast_wire` does not import it, because an edge does not need it.
"""

from posecast_wire.recording.contents import (
    RECORDING_FILE,
    PastRecording,
    RecordedEvent,
    RecordedSegment,
    RecordedWord,
    RecordingError,
    RecordingNote,
    check_segment,
    key_page_path,
    model_path,
    segment_path,
)
from posecast_wire.recording.reader import decode_recording, unpack_segment
from posecast_wire.recording.writer import encode_recording, pack_segment

__all__ = [
    "RECORDING_FILE",
    "PastRecording",
    "RecordedEvent",
    "RecordedSegment",
    "RecordedWord",
    "RecordingError",
    "RecordingNote",
    "check_segment",
    "decode_recording",
    "encode_recording",
    "key_page_path",
    "model_path",
    "pack_segment",
    "segment_path",
    "unpack_segment",
]
