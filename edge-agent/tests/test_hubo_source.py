"""The source `hubo-ach` as a user has it: the agent, an achd or a channel file, the frames that arrive."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from ach_stage import Writer
from achd_stage import Achd, framed
from edge_stage import ROBOT, Edge, Router
from hubo_structs import SLOT, state
from posecast_edge.profile.reader import load_profile
from posecast_edge.sources.hubo.reconnecting import PersistentReader
from posecast_edge.sources.hubo.source import HuboAchSource
from posecast_testing import until
from posecast_wire.decoder import Decoder

HUBO = Path(__file__).parents[1] / "src/posecast_edge/profiles/hubo2plus.toml"
Run = Callable[..., Edge]


class Robot:
    """A daemon's clock and joints: 200 Hz of frames into `put`."""

    def __init__(self, put: Callable[[bytes], None]) -> None:
        self.state = state()
        self.running = threading.Event()
        self.running.set()
        self._put = put
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        k = 0
        while not self._stop.wait(0.005):
            if self.running.is_set():
                k += 1
                self.state.time = k * 0.005
                self.state.joint[SLOT["RKN"]].ref = math.sin(k * 0.005)
                self.state.joint[SLOT["RKN"]].pos = math.sin(k * 0.005 - 0.05)
            self._put(bytes(self.state))

    def end(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def run(router: Router) -> Iterator[Run]:
    started: list[Edge] = []

    def start(source: str, *args: str) -> Edge:
        flags = ("--robot", ROBOT, "--source", source, "--relay", router.endpoint, "--profile", str(HUBO))
        started.append(Edge("run", *flags, *args, stdin=False))
        return started[-1]

    yield start
    for e in started:
        e.kill()


def decoder_of(router: Router) -> Decoder:
    until("a snapshot", lambda: router.snapshot() is not None)
    decoder = router.decoder()
    assert decoder is not None
    return decoder


def test_from_achd_to_the_relay_with_every_fault_and_silence(server: Achd, router: Router, run: Run) -> None:
    robot = Robot(server.publish)
    for i in range(42):
        robot.state.status[i].homeFlag = 6
    edge = run(server.source)
    try:
        until("frames", lambda: len(router.frames) > 10)
        decoder = decoder_of(router)
        start = next(i for i, f in enumerate(router.frames) if f.header.is_key)
        frames = [decoder.decode(f.data) for f in router.frames[start:]]
        knee = load_profile(HUBO).labels["joint"].index("RKN")
        for f in frames:
            assert f.values("ref")[knee] == pytest.approx(math.sin(f.t_s), abs=0.002)
            assert f.values("pos")[knee] == pytest.approx(math.sin(f.t_s - 0.05), abs=0.002)
        # a fault of a few frames
        robot.state.status[SLOT["LSR"]].jam = 1
        until("the rise", lambda: any(e["text"] == "jam" for e in router.events))
        robot.state.status[SLOT["LSR"]].jam = 0
        until("the fall", lambda: len(router.events) == 2)
        assert [(e["source"], e["text"], e["state"]) for e in router.events] == [
            ("LSR", "jam", "on"),
            ("LSR", "jam", "off"),
        ]
        # frames go on, their time does not: that is silence
        robot.running.clear()
        until("silent", lambda: any(e["text"] == "silent" for e in router.events))
        count = len(router.frames)
        published = server.connections
        until("said aloud", lambda: any("robot time stays at" in line for line in edge.lines))
        assert len(router.frames) == count
        assert server.connections == published
        robot.running.set()
        until("on air again", lambda: len(router.frames) > count)
        assert {h["direction"] for h in server.headers} == {"push"}
        loaded = Path(f"/proc/{edge.process.pid}/maps").read_text()
        assert "zenoh" in loaded
        assert "numpy" not in loaded, "the agent is small"
    finally:
        robot.end()


@pytest.mark.parametrize("way", ["achd", "shm"])
def test_a_fault_of_a_single_frame_is_told_at_any_time_between_two_sent(
    way: str, tmp_path: Path, server: Achd, router: Router, run: Run
) -> None:
    """Five milliseconds of a jam, ever elsewhere in the pace: of 200 frames a second 30 are sent."""
    path = tmp_path / "achshm-hubo-state"
    # holds twelve: some are kept before the look as of a Hubo's seven, but a busy machine may be 40 ms late
    put = server.publish_surely if way == "achd" else Writer(path, frames=16).put
    jam = [20, 123, 227, 332, 438, 545]  # frames since the agent is on air
    robot = state()
    stop, on_air = threading.Event(), threading.Event()
    jammed_s: list[float] = []

    def daemon() -> None:
        since = 0
        for k in itertools.count():
            if stop.wait(0.005):
                return
            since += on_air.is_set()
            robot.time = k / 200
            robot.status[SLOT["RKN"]].jam = since in jam
            if since in jam:
                jammed_s.append(robot.time)
            put(bytes(robot))

    thread = threading.Thread(target=daemon, daemon=True)
    thread.start()
    run(server.source if way == "achd" else f"hubo-ach:shm:{path}")
    try:
        until("frames", lambda: len(router.frames) > 2)
        on_air.set()
        until("the jams", lambda: len(router.events) >= 2 * len(jam), 20)
    finally:
        stop.set()
        thread.join()
    assert [(e["t"], e["state"], e["text"], e["source"]) for e in router.events] == [
        (pytest.approx(t_s), state, "jam", "RKN")
        for k_s in jammed_s
        for t_s, state in ((k_s, "on"), (k_s + 1 / 200, "off"))
    ]


def test_from_shared_memory_while_the_daemon_is_restarted(tmp_path: Path, router: Router, run: Run) -> None:
    path, made = tmp_path / "achshm-hubo-state", tmp_path / "made"
    run(f"hubo-ach:shm:{path}")
    for _ in range(2):
        router.frames.clear()
        writer = Writer(made)
        made.rename(path)
        robot = Robot(writer.put)
        try:
            until("frames", lambda: len(router.frames) > 5)
        finally:
            robot.end()


def test_a_foreign_frame_is_told_once_and_the_next_good_one_counts(
    server: Achd, router: Router, run: Run
) -> None:
    good = state()

    def mixed(client: Any, header: dict[str, str]) -> None:
        client.sendall(b"frame-count: 10\nframe-size: 3000\nstatus: 0 # ACH_OK\n.\n")
        for i in range(400):
            good.time = i * 0.005
            client.sendall(framed(bytes(3632) if i % 2 else bytes(good)))
            time.sleep(0.005)

    server.instead = mixed
    edge = run(server.source)
    until("frames", lambda: len(router.frames) > 5)
    told = [line for line in edge.lines if "3632 bytes" in line]
    assert len(told) == 1
    assert "not a known hubo_state (3368, " in told[0]


class OneByOne(PersistentReader):
    """A reader that never reads: a test hands frames over itself."""

    def _open(self) -> None:
        pass

    def _next(self, stop: threading.Event, wanted_s: float) -> list[bytes]:
        return []


def test_time_that_stands_still_gives_no_sample_and_time_that_steps_back_does() -> None:
    source, s = HuboAchSource(OneByOne("test"), None), state()

    def frame(t_s: float) -> bytes:
        s.time = t_s
        return bytes(s)

    def take(*times_s: float) -> list[tuple[float, bool]]:
        return [(x.t_s, x.newest) for x in source.make_samples([frame(t_s) for t_s in times_s], 0.0)]

    assert [take(t_s) for t_s in (5.0, 5.0, 5.005)] == [[(5.0, True)], [], [(5.005, True)]]
    assert take(5.005, 1.0, 1.0, 1.005) == [(1.0, False), (1.005, True)]
    assert take(1.005, 1.005) == []


def test_of_frames_that_came_at_once_the_last_that_is_one_is_the_newest() -> None:
    source, s = HuboAchSource(OneByOne("test"), None), state()
    frames = []
    for k in range(4):
        s.time = k / 200
        frames.append(bytes(s))
    taken = source.make_samples([*frames, bytes(3632)], 0.0)
    assert [(x.t_s, x.newest) for x in taken] == [(0.0, False), (0.005, False), (0.01, False), (0.015, True)]
