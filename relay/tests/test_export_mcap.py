"""MCAP of the past: read back by readers that are not ours it is what the wire said."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from posecast_relay.export import mcap_file
from posecast_relay.export.link_poses import FrameReadings, LinkPose, LinkPoses, compose_poses
from posecast_relay.export.mcap_file import TooManyTopicsError
from posecast_relay.export.model_tree import read_model_tree
from posecast_relay.export.ros_messages import CdrMessage
from posecast_relay.export.ros_topics import find_factor, make_topic_part
from posecast_relay.export.table import TableReader, TableRow
from posecast_wire import Schema, build_schema_text, compute_joint_values
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from .export_cases import VECTORS, make_rows, make_schema, to_json
from .export_stage import EVENT, FROM_MS, Named, Take, hash_of, mcap_of, messages_of, schemas_of
from .link_pose_cases import make_manifest, place_links

CASES = json.loads(VECTORS.read_text())["cases"]
STORE = get_typestore(Stores.ROS2_HUMBLE)

NOT_BUILT = "v: a URDF that has not been built; the robot's program does that with the extra `model`"


def check_close(found: Any, wanted: Any, where: str) -> None:
    """Numbers to a millionth, all else exactly."""
    if isinstance(wanted, dict):
        assert found.keys() == wanted.keys(), where
        for name, value in wanted.items():
            check_close(found[name], value, f"{where}.{name}")
    elif isinstance(wanted, list):
        assert len(found) == len(wanted), where
        for i, value in enumerate(wanted):
            check_close(found[i], value, f"{where}[{i}]")
    elif isinstance(wanted, float):
        assert found == pytest.approx(wanted, abs=2e-6), where
    else:
        assert found == wanted, where


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_the_messages_are_those_that_the_page_writes(case: Mapping[str, Any]) -> None:
    segments = [(str(i), bytes.fromhex(raw)) for i, raw in enumerate(case["segments"])]
    models = {hash_of(text): text.encode() for text in case["models"]}
    span = {"from_ms": case["from_ms"], "to_ms": case["to_ms"]}
    data, table = mcap_of(segments, *case["schemas"], models=models, **span)
    found = [
        [topic, type_name, unix_ns // 1000, to_json(STORE.deserialize_cdr(raw, type_name))]
        for topic, type_name, unix_ns, raw in messages_of(data)
    ]
    assert [each[:3] for each in found] == [each[:3] for each in case["messages"]]
    for each, wanted in zip(found, case["messages"], strict=True):
        check_close(each[3], wanted[3], f"{each[0]} at {each[2]}")
    lacking = any("no /tf" in line for line in table.losses.describe())
    assert lacking == (not case["models"])


def robot(count: int = 60) -> tuple[list[Named], str, dict[str, bytes], list[TableRow]]:
    """A robot's segments, its schema, its model, and its frames as they were decoded."""
    manifest = json.dumps(make_manifest()).encode()
    take = Take(make_schema(), model=hash_of(manifest), segment_frames=20)
    events = {7: {**EVENT, "text": "jam", "state": "on"}}
    segments = take.record(take.encode(make_rows(take.schema, count, "mcap")), events=events)
    read = TableReader(segments, schemas_of(take.schema_text)).read()
    rows = [row for row in read if isinstance(row, TableRow)]
    return segments, take.schema_text, {hash_of(manifest): manifest}, rows


def test_the_library_finds_a_whole_file() -> None:
    segments, text, models, rows = robot()
    data, _ = mcap_of(segments, text, models=models)
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    assert reader.get_header().profile == "ros2"
    summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
    topics = {channel.topic: channel for channel in summary.channels.values()}
    counts = {
        topic: summary.statistics.channel_message_counts[channel.id] for topic, channel in topics.items()
    }
    assert counts.pop("/rosout") == 1
    assert set(counts.values()) == {len(rows)}
    assert {channel.message_encoding for channel in topics.values()} == {"cdr"}
    assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert topics["/posecast/cur"].metadata == {"unit": "mA"}
    assert topics["/posecast/pos"].metadata == {"unit": "rad", "unit.wrist": "deg", "unit.finger": "ticks"}
    assert summary.statistics.message_start_time == 1000 * rows[0].unix_us
    assert summary.statistics.message_end_time == 1000 * rows[-1].unix_us


