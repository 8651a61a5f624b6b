"""An arm that runs, and then a gripper or another sensor: both are shown, whatever the source."""

from __future__ import annotations

import io
import json
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bag_stage
import pytest
from edge_stage import ROBOT, Router
from posecast_edge.agent import Agent, AgentSettings
from posecast_edge.cli.console import Console
from posecast_edge.cli.probe import run_probe
from posecast_edge.profile.reader import parse_profile
from posecast_edge.profile.types import Profile
from posecast_edge.sources.registry import open_source
from posecast_edge.sources.ros.messages import IMU, JOINT_STATE
from posecast_edge.uplink.route import RelayRoute
from posecast_testing import until
from ros_stage import Graph, imu, joint_state
from rosbridge_stage import Rosbridge, ros_2
from rosbridge_stage import joint_state as bridged_joint_state
from source_stage import Move
from test_robot import Watched

ARM, FINGER = ["shoulder", "elbow"], ["finger"]
PROFILE = '[labels]\njoint = ["shoulder", "elbow"]\n[[fields]]\nname = "pos"\n'
IMU_PARTS = {"quat", "gyro", "acc"}


@contextmanager
def running(router: Router, spec: str, profile: Profile | None = None) -> Iterator[Watched]:
    settings = AgentSettings(ROBOT, RelayRoute(router.endpoint), 30.0, 30.0)
    agent = Agent(settings, open_source(spec, profile), profile, Console(io.StringIO()))
    thread = threading.Thread(target=agent.run)
    thread.start()
    try:
        yield Watched(router)
    finally:
        agent.stop()
        thread.join()


def has(watched: Watched, *labels: str) -> bool:
    return set(labels) <= {
        label for label, value in watched.look().get("pos", {}).items() if value is not None
    }


def check_frames(router: Router, watched: Watched, schemas: int) -> None:
    """There were so many schemas, and no frame was lost between them."""
    headers = [frame.header for frame in list(router.frames)]
    assert len({header.schema_id for header in headers} - {None}) == schemas
    watched.look()
    assert watched.seqs == list(range(watched.seqs[0], watched.seqs[0] + len(watched.seqs)))


def show_late(
    router: Router, watched: Watched, begin: Callable[[], object], shown: Callable[[], bool]
) -> None:
    """The arm is shown for a while before the other part begins."""
    until("the arm", lambda: has(watched, *ARM))
    n = len(router.frames)
    until("the arm for a while", lambda: len(router.frames) > n + 10)
    assert not shown()
    begin()
    until("the part that came later", shown)
    n = len(router.frames)
    until("the arm goes on", lambda: len(router.frames) > n + 10 and has(watched, *ARM))
    assert shown()
    check_frames(router, watched, schemas=2)


@pytest.fixture
def graph() -> Iterator[Graph]:
    made = Graph().start()
    yield made
    made.stop()


@pytest.mark.parametrize("topic", ["/joint_states", "/gripper/joint_states"])
def test_a_gripper_of_ros_2(router: Router, graph: Graph, moving: Move, topic: str) -> None:
    def publish(topic: str, names: list[str]) -> Callable[[float], None]:
        return lambda t_s: graph.publish(
            topic, JOINT_STATE, joint_state(1e3 + t_s, names, [t_s % 1] * len(names))
        )

    moving(20, publish("/joint_states", ARM))
    with running(router, graph.source) as watched:
        show_late(router, watched, lambda: moving(20, publish(topic, FINGER)), lambda: has(watched, *FINGER))


def test_a_gripper_and_an_imu_behind_the_dds_bridge(router: Router, graph: Graph, moving: Move) -> None:
    put = graph.bridge("/joint_states", JOINT_STATE)
    moving(20, lambda t_s: put(joint_state(1e3 + t_s, ARM, [t_s % 1] * 2)))

    def begin() -> None:
        gripper = graph.bridge("/gripper/joint_states", JOINT_STATE)
        torso = graph.bridge("/imu/data", IMU)

        def act(t_s: float) -> None:
            torso(imu(1e3 + t_s, "torso"))
            gripper(joint_state(1e3 + t_s, FINGER, [t_s % 1]))

        moving(20, act)

    with running(router, graph.source) as watched:
        show_late(
            router, watched, begin, lambda: has(watched, *FINGER) and watched.look().keys() >= IMU_PARTS
        )


