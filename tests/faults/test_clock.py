"""The wall clock of a machine on the path is changed: no viewer notices."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from itertools import pairwise
from pathlib import Path

import pytest
from posecast_loadtests.connection import Connection
from posecast_testing import Process

from tests.conftest import Stack
from tests.faults.conftest import Scene

SOURCE = Path(__file__).with_name("wall_clock.c")


class WallClock:
    """Of the processes that are started with `prefix`."""

    def __init__(self, stack: Stack) -> None:
        if shutil.which("cc") is None:
            pytest.skip("no C compiler (cc) here")
        self._library = stack.folder / "wall_clock.so"
        self._step = stack.folder / "wall_clock"
        self.set(0)
        flags = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
        subprocess.run(["cc", *flags, "-o", str(self._library), str(SOURCE), "-ldl"], check=True)
        self.prefix = ("env", f"LD_PRELOAD={self._library}", f"WALL_CLOCK={self._step}")

    def set(self, step_s: int) -> None:
        """Sets it this many seconds from the true time, at once."""
        descriptor = os.open(self._step, os.O_WRONLY | os.O_CREAT)
        os.write(descriptor, step_s.to_bytes(8, "little", signed=True))
        os.close(descriptor)

    def rules(self, part: Process) -> bool:
        """Whether that process uses it."""
        return str(self._library) in Path(f"/proc/{part.process.pid}/maps").read_text()


def server_time_s(address: str) -> float:
    """The time according to the relay."""
    link = Connection(f"ws://{address}/api/v1/robots/demo/live?hz=1")
    _, payload, _ = next(link.messages())
    link.close()
    return float(json.loads(payload)["server_time"])


@pytest.mark.full
@pytest.mark.parametrize("step_s", [-3600, 86_400], ids=["an hour back", "a day on"])
@pytest.mark.parametrize("whose", ["edge", "relay"])
def test_a_machines_clock_is_set(scene: Scene, whose: str, step_s: int) -> None:
    clock = WallClock(scene.stack)
    if whose == "edge":
        scene.stack.edge_command = (*clock.prefix, *scene.stack.edge_command)
    else:
        scene.stack.relay_command = (*clock.prefix, *scene.stack.relay_command)
    relay, address, zenoh = scene.stack.relay()
    _, fifo = scene.robot()
    edge = scene.edge(zenoh, fifo)
    screen = scene.screen(address, hz=30)
    screen.says("LIVE")
    screen.watches(30)
    assert clock.rules(edge if whose == "edge" else relay)
    at_s = time.monotonic()
    clock.set(step_s)
    screen.watches(150, since_s=at_s)
    late = scene.screen(address, hz=30)  # who comes now finds nothing odd either
    late.says("LIVE")
    late.watches(30)
    if whose == "relay":
        assert abs(server_time_s(address) - time.time() - step_s) < 60
    assert screen.lines("word", at_s) == []
    assert {line["word"] for line in late.lines("word")} <= {None, "LIVE"}
    for one in (screen, late):
        one.never_lied()
    frames = screen.frames(at_s)
    scene.tell(longest_gap=max(b["at"] - a["at"] for a, b in pairwise(frames)))
