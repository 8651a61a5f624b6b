"""Source `mcap`: files of the library's writer, CDR packed by hand, and what can be wrong with them."""

from __future__ import annotations

import itertools
import json
import logging
from pathlib import Path

import pytest
from posecast_edge.profile.reader import parse_profile
from posecast_edge.sample import Sample, SourceError
from posecast_edge.sources.base import Discovering
from posecast_edge.sources.files.playback import Player
from posecast_edge.sources.registry import open_source

mcap = pytest.importorskip("mcap", reason="the extra [mcap] is not installed")

from bag_stage import BEGAN_NS, STEP_NS, Bag, header, joint_state, wrench  # noqa: E402
from mcap.writer import CompressionType  # noqa: E402
from posecast_edge.sources.files.ros_recording import RosRecording  # noqa: E402
from ros_stage import text_message  # noqa: E402

PROFILE = '[labels]\njoint = ["A", "B"]\n[[fields]]\nname = "ref"\n[[fields]]\nname = "pos"\n'
PACKED = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def walk(
    count: int = 200, compression: CompressionType = CompressionType.ZSTD, encoding: str = "cdr"
) -> bytes:
    """Two joints at 100 Hz."""
    bag = Bag(compression)
    for k in range(count):
        t_ns = BEGAN_NS + k * STEP_NS
        data = joint_state(t_ns, A=k / 100, B=-k / 100)
        if encoding == "json":
            stamp = {"sec": t_ns // 10**9, "nanosec": t_ns % 10**9}
            said = {
                "header": {"stamp": stamp, "frame_id": ""},
                "name": ["A", "B"],
                "position": [k / 100, -k / 100],
            }
            data = json.dumps({**said, "velocity": [], "effort": []}).encode()
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, data, encoding)
    return bag.finish()


def file_of(tmp_path: Path, content: bytes, profile: str = PROFILE) -> RosRecording:
    path = tmp_path / "walk.mcap"
    path.write_bytes(content)
    return RosRecording(path, parse_profile(profile) if profile else None)


def samples(tmp_path: Path, content: bytes, profile: str = PROFILE, start_s: float = 0) -> list[Sample]:
    return list(file_of(tmp_path, content, profile).read_samples(start_s, first_pass=True))


@pytest.mark.parametrize("compression", PACKED)
@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_joint_states(tmp_path: Path, compression: CompressionType, encoding: str) -> None:
    found = samples(tmp_path, walk(compression=compression, encoding=encoding))
    assert len(found) == 200
    for k, sample in enumerate(found):
        assert sample.t_s == pytest.approx(BEGAN_NS * 1e-9 + k / 100)
        assert sample.values == {"pos": {"A": k / 100, "B": -k / 100}}


def test_other_topics_are_merged_and_unknown_ones_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bag = Bag()
    for k in range(3):
        t_ns = BEGAN_NS + k * STEP_NS
        bag.add("/foot", "geometry_msgs/msg/WrenchStamped", t_ns, wrench(t_ns, "ankle", 1, 2, 3 + k, 4, 5, 6))
        bag.add("/image", "sensor_msgs/msg/Image", t_ns, b"\x00\x01\x00\x00")
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, A=1))
    with caplog.at_level(logging.WARNING):
        last = samples(tmp_path, bag.finish())[-1]
    assert last.values["ftf"] == {"ankle.fx": 1, "ankle.fy": 2, "ankle.fz": 5}
    assert last.values["ftm"] == {"ankle.mx": 4, "ankle.my": 5, "ankle.mz": 6}
    assert last.links == {"ankle": "ankle"}
    assert caplog.messages == [
        f"{tmp_path}/walk.mcap: /image is ignored: the type sensor_msgs/Image is not supported"
    ]


def test_a_recorded_description_is_handed_on_also_from_a_later_start(tmp_path: Path) -> None:
    bag = Bag()
    bag.add("/robot_description", "std_msgs/msg/String", BEGAN_NS, text_message("<robot name='x'/>"))
    for k in range(50):
        t_ns = BEGAN_NS + k * STEP_NS
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, A=k))
    (tmp_path / "a.mcap").write_bytes(bag.finish())
    source = open_source(f"mcap:{tmp_path}/a.mcap?start=0.4&loop", parse_profile(PROFILE))
    assert isinstance(source, Discovering)
    given: list[str] = []
    source.send_urdf_to(given.append)
    assert isinstance(source, Player)
    played = [s.values["pos"] for _, s in itertools.islice(source.schedule_samples(), 15)]
    assert played[:11] == [{"A": k} for k in (40, 41, 42, 43, 44, 45, 46, 47, 48, 49, 40)]
    assert given == ["<robot name='x'/>"]
    assert source.offers == [
        "/joint_states  sensor_msgs/JointState → pos",
        "/robot_description  std_msgs/String → description",
    ]


def test_from_a_start(tmp_path: Path) -> None:
    found = samples(tmp_path, walk(), start_s=1.5)
    assert len(found) == 50
    assert found[0].values == {"pos": {"A": 1.5, "B": -1.5}}


def test_without_a_profile_the_first_sample_has_every_joint(tmp_path: Path) -> None:
    bag = Bag()
    for k in range(100):
        t_ns = BEGAN_NS + k * STEP_NS
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, **{"AB"[k % 2]: 0.5}))
    first = samples(tmp_path, bag.finish(), profile="")[0]
    assert set(first.values["pos"]) == {"A", "B"}
    assert first.values["pos"] == {"A": 0.5, "B": None}
    short = samples(tmp_path, walk(10), profile="")
    assert [s.values for s in short] == [{"pos": {"A": k / 100, "B": -k / 100}} for k in range(10)]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("compression", PACKED)