def test_rosbags_reads_the_file_by_the_definitions_in_it(tmp_path: Path) -> None:
    segments, text, models, rows = robot()
    file = tmp_path / "past.mcap"
    file.write_bytes(mcap_of(segments, text, models=models)[0])
    tree = read_model_tree(next(iter(models.values())))
    poses, readings = LinkPoses(tree), FrameReadings(rows[0].parsed)
    by_time = {row.unix_us: row for row in rows}
    states = frames = 0
    with AnyReader([file]) as reader:
        for connection, unix_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/joint_states":
                row = rows[states]
                assert abs(unix_ns - 1000 * row.unix_us) < 1_000_000
                check_joints(row.parsed, row, message)
                states += 1
            elif connection.topic == "/tf":
                readings.take(rows[frames].codes)
                poses.update(readings)
                check_links(message, place_links(tree, poses), tree.links)
                frames += 1
            elif connection.topic == "/wrench/RF":
                check_wrench(by_time[unix_ns // 1000], message)
    assert (states, frames) == (len(rows), len(rows))


def check_joints(schema: Schema, row: TableRow, message: Any) -> None:
    """Positions of joints without units of their own are what the mapping of the wire makes of them."""
    wanted = compute_joint_values(schema, row.codes, "pos")
    assert message.name == list(wanted)
    stamp = message.header.stamp
    assert stamp.sec * 10**6 + stamp.nanosec // 1000 == row.unix_us
    for name, position in zip(message.name, message.position, strict=True):
        factor = {"wrist": math.pi / 180, "finger": math.nan}.get(name, 1.0)
        assert position == pytest.approx(wanted[name] * factor, abs=1e-9, nan_ok=True)
    speeds = dict(zip(schema.fields[2].labels, row.parsed.fields[2].values(row.codes), strict=True))
    for name, velocity in zip(message.name, message.velocity, strict=True):
        if name in ("lift", "m1", "knee"):
            speed = speeds[name]
            assert velocity == pytest.approx(math.nan if speed is None else speed, nan_ok=True)


def check_links(message: Any, wanted: Sequence[LinkPose], links: Sequence[str]) -> None:
    """Added up from the world, every link is there to the millimetre."""
    world = {"world": LinkPose((0, 0, 0), (1, 0, 0, 0))}
    for each in message.transforms:
        t, r = each.transform.translation, each.transform.rotation
        parent = world[each.header.frame_id]
        world[each.child_frame_id] = compose_poses(parent, LinkPose((t.x, t.y, t.z), (r.w, r.x, r.y, r.z)))
    assert list(world) == ["world", *links]
    for link, pose in zip(links, wanted, strict=True):
        assert math.dist(world[link].xyz, pose.xyz) < 1e-9


def check_wrench(row: TableRow, message: Any) -> None:
    force = message.wrench.force
    kilo = row.parsed.find_field("ftf")
    assert kilo is not None
    for found, wanted in zip((force.x, force.y, force.z), kilo.values(row.codes), strict=False):
        assert found == pytest.approx(math.nan if wanted is None else 1000 * wanted, nan_ok=True)
    assert message.header.frame_id == "foot"


def test_a_robot_that_slides_says_metres() -> None:
    text = build_schema_text(
        "lift",
        {"joint": ["lift", "turn"]},
        [
            {"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.0001},
            {"name": "vel", "labels": "joint", "unit": "rad/s", "scale": 0.005},
            {"name": "effort", "labels": "joint", "unit": "N·m", "scale": 0.05},
        ],
        {"units": {"pos": {"lift": "mm"}, "vel": {"lift": "m/s"}, "effort": {"lift": "N"}}},
    )
    take = Take(text)
    data, _ = mcap_of(take.record(take.encode([[250, 0.5, 0.1, 0.2, 12, 3]])), text)
    ((topic, type_name, _, raw),) = messages_of(data)
    message: Any = STORE.deserialize_cdr(raw, type_name)
    assert topic == "/joint_states"
    assert list(message.position) == pytest.approx([0.25, 0.5])
    assert list(message.velocity) == pytest.approx([0.1, 0.2])
    assert list(message.effort) == pytest.approx([12, 3])


def one_message(fields: Sequence[Mapping[str, Any]], labels: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """The messages of a frame of ones, by topic."""
    text = build_schema_text("r", labels, fields)
    take = Take(text)
    data, _ = mcap_of(take.record(take.encode([[1.0] * take.schema.size])), text)
    return {topic: STORE.deserialize_cdr(raw, kind) for topic, kind, _, raw in messages_of(data)}


def test_what_is_not_si_is_a_topic_of_its_own() -> None:
    found = one_message([{"name": "pos", "labels": "joint", "unit": "ticks"}], {"joint": ["a", "b"]})
    assert list(found) == ["/posecast/pos"]
    found = one_message([{"name": "pos", "labels": "motor"}], {"motor": ["a", "b"]})
    assert list(found) == ["/posecast/pos"], "no joints"
    found = one_message([{"name": "vel", "labels": "joint", "unit": "rpm"}], {"joint": ["a"]})
    assert (list(found), len(found["/joint_states"].position)) == (["/joint_states"], 0)
    assert list(found["/joint_states"].velocity) == pytest.approx([2 * math.pi / 60])
    found = one_message([{"name": "gyro", "labels": "x"}], {"x": ["imu.x", "imu.y", "odd"]})
    assert list(found) == ["/posecast/gyro", "/imu/imu"]


def test_names_of_sites_become_parts_of_topics() -> None:
    assert make_topic_part("RF", []) == "RF"
    assert make_topic_part("left foot/3", []) == "left_foot_3"
    assert make_topic_part("3", []) == "_3"
    assert make_topic_part("발", []) == "_"
    assert make_topic_part("a b", ["a_b", "a_b_2"]) == "a_b_3"


def test_a_link_called_world_is_not_its_own_parent() -> None:
    manifest = make_manifest()
    manifest["links"][0] = "world"
    raw = json.dumps(manifest).encode()
    text = build_schema_text("r", {"joint": ["lift"]}, [{"name": "pos", "labels": "joint"}])
    take = Take(text, model=hash_of(raw))
    data, _ = mcap_of(take.record(take.encode([[0.0]])), text, models={hash_of(raw): raw})
    tf: Any = next(
        STORE.deserialize_cdr(data, kind) for topic, kind, _, data in messages_of(data) if topic == "/tf"
    )
    assert (tf.transforms[0].header.frame_id, tf.transforms[0].child_frame_id) == ("posecast_world", "world")


@pytest.mark.parametrize(
    ("manifest", "line"), [(None, "it is not here"), (b'{"v":1}', NOT_BUILT), (b"x", "manifest: not JSON")]
)
def test_a_model_that_poses_nothing_is_told_once(manifest: bytes | None, line: str) -> None:
    text = build_schema_text("r", {"joint": ["lift"]}, [{"name": "pos", "labels": "joint"}])
    take = Take(text, model="ab" * 32)
    data, table = mcap_of(
        take.record(take.encode([[0.0]] * 3)), text, models={} if manifest is None else {"ab" * 32: manifest}
    )
    assert {topic for topic, *_ in messages_of(data)} == {"/joint_states"}
    assert table.losses.describe() == [f"no /tf of the model abababababab: {line}"]


@pytest.mark.parametrize(
    "event", ["", "[]", '{"level":"fault"}', '{"level":["fault"],"text":"x"}', '{"level":"fault","text":5}']
)
def test_what_is_no_event_is_left_out(event: str) -> None:
    text = build_schema_text("r", {"joint": ["a"]}, [{"name": "pos", "labels": "joint"}])
    take = Take(text)
    segments = take.record(take.encode([[0.0]] * 2), events={1: event})
    assert [topic for topic, *_ in messages_of(mcap_of(segments, text)[0])] == ["/joint_states"] * 2


def test_a_text_with_a_zero_byte_stays_one() -> None:
    message = CdrMessage()
    message.add_text("a\0b")
    assert bytes(message) == b"\0\1\0\0" + b"\3\0\0\0ab\0"


def test_a_time_that_ros_has_not_is_its_last() -> None:
    message = CdrMessage()
    message.add_stamp()
    message.set_stamps(10**20)
    assert bytes(message)[4:] == ((1 << 31) - 1).to_bytes(4, "little") + (10**9 - 1).to_bytes(4, "little")
    text = build_schema_text("r", {"joint": ["a"]}, [{"name": "pos", "labels": "joint"}])
    far = Take(text, from_ms=250_000_000_000_000)
    assert len(list(messages_of(mcap_of(far.record(far.encode([[0.0]])), text)[0]))) == 1


def test_units_are_worth_what_they_are() -> None:
    assert find_factor("position", "deg") == pytest.approx(math.pi / 180)
    assert find_factor("velocity", "rpm") == pytest.approx(2 * math.pi / 60)
    assert find_factor("effort", "mNm") == 1e-3
    assert find_factor("effort", "A") is None
    assert find_factor("position", "rad/s") is None


def test_topics_without_end_are_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    texts = [
        build_schema_text("r", {"joint": ["a"]}, [{"name": name, "labels": "joint"}])
        for name in ("one", "two", "three")
    ]
    segments: list[Named] = []
    for i, text in enumerate(texts):
        take = Take(text, i, i + 1, FROM_MS + 10_000 * i)
        segments += take.record(take.encode([[0.5]] * 3))
    monkeypatch.setattr(mcap_file, "CHANNELS_MAX", 3)
    assert len({topic for topic, *_ in messages_of(mcap_of(segments, *texts)[0])}) == 3
    monkeypatch.setattr(mcap_file, "CHANNELS_MAX", 2)
    with pytest.raises(TooManyTopicsError) as caught:
        mcap_of(segments, *texts)
    assert str(caught.value) == "more than 2 topics: take a shorter span"
