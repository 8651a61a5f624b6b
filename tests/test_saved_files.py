"""Files saved by the page can be read by other programs, and agree with the command's exports."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import subprocess
import zipfile
from collections import Counter
from pathlib import Path

import pytest
from mcap.reader import make_reader
from posecast_relay.export.csv_file import write_csv
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.table import TableReader
from posecast_relay.past_command.convert import run_convert
from posecast_wire import Decoder
from posecast_wire.recording import decode_recording
from posecast_wire.segment import CopyRecord, FrameRecord, Segment, decode_segment

REPO = Path(__file__).resolve().parent.parent
SEGMENTS = REPO / "wire" / "vectors" / "segments"
SCHEMA = (SEGMENTS / "schema.json").read_text()


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("saved")
    folders = json.dumps({"from": str(SEGMENTS), "into": str(folder)})
    command = ["node", str(REPO / "spa/tests/rigs/run.mjs"), "save_files.ts", "saveFiles"]
    subprocess.run(command, input=folders, text=True, stdout=subprocess.DEVNULL, check=True)
    return folder


def segments_of_all() -> list[Segment]:
    segments = [decode_segment(path.read_bytes()) for path in SEGMENTS.glob("*.pcs")]
    return sorted(segments, key=lambda segment: segment.start.from_ms)


def frames_of_all() -> list[tuple[int, list[float | None]]]:
    """When each frame was accepted (unix µs), and its positions. What several segments have counts once."""
    decoder = Decoder()
    decoder.add_schema(SCHEMA)
    found: dict[int, tuple[int, list[float | None]]] = {}
    for segment in segments_of_all():
        for record in segment.records:
            if not isinstance(record, FrameRecord | CopyRecord):
                continue
            frame = decoder.decode(record.frame)
            if isinstance(record, FrameRecord):
                found.setdefault(
                    record.seq, (1000 * segment.start.from_ms + record.at_us, frame.values("pos"))
                )
    return [found[seq] for seq in sorted(found)]


def test_a_table_is_read_by_csv_and_is_that_of_the_command(saved: Path) -> None:
    text = (saved / "page.csv").read_text("utf-8-sig")
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    frames = frames_of_all()
    joints = Decoder().add_schema(SCHEMA).find_field("pos").labels  # type: ignore[union-attr]
    assert len(rows) == len(frames)
    for row, (unix_us, positions) in zip(rows, frames, strict=True):
        assert row["time"].endswith(f".{unix_us // 1000 % 1000:03}Z")
        cells = [row[f"pos.{joint} [rad]"] for joint in joints]
        assert [None if cell == "" else float(cell) for cell in cells] == pytest.approx(positions)
    exported = io.BytesIO()
    write_csv(exported, table_of_all())
    assert (saved / "page.csv").read_bytes() == exported.getvalue()


def table_of_all() -> TableReader:
    segments = [(path.name, path.read_bytes()) for path in SEGMENTS.glob("*.pcs")]
    segments.sort(key=lambda each: decode_segment(each[1]).start.from_ms)
    return TableReader(segments, {hashlib.sha256(SCHEMA.encode()).hexdigest(): SCHEMA})


def test_a_recording_converts_to_what_the_command_exports(saved: Path, tmp_path: Path) -> None:
    run_convert([str(saved / "page.posecast"), str(tmp_path / "x.csv")])
    assert (tmp_path / "x.csv").read_bytes() == (saved / "page.csv").read_bytes()
    run_convert([str(saved / "page.posecast"), str(tmp_path / "x.mcap")])
    exported = io.BytesIO()
    write_mcap(exported, table_of_all())
    reader = make_reader(io.BytesIO((tmp_path / "x.mcap").read_bytes()), validate_crcs=True)
    theirs = make_reader(io.BytesIO(exported.getvalue()))
    counts: Counter[str] = Counter()
    for (schema, channel, message), (other, as_channel, wanted) in zip(
        reader.iter_messages(log_time_order=False), theirs.iter_messages(log_time_order=False), strict=True
    ):
        assert schema is not None
        assert other is not None
        assert (schema.name, schema.data) == (other.name, other.data)
        assert (channel.topic, channel.metadata) == (as_channel.topic, as_channel.metadata)
        assert (message.log_time, message.publish_time) == (wanted.log_time, wanted.publish_time)
        assert message.data == wanted.data, channel.topic
        counts[channel.topic] += 1
    frames = frames_of_all()
    assert counts["/joint_states"] == counts["/joint_references"] == counts["/imu/torso"] == len(frames)
    assert counts["/rosout"] == 4


def test_a_recording_is_read_by_zipfile_and_the_wire(saved: Path) -> None:
    with zipfile.ZipFile(saved / "page.posecast") as found:
        assert found.testzip() is None
        recording = decode_recording(found.read("recording.json"))
        assert (recording.robot, recording.view) == ("demo", "public")
        kept = {found.read(name) for name in found.namelist() if name.endswith(".segment")}
    assert kept == {path.read_bytes() for path in SEGMENTS.glob("*.pcs")}
    assert len(recording.segments) == len(kept)