def test_a_file_that_breaks_off_plays_as_far_as_it_goes(
    tmp_path: Path, share: float, compression: CompressionType, caplog: pytest.LogCaptureFixture
) -> None:
    whole = walk(1000, compression)
    data_end = whole.rindex(b"\x0f", 0, len(whole) - 8)  # anything from here on is the summary
    with caplog.at_level(logging.WARNING):
        found = samples(tmp_path, whole[: int(data_end * share * 0.8)])
    assert len(found) < 1000
    assert [s.values["pos"] for s in found] == [{"A": k / 100, "B": -k / 100} for k in range(len(found))]
    assert len(caplog.messages) <= 2
    assert all(message.startswith(f"{tmp_path}/walk.mcap: ") for message in caplog.messages)
    assert "at byte" in caplog.text


def test_a_damaged_chunk_is_left_out(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    whole = bytearray(walk(1000, CompressionType.NONE))
    place = len(whole) // 3
    whole[place] ^= 0xFF
    with caplog.at_level(logging.WARNING):
        found = samples(tmp_path, bytes(whole))
    assert 900 < len(found) < 1000
    for sample in found:
        k = round((sample.t_s - BEGAN_NS * 1e-9) * 100)
        assert sample.values == {"pos": {"A": k / 100, "B": -k / 100}}
    assert len(caplog.messages) == 1
    assert "its checksum is wrong; left out" in caplog.text


def test_a_bad_message_is_named(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bag = Bag()
    for k, cut in enumerate([None, 30, None]):
        t_ns = BEGAN_NS + k * STEP_NS
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, A=k)[:cut])
    file = file_of(tmp_path, bag.finish())
    with caplog.at_level(logging.WARNING):
        found = list(file.read_samples(0, first_pass=True))
        again = list(file.read_samples(0, first_pass=False))
    assert [s.values for s in found] == [s.values for s in again] == [{"pos": {"A": 0}}, {"pos": {"A": 2}}]
    assert len(caplog.messages) == 1
    assert caplog.messages[0].startswith(
        f"{tmp_path}/walk.mcap: /joint_states, message 2: 30 bytes that are no"
    )


def test_one_bad_part_of_every_message_is_named_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    bag = Bag()
    for k in range(9):
        t_ns = BEGAN_NS + k * STEP_NS
        data = header(t_ns).texts(["A", "B\t"]).doubles([k, 1.0]).doubles([0.5] * 3).doubles([k]).done()
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, data)
    file = file_of(tmp_path, bag.finish())
    with caplog.at_level(logging.WARNING):
        found = [list(file.read_samples(0, first_pass)) for first_pass in (True, False)]
    assert [[s.values for s in of_pass] for of_pass in found] == [
        [{"pos": {"A": k, "B\t": 1.0}} for k in range(9)]
    ] * 2
    assert caplog.messages == [
        f"{tmp_path}/walk.mcap: /joint_states: velocity has 3 values, name 2; it is left out",
        f"{tmp_path}/walk.mcap: /joint_states: effort has 1 value, name 2; it is left out",
    ]


@pytest.mark.parametrize("head", [{"stamp": {"sec": 1_700_000_000, "nsec": 500}}, {}, None, 5])
def test_json_that_leaves_members_out_or_writes_times_otherwise(tmp_path: Path, head: object) -> None:
    bag = Bag()
    message = {"name": ["A"], "position": [0.5], **({} if head is None else {"header": head})}
    bag.add("/joint_states", "sensor_msgs/msg/JointState", BEGAN_NS, json.dumps(message).encode(), "json")
    (sample,) = samples(tmp_path, bag.finish())
    assert sample.values == {"pos": {"A": 0.5}}
    assert sample.t_s == pytest.approx(BEGAN_NS * 1e-9, abs=1e-6)


def test_a_bomb_is_not_unpacked(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bag = Bag(CompressionType.ZSTD, chunk_bytes=1 << 30)
    for k in range(9):
        bag.add("/joint_states", "sensor_msgs/msg/JointState", BEGAN_NS + k, bytes(8 << 20))
    with caplog.at_level(logging.WARNING):
        assert samples(tmp_path, bag.finish()) == []
    assert "bytes unpacked, at most 67108864; left out" in caplog.text


@pytest.mark.parametrize("content", [b"", b"rosbag", b"\x89MCAP9\r\n" + bytes(100)])
def test_what_is_no_such_file_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.mcap").write_bytes(content)
    with pytest.raises(SourceError) as e:
        open_source(f"mcap:{tmp_path}/a.mcap", None)
    assert str(e.value) == f"{tmp_path}/a.mcap: neither an MCAP file nor a ROS 1 or ROS 2 bag"
    with pytest.raises(SourceError, match=r"none\.mcap: No such file"):
        open_source(f"mcap:{tmp_path}/none.mcap", None)


@pytest.mark.skipif(not Path("/proc/self/mem").exists(), reason="no /proc here")
def test_a_file_that_opens_and_does_not_read() -> None:
    with pytest.raises(SourceError, match="/proc/self/mem: Input/output error"):
        open_source("mcap:/proc/self/mem", None)
