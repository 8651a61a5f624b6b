"""People who look back, beside those who watch live: what they ask for, and how long it takes.

python -m relay.benches.lookers --port P --robot NAME [--lookers 200] [--every 5]

Each opens the past once, then in every `--every` seconds lets go of the time line somewhere: the index and
the first poses of those ten minutes, and two segments. A page keeps what it has fetched and asks for less.
Prints "READY" when all have done so once, and one JSON object when its standard input ends.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

SOURCES = 64  # loopback addresses to come from, as `viewers` does: no cap per address is met
PAGE_MS = 600_000
READ_LIMIT = 4 << 20
BEGINNING_S = 1.0  # until a past that has just begun is asked for again


@dataclass
class Tally:
    """What all lookers saw so far."""

    requests: int = 0
    bytes: int = 0
    refused: dict[str, int] = field(default_factory=dict)  # by status
    seconds: list[float] = field(default_factory=list)  # of each request

    def describe(self) -> dict[str, Any]:
        """Return it as one JSON object, times in ms."""
        waited = sorted(self.seconds)
        return {
            "requests": self.requests,
            "bytes": self.bytes,
            "refused": self.refused,
            "p50_ms": waited[len(waited) // 2] * 1e3 if waited else 0.0,
            "p99_ms": waited[int(len(waited) * 0.99)] * 1e3 if waited else 0.0,
        }


class Looker:
    """One page that looks back, on one connection that is kept."""

    def __init__(self, number: int, port: int, robot: str, tally: Tally) -> None:
        self.number = number
        self.port = port
        self.past = f"/api/v1/robots/{robot}/past"
        self.tally = tally
        self.random = random.Random(number)

    async def connect(self) -> None:
        """Open the connection, from an address of its own among SOURCES."""
        address = f"127.0.1.{self.number % SOURCES + 1}"
        self.reader, self.writer = await asyncio.open_connection(
            "127.0.0.1", self.port, local_addr=(address, 0), limit=READ_LIMIT
        )

    async def ask(self, path: str = "") -> bytes:
        """Return the body of the answer; empty where it is no 200, which the tally remembers."""
        began = time.monotonic()
        try:
            head = await self._ask_once(path)
        except (ConnectionError, asyncio.IncompleteReadError):  # a relay ends connections that rest for 5 s
            await self.connect()
            head = await self._ask_once(path)
        lines = head.lower().split("\r\n")
        sizes = [int(line.split(":")[1]) for line in lines if line.startswith("content-length:")]
        body = await self.reader.readexactly(sizes[0] if sizes else 0)
        self.tally.seconds.append(time.monotonic() - began)
        self.tally.requests += 1
        self.tally.bytes += len(body)
        status = head.split(" ", 2)[1]
        if status == "200":
            return body
        self.tally.refused[status] = self.tally.refused.get(status, 0) + 1
        return b""

    async def _ask_once(self, path: str) -> str:
        self.writer.write(f"GET {self.past}{path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        return (await self.reader.readuntil(b"\r\n\r\n")).decode("latin-1")

    async def open(self) -> dict[str, Any]:
        """Return what the relay says of the past, when there is a segment in it."""
        while True:
            said: dict[str, Any] = json.loads(await self.ask() or b"{}")
            if said.get("newest"):
                await self.ask(f"/{said['view']}/{said['days'][-1]}")
                return said
            await asyncio.sleep(BEGINNING_S)

    async def look(self, said: dict[str, Any]) -> None:
        """Let go of the time line somewhere in it."""
        at_ms = self.random.randint(said["from_ms"], said["to_ms"])
        at = datetime.fromtimestamp(at_ms // PAGE_MS * PAGE_MS / 1000, UTC)
        page = f"/{said['view']}/{at:%Y-%m-%dT%H:%MZ}"
        segments = json.loads(await self.ask(page) or b"{}").get("segments", [])
        await self.ask(f"{page}/keys")
        if segments:
            first = self.random.randrange(len(segments))
            for segment in segments[first : first + 2]:
                await self.ask(f"/{said['view']}/{segment['take']}/{segment['index']}")


async def look_back(number: int, asked: argparse.Namespace, tally: Tally, ready: asyncio.Barrier) -> None:
    """One looker, for good."""
    looker = Looker(number, asked.port, asked.robot, tally)
    own_turn_s = asked.every * number / asked.lookers  # nobody in step with others
    await asyncio.sleep(own_turn_s)
    await looker.connect()
    said = await looker.open()
    await looker.look(said)
    await ready.wait()
    due = time.monotonic() + own_turn_s
    while True:
        await asyncio.sleep(due - time.monotonic())
        await looker.look(said)
        due = max(due + asked.every, time.monotonic())


async def run(asked: argparse.Namespace) -> None:
    tally, ready = Tally(), asyncio.Barrier(asked.lookers + 1)
    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(look_back(number, asked, tally, ready)) for number in range(asked.lookers)]
        await ready.wait()
        tally.requests, tally.bytes = 0, 0
        tally.seconds.clear()
        tally.refused.clear()
        began = time.monotonic()
        print("READY", flush=True)
        await asyncio.to_thread(sys.stdin.read)
        for task in tasks:
            task.cancel()
    print(json.dumps(tally.describe() | {"wall_s": time.monotonic() - began}), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--robot", required=True)
    parser.add_argument("--lookers", type=int, default=200)
    parser.add_argument("--every", type=float, default=5.0, help="seconds between two looks of one")
    asyncio.run(run(parser.parse_args()))


if __name__ == "__main__":
    main()
