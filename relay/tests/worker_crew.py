"""A relay of several workers in tests: which process has which connection, and viewers at each of them."""

from __future__ import annotations

import re
from contextlib import AsyncExitStack
from pathlib import Path

import httpx

from .stage import Relay, Watcher, until


def list_pids(relay: Relay) -> list[int]:
    """The first worker and the others, as they were started."""
    first = relay.process.pid
    children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
    return [first, *map(int, children)]


def find_pid(relay: Relay, port: int) -> int:
    """The process of this relay that has the connection from a local port."""
    inode = ""
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        _, here, there, *rest = line.split()
        if here.endswith(f":{relay.http:04X}") and there.endswith(f":{port:04X}"):
            inode = rest[6]
    for pid in list_pids(relay):
        for each in Path(f"/proc/{pid}/fd").iterdir():
            try:
                name = str(each.readlink())
            except OSError:
                continue
            if name == f"socket:[{inode}]":
                return pid
    raise AssertionError("no process has this connection")


async def watch_at(
    relay: Relay, pid: int, stack: AsyncExitStack, query: str = "", robot: str = "r"
) -> Watcher:
    """A viewer of the process `pid`: others, whom the kernel gave to another one, leave at once."""
    for _ in range(100):
        watcher = Watcher(relay.url(robot, query))
        await watcher.__aenter__()
        assert watcher.connection is not None
        if find_pid(relay, watcher.connection.transport.get_extra_info("sockname")[1]) == pid:
            stack.push_async_exit(watcher)
            return watcher
        await watcher.__aexit__()
    raise AssertionError("the kernel gives it no connection")


def ask_at(relay: Relay, pid: int, path: str, **headers: str) -> httpx.Response:
    """The answer of the process `pid`."""
    for _ in range(100):
        client = httpx.Client(base_url=f"http://{relay.address}", timeout=20, headers=headers)
        with client, client.stream("GET", path) as answer:
            port = answer.extensions["network_stream"].get_extra_info("client_addr")[1]
            if find_pid(relay, port) == pid:
                answer.read()
                return answer
    raise AssertionError("the kernel gives it no connection")


def await_ready(relay: Relay) -> None:
    """Wait until all workers serve."""
    ready = lambda: httpx.get(f"http://{relay.address}/readyz").status_code == 200  # noqa: E731
    until("all workers serve", ready)


def read_metric(port: int, name: str) -> float:
    """The sum of a metric's samples, whatever their labels."""
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    found = re.findall(rf"^{name}(?:{{[^}}]*}})? (\S+)$", text, re.MULTILINE)
    return sum(map(float, found))
