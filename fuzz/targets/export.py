"""What an export reads: segments with all that robots wrote into them, and models' manifests; and what
`posecast convert` reads: a recording in one file that anybody may have made."""

from __future__ import annotations

import csv
import io
import zipfile
from collections.abc import Iterator, Mapping
from unittest.mock import patch

from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.link_poses import FrameReadings, LinkPoses
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.model_tree import VARIABLES, ModelTreeError, read_model_tree
from posecast_relay.export.span import ExportedSpan, FileUnreadable, RecordingZip
from posecast_relay.export.table import TableReader
from posecast_wire import Encoder, Schema, build_schema_text
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
from posecast_wire.segment import SegmentError, SegmentStart, SegmentWriter, decode_segment

from fuzz.target import Differs, Target
from fuzz.targets.wire import mended

TEXT = build_schema_text(
    "arm",
    {
        "joint": ["a", "b"],
        "imu": [f"imu.{part}" for part in "wxyz"],
        "foot": ["F.fz"],
    },
    [
        {"name": "ref", "labels": "joint", "scale": 0.001},
        {"name": "pos", "labels": "joint", "scale": 0.001, "rel": "ref"},
        {"name": "flags", "labels": "joint", "bits": ["homed", "=a|b"]},
        {"name": "quat", "labels": "imu", "scale": 0.001},
        {"name": "ftf", "labels": "foot", "unit": "kN"},
    ],
    {"joints": {"c": {"terms": [["a", 0.5], ["b", -1.0]]}}},
)
MANIFEST = (
    b'{"v":2,"links":["r","s"],"visuals":[{"link":1,"box":[[0,0,-1],[1,1,0]]}],'
    b'"joints":[{"name":"c","type":"revolute","parent":0,"child":1,"axis":[0,1,0]}]}'
)
EVENT = '{"type":"event","n":7,"t":1,"at":2,"level":"fault","source":"a","text":"jam","state":"on"}'


class _Always(Mapping[str, str]):
    """The schema, whichever hash is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __getitem__(self, name: str) -> str:
        return TEXT

    def __iter__(self) -> Iterator[str]:
        return iter((self._name,))

    def __len__(self) -> int:
        return 1


def exported(data: bytes) -> None:
    """A segment, once as it is and once with checksums that fit: CSV and MCAP have the same frames."""
    for each in (data, mended(data)):
        try:
            found = decode_segment(each)
        except SegmentError:
            if each is data:
                continue
            raise
        schemas = _Always(found.start.schema or "")
        rows, messages = io.BytesIO(), io.BytesIO()
        wanted = write_csv(rows, TableReader([("s", each)], schemas))
        if write_mcap(messages, TableReader([("s", each)], schemas), lambda _: MANIFEST) != wanted:
            raise Differs("CSV and MCAP have other frames")
        table = list(csv.reader(io.StringIO(rows.getvalue().decode(), newline="")))
        if len(table) != wanted + 1 or len({len(row) for row in table}) != 1:
            raise Differs("a row that is none")


def posed(data: bytes) -> None:
    """A model, its joints moved: whatever it is, poses come of it."""
    tree = read_model_tree(data)
    readings = FrameReadings(Schema.parse(TEXT))
    poses = LinkPoses(tree)
    poses.update(readings)
    readings.joints = {
        joint.name + part: 0.5 for joint in tree.joints[1:] for part, _ in VARIABLES[joint.type]
    }
    poses.update(readings)
    if len(poses.poses) != len(tree.links):
        raise Differs("links without a pose")


def make_seed() -> bytes:
    """A segment that has some of everything."""
    encoder = Encoder(Schema.parse(TEXT))
    writer = SegmentWriter(SegmentStart("r", "public", 7, 0, 9, 1_764_000_000_000, "5c" * 32, "ab" * 32))
    for i in range(6):
        codes = [i, -i, 2 * i, 3, 1, 2, 900, 0, i, 400, -(1 << 28) if i == 3 else 5]
        writer.append_frame(encoder.encode(codes, i, i / 10, i / 10), 100_000 * i, 10)
    writer.append_event(EVENT, 600_000)
    writer.append_model(None, 600_000)
    return writer.close(1_764_000_000_700)


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
    Target("exported", exported, (SegmentError,), corpus="segment", seeds=(make_seed(),), ms=250),
    Target("posed", posed, (ModelTreeError,), stretched=1 << 18, corpus="manifest", seeds=(MANIFEST,)),
    Target("converted", converted, REFUSES, corpus="page-zip", seeds=(make_file(),), ms=250, longest=1 << 14),
)
