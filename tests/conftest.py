"""The real components for end-to-end tests: processes on free ports, stopped by pid, their logs shown on
failure."""

from __future__ import annotations

import asyncio
import json
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
from posecast_testing import Process, free_port, is_listened_on, share_trust, until, until_async
from posecast_wire.decoder import Decoder, Frame
from posecast_wire.frame import FrameError

share_trust()
BIN = Path(sys.executable).parent


@dataclass
class Stack:
    """Everything that one test started."""

    folder: Path
    parts: list[Process] = field(default_factory=list)
    relay_command: tuple[str, ...] = (f"{BIN}/posecast-relay",)
    edge_command: tuple[str, ...] = (f"{BIN}/posecast-edge",)

    def start(self, name: str, *command: str, stdin: int | None = None) -> Process:
        """Any process."""
        part = Process(self.folder, f"{len(self.parts)}-{name}", *command, stdin=stdin)
        self.parts.append(part)
        return part

    def relay(
        self,
        port: int = 0,
        zenoh_port: int = 0,
        store: str = "memory://",
        zenoh_host: str = "127.0.0.1",
        flags: tuple[str, ...] = (),
    ) -> tuple[Process, str, str]:
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

    def edge(self, zenoh: str, *arguments: str, stdin: int | None = None) -> Process:
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
        until("redis listens", lambda: is_listened_on(port))
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
        await until_async(what, lambda: probe(self), deadline_s)

    def longest_gap_s(self, since_s: float) -> float:
        """The longest time without a decodable frame from `since_s` (monotonic) to the newest."""
        times = [since_s, *(at for at, _ in self.frames if at > since_s)]
        return max((b - a for a, b in pairwise(times)), default=float("inf"))


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The guide, built; any warning of the generator would have failed."""
    from tools.site.__main__ import build

    out = tmp_path_factory.mktemp("guide") / "site"
    build(out)
    return out


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    """Everything started in it ends with the test."""
    made = Stack(tmp_path)
    yield made
    for part in reversed(made.parts):
        part.stop()
        print(part.log)  # pytest shows it when the test has failed