@pytest.mark.parametrize("topic", ["/joint_states", "/gripper/joint_states"])
def test_a_gripper_through_rosbridge(router: Router, moving: Move, topic: str) -> None:
    server = Rosbridge({"/joint_states": ros_2(JOINT_STATE)})

    def publish(topic: str, names: list[str]) -> Callable[[float], None]:
        return lambda t_s: server.publish(
            topic, bridged_joint_state(1e3 + t_s, names, [t_s % 1] * len(names))
        )

    def begin() -> None:
        if topic in server.topics:
            server.publishers[topic] = 2
        server.topics[topic] = ros_2(JOINT_STATE)
        moving(20, publish(topic, FINGER))

    moving(20, publish("/joint_states", ARM))
    try:
        with running(router, server.source) as watched:
            show_late(router, watched, begin, lambda: has(watched, *FINGER))
    finally:
        server.stop()


def test_json_lines(router: Router, tmp_path: Path, moving: Move) -> None:
    fifo = tmp_path / "lines"
    os.mkfifo(fifo)
    more: dict[str, Any] = {}

    def act(t_s: float) -> None:
        pos = dict.fromkeys((*ARM, *more.get("joints", ())), t_s % 1)
        os.write(fd, json.dumps({"t": t_s, "pos": pos, **more.get("fields", {})}).encode() + b"\n")

    def begin() -> None:
        more.update(joints=FINGER, fields={"temp": {"elbow": 40}, "flags": {"elbow": ["overheat"]}})

    with running(router, f"jsonl:{fifo}") as watched:
        fd = os.open(fifo, os.O_WRONLY)
        mover = moving(50, act)
        show_late(
            router,
            watched,
            begin,
            lambda: (
                has(watched, *FINGER) and watched.sees(temp={"shoulder": None, "elbow": 40, "finger": None})
            ),
        )
        until(
            "its fault, though it has no name yet",
            lambda: any(e["text"] == "overheat" for e in router.events),
        )
        mover.end()
        os.close(fd)


def recording(kind: str, folder: Path) -> str:
    """Four seconds of the arm, and the gripper in the last, later than a recording is looked ahead."""
    times = [k / 20 for k in range(80)]
    path = folder / f"late.{kind}"
    if kind == "jsonl":
        lines = [{"t": t, "pos": dict.fromkeys(ARM if t < 3 else ARM + FINGER, t % 1)} for t in times]
        path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))
        return f"jsonl:{path}"
    bag = bag_stage.Bag()
    for t in times:
        t_ns = bag_stage.BEGAN_NS + round(t * 1e9)
        bag.add(
            "/joint_states",
            "sensor_msgs/msg/JointState",
            t_ns,
            bag_stage.joint_state(t_ns, shoulder=t % 1, elbow=0.5),
        )
        if t >= 3:
            data = bag_stage.joint_state(t_ns, finger=t % 1)
            bag.add("/gripper/joint_states", "sensor_msgs/msg/JointState", t_ns, data)
    path.write_bytes(bag.finish())
    return f"mcap:{path}"


@pytest.mark.parametrize("kind", ["jsonl", "mcap"])
def test_a_recording_and_its_probe(
    router: Router, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spec = recording(kind, tmp_path)
    with running(router, spec) as watched:
        until("the arm", lambda: has(watched, *ARM))
        assert not has(watched, *FINGER)
        until("the finger", lambda: has(watched, *FINGER))
        check_frames(router, watched, schemas=2)
    assert run_probe([spec, "--seconds", "9"]) == 0
    assert "joints: shoulder elbow finger\n" in capsys.readouterr().out


def test_with_a_profile_nothing_else_leaves(router: Router, tmp_path: Path) -> None:
    with running(router, recording("jsonl", tmp_path), parse_profile(PROFILE)) as watched:
        until("the arm", lambda: has(watched, *ARM))
        until("the finger's time", lambda: has(watched, *ARM) and watched.t_s > 3)
        assert list(watched.look()) == ["pos"]
        assert list(watched.look()["pos"]) == ARM
    check_frames(router, watched, schemas=1)
