"""The examples in edge-agent/examples, run with a real relay: a viewer sees what they publish.

Examples whose library is not installed here are skipped with a message. The ROS 2 and LeRobot programs need a
robot, so only their publishing function is called, with their own messages.
"""

from __future__ import annotations

import asyncio
import importlib.util
import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import posecast
import pytest

from tests.conftest import Stack

EXAMPLES = Path(__file__).resolve().parent.parent / "edge-agent" / "examples"
JOINTS = ("shoulder", "elbow")


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


async def seen(viewer: Any, robot: str, what: str, holds: Callable[[Any], bool]) -> Any:
    """The newest frame, as soon as it is what is wanted."""
    viewer.url = viewer.url.replace("/demo/", f"/{robot}/")
    task = asyncio.create_task(viewer.watch())
    try:
        await viewer.until(what, lambda v: bool(v.frames) and holds(v.frames[-1][1]))
        return viewer.frames[-1][1]
    finally:
        task.cancel()


def readings(frame: Any, name: str) -> dict[str, float]:
    field = frame.schema.find_field(name)
    return dict(zip(field.labels, frame.values(name), strict=True))


def moves(frame: Any) -> bool:
    pos = readings(frame, "pos")
    assert tuple(pos) == JOINTS
    return all(value is not None and abs(value) > 0.02 for value in pos.values())


@pytest.fixture(scope="module")
def air(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """One relay for all: its address and where robots connect."""
    stack = Stack(tmp_path_factory.mktemp("relay"))
    relay, address, zenoh = stack.relay()
    yield address, zenoh
    relay.stop()
    assert "Traceback" not in relay.log, relay.log


@pytest.mark.parametrize(
    ("example", "library"), [("mujoco", "mujoco"), ("pybullet", "pybullet"), ("pinocchio", "pinocchio")]
)
async def test_a_simulation_is_seen_to_move(
    stack: Any, air: tuple[str, str], example: str, library: str
) -> None:
    if importlib.util.find_spec(library) is None:
        pytest.skip(f"{library} is not installed here")
    address, zenoh = air
    stack.start("example", sys.executable, str(EXAMPLES / f"{example}_arm.py"), zenoh)
    frame = await seen(stack.viewer(address), f"{example}-arm", "the arm moves", moves)
    pos = readings(frame, "pos")
    # all three follow the same path: the elbow is told 0.8 sin 2t, the shoulder 0.5 sin t
    if example == "pinocchio":
        assert pos == pytest.approx(
            {"shoulder": 0.5 * math.sin(frame.t_s), "elbow": 0.8 * math.sin(2 * frame.t_s)}, abs=0.003
        )
    else:
        ref = readings(frame, "ref")
        assert ref["elbow"] == pytest.approx(0.8 * math.sin(2 * frame.t_s), abs=0.02)
        assert pos == pytest.approx(ref, abs=0.5)


async def test_the_cells_of_the_notebook_run(stack: Any, air: tuple[str, str]) -> None:
    """As a program, cell after cell; by Jupyter's own kernel where there is one."""
    address, zenoh = air
    notebook = json.loads((EXAMPLES / "notebook.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    program = "\n".join(cells)
    if importlib.util.find_spec("nbclient") and importlib.util.find_spec("ipykernel"):
        program = (
            "import nbformat, nbclient\n"
            "nbclient.NotebookClient(nbformat.read('notebook.ipynb', 4), kernel_name='python3').execute()"
        )
    words = ("env", "-C", str(EXAMPLES), f"RELAY={zenoh}", sys.executable, "-c", program)
    part = stack.start("notebook", *words)
    frame = await seen(stack.viewer(address), "notebook-arm", "the arm moves", moves)
    assert readings(frame, "pos")["elbow"] == pytest.approx(0.8, abs=0.002)
    assert await asyncio.to_thread(part.process.wait, 30) == 0


@pytest.fixture
def robot(air: tuple[str, str], request: pytest.FixtureRequest) -> Iterator[tuple[posecast.Robot, str]]:
    """One that is named by the test's parameter, and its viewers' address."""
    name: str = request.param
    with posecast.Robot(name, relay=air[1]) as made:
        yield made, f"{air[0]} {name}"


async def publish_until_seen(seen_at: str, publish: Callable[[], None], pos: dict[str, float]) -> Any:
    address, robot = seen_at.split()

    async def keep_publishing() -> None:
        while True:
            publish()
            await asyncio.sleep(0.01)

    task = asyncio.create_task(keep_publishing())
    try:
        return await seen(
            Stack.viewer(address),
            robot,
            "what was published",
            lambda frame: readings(frame, "pos") == pytest.approx(pos, abs=0.002),
        )
    finally:
        task.cancel()


@pytest.mark.parametrize("robot", ["ros-arm"], indirect=True)
async def test_a_joint_state_of_ros_2_arrives(robot: tuple[posecast.Robot, str]) -> None:
    """rosbags has ROS's message types; rclpy itself is not on PyPI, so the node around it is not run."""
    pytest.importorskip("rosbags", reason="the extra [ros] is not installed")
    import numpy as np
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE).types
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](12, 500_000_000), "base")
    message = types["sensor_msgs/msg/JointState"](
        header, ["elbow", "shoulder"], np.array([0.25, -0.5]), np.array([]), np.array([1.0, 2.0])
    )
    own, at = robot
    publish = load("ros2_node").publish_joint_state
    frame = await publish_until_seen(at, lambda: publish(own, message), {"elbow": 0.25, "shoulder": -0.5})
    assert frame.t_s == 12.5
    assert readings(frame, "effort") == pytest.approx({"elbow": 1.0, "shoulder": 2.0}, abs=0.05)
    assert [f.name for f in frame.schema.fields] == ["pos", "effort"]
    assert own.status().problems == {}


@pytest.mark.parametrize("robot", ["lerobot-arm"], indirect=True)
async def test_dictionaries_of_lerobot_arrive(robot: tuple[posecast.Robot, str]) -> None:
    own, at = robot
    publish = load("lerobot_arm").publish_lerobot
    observation = {"shoulder_pan.pos": 12.3, "elbow_flex.pos": -90.0, "gripper.pos": 40.0, "front": object()}
    action = {"shoulder_pan.pos": 15.0, "elbow_flex.pos": -90.0, "gripper.pos": 40.0}
    frame = await publish_until_seen(
        at,
        lambda: publish(own, observation, action),
        {"shoulder_pan": math.radians(12.3), "elbow_flex": -math.pi / 2},
    )
    assert readings(frame, "ref")["shoulder_pan"] == pytest.approx(math.radians(15), abs=0.001)
    assert readings(frame, "opening") == pytest.approx({"gripper": 40.0})
    assert own.status().problems == {}


def test_examples_are_short() -> None:
    scripts = sorted(EXAMPLES.glob("*.py"))
    assert len(scripts) == 5
    assert {path.name: n for path in scripts if (n := len(path.read_text().splitlines())) > 60} == {}
    assert os.path.getsize(EXAMPLES / "notebook.ipynb") < 4000
