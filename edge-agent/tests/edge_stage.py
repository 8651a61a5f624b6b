"""A real Zenoh router on a free port, playing the relay's part, and the real agent as a process beside it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import zenoh
from posecast_testing import free_port
from posecast_wire.decoder import Decoder
from posecast_wire.frame import Header, parse_header
from posecast_wire.keys import Echo, Snapshot, Stamp, echo_key, snapshot_key

ROBOT = "r1"
LEASE_MS = 2500
WITHOUT_MESH_TOOLS = "import sys; sys.modules['PIL'] = None; from posecast_edge.cli.main import main; main()"


@dataclass
class Got:
    """A frame or event as it arrived."""

    key: str
    data: bytes
    stamp: Stamp
    at_s: float

    @property
    def header(self) -> Header:
        return parse_header(self.data)


@dataclass
class Router:
    """The relay's side of the link. `answer_echo` says what the relay claims to have."""

    port: int = field(default_factory=free_port)
    host: str = "127.0.0.1"
    frames: list[Got] = field(default_factory=list)
    events: list[dict[str, object]] = field(default_factory=list)
    echo: Callable[[], Echo | None] | None = None
    tokens: list[tuple[str, bool]] = field(default_factory=list)
    session: zenoh.Session | None = None
    _held: list[object] = field(default_factory=list)

    @property
    def endpoint(self) -> str:
        return f"tcp/{self.host}:{self.port}"

    def start(self, subscribe: bool = True) -> None:
        config = {
            "mode": "router",
            "listen": {"endpoints": [self.endpoint]},
            "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "transport": {"link": {"tx": {"lease": LEASE_MS}}, "shared_memory": {"enabled": False}},
            "adminspace": {"enabled": True},
        }
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        if subscribe:
            self._held = [
                self.session.liveliness().declare_subscriber(
                    "posecast/v1/*/alive", self._on_token, history=True
                ),
                self.session.declare_queryable(echo_key(ROBOT), self._on_echo),
                self.session.declare_subscriber("posecast/v1/*/*/event", self._on_event),
                self.session.declare_subscriber("posecast/v1/*/*/frame", self._on_frame),
            ]

    def stop(self) -> None:
        if self.session is not None:
            self.session.close()  # type: ignore[no-untyped-call]
            self.session = None
            self._held = []

    def get(self, selector: str, timeout: float = 3.0) -> list[zenoh.Reply]:
        assert self.session is not None
        return list(self.session.get(selector, timeout=timeout))

    def snapshot(self) -> zenoh.Sample | None:
        for reply in self.get(snapshot_key(ROBOT, "public")):
            if reply.ok is not None:
                return reply.ok
        return None

    def decoder(self) -> Decoder | None:
        """Knows the schema of the newest snapshot; None before there is one."""
        sample = self.snapshot()
        if sample is None:
            return None
        decoder = Decoder()
        decoder.add_schema(Snapshot.unpack(sample.payload.to_bytes()).schema)
        return decoder

    def _on_token(self, sample: zenoh.Sample) -> None:
        self.tokens.append((str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

    def _on_frame(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        stamp = Stamp.unpack(sample.attachment.to_bytes())
        self.frames.append(Got(str(sample.key_expr), sample.payload.to_bytes(), stamp, time.monotonic()))

    def _on_event(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        Stamp.unpack(sample.attachment.to_bytes())
        self.events.append(json.loads(sample.payload.to_bytes()))

    def _on_echo(self, query: zenoh.Query) -> None:
        with query:
            echo = self.echo() if self.echo else None
            if echo is not None:
                query.reply(echo_key(ROBOT), echo.pack())


@pytest.fixture
def router() -> Iterator[Router]:
    r = Router()
    r.start()
    yield r
    r.stop()


class Edge:
    """`posecast-edge run` as a process, its source on stdin."""

    def __init__(self, *args: str, stdin: bool = True, mesh_tools: bool = True) -> None:
        program = ["-m", "posecast_edge"] if mesh_tools else ["-c", WITHOUT_MESH_TOOLS]
        self.process = subprocess.Popen(
            [sys.executable, *program, *args],
            stdin=subprocess.PIPE if stdin else subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={k: v for k, v in os.environ.items() if not k.startswith("POSECAST_")},
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.lines.append(line.decode().rstrip("\n"))

    def send(self, **sample: object) -> None:
        self.send_text(json.dumps(sample))

    def send_text(self, text: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(text.encode() + b"\n")
        self.process.stdin.flush()

    def end_of_input(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()

    def wait(self, seconds: float = 10.0) -> int:
        status = self.process.wait(seconds)
        self._reader.join(seconds)
        return status

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.kill()
            self.process.wait()


@pytest.fixture
def edge(router: Router) -> Iterator[Callable[..., Edge]]:
    started: list[Edge] = []

    def start(*args: str, relay: str | None = None, mesh_tools: bool = True) -> Edge:
        to = ("--relay", relay or router.endpoint)
        e = Edge("run", "--robot", ROBOT, "--source", "jsonl", *to, *args, mesh_tools=mesh_tools)
        started.append(e)
        return e

    yield start
    for e in started:
        e.kill()


@pytest.fixture
def profile_file(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(PROFILE, encoding="utf-8")
    return path


class Feeder:
    """Writes samples to an agent's stdin at 100 Hz from a thread, pos moving."""

    def __init__(self, edge: Edge) -> None:
        self._edge = edge
        self._stop = threading.Event()
        self.extra: dict[str, object] = {}
        self.moving = True
        self.t = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        pos = 0.0
        while not self._stop.wait(0.01):
            self.t += 0.01
            pos += 0.002 if self.moving else 0.0
            try:
                self._edge.send(t=self.t, ref=[pos, 0.0], pos={"RKN": pos, "LKN": None}, **self.extra)
            except OSError:
                return

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


PROFILE = """
[robot]
name = "two-joints"
[labels]
joint = ["RKN", "LKN"]
[[fields]]
name = "ref"
[[fields]]
name = "pos"
[[fields]]
name = "ftf"
labels = ["RF.fz"]
[[fields]]
name = "flags"
bits = ["homed", "jam", "hot"]
[joints.KNEE]
terms = [["RKN", 2.0], ["LKN", -1.0]]
offset_deg = 90
[sensors.RF]
kind = "wrench"
link = "foot"
xyz = [0, 0, -0.1]
[thresholds.ftf]
"RF.fz" = { low = -30, high = 500, caution = 0.5 }
[severity.flags]
homed = "state"
hot = "caution"
[tolerance]
"*" = 0.05
[names]
RKN = "right knee"
RF = "right foot"
"""
