"""Recovery after a fault. Nobody waits for the next KEY, which is a minute away here, and no old data is
shown as live."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import until
from posecast_wire.decoder import Frame

from tests.faults.robot import hand, told_s

KEYS = ("--key-interval", "60")
MISSED_MAX = 90  # frames without which a viewer may be, of the 1800 from KEY to KEY
ON_ITS_WAY_S = 1.0  # from the joint to the viewer, on a machine that does much else
SILENT_S = 2.0  # as old as nothing is that a relay calls online
BRIDGE = Path(__file__).with_name("bridge.py")


class Robot:
    """A robot's program: JSON lines, 30 a second, on a clock that can be set back.

    Its knees are the hand of a clock, so every pose reveals when it was true.
    """

    def __init__(self, *others: str) -> None:
        """`others`: joints beside the two."""
        self.read, self._write = os.pipe()
        self._others = others
        self._offset_s = 1000.0
        self._stop = threading.Event()
        self._going = threading.Event()
        self._going.set()
        self._silent = threading.Event()
        self.lines = 0
        self.newest_s = 0.0  # when the newest was true
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def step_back(self) -> None:
        """Sets its clock back by a minute, which forces a KEY."""
        self._offset_s -= 60.0

    def pause(self) -> None:
        """Falls silent; nothing more is written once this returns."""
        self._silent.clear()
        self._going.clear()
        self._silent.wait()

    def go_on(self) -> None:
        """Resumes."""
        self._going.set()

    def _run(self) -> None:
        with suppress(BrokenPipeError), os.fdopen(self._write, "w", buffering=1) as out:
            while not self._stop.wait(1 / 30):
                if not self._going.is_set():
                    self._silent.set()
                    self._going.wait()
                now_s = time.monotonic()
                sine, cosine = hand(now_s)
                pos = {"RKN": round(sine, 3), "LKN": round(cosine, 3)} | dict.fromkeys(self._others, 0.0)
                out.write(json.dumps({"t": now_s + self._offset_s, "pos": pos}) + "\n")
                self.newest_s, self.lines = now_s, self.lines + 1

    def end(self) -> None:
        """Its last sample has been written."""
        self._stop.set()
        self._going.set()
        self._thread.join()


def true_s(frame: Frame) -> float:
    """When (monotonic) the robot stood as this frame shows it."""
    sine, cosine = frame.values("pos")[:2]
    assert sine is not None
    assert cosine is not None
    return told_s(sine, cosine, time.monotonic())


def state_of(address: str) -> dict[str, Any]:
    """The relay's entry for the robot; {} while it knows none."""
    try:
        with urllib.request.urlopen(f"http://{address}/api/v1/robots/demo", timeout=5) as answer:
            document: dict[str, Any] = json.load(answer)
    except urllib.error.HTTPError:
        return {}
    return document


@pytest.fixture
def robot() -> Iterator[Robot]:
    made = Robot()
    yield made
    made.end()
    with suppress(OSError):
        os.close(made.read)


async def test_one_lost_key_costs_a_second_not_an_interval(stack: Any, robot: Robot) -> None:
    _, address, zenoh = stack.relay()
    order_out, order_in = os.pipe()
    bridge = stack.start("bridge", sys.executable, str(BRIDGE), zenoh, "demo", stdin=order_out)
    middle = bridge.line(r"listening (\S+)")[1]
    stack.edge(middle, "--source", "jsonl", *KEYS, stdin=robot.read)
    viewers = [stack.viewer(address), stack.viewer(address, hz=10)]
    tasks = [asyncio.create_task(viewer.watch()) for viewer in viewers]
    for viewer in viewers:
        await viewer.until("a viewer decodes", lambda v: len(v.frames) > 20)

    os.write(order_in, b"drop\n")
    await asyncio.to_thread(bridge.line, "armed")
    before_s = time.monotonic()
    robot.step_back()
    await asyncio.to_thread(bridge.line, r"dropped (\d+)")
    lost = int(bridge.line(r"dropped (\d+)")[1])
    for viewer in viewers:
        await viewer.until("frames after the lost one decode", lambda v: v.frames[-1][1].seq > lost + 20)
        after = min(frame.seq for _, frame in viewer.frames if frame.seq > lost)
        assert after - lost <= MISSED_MAX
    print("longest gaps", [f"{viewer.longest_gap_s(before_s):.2f} s" for viewer in viewers])
    for task in tasks:
        task.cancel()
    os.close(order_in)


async def test_a_killed_relay_is_back_at_once(stack: Any, robot: Robot) -> None:
    part, address, zenoh = stack.relay()
    port, zenoh_port = int(address.rsplit(":", 1)[1]), int(zenoh.rsplit(":", 1)[1])
    stack.edge(zenoh, "--source", "jsonl", *KEYS, stdin=robot.read)
    viewer = stack.viewer(address)
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the viewer decodes", lambda v: len(v.frames) > 20)

    killed_s = time.monotonic()
    part.kill()
    seen = len(viewer.frames)
    await asyncio.to_thread(stack.relay, port, zenoh_port)
    serving_s = time.monotonic()
    await viewer.until("frames come again", lambda v: len(v.frames) > seen + 20)
    first_s = next(at for at, _ in viewer.frames[seen:] if at > killed_s + 0.05)
    print(f"{first_s - killed_s:.2f} s after the kill, {first_s - serving_s:.2f} s after the new line")
    before, after = viewer.frames[seen - 1][1], next(f for at, f in viewer.frames[seen:] if at > serving_s)
    # what Python needs to start is the machine's; what the edge has sent since then is ours
    assert after.seq - before.seq <= MISSED_MAX
    assert true_s(after) > killed_s - ON_ITS_WAY_S
    task.cancel()


