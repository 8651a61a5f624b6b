"""Recordings play by time, in whatever order, format and state of the index their messages lie in files."""

from __future__ import annotations

import io
import random
import sqlite3
import struct
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from parser_stage import held_bytes
from posecast_edge.cli.probe import run_probe
from posecast_edge.sample import Sample

pytest.importorskip("mcap", reason="the extra [mcap] is not installed")

from bag_stage import BEGAN_NS, JOINTS, ROS2, STEP_NS, Said, Words, write_ros1, write_ros2
from mcap.writer import CompressionType, IndexType, Writer
from posecast_edge.sources.files import records
from posecast_edge.sources.files.mcap_records import McapFile
from posecast_edge.sources.files.playback import Playback, Player
from posecast_edge.sources.files.recorded_clock import RecordedClock
from posecast_edge.sources.files.records import Block, RecordedMessage, merge_blocks
from posecast_edge.sources.files.ros_recording import RosRecording
from rosbags.rosbag2 import StoragePlugin

ARM, GRIPPER = "/joint_states", "/gripper/joint_states"
COUNT = 60


def samples(path: Path) -> list[Sample]:
    return list(RosRecording(path, None).read_samples(0.0, first_pass=True))


def arm_and_gripper(ros1: bool) -> list[Said]:
    """Two arm joints at 100 Hz, and half a step after each, a gripper."""
    words = Words(ros1)
    said: list[Said] = []
    for k in range(COUNT):
        t_ns = BEGAN_NS + k * STEP_NS
        said.append((ARM, JOINTS, t_ns, words.joints(t_ns, A=k / 100, B=-k / 100)))
        t_ns += STEP_NS // 2
        said.append((GRIPPER, JOINTS, t_ns, words.joints(t_ns, finger=k / 50)))
    return said


