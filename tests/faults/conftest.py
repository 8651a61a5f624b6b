"""The building blocks of the fault suite's scenarios: a robot, an edge, screens; and the table at the end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from posecast_testing import Process, until

from tests.conftest import Stack
from tests.faults.truth import Stand, lies, stands, steps_back
from tests.namespaces import Namespace

HERE = Path(__file__).parent
SETTLED_S = 0.5  # what a screen said before is written down


class Screen:
    """A viewer in a separate process, and its reports."""

    def __init__(self, part: Process, stood: Callable[[], list[Stand]]) -> None:
        self.part = part
        self._stood = stood
        self._read = 0
        self._said: list[dict[str, Any]] = []

    def said(self) -> list[dict[str, Any]]:
        """Everything so far; what was read before is not read again."""
        new = self.part.out[self._read :]
        self._read += len(new)
        self._said += [json.loads(line) for line in new.splitlines()]
        return self._said

    def lines(self, what: str, since_s: float = 0.0) -> list[dict[str, Any]]:
        """Everything with this member, from then (monotonic) on."""
        return [line for line in self.said() if what in line and line["at"] >= since_s]

    @property
    def word(self) -> str | None:
        """Its current word."""
        said = self.lines("word")
        return said[-1]["word"] if said else None

    def says(
        self, word: str, cause: str | None = None, since_s: float = 0.0, deadline_s: float = 30.0
    ) -> float:
        """Waits for that word; seconds from `since_s` to it."""

        def found() -> dict[str, Any] | None:
            said = [w for w in self.lines("word", since_s) if w["word"] == word]
            return next((w for w in said if cause is None or w["cause"] == cause), None)

        at: float = until(f"the screen says {word} {cause or ''}", found, deadline_s)["at"]
        return at - since_s

    def frames(self, since_s: float = 0.0) -> list[dict[str, Any]]:
        """Those that came."""
        return self.lines("seq", since_s)

    def watches(self, count: int = 20, since_s: float = 0.0, deadline_s: float = 60.0) -> None:
        """Waits until so many frames have come."""
        until(f"{count} frames", lambda: len(self.frames(since_s)) >= count, deadline_s)

    def never_lied(self) -> None:
        """Its claims were true; no frame was older than the previous one; every one could be decoded."""
        told = lies(self.lines("at"), self._stood(), time.monotonic() - SETTLED_S)
        assert not told, "; ".join(told)
        assert self.lines("undecodable") == []
        assert steps_back(self.frames()) == []

    def signal(self, number: signal.Signals) -> float:
        """Sends it; when."""
        self.part.process.send_signal(number)
        return time.monotonic()


class Hall(Screen):
    """Many viewers in one process, and their reports."""

    def __init__(self, part: Process, viewers: int, stood: Callable[[], list[Stand]]) -> None:
        super().__init__(part, stood)
        self.viewers = viewers

    def live(self, since_s: float = 0.0, deadline_s: float = 60.0) -> list[float]:
        """Waits until each has said LIVE; seconds from `since_s` to it, the quickest first."""

        def found() -> list[float] | None:
            first: dict[int, float] = {}
            for line in self.said():
                if line.get("word") == "LIVE" and line["at"] >= since_s:
                    first.setdefault(line["viewer"], line["at"] - since_s)
            return sorted(first.values()) if len(first) == self.viewers else None

        return until(f"{self.viewers} viewers say LIVE", found, deadline_s)

    def never_lied(self) -> None:
        """A screen's claims were true; nobody saw a frame older than the previous one, or a broken one."""
        by_viewer: dict[int, list[dict[str, Any]]] = {}
        for line in self.said():
            assert "undecodable" not in line, line
            by_viewer.setdefault(line["viewer"], []).append(line)
        until_s = time.monotonic() - SETTLED_S
        for said in by_viewer.values():
            told = lies(said, self._stood(), until_s)
            assert not told, "; ".join(told)
            assert steps_back([line for line in said if "seq" in line]) == []


