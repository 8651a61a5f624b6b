"""A robot without joint states: its joints by /tf, of a bag, a live graph and rosbridge; by its own
description, by a file, and without either."""

from __future__ import annotations

import math
import threading
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from command_stage import run_edge
from posecast_edge.model.moving_joints import list_moving_joints
from posecast_edge.model.urdf.reader import load_urdf, read_urdf
from posecast_edge.sample import Sample
from posecast_edge.sources.registry import open_source
from posecast_edge.sources.ros.messages import JOINT_STATE, STRING, TF
from posecast_edge.sources.ros.robot_frames import NO_MODEL
from posecast_testing import until
from source_stage import Listen, Move

pytest.importorskip("mcap", reason="the extra [mcap] is not installed")
pytest.importorskip("cbor2", reason="the extra [ros] is not installed")

from bag_stage import BEGAN_NS, STEP_NS, Said, Words, write_ros1, write_ros2
from posecast_edge.sources.files.ros_recording import RosRecording
from ros_stage import Graph, joint_state, text_message, transforms
from rosbags.rosbag2 import StoragePlugin
from rosbridge_stage import Rosbridge

Chain = tuple[str, str, tuple[float, float, float], tuple[float, float, float, float]]

LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'
URDF = f"""<robot name="crane">
<link name="base_link"/><link name="mast"/><link name="trolley"/><link name="hook"/>
<joint name="slew" type="revolute"><parent link="base_link"/><child link="mast"/><axis xyz="0 0 1"/>
<origin xyz="0 0 1" rpy="0 0 0.5"/>{LIMIT}</joint>
<joint name="travel" type="prismatic"><parent link="mast"/><child link="trolley"/>
<axis xyz="1 0 0"/>{LIMIT}</joint>
<joint name="hoist" type="prismatic"><parent link="trolley"/><child link="hook"/>
<axis xyz="0 0 -1"/>{LIMIT}</joint>
</robot>"""
TF_TYPE, STRING_TYPE = "tf2_msgs/msg/TFMessage", "std_msgs/msg/String"


