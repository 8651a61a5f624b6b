"""A table, a bag and a simulation, each shown to a viewer from its file with one command."""

from __future__ import annotations

import asyncio
import json
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from tests.conftest import until

EDGE_TESTS = Path(__file__).parents[1] / "edge-agent" / "tests"
POSE = {"hip": 0.25, "knee": -0.5}


async def frames(stack: Any, *arguments: str) -> tuple[Any, str]:
    """A viewer that has seen twenty frames of the robot, and the relay's URL."""
    _, http, zenoh = stack.relay()
    stack.edge(zenoh, *arguments)
    viewer = stack.viewer(http)
    watching = asyncio.create_task(viewer.watch())
    await viewer.until("twenty frames", lambda v: len(v.frames) >= 20, 30)
    watching.cancel()
    assert viewer.undecodable == 0
    return viewer, f"http://{http}/api/v1/robots/demo"


def model_of(url: str) -> str:
    """The hash of the model that the relay knows of, once there is one."""

    def known() -> str | None:
        with urllib.request.urlopen(url, timeout=5) as answer:
            model: str | None = json.load(answer)["model"]
            return model

    return until("a model is announced", known)


@pytest.mark.full
async def test_a_table(stack: Any, tmp_path: Path) -> None:
    rows = "".join(f"{k / 50},{POSE['hip']},{k / 1000}\n" for k in range(250))
    (tmp_path / "walk.csv").write_text(f"t,hip,knee [deg]\n{rows}")
    viewer, _ = await frames(stack, "--source", f"csv:{tmp_path}/walk.csv?loop")
    for _, frame in viewer.frames:
        assert frame.schema.fields[0].labels == ("hip", "knee")
        assert frame.values("pos")[0] == pytest.approx(POSE["hip"], abs=0.0006)


@pytest.mark.full
async def test_a_bag_brings_its_model(stack: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mcap", reason="the extra [mcap] is not installed")
    monkeypatch.syspath_prepend(str(EDGE_TESTS))
    from mcap_stage import BEGAN_NS, STEP_NS, Bag, joint_state
    from ros_stage import text_message

    joints = "".join(
        f"<link name='{name}'/><joint name='{name}' type='continuous'>"
        f"<parent link='base'/><child link='{name}'/></joint>"
        for name in POSE
    )
    bag = Bag()
    urdf = f"<robot name='two'><link name='base'/>{joints}</robot>"
    bag.add("/robot_description", "std_msgs/msg/String", BEGAN_NS, text_message(urdf))
    for k in range(300):
        t_ns = BEGAN_NS + k * STEP_NS
        bag.add("/joint_states", "sensor_msgs/msg/JointState", t_ns, joint_state(t_ns, **POSE))
    (tmp_path / "walk.mcap").write_bytes(bag.finish())
    viewer, url = await frames(stack, "--source", f"mcap:{tmp_path}/walk.mcap?loop")
    for _, frame in viewer.frames:
        assert frame.values("pos") == pytest.approx(list(POSE.values()), abs=0.0006)
    assert await asyncio.to_thread(model_of, url)


async def test_a_simulated_arm_brings_profile_and_model(stack: Any) -> None:
    pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    viewer, url = await frames(stack, "--source", "mujoco")
    schema = viewer.frames[-1][1].schema
    assert [f.name for f in schema.fields] == ["ref", "pos", "vel", "effort"]
    assert schema.mapping.units["pos"] == {"finger_left": "m", "finger_right": "m"}
    turns = {frame.values("ref")[0] for _, frame in viewer.frames}
    assert len(turns) > 5, "the first joint moves"
    assert await asyncio.to_thread(model_of, url)
