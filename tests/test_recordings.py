"""A simulation, shown to a viewer with one command. Tables and bags: doc_blocks/test_robot_commands.py."""

from __future__ import annotations

import asyncio
import json
import urllib.request
from typing import Any

import pytest
from posecast_testing import until


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


async def test_a_simulated_arm_brings_profile_and_model(stack: Any) -> None:
    pytest.importorskip("mujoco", reason="the extra [mujoco] is not installed")
    viewer, url = await frames(stack, "--source", "mujoco")
    schema = viewer.frames[-1][1].schema
    assert [f.name for f in schema.fields] == ["ref", "pos", "vel", "effort"]
    assert schema.mapping.units["pos"] == {"finger_left": "m", "finger_right": "m"}
    turns = {frame.values("ref")[0] for _, frame in viewer.frames}
    assert len(turns) > 5, "the first joint moves"
    assert await asyncio.to_thread(model_of, url)
