"""Recovery without help: after a second edge, a clock that stood still, a Redis that lost its data.

All run at once, each with its own robot and viewer: they wait more than they work.
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from posecast_testing import Process, until

from tests.attack.arena import ROOT, Arena, arena, said
from tests.attack.figure import Figure
from tests.attack.redis_stage import RedisStage

LOOKED_S = 14.0
STEADY_S = 2.0  # LIVE for so long, without another word
SLEPT_S = 60.0
LIES_S = 3.0
HOSTILE_LINES = [
    '{"t":1e999,"pos":{"RKN":1}}',
    '{"pos":{"RKN":"\\ud800"},"info":{"a":"\\udfff","\\ud800":"b"}}',
    '{"pos":{"RKN":' + "9" * 5000 + "}}",
    '{"pos":' + "[" * 3000,
    '{"t":NaN,"pos":{"RKN":Infinity}}',
    '{"pos":{"RKN":0.5},"info":{"mode":"\\ud800"}}',
    "\ufeff{}",
    "null",
    '{"pos":{"RKN":1,"RKN":2},"pos":7}',
    "x" * 100_000,
]


NEVER_S = float("inf")


class Back:
    """When a viewer had recovered for good."""

    def __init__(self, screen: Process) -> None:
        self._screen = screen

    def first_live(self) -> None:
        """Waits for it. AssertionError when it does not come."""
        until("LIVE at first", lambda: any(line["word"] == "LIVE" for line in said(self._screen, "word")))

    def after(self, since_s: float) -> float:
        """Seconds from then to its last return to LIVE: 0 if it said nothing else, infinite if it never
        returned."""
        end_s = since_s + LOOKED_S
        while time.monotonic() < end_s:
            words = said(self._screen, "word")
            word, at_s = (words[-1]["word"], float(words[-1]["at"])) if words else (None, end_s)
            fresh = [line for line in said(self._screen, "seq") if line["at"] > time.monotonic() - 0.3]
            steady_s = time.monotonic() - max(since_s, at_s)
            if word == "LIVE" and fresh and steady_s >= STEADY_S:
                return max(0.0, at_s - since_s)
            time.sleep(0.1)
        return float("inf")


def second_edge(made: Arena, http: str, zenoh: str) -> Figure:
    """Another edge takes the robot's name for two seconds, and goes."""
    made.robot(zenoh, "doubled")
    back = Back(made.screen(http, "doubled"))
    back.first_live()
    other = made.robot(zenoh, "doubled")
    until("the other one sends", lambda: len(said(other, "sent")) > 60)
    other.kill()
    return Figure(
        "a second agent with the same robot name comes and goes: LIVE again after",
        back.after(time.monotonic()),
        5.0,
        "s",
    )


def clock_stood_still(made: Arena, http: str, zenoh: str) -> Figure:
    """The edge's computer was asleep: its stamps are a minute behind."""
    robot = made.robot(zenoh, "asleep")
    back = Back(made.screen(http, "asleep"))
    back.first_live()
    assert robot.process.stdin is not None
    robot.process.stdin.write(f"clock {SLEPT_S:g}\n".encode())
    robot.process.stdin.flush()
    back_s = back.after(time.monotonic())
    return Figure("an agent's clock stood still for 60 s: LIVE again after", back_s, 10.0, "s")


def hostile_lines(made: Arena, http: str, zenoh: str) -> Figure:
    """A robot's program writes unreadable lines between its own: the agent continues."""
    fifo = made.folder / "lines"
    os.mkfifo(fifo)
    held = os.open(fifo, os.O_RDWR | os.O_NONBLOCK)
    try:
        made.start("program", sys.executable, str(ROOT / "tests/faults/robot.py"), str(fifo), "RKN,LKN")
        edge = made.agent("--robot", "lines", "--relay", f"tcp/{zenoh}", "--source", f"jsonl:{fifo}")
        back = Back(made.screen(http, "lines"))
        back.first_live()
        end_s = time.monotonic() + LIES_S
        turn = 0
        while time.monotonic() < end_s:
            line = HOSTILE_LINES[turn % len(HOSTILE_LINES)].encode("utf-8", "surrogatepass")
            with suppress(BlockingIOError):
                os.write(held, line + b"\n")
            turn += 1
            time.sleep(0.02)
        back_s = back.after(end_s) if edge.process.poll() is None else float("inf")
    finally:
        os.close(held)
    return Figure("a program writes invalid lines to its agent: LIVE after", back_s, 2.0, "s")


def _sends(robot: Process) -> None:
    until("its new run sends", lambda: "sent" in robot.out)


def forgotten_generation(made: Arena) -> Figure:
    """Redis loses the robot's generation each time its edge restarts."""
    stage = RedisStage(made)
    robot = made.robot(stage.zenoh, "numbered")
    back = Back(made.screen(stage.http, "numbered"))
    back.first_live()
    for _ in range(2):  # each new run counts one further, before the loss
        robot.kill()
        robot = made.robot(stage.zenoh, "numbered")
        _sends(robot)
        until("its generation stands", lambda: stage.ask("GET", "posecast:{numbered}:generation")[:1] == b"$")
    robot.kill()
    stage.ask("DEL", "posecast:{numbered}:generation")
    robot = made.robot(stage.zenoh, "numbered")
    _sends(robot)
    back_s = back.after(time.monotonic())
    return Figure(
        "Redis loses a robot's generation while its agent restarts: LIVE again after", back_s, 2.0, "s"
    )


def flushed(made: Arena) -> Figure:
    """FLUSHALL while the ingest is down, and again while everything works."""
    stage = RedisStage(made)
    made.robot(stage.zenoh, "flushed")
    back = Back(made.screen(stage.http, "flushed"))
    back.first_live()
    stage.restart_ingest(lambda: stage.ask("FLUSHALL"))
    worst_s = back.after(time.monotonic())
    stage.ask("FLUSHALL")
    worst_s = max(worst_s, back.after(time.monotonic()))
    return Figure(
        "FLUSHALL with the ingest down, and in normal operation: LIVE again after", worst_s, 2.0, "s"
    )


def recoveries(relay_command: tuple[str, ...]) -> list[Figure]:
    """All of them."""
    with arena(relay_command) as made, ThreadPoolExecutor() as threads:
        _, http, zenoh = made.relay()
        under_way = [
            threads.submit(each, made, http, zenoh)
            for each in (second_edge, clock_stood_still, hostile_lines)
        ]
        under_way += [threads.submit(each, made) for each in (forgotten_generation, flushed)]
        found = [each.result() for each in under_way]  # AssertionError when one was never LIVE
        tracebacks = sum(part.log.count("Traceback") for part in made.parts)
    return [*found, Figure("tracebacks in all logs", tracebacks, 0.0, "")]