@dataclass
class Scene:
    """The components of one scenario."""

    stack: Stack
    name: str
    held: list[int] = field(default_factory=list)
    robots: list[Process] = field(default_factory=list)
    seen: list[tuple[str, object]] = field(default_factory=list)  # for the summary

    def stood(self) -> list[Stand]:
        """When its robots stood still, according to themselves."""
        return [
            stand
            for robot in self.robots
            for stand in stands(json.loads(line) for line in robot.out.splitlines())
        ]

    def robot(self, joints: str = "RKN,LKN") -> tuple[Process, Path]:
        """The robot's program and the FIFO it writes into."""
        fifo = self.stack.folder / f"robot-{len(self.stack.parts)}"
        os.mkfifo(fifo)
        self.held.append(os.open(fifo, os.O_RDWR))  # so that neither end waits for the other or ends with it
        program = [sys.executable, str(HERE / "robot.py"), str(fifo), joints]
        self.robots.append(self.stack.start("robot", *program, stdin=subprocess.PIPE))
        return self.robots[-1], fifo

    def edge(self, zenoh: str, fifo: Path, *arguments: str) -> Process:
        """The agent of `demo`, fed by the FIFO."""
        return self.stack.edge(zenoh, "--source", f"jsonl:{fifo}", *arguments)

    def router(self, listen: str, relay: str) -> Process:
        """Another Zenoh router on the way to the relay."""
        command = [sys.executable, str(HERE / "router.py"), listen, relay]
        part = self.stack.start("router", *command, stdin=subprocess.PIPE)
        part.line("listening")
        return part

    def screen(self, address: str, hz: int = 10, namespace: Namespace | None = None) -> Screen:
        """A viewer of `demo`."""
        url = f"ws://{address}/api/v1/robots/demo/live?hz={hz}"

        def start() -> Process:
            return self.stack.start("screen", sys.executable, str(HERE / "screen.py"), url)

        return Screen(namespace.run(start) if namespace else start(), self.stood)

    def hall(self, address: str, viewers: int) -> Hall:
        """So many viewers of `demo`."""
        url = f"ws://{address}/api/v1/robots/demo/live?hz=1"
        part = self.stack.start("hall", sys.executable, str(HERE / "screen.py"), url, str(viewers))
        return Hall(part, viewers, self.stood)

    def tell(self, *seen: str, **seen_s: float) -> None:
        """What was measured, for the table."""
        times = (f"{k.replace('_', ' ')} {v:.2f} s" for k, v in seen_s.items())
        self.seen.append(("seen", f"{self.name:27} {', '.join((*times, *seen))}"))


def told(robot: Process, order: str) -> float:
    """Gives a robot's program a command and waits until it has accepted it; returns the time."""
    before = len(robot.out.splitlines())
    assert robot.process.stdin is not None
    os.write(robot.process.stdin.fileno(), f"{order}\n".encode())
    taken = until(f"{order} is taken", lambda: robot.out.splitlines()[before:] or None)
    return float(json.loads(taken[-1])["at"])


def signalled(part: Process, number: signal.Signals) -> float:
    """Sends it; when, on the monotonic clock."""
    at_s = time.monotonic()
    part.process.send_signal(number)
    return at_s


def killed(part: Process) -> float:
    """SIGKILL; when."""
    at_s = time.monotonic()
    part.kill()
    return at_s


@pytest.fixture
def scene(stack: Stack, request: pytest.FixtureRequest) -> Iterator[Scene]:
    """Named after the test."""
    made = Scene(stack, request.node.name.removeprefix("test_").replace("_", " "))
    made.seen = request.node.user_properties  # which reach the summary also from another process
    yield made
    for fifo in made.held:
        os.close(fifo)


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """One line for each scenario that measured something."""
    reports = [report for of in ("passed", "failed") for report in terminalreporter.stats.get(of, ())]
    lines = [line for report in reports for name, line in report.user_properties if name == "seen"]
    if lines:
        terminalreporter.section("what viewers saw")
    for line in lines:
        terminalreporter.write_line(line)
