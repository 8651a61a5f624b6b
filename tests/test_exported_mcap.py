"""Round trip: the demo robot's motion is exported as MCAP, played by an edge, and seen unchanged."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from posecast_edge.profile.reader import load_profile
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.sources.demo import BUNDLE, PROFILE, read_motion
from posecast_edge.sources.files.ros_recording import RosRecording
from posecast_relay.export.link_poses import FrameReadings, LinkPoses
from posecast_relay.export.mcap_file import write_mcap
from posecast_relay.export.model_tree import ModelTree, read_model_tree
from posecast_relay.export.table import TableReader, TableRow
from posecast_wire import Quantiser, Schema, compute_joint_values

from relay.tests.export_stage import Take, hash_of, schemas_of

HZ = 30
FRAMES = 90
MM = 1e-3


class Exported:
    """Some seconds of the demo robot in a file."""

    def __init__(self, file: Path) -> None:
        motion = read_motion((BUNDLE / "motion.bin").read_bytes())
        text = make_schema_text(load_profile(PROFILE))
        self.schema = Schema.parse(text)
        manifest = (BUNDLE / "model" / "manifest.json").read_bytes()
        self.tree = read_model_tree(manifest)
        take = Take(text, model=hash_of(manifest), step_us=1_000_000 // HZ)
        quantiser = Quantiser(self.schema)
        rows: list[list[float | None]] = []
        for i in range(FRAMES):
            values = motion.make_sample(round((10 + i / HZ) * motion.rate_hz)).values
            said = [v for f in self.schema.fields for v in (values.get(f.name) or [None] * f.size)]
            codes = iter(quantiser.quantise(said))  # type: ignore[arg-type]
            rows.append([next(codes) * f.scale for f in self.schema.fields for _ in f.labels])
        segments = take.record(take.encode(rows))
        read = TableReader(segments, schemas_of(text)).read()
        self.rows = [row for row in read if isinstance(row, TableRow)]
        with file.open("wb") as out:
            write_mcap(out, TableReader(segments, schemas_of(text)), {hash_of(manifest): manifest}.get)

    def find_joints(self, row: TableRow, field: str) -> Mapping[str, float]:
        return compute_joint_values(self.schema, row.codes, field)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Exported, Path]:
    file = tmp_path_factory.mktemp("past") / "past.mcap"
    return Exported(file), file


def test_our_own_source_reads_what_was_exported(exported: tuple[Exported, Path]) -> None:
    past, file = exported
    samples = list(RosRecording(file, None).read_samples(0, True))
    # at first a source waits for topics, since the first sample says which there are
    rows = past.rows[-len(samples) :]
    assert len(samples) >= FRAMES - 2 * HZ
    for sample, row in zip(samples, rows, strict=True):
        assert sample.t_s == pytest.approx(row.unix_us / 1e6, abs=1e-3)
        for field in ("pos", "ref"):
            values: Any = sample.values[field]
            assert values == pytest.approx(past.find_joints(row, field), abs=1e-9, nan_ok=True)
        forces: Any = sample.values["ftf"]
        at = past.schema.find_field("ftf")
        assert at is not None
        for label, value in zip(at.labels, at.values(row.codes), strict=True):
            link, part = past.schema.mapping.sensors[label[:2]].link, label[3:]
            assert forces[f"{link}.{part}"] == pytest.approx(
                math.nan if value is None else value, nan_ok=True
            )


def pose(tree: ModelTree, schema: Schema, codes: tuple[int, ...]) -> LinkPoses:
    readings = FrameReadings(schema)
    readings.take(codes)
    poses = LinkPoses(tree)
    poses.update(readings)
    return poses


async def test_a_viewer_of_the_played_file_sees_the_same_body(
    stack: Any, exported: tuple[Exported, Path]
) -> None:
    past, file = exported
    _, http, zenoh = stack.relay()
    stack.edge(zenoh, "--source", f"mcap:{file}?loop", "--model", str(BUNDLE / "model"))
    viewer = stack.viewer(http)
    watching = asyncio.create_task(viewer.watch())
    await viewer.until("thirty frames", lambda v: len(v.frames) >= 30, 30)
    watching.cancel()
    assert viewer.undecodable == 0
    were = [past.find_joints(row, "pos") for row in past.rows]
    for _, frame in viewer.frames:
        found = compute_joint_values(frame.schema, frame.codes, "pos")
        assert set(found) == set(were[0])

        def differ(i: int, found: Mapping[str, float] = found) -> float:
            pairs = ((were[i][name], value) for name, value in found.items())
            return max(abs(a - b) for a, b in pairs if not math.isnan(a + b))

        # it keeps a code until the value is 0.8 steps off
        at = min(range(len(were)), key=differ)
        assert differ(at) <= 0.81 * 0.001
        shown = pose(past.tree, frame.schema, frame.codes)
        was = pose(past.tree, past.schema, past.rows[at].codes)
        for one, other in zip(shown.poses[1:], was.poses[1:], strict=True):
            assert math.dist(one.xyz, other.xyz) <= MM
            assert abs(sum(a * b for a, b in zip(one.quat, other.quat, strict=True))) > math.cos(0.001)


def test_the_file_is_what_the_relay_says_it_is(exported: tuple[Exported, Path]) -> None:
    from mcap.reader import make_reader

    with exported[1].open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    assert topics == {
        *("/joint_states", "/joint_references", "/tf"),
        *(f"/imu/{site}" for site in ("torso", "RF", "LF")),
        *(f"/wrench/{site}" for site in ("RH", "LH", "RF", "LF")),
        *(f"/posecast/{field}" for field in ("cur", "volt", "amp", "temp", "flags", "base", "baseq")),
    }
