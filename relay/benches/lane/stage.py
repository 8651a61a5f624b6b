"""What the lane's bench runs on: an origin with a robot, cache nodes before it, crowds that read there."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from posecast_testing import until

from relay.benches.lane.caches import CACHES, CacheNode
from relay.benches.servers import CannotStart, Place, hear, start_on, started

ROBOT = "bench"
JOIN_S = 4.0
ANSWER_S = 30.0

Row = dict[str, Any]  # what `viewers --mode lane` prints


def read_cpu_s(pid: int) -> float:
    """Return the CPU time of all threads of a process and of its children, in seconds."""
    total = 0.0
    with suppress(FileNotFoundError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(FileNotFoundError, ProcessLookupError):
                total += int((task / "schedstat").read_text().split()[0]) * 1e-9
                for child in (task / "children").read_text().split():
                    total += read_cpu_s(int(child))
    return total


class RobotProcess:
    """The robot, which can pause, and come back as another run."""

    def __init__(self, endpoint: str, place: Place) -> None:
        self._command = [sys.executable, "-m", "relay.benches.lane.robot", "--relay", endpoint]
        self._command += ["--robot", ROBOT, "--stamps", str(place.stamps)]
        self._place = place
        self._start()

    def _start(self) -> None:
        self._child = start_on(self._place, self._place.other_core, "robot", *self._command)
        hear(self._child, "^READY$")

    def pause(self) -> None:
        """Send nothing from now on, but stay."""
        self._child.process.send_signal(signal.SIGUSR1)

    def go_on(self) -> None:
        """Send again."""
        self._child.process.send_signal(signal.SIGUSR2)

    def restart(self) -> None:
        """End without a word, and begin a new run."""
        self.end()
        self._start()

    def end(self) -> None:
        self._child.kill()


@dataclass(frozen=True)
class LaneStage:
    """An origin, its robot and its nodes. `requests`: the origin's answers, see origin.py."""

    relay_pid: int
    relay_port: int
    robot: RobotProcess
    nodes: tuple[CacheNode, ...]
    requests: Path


@contextmanager
def set_stage(place: Place, caches: list[str]) -> Iterator[LaneStage]:
    """Start all of it; the past has begun when this returns. CannotStart."""
    requests = place.out / "requests"
    requests.unlink(missing_ok=True)
    with ExitStack() as stack:
        command = [sys.executable, "-m", "relay.benches.lane.origin", str(requests), "run", "--dev"]
        command += ["--host", "0.0.0.0", "--port", "0", "--zenoh-listen", "tcp/127.0.0.1:0"]
        command += ["--past", "memory:"]
        relay = stack.enter_context(started(place, place.server_core, "origin", *command))
        said = hear(relay, r"serving http://[^ ]*:(\d+), robots on (\S+)\s")
        port = int(said[1])
        robot = RobotProcess(said[2], place)
        stack.callback(robot.end)
        nodes = [
            # each asks at an address of its own, by which the origin knows it
            stack.enter_context(CACHES[name](f"127.0.0.{n}:{port}", place))
            for n, name in enumerate(caches, 2)
        ]
        wait_past(port)
        yield LaneStage(relay.process.pid, port, robot, tuple(nodes), requests)


def wait_past(port: int) -> None:
    """Until there is a segment. CannotStart."""

    def has_segment() -> bool:
        address = f"http://127.0.0.1:{port}/api/v1/robots/{ROBOT}/past?view=public"
        with suppress(OSError), urllib.request.urlopen(address, timeout=2) as answer:
            return bool(json.load(answer)["newest"])
        return False

    try:
        until("there is a segment", has_segment, ANSWER_S)
    except AssertionError as e:
        raise CannotStart(str(e)) from None


class Crowd:
    """So many viewers that read through one node."""

    def __init__(self, place: Place, node: CacheNode, viewers: int) -> None:
        command = [str(place.binaries["viewers"]), "--mode", "lane", "--port", str(node.port)]
        command += ["--robot", ROBOT, "--viewers", str(viewers), "--join", str(JOIN_S)]
        pipe = subprocess.PIPE
        self.node = node
        self._child = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)

    def mark(self, name: str) -> Row:
        """Return what they saw since the last mark. CannotStart when they have ended."""
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(f"{name}\n")
        self._child.stdin.flush()
        line = self._child.stdout.readline()
        if not line:
            raise CannotStart(f"the viewers of {self.node.name} ended with {self._child.wait()}")
        row: Row = json.loads(line)
        return row

    def end(self) -> None:
        """Let them leave."""
        self._child.kill()
        self._child.wait()
        for pipe in (self._child.stdin, self._child.stdout):
            assert pipe is not None
            pipe.close()


@contextmanager
def crowds(place: Place, nodes: tuple[CacheNode, ...], viewers: int) -> Iterator[list[Crowd]]:
    """So many viewers at each node, pinned like this process."""
    with ExitStack() as stack:
        found = [Crowd(place, node, viewers) for node in nodes]
        for crowd in found:
            stack.callback(crowd.end)
        yield found
