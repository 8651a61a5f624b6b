"""ROS robots from their own kinds of source to a viewer: with one command, and a G1 with its profile."""

from __future__ import annotations

import asyncio
import json
import math
import os
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from posecast_wire.schema import compute_joint_values

EDGE_TESTS = Path(__file__).parents[1] / "edge-agent" / "tests"
SHARED = Path(os.environ.get("POSECAST_SHARED", Path(__file__).parents[2] / "shared"))
G1 = (
    SHARED / "robots/unitree-g1/example-robot-data/robots/g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf"
)
ARM = """<robot name="arm"><link name="base"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
<link name="upper"><visual><geometry><sphere radius="0.2"/></geometry></visual></link>
<joint name="elbow" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 1"/>
<axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""


@pytest.fixture(autouse=True)
def edge_tests(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EDGE_TESTS))


def swing(t_s: float, i: int = 0) -> float:
    """The position of joint i: rad."""
    return 0.1 + 0.1 * math.sin(3 * t_s + i)  # within every limit of a G1


async def seen(stack: Any, http: str, wanted: int = 60) -> Any:
    viewer = stack.viewer(http)
    watching = asyncio.create_task(viewer.watch())
    await viewer.until(f"{wanted} frames", lambda v: len(v.frames) >= wanted, 40)
    watching.cancel()
    assert viewer.undecodable == 0
    return viewer


def fetch(url: str) -> Any:
    return json.load(urllib.request.urlopen(url, timeout=5))


# in `make test`, a robot behind a rosbridge is on air in doc_blocks/test_robot_commands.py
@pytest.mark.parametrize("kind", ["ros2", pytest.param("rosbridge", marks=pytest.mark.full)])
async def test_one_command_puts_a_robot_that_describes_itself_on_air(stack: Any, kind: str) -> None:
    """Neither profile nor --urdf: joints and model come from the robot itself."""
    import ros_stage
    from posecast_edge.sources.ros.messages import JOINT_STATE, STRING
    from rosbridge_stage import Rosbridge, joint_state
    from source_stage import Mover

    robot: Any
    if kind == "ros2":
        robot = ros_stage.Graph().start()
        robot.latch("/robot_description", STRING, ros_stage.text_message(ARM))

        def put(t_s: float) -> None:
            state = ros_stage.joint_state(t_s, ["elbow"], [swing(t_s)], [0.1])
            robot.publish("/joint_states", JOINT_STATE, state)
    else:
        robot = Rosbridge({"/joint_states": JOINT_STATE})
        robot.parameters["/robot_description"] = ARM

        def put(t_s: float) -> None:
            robot.publish("/joint_states", joint_state(t_s, ["elbow"], [swing(t_s)]))

    mover = Mover(100, lambda _: put(time.monotonic()))
    try:
        _, http, zenoh = stack.relay()
        stack.edge(zenoh, "--source", robot.source)
        viewer = await seen(stack, http)
        for _, frame in viewer.frames:
            body = compute_joint_values(frame.schema, frame.codes, "pos")
            assert body == {"elbow": pytest.approx(swing(frame.t_s), abs=0.002)}

        about = f"http://{http}/api/v1/robots/demo"
        digest = None
        for _ in range(300):
            digest = (await asyncio.to_thread(fetch, about)).get("model")
            if digest:
                break
            await asyncio.sleep(0.1)
        manifest = await asyncio.to_thread(fetch, f"{about}/model/{digest}/manifest.json")
        assert "upper" in json.dumps(manifest["links"])
    finally:
        mover.end()
        robot.stop()


@pytest.mark.full
@pytest.mark.skipif(not SHARED.is_dir(), reason="no robot models beside this checkout")
async def test_a_g1_from_its_topics_to_the_viewer_and_the_doctor(stack: Any) -> None:
    import ros_stage
    from posecast_edge.profile.reader import find_profile, load_profile
    from posecast_edge.sources.ros.messages import CONTROLLER_STATE, IMU, JOINT_STATE, ODOMETRY
    from source_stage import Mover

    names = load_profile(find_profile("g1")).labels["joint"]
    graph = ros_stage.Graph().start()

    def put(_: float) -> None:
        t_s = time.monotonic()
        pos = [swing(t_s, i) for i in range(len(names))]
        graph.publish("/joint_states", JOINT_STATE, ros_stage.joint_state(t_s, names, pos))
        ref = [0.5 * p for p in pos]
        told = ros_stage.controller_state(t_s, names, ref)
        graph.publish("/legs_controller/controller_state", CONTROLLER_STATE, told)
        graph.publish("/imu", IMU, ros_stage.imu(t_s, "pelvis"))
        where = ros_stage.odometry(t_s, (t_s % 10, 0, 0.79), (1, 0, 0, 0))
        graph.publish("/odom", ODOMETRY, where)

    mover = Mover(100, put)
    try:
        _, http, zenoh = stack.relay()
        stack.edge(zenoh, "--source", graph.source, "--profile", "g1", "--urdf", str(G1))
        viewer = await seen(stack, http)
        frames = [f for _, f in viewer.frames]  # since every topic has spoken:
        told = [f for f in frames if None not in (*f.values("ref"), *f.values("base"))]
        assert len(told) > 30
        for frame in told:
            for i, value in enumerate(frame.values("pos")):
                assert value == pytest.approx(swing(frame.t_s, i), abs=0.002)
            assert frame.values("base")[2] == pytest.approx(0.79, abs=0.002)
        done = await asyncio.to_thread(
            subprocess.run,
            [
                *(sys.executable, "-m", "posecast_edge", "doctor", "--source", graph.source),
                *("--profile", "g1", "--urdf", str(G1), "--seconds", "4"),
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        said = [line for line in done.stdout.splitlines() if "[" in line and ": hint: " not in line]
        codes = {line.rpartition("[")[2].rstrip("]") for line in said}
        assert codes == {"joint-undriven"}, done.stdout  # this model has hands, the profile's robot has none
    finally:
        mover.end()
        graph.stop()
