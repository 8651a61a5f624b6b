"""The segment (SPEC §10): the data that a relay accepted of one robot and view in a few seconds, immutable.

`posecast_wire` does not import it, because an edge does not need it.
"""

from posecast_wire.segment.reader import MergedFrame, MergedRun, decode_segment, merge_segments
from posecast_wire.segment.records import (
    CopyRecord,
    EventRecord,
    FrameRecord,
    InfoRecord,
    ModelRecord,
    Record,
    Segment,
    SegmentError,
    SegmentStart,
    WordRecord,
)
from posecast_wire.segment.writer import SegmentWriter, encode_segment

__all__ = [
    "CopyRecord",
    "EventRecord",
    "FrameRecord",
    "InfoRecord",
    "MergedFrame",
    "MergedRun",
    "ModelRecord",
    "Record",
    "Segment",
    "SegmentError",
    "SegmentStart",
    "SegmentWriter",
    "WordRecord",
    "decode_segment",
    "encode_segment",
    "merge_segments",
]