def crane(slew: float, travel: float, prefix: str = "") -> list[Chain]:
    """As robot_state_publisher tells it; of the hook nothing is told."""
    half = (0.5 + slew) / 2
    turned = (math.cos(half), 0.0, 0.0, math.sin(half))
    frames = [
        ("base_link", "mast", (0.0, 0.0, 1.0), turned),
        ("mast", "trolley", (travel, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ]
    return [(prefix + parent, prefix + child, xyz, wxyz) for parent, child, xyz, wxyz in frames]


def bag(ros1: bool, prefix: str = "", described: bool = True, count: int = 200) -> list[Said]:
    words = Words(ros1)
    fixed = words.transforms(BEGAN_NS, ("world", f"{prefix}base_link", (0, 0, 0), (1, 0, 0, 0)))
    said: list[Said] = [("/tf_static", TF_TYPE, BEGAN_NS, fixed)]
    if described:
        text = words.make(STRING_TYPE, data=URDF)
        said.append(("/robot_description", STRING_TYPE, BEGAN_NS + 1, text))
    for k in range(count):
        t_ns = BEGAN_NS + k * STEP_NS
        said.append(("/tf", TF_TYPE, t_ns, words.transforms(t_ns, *crane(k / 100, -k / 200, prefix))))
    return sorted(said, key=lambda one: one[2])


def read(recording: RosRecording) -> list[Sample]:
    return list(recording.read_samples(0.0, first_pass=True))


@pytest.mark.parametrize("ros1", [True, False])
@pytest.mark.parametrize("prefix", ["", "lab/"])
def test_a_bag_that_describes_its_robot(ros1: bool, prefix: str, tmp_path: Path) -> None:
    said = bag(ros1, prefix)
    if ros1:
        path = write_ros1(tmp_path / "a.bag", said)
    else:
        path = write_ros2(tmp_path / "bag", said, StoragePlugin.MCAP)
    found = read(RosRecording(path, None))
    assert 140 <= len(found) <= 200  # all but the moment in which it is seen what there is
    for sample in found:
        k = round((sample.t_s - BEGAN_NS * 1e-9) * 100)
        expected = {"slew": pytest.approx(k / 100), "travel": -k / 200, "hoist": None}
        assert sample.values == {"pos": expected}


def test_a_bag_and_the_model_in_a_file(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_ros2(tmp_path / "bag", bag(False, described=False), StoragePlugin.SQLITE3)
    assert read(RosRecording(path, None)) == []
    assert [message.partition(": ")[2] for message in caplog.messages] == [NO_MODEL]
    caplog.clear()
    urdf = tmp_path / "crane.urdf"
    urdf.write_text(URDF)
    recording = RosRecording(path, None)
    recording.joints = list_moving_joints(load_urdf(urdf))
    last = {"slew": pytest.approx(1.99), "travel": -0.995, "hoist": None}
    assert read(recording)[-1].values["pos"] == last
    assert [message.partition(": ")[2] for message in caplog.messages] == [
        "joints from /tf: 2 of 3; no transform for hoist (trolley → hook)"
    ]


def test_a_recording_waits_for_a_model_that_is_being_built(tmp_path: Path) -> None:
    path = write_ros2(tmp_path / "bag", bag(False, described=False, count=3), StoragePlugin.SQLITE3)
    urdf = tmp_path / "crane.urdf"
    urdf.write_text(URDF)
    source: Any = open_source(f"bag:{path}", None)
    source.expect_joints()
    heard: list[Sample] = []
    thread = threading.Thread(target=source.run, args=(heard.append, threading.Event()))
    thread.start()
    until("it reads", lambda: source._file.topics != {})
    assert heard == []
    source.take_joints(list_moving_joints(load_urdf(urdf)))
    thread.join(20)
    assert heard[-1].values["pos"] == {"slew": pytest.approx(0.02), "travel": -0.01, "hoist": None}


def test_joint_states_in_the_same_bag_win(tmp_path: Path) -> None:
    words, said = Words(False), bag(False)
    for k in range(100, 200):
        t_ns = BEGAN_NS + k * STEP_NS
        said.append(("/joint_states", "sensor_msgs/msg/JointState", t_ns, words.joints(t_ns, slew=9.0)))
    said.sort(key=lambda one: one[2])
    found = read(RosRecording(write_ros2(tmp_path / "bag", said, StoragePlugin.SQLITE3), None))
    assert found[-1].values["pos"] == {"slew": 9.0}
    assert not any(sample.values["pos"].get("travel") for sample in found[-90:])  # type: ignore[union-attr]


def test_probe_says_how_many_joints_it_found(tmp_path: Path) -> None:
    path = write_ros2(tmp_path / "bag", bag(False, described=False), StoragePlugin.SQLITE3)
    alone = run_edge("probe", f"bag:{path}", "--seconds", "0.5")
    assert (alone.returncode, f"  joints from /tf: none; {NO_MODEL}\n" in alone.stdout) == (1, True)
    urdf = tmp_path / "crane.urdf"
    urdf.write_text(URDF)
    done = run_edge("probe", f"bag:{path}", "--seconds", "0.5", "--urdf", str(urdf))
    assert done.returncode == 0, done.stderr
    assert "  joints from /tf: 2 of 3; no transform for hoist (trolley → hook)\n" in done.stdout
    units = {tuple(line.split()[:3]) for line in done.stdout.splitlines() if line.startswith("pos")}
    assert units == {("pos", "1", "rad"), ("pos", "1/2", "m")}
    wrong = run_edge("probe", f"bag:{path}", "--urdf", str(tmp_path / "none.urdf"))
    assert wrong.returncode == 2
    assert wrong.stderr.count("\n") == 1


# --- live


def test_a_live_graph_whose_joint_states_come_later(graph: Graph, listen: Listen, moving: Move) -> None:
    graph.latch("/robot_description", STRING, text_message(URDF))
    graph.latch("/tf_static", TF, transforms(1000, ("world", "base_link", (0, 0, 0), (1, 0, 0, 0))))
    moving(50, lambda t: graph.publish("/tf", TF, transforms(1000 + t, *crane(0.5, t / 100))))
    heard = listen(graph.source, None)
    until("joints by /tf", lambda: "pos" in heard.newest)
    assert heard.newest["pos"].keys() == {"slew", "travel", "hoist"}
    assert heard.newest["pos"]["slew"] == pytest.approx(0.5)
    t_s, values = heard.last
    assert values["pos"]["travel"] == pytest.approx((t_s - 1000) / 100, abs=1e-6)
    assert "joints from /tf: 2 of 3; no transform for hoist (trolley → hook)" in heard.source.offers
    moving(50, lambda t: graph.publish("/joint_states", JOINT_STATE, joint_state(2000 + t, ["slew"], [2.0])))
    until("joint states", lambda: heard.newest["pos"] == {"slew": 2.0})


def test_frames_of_a_bridge_and_a_model_given_later(graph: Graph, listen: Listen, moving: Move) -> None:
    publish = graph.bridge("/tf", TF)
    heard = listen(graph.source, None)
    moving(50, lambda t: publish(transforms(1000 + t, *crane(0.5, 0.25, "lab/"))))
    until("frames", lambda: any(NO_MODEL in line for line in heard.source.offers))
    heard.source.take_joints(
        tuple(j for j in list_moving_joints(read_urdf(BytesIO(URDF.encode()))) if j.name != "hoist")
    )
    until("joints", lambda: heard.newest.get("pos") == {"slew": pytest.approx(0.5), "travel": 0.25})


def test_with_joint_states_nothing_asks_for_transforms(graph: Graph, listen: Listen, moving: Move) -> None:
    heard = listen(graph.source, None)
    moving(50, lambda t: graph.publish("/joint_states", JOINT_STATE, joint_state(1000 + t, ["slew"], [2.0])))
    moving(50, lambda t: graph.publish("/tf", TF, transforms(1000 + t, *crane(0.5, 0.25))))
    until("joint states", lambda: heard.newest.get("pos") == {"slew": 2.0})
    until("for longer than joint states are waited for", lambda: len(heard.samples) > 150)
    assert heard.newest["pos"] == {"slew": 2.0}
    assert any("tf2_msgs/TFMessage" in line and "not read" in line for line in heard.source.offers)


def test_rosbridge(listen: Listen, moving: Move) -> None:
    server = Rosbridge({"/tf": "tf2_msgs/TFMessage", "/tf_static": "tf2_msgs/TFMessage"})
    try:
        heard = listen(server.source, None)
        heard.source.take_joints(list_moving_joints(read_urdf(BytesIO(URDF.encode()))))

        def act(t_s: float) -> None:
            told = [
                {
                    "header": {"stamp": {"secs": 9, "nsecs": round(t_s * 1e9) % 10**9}, "frame_id": parent},
                    "child_frame_id": child,
                    "transform": {
                        "translation": dict(zip("xyz", xyz, strict=True)),
                        "rotation": dict(zip("wxyz", wxyz, strict=True)),
                    },
                }
                for parent, child, xyz, wxyz in crane(0.5, 0.25)
            ]
            server.publish("/tf", {"transforms": told})

        moving(50, act)
        expected = {"slew": pytest.approx(0.5), "travel": 0.25, "hoist": None}
        until("joints", lambda: heard.newest.get("pos") == expected)
    finally:
        server.stop()