@pytest.mark.parametrize("lines", [45, 150], ids=["shorter than the lease", "longer"])
async def test_an_edge_that_was_stopped_shows_nothing_from_before(
    stack: Any, robot: Robot, lines: int
) -> None:
    """Meanwhile the robot goes on: so many lines wait in the pipe."""
    _, address, zenoh = stack.relay()
    edge = stack.edge(zenoh, "--source", "jsonl", stdin=robot.read)
    viewer = stack.viewer(address)
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the viewer decodes", lambda v: len(v.frames) > 20)

    edge.process.send_signal(signal.SIGSTOP)
    written = robot.lines
    await asyncio.to_thread(until, "lines in the pipe", lambda: robot.lines >= written + lines)
    thawed_s = time.monotonic()
    edge.process.send_signal(signal.SIGCONT)
    await viewer.until("frames again", lambda v: sum(at > thawed_s for at, _ in v.frames) > 30)
    told = [thawed_s - true_s(frame) for at, frame in viewer.frames if at > thawed_s]
    print(f"the oldest pose after it went on: {max(told):.2f} s before")
    assert max(told) <= ON_ITS_WAY_S
    task.cancel()


async def test_what_the_robot_said_while_nobody_listened_is_a_picture(stack: Any, robot: Robot) -> None:
    """While the relay is away, the robot sends its last sample; when the relay is back, the robot is there,
    and silent."""
    part, address, zenoh = stack.relay()
    port, zenoh_port = int(address.rsplit(":", 1)[1]), int(zenoh.rsplit(":", 1)[1])
    stack.edge(zenoh, "--source", "jsonl", *KEYS, stdin=robot.read)
    viewer = stack.viewer(address)
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the viewer decodes", lambda v: len(v.frames) > 20)

    part.kill()
    killed_s, written = time.monotonic(), robot.lines
    await asyncio.to_thread(until, "lines that nobody sees", lambda: robot.lines > written + 60)
    robot.pause()
    last_s = robot.newest_s
    await asyncio.to_thread(until, "it is past", lambda: time.monotonic() > last_s + SILENT_S)
    await asyncio.to_thread(stack.relay, port, zenoh_port)

    heard: list[str] = []

    def pictured() -> bool:
        state = state_of(address)
        heard.append(state.get("status", ""))
        return state.get("seq") is not None

    await asyncio.to_thread(until, "a picture", pictured)
    await viewer.until("the picture", lambda v: true_s(v.frames[-1][1]) > killed_s + ON_ITS_WAY_S)
    assert abs(true_s(viewer.frames[-1][1]) - last_s) < 0.1, "the last word"
    heard += [state_of(address)["status"] for _ in range(20)]
    assert "online" not in heard
    robot.go_on()
    await asyncio.to_thread(until, "it speaks again", lambda: state_of(address)["status"] == "online")
    await viewer.until("what it says then", lambda v: true_s(v.frames[-1][1]) > last_s)
    task.cancel()


async def test_a_second_edge_of_the_same_name_comes_and_goes(stack: Any, robot: Robot) -> None:
    """The first one is refused meanwhile, keeps sending, and is on air again without help."""
    _, address, zenoh = stack.relay()
    first = stack.edge(zenoh, "--source", "jsonl", *KEYS, stdin=robot.read)
    viewer = stack.viewer(address)
    task = asyncio.create_task(viewer.watch())
    await viewer.until("the first is shown", lambda v: len(v.frames) > 20)
    other = Robot("WST")
    try:
        second = stack.edge(zenoh, "--source", "jsonl", stdin=other.read)
        await viewer.until("the second is shown", lambda v: v.frames[-1][1].schema.size == 3)
        await asyncio.to_thread(
            until, "the first is told", lambda: "the relay accepts no frames" in first.log
        )
        await asyncio.to_thread(until, "all are told", lambda: state_of(address)["conflict"] is True)
        second.kill()
        await viewer.until("the first is shown again", lambda v: v.frames[-1][1].schema.size == 2)
        seen, again_s = len(viewer.frames), time.monotonic()
        await viewer.until("and goes on", lambda v: len(v.frames) > seen + 60)
        await asyncio.to_thread(until, "it says so", lambda: "on air again" in first.log)
        assert {frame.schema.size for _, frame in viewer.frames[seen:]} == {2}
        assert min(true_s(frame) for _, frame in viewer.frames[seen:]) > again_s - ON_ITS_WAY_S
        assert state_of(address)["status"] == "online"
    finally:
        other.end()
        task.cancel()