def check_whole(found: Sequence[Sample]) -> None:
    """Every message moved something, at its time; and the first sample names all joints."""
    assert [s.t_s for s in found] == pytest.approx(
        [(BEGAN_NS + n * STEP_NS / 2) * 1e-9 for n in range(2 * COUNT)], abs=1e-6
    )
    for n, sample in enumerate(found):
        finger = None if n == 0 else (n - 1) // 2 / 50
        assert sample.values["pos"] == {"A": n // 2 / 100, "B": -(n // 2) / 100, "finger": finger}


# --- files

Order = Callable[[list[Said]], list[Said]]


def _shuffle(said: list[Said]) -> list[Said]:
    return random.Random(3).sample(said, len(said))


ORDERS: dict[str, Order] = {
    "by time": lambda said: said,
    "topic after topic": lambda said: sorted(said, key=lambda one: one[0] != ARM),
    "halves swapped": lambda said: said[len(said) // 2 :] + said[: len(said) // 2],
    "overlapping chunks": lambda said: sorted(said, key=lambda one: one[2] // (20 * STEP_NS) ^ one[2] % 3),
    "backwards": lambda said: said[::-1],
    "shuffled": _shuffle,
}


def write_mcap(
    path: Path, said: Sequence[Said], compression: CompressionType = CompressionType.ZSTD, **how: object
) -> Path:
    made = io.BytesIO()
    writer = Writer(made, compression=compression, **{"chunk_size": 2000, **how})  # type: ignore[arg-type]
    writer.start(profile="ros2")
    channels: dict[str, int] = {}
    for topic, name, t_ns, message in said:
        if topic not in channels:
            schema = writer.register_schema(name, "ros2msg", b"")
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        data = message if isinstance(message, bytes) else bytes(ROS2.serialize_cdr(message, name))
        writer.add_message(channels[topic], t_ns, data, t_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    path.write_bytes(made.getvalue())
    return path


def without_summary(path: Path) -> Path:
    """As when the power fails after the last chunk and its index."""
    whole = path.read_bytes()
    at = 8
    while whole[at] != 0x0F:  # the end of the data
        at += 9 + struct.unpack_from("<Q", whole, at + 1)[0]
    path.write_bytes(whole[:at])
    return path


def without_times(path: Path) -> Path:
    """As by a writer that leaves the times of its chunks at zero."""
    whole = bytearray(path.read_bytes())
    at = 8
    while whole[at] != 0x02:
        if whole[at] == 0x06:
            whole[at + 9 : at + 25] = bytes(16)
        at += 9 + struct.unpack_from("<Q", whole, at + 1)[0]
    path.write_bytes(whole)
    return path


def never_closed(path: Path) -> Path:
    """A bag of ROS 1 without the index at its end."""
    whole = path.read_bytes()
    at = 13
    while True:
        head = at + 4 + struct.unpack_from("<I", whole, at)[0]
        if b"op=\x07" in whole[at:head]:
            path.write_bytes(whole[:at])
            return path
        at = head + 4 + struct.unpack_from("<I", whole, head)[0]


def without_index(path: Path) -> Path:
    with sqlite3.connect(path) as database:
        database.execute("DROP INDEX timestamp_idx")
    database.close()
    return path


def write_sqlite(path: Path, said: Sequence[Said]) -> Path:
    return next(write_ros2(path.with_suffix(""), said, StoragePlugin.SQLITE3).glob("*.db3"))


FORMATS: dict[str, tuple[bool, Callable[[Path, list[Said]], Path]]] = {
    "mcap": (False, write_mcap),
    "mcap lz4": (False, lambda path, said: write_mcap(path, said, CompressionType.LZ4)),
    "mcap without chunks": (False, lambda path, said: write_mcap(path, said, use_chunking=False)),
    "mcap without indexes": (False, lambda path, said: write_mcap(path, said, index_types=IndexType.NONE)),
    "mcap without summary": (False, lambda path, said: without_summary(write_mcap(path, said))),
    "mcap without any": (
        False,
        lambda path, said: without_summary(write_mcap(path, said, index_types=IndexType.NONE)),
    ),
    "mcap without times": (False, lambda path, said: without_times(write_mcap(path, said))),
    "ros1": (True, lambda path, said: write_ros1(path, said, chunk_bytes=2000)),
    "ros1 bz2": (True, lambda path, said: write_ros1(path, said, "BZ2", 2000)),
    "ros1 never closed": (True, lambda path, said: never_closed(write_ros1(path, said, chunk_bytes=2000))),
    "sqlite": (False, write_sqlite),
    "sqlite without index": (False, lambda path, said: without_index(write_sqlite(path, said))),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("is_tight", [False, True], ids=["", "no memory"])
def test_messages_play_by_time(
    form: str,
    order: str,
    is_tight: bool,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ros1, write = FORMATS[form]
    if is_tight:
        monkeypatch.setattr(records, "HELD_MAX", 3000)
    monkeypatch.setattr(records, "BLOCK_BYTES", 3000)
    check_whole(samples(write(tmp_path / "a.bag", ORDERS[order](arm_and_gripper(ros1)))))
    lines = [line for line in caplog.messages if "is cut off in the record at byte" not in line]
    assert lines == []


@pytest.mark.parametrize("order", ["by time", "topic after topic", "shuffled"])
@pytest.mark.parametrize("form", FORMATS)
def test_a_recording_whose_clock_stood_still_plays_by_its_timestamps(
    form: str, order: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ros1, write = FORMATS[form]
    said = [(topic, name, 0, message) for topic, name, _, message in ORDERS[order](arm_and_gripper(ros1))]
    check_whole(samples(write(tmp_path / "a.bag", said)))
    assert "the recorder's clock stood still: the timestamps of the messages are used" in caplog.text


@pytest.mark.parametrize("form", ["mcap", "ros1", "sqlite"])
@pytest.mark.parametrize("split", ["by time", "by topic", "in turn", "numbers backwards"])
def test_files_of_a_folder_play_by_time(
    form: str, split: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ros1, write = FORMATS[form]
    said = arm_and_gripper(ros1)
    parts = {
        "by time": [said[:50], said[50:80], said[80:]],
        "by topic": [[one for one in said if one[0] == topic] for topic in (GRIPPER, ARM)],
        "in turn": [said[n::5] for n in range(5)],
        "numbers backwards": [said[80:], said[50:80], said[:50]],
    }[split]
    folder = tmp_path / "all"
    folder.mkdir()
    for n, part in enumerate(parts):
        write(tmp_path / f"part{n}.bag", part).rename(folder / f"walk_{n}.bag")
    check_whole(samples(folder))
    assert caplog.messages == []


def test_an_index_that_is_wrong_costs_what_it_hides(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(records, "BLOCK_BYTES", 0)
    path = write_mcap(tmp_path / "a.mcap", arm_and_gripper(False))
    whole = bytearray(path.read_bytes())
    at = whole.index(b"\x06")  # the first chunk
    late_ns = BEGAN_NS + 30 * STEP_NS
    whole[at + 9 : at + 25] = struct.pack("<QQ", late_ns, late_ns)
    path.write_bytes(whole)
    found = samples(path)
    assert 60 < len(found) < 2 * COUNT
    assert [s.t_s for s in found] == sorted(s.t_s for s in found)
    left_out = 2 * COUNT - len(found)
    assert caplog.messages == [
        f"{path}: {left_out} messages can't be put in order, because its index is wrong; left out"
    ]


def test_memory_is_bounded_however_many_chunks_overlap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(records, "BLOCK_BYTES", 1 << 16)
    said = [(ARM, JOINTS, BEGAN_NS + k * STEP_NS, bytes(1 << 13)) for k in range(400)]
    path = write_mcap(tmp_path / "a.mcap", _shuffle(said), CompressionType.NONE, chunk_size=1 << 17)
    times: list[int] = []

    def work() -> None:
        file = McapFile(path, pytest.fail)
        times.extend(message.t_ns for message in file.read_messages(file.topics, 1 << 18))

    assert held_bytes(work) < 1 << 20  # of 3 MiB
    assert times == [t_ns for _, _, t_ns, _ in said]


def test_blocks_are_read_as_often_as_they_must_be() -> None:
    """Any blocks: all messages, by time, and of one time by place; within the memory that is given."""
    dice = random.Random(5)
    for _ in range(300):
        contents = [
            [
                RecordedMessage(number, dice.randrange(30), bytes(dice.randrange(400)))
                for _ in range(dice.randrange(1, 12))
            ]
            for number in range(dice.randrange(1, 8))
        ]
        times = [[message.t_ns for message in content] for content in contents]
        blocks = [Block(i, i + 1, 0, min(own), max(own)) for i, own in enumerate(times)]
        blocks[0].start_ns = blocks[0].end_ns = None
        held_max = dice.choice([0, 1500, 1 << 20])
        found = list(merge_blocks(blocks, partial(_messages_of, contents), held_max))
        everything = (message for content in contents for message in content)
        assert found == sorted(everything, key=lambda message: (message.t_ns, message.topic_id))


def _messages_of(contents: list[list[RecordedMessage]], block: Block) -> Iterator[RecordedMessage]:
    return iter(contents[block.begins])


# --- what is shown of the beginning


@pytest.mark.parametrize("began_s", [0.3, 1.5])
def test_channels_that_begin_soon_are_in_the_first_sample(began_s: float, tmp_path: Path) -> None:
    words = Words(False)
    t_ns = BEGAN_NS + int(began_s * 1e9)
    said = [
        (ARM, JOINTS, BEGAN_NS + k * STEP_NS, words.joints(BEGAN_NS + k * STEP_NS, A=k)) for k in range(200)
    ]
    vector = words.make("geometry_msgs/msg/Vector3", x=1.0, y=2.0, z=3.0)
    wrench = words.make("geometry_msgs/msg/Wrench", force=vector, torque=vector)
    name = "geometry_msgs/msg/WrenchStamped"
    said.append(("/foot", name, t_ns, words.make(name, header=words.header(t_ns, "ankle"), wrench=wrench)))
    found = samples(write_mcap(tmp_path / "a.mcap", sorted(said, key=lambda one: one[2])))
    assert len(found) == 200
    assert found[0].values["pos"] == {"A": 0}
    assert found[0].values["ftf"] == {"ankle.fx": None, "ankle.fy": None, "ankle.fz": None}
    assert found[0].links == {"ankle": "ankle"}
    assert found[int(began_s * 100) + 1].values["ftf"] == {"ankle.fx": 1, "ankle.fy": 2, "ankle.fz": 3}


@pytest.mark.parametrize("topic", ["/joint_commands", ARM])
def test_every_sample_of_a_recording_is_shown(topic: str, tmp_path: Path) -> None:
    words = Words(False)
    times = [BEGAN_NS + k * STEP_NS for k in range(COUNT)]
    said = [(topic, JOINTS, t_ns, words.joints(t_ns, A=t_ns % 7)) for t_ns in times]
    field = "pos" if topic == ARM else "ref"
    found = samples(write_mcap(tmp_path / "a.mcap", said))
    assert [s.values[field] for s in found] == [{"A": t_ns % 7} for t_ns in times]


def test_probe_lists_what_run_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_mcap(tmp_path / "a.mcap", ORDERS["topic after topic"](arm_and_gripper(False)))
    run_probe([f"mcap:{path}"])
    out = capsys.readouterr().out
    assert f"{2 * COUNT} samples in 0.6 s" in out
    assert "joints: A B finger\n" in out


def test_a_topic_of_joint_states_with_another_name_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    said = [("/measured", *one[1:]) for one in arm_and_gripper(False)]
    assert samples(write_mcap(tmp_path / "a.mcap", said)) == []
    assert caplog.messages == [
        f"{tmp_path}/a.mcap: no topic is called joint_states, but /measured has joint states; "
        'to read it, in a profile: [ros] pos = ["/measured"]'
    ]


BATTERIES = {
    (True, 80.0): (80, "percentage is 80, not 0 to 1, and is read as percent"),
    (True, 0.8): (80, None),
    (False, 0.8): (None, "present is false, so no readings of the battery are shown"),
    (False, 0.0): (None, None),
}


@pytest.mark.parametrize("battery", BATTERIES)
def test_batteries(battery: tuple[bool, float], tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    charge, line = BATTERIES[battery]
    words, name, none = Words(False), "sensor_msgs/msg/BatteryState", np.array([], np.float32)
    said: list[Said] = []
    for one in arm_and_gripper(False)[:20]:
        numbers = dict.fromkeys(("temperature", "capacity", "design_capacity"), 0.0)
        message = words.make(
            name, header=words.header(one[2]), voltage=0.0, current=0.0, charge=0.0, percentage=battery[1],
            power_supply_status=0, power_supply_health=0, power_supply_technology=0, present=battery[0],
            cell_voltage=none, cell_temperature=none, location="", serial_number="", **numbers,
        )  # fmt: skip
        said += [one, ("/battery_state", name, one[2], message)]
    last = samples(write_mcap(tmp_path / "a.mcap", said))[-1]
    assert last.values["charge"] == {"main": charge and pytest.approx(charge)}
    assert caplog.messages == ([] if line is None else [f"{tmp_path}/a.mcap: /battery_state: {line}"])


# --- clocks

S = [k * 0.05 for k in range(100)]  # the recorder's clock, seconds
LOOP = [100 + k % 40 * 0.05 for k in range(100)]  # 2 s, again and again
CLOCKS: dict[str, tuple[Sequence[float], float, str]] = {
    "as it is": ([5 + s for s in S], 5, ""),
    "zero": ([0] * 100, 1000, ""),
    "some zero": ([0 if k % 10 == 9 else 5 + s for k, s in enumerate(S)], 5, ""),
    "constant": ([7] * 100, 1000, "A', …) do not advance: the times of recording are used"),
    "a loop": (LOOP, 100, "step back by 2.0 s: robot time goes on without the step"),
    "a short loop": ([9 + k % 8 * 0.05 for k in range(100)], 9, "step back by 0.3 s"),
    "set back": ([5 + s - (k > 30) for k, s in enumerate(S)], 5, "step back by 1.0 s"),
    "set ahead": ([5 + s + 3600 * (k > 30) for k, s in enumerate(S)], 5, "jump ahead by 3600.1 s"),
    "once wrong": ([5 + s + 3600 * (k == 30) for k, s in enumerate(S)], 5, "jump ahead by 3600.1 s"),
    "to and fro": ([5 + s + 900 * (k % 2) for k, s in enumerate(S)], 5, "jump ahead by 900.0 s"),
}  # fmt: skip


@pytest.mark.parametrize("case", CLOCKS)
def test_stamps_that_are_no_clock(case: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stamps, first_s, line = CLOCKS[case]
    words = Words(False)
    said = [
        (ARM, JOINTS, 10**12 + int(s * 1e9), words.joints(int(stamp * 1e9), A=s, B=0))
        for s, stamp in zip(S, stamps, strict=True)
    ]
    path = write_mcap(tmp_path / "a.mcap", said)
    found = samples(path)
    assert [s.t_s for s in found] == pytest.approx([first_s + s for s in S], abs=0.01)
    played = [due_s for due_s, _ in Player(RosRecording(path, None), Playback(path)).schedule_samples()]
    assert played == pytest.approx(S, abs=0.01)
    assert line in caplog.text
    assert len(caplog.messages) <= 2 * bool(line)  # played twice


def test_stamps_at_another_pace_are_robot_time() -> None:
    """A simulation at a tenth of the pace, and at ten times; a recorder that stalls, then writes all."""
    for pace in (0.1, 10):
        clock = RecordedClock(pytest.fail)
        assert [clock.place(("a", ("A",)), pace * s, 1000 + s) for s in S] == [pace * s for s in S]
    clock = RecordedClock(pytest.fail)
    assert [clock.place(("a", ("A",)), s, 1000 + s // 2 * 2) for s in S] == S


def test_two_clocks(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """An arm in simulated time at 20 Hz, a gripper at 1 Hz with the time of day."""
    words = Words(False)
    said: list[Said] = []
    for k, s in enumerate(S):
        t_ns = BEGAN_NS + int(s * 1e9)
        said.append((ARM, JOINTS, t_ns, words.joints(int((12 + s) * 1e9), A=s)))
        if k % 20 == 10:
            said.append((ARM, JOINTS, t_ns + 10**7, words.joints(t_ns, finger=s)))
    found = samples(write_mcap(tmp_path / "a.mcap", said))
    assert len(found) == 105
    assert {round(12 + s, 6) for s in S} <= {round(sample.t_s, 6) for sample in found}
    assert found[-1].values["pos"] == {"A": S[-1], "finger": S[90]}
    assert caplog.messages == [
        f"{tmp_path}/a.mcap: the timestamps of /joint_states ('finger') are 1699999988.0 s ahead of those of "
        "/joint_states ('A'): the times of recording are used"
    ]
