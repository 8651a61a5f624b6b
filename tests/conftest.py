"""The real components for end-to-end tests: processes on free ports, stopped by pid, their logs shown on
failure."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import websockets
from posecast_wire.decoder import Decoder, Frame
from posecast_wire.frame import FrameError

from relay.tests.stage import free_port, until

__all__ = ("free_port", "until")  # of the relay's tests, and for all of these

BIN = Path(sys.executable).parent
GRACE_S = 10.0


class Part:
    """One process; stdout and stderr go to files in `folder`."""

    def __init__(self, folder: Path, name: str, *command: str, stdin: int | None = None) -> None:
        self.name = name
        self._paths = [folder / f"{name}.out", folder / f"{name}.err"]
        with self._paths[0].open("ab") as out, self._paths[1].open("ab") as err:
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL if stdin is None else stdin, stdout=out, stderr=err
            )

    def line(self, pattern: str) -> re.Match[str]:
        """Waits for the newest line of stdout that matches."""

        def found() -> re.Match[str] | None:
            assert self.process.poll() is None, f"{self.name} has ended:\n{self.log}"
            matches = list(re.finditer(pattern, self._paths[0].read_text()))
            return matches[-1] if matches else None

        return until(f"{self.name} prints {pattern}", found)

    @property
    def out(self) -> str:
        """Its stdout so far, whole lines."""
        text = self._paths[0].read_text()
        return text[: text.rfind("\n") + 1]

    @property
    def log(self) -> str:
        """Both outputs."""
        return "\n".join(f"--- {path.name}\n{path.read_text()}" for path in self._paths)

    def kill(self) -> None:
        """Sends SIGKILL and waits for the end."""
        self.process.kill()
        self.process.wait()

    def stop(self) -> None:
        """Sends SIGTERM; SIGKILL if that is not enough."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(GRACE_S)
        if self.process.poll() is None:
            self.kill()


@dataclass
class Stack:
    """Everything that one test started."""

    folder: Path
    parts: list[Part] = field(default_factory=list)
    relay_command: tuple[str, ...] = (f"{BIN}/posecast-relay",)
    edge_command: tuple[str, ...] = (f"{BIN}/posecast-edge",)

    def start(self, name: str, *command: str, stdin: int | None = None) -> Part:
        """Any process."""
        part = Part(self.folder, f"{len(self.parts)}-{name}", *command, stdin=stdin)
        self.parts.append(part)
        return part

    def relay(
        self,
        port: int = 0,
        zenoh_port: int = 0,
        store: str = "memory://",
        zenoh_host: str = "127.0.0.1",
        flags: tuple[str, ...] = (),
    ) -> tuple[Part, str, str]:
        """(process, `127.0.0.1:port` of HTTP, Zenoh endpoint: empty for a gateway)."""
        listen = f"tcp/{zenoh_host}:{zenoh_port}"
        part = self.start(
            "relay",
            *(*self.relay_command, "run", "--dev", "--port", str(port)),
            *("--zenoh-listen", listen, "--store", store),
            *flags,
        )
        found = part.line(r"serving http://(\S+), robots (?:on (tcp/\S+)|from Redis)")
        return part, found[1], found[2] or ""

    def edge(self, zenoh: str, *arguments: str, stdin: int | None = None) -> Part:
        """An edge of the robot `demo`."""
        return self.start(
            "edge",
            *(*self.edge_command, "run", "--robot", "demo", "--relay", zenoh),
            *arguments,
            stdin=stdin,
        )

    @staticmethod
    def viewer(address: str, hz: int = 30) -> Viewer:
        """Watches `demo` at the relay with this address."""
        return Viewer(f"ws://{address}/api/v1/robots/demo/live?hz={hz}")

    def redis(self) -> str:
        """A separate Redis, in memory only; its URL."""
        port = free_port()
        self.start(
            "redis",
            *("redis-server", "--port", str(port), "--bind", "127.0.0.1", "--save", ""),
            *("--appendonly", "no", "--dir", str(self.folder)),
        )

        def listens() -> bool:
            with socket.socket() as probe:
                return probe.connect_ex(("127.0.0.1", port)) == 0

        until("redis listens", listens)
        return f"redis://127.0.0.1:{port}/0"


@dataclass
class Viewer:
    """A browser's stream without a browser: reads, decodes, acknowledges, and reconnects at once when cut."""

    url: str
    frames: list[tuple[float, Frame]] = field(default_factory=list)
    undecodable: int = 0
    messages: list[dict[str, Any]] = field(default_factory=list)
    connections: int = 0

    async def watch(self) -> None:
        """Until cancelled."""
        while True:
            with suppress(OSError, websockets.WebSocketException):
                await self._connection()
            await asyncio.sleep(0.05)

    async def _connection(self) -> None:
        decoder, received, acknowledged, acknowledged_s = Decoder(), 0, 0, time.monotonic()
        async with websockets.connect(self.url, proxy=None, compression=None) as link:
            self.connections += 1
            async for message in link:
                now_s = time.monotonic()
                if isinstance(message, bytes):
                    received += 1
                    try:
                        self.frames.append((now_s, decoder.decode(message)))
                    except FrameError:
                        self.undecodable += 1
                else:
                    said = json.loads(message)
                    if said["type"] == "schema":
                        decoder.add_schema(message)
                    elif said["type"] != "status":
                        self.messages.append(said)
                if now_s - acknowledged_s >= 1 and received > acknowledged:
                    acknowledged, acknowledged_s = received, now_s
                    await link.send(json.dumps({"type": "ack", "n": received}))

    async def until(self, what: str, probe: Callable[[Viewer], bool], deadline_s: float = 20.0) -> None:
        """Waits on the event loop until `probe` holds."""
        end_s = time.monotonic() + deadline_s
        while not probe(self):
            assert time.monotonic() < end_s, f"not within {deadline_s:g} s: {what}"
            await asyncio.sleep(0.02)

    def longest_gap_s(self, since_s: float) -> float:
        """The longest time without a decodable frame from `since_s` (monotonic) to the newest."""
        times = [since_s, *(at for at, _ in self.frames if at > since_s)]
        return max((b - a for a, b in pairwise(times)), default=float("inf"))


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    """Everything started in it ends with the test."""
    made = Stack(tmp_path)
    yield made
    for part in reversed(made.parts):
        part.stop()
        print(part.log)  # pytest shows it when the test has failed
