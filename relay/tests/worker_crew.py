"""A relay of several workers in tests: which process has which connection, and viewers at each of them."""

from __future__ import annotations

import re
import socket
from contextlib import AsyncExitStack, suppress
from functools import partial
from http.client import HTTPConnection
from pathlib import Path

import httpx

from .stage import Relay, Watcher, until


def list_pids(relay: Relay) -> list[int]:
    """The first worker and the others, as they were started."""
    first = relay.process.pid
    children = Path(f"/proc/{first}/task/{first}/children").read_text().split()
    return [first, *map(int, children)]


def connect_to(relay: Relay, pid: int) -> socket.socket:
    """A connection that the process `pid` has accepted; those that the kernel gave to others are closed."""
    for _ in range(200):
        sock = socket.create_connection(("127.0.0.1", relay.http))
        if until("accepted", partial(_find_pid, relay, sock.getsockname()[1])) == pid:
            return sock
        sock.close()
    raise AssertionError("the kernel gives it no connection")


def _find_pid(relay: Relay, port: int) -> int | None:
    """The process of this relay that has the connection from a local port."""
    inode = ""
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        _, here, there, *rest = line.split()
        if here.endswith(f":{relay.http:04X}") and there.endswith(f":{port:04X}"):
            inode = rest[6]
    for pid in list_pids(relay):
        for each in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):
                if str(each.readlink()) == f"socket:[{inode}]":
                    return pid
    return None


async def watch_at(
    relay: Relay, pid: int, stack: AsyncExitStack, query: str = "", robot: str = "r"
) -> Watcher:
    """A viewer at the process `pid`."""
    return await stack.enter_async_context(Watcher(relay.url(robot, query), sock=connect_to(relay, pid)))


def ask_at(relay: Relay, pid: int, path: str, method: str = "GET", **headers: str) -> httpx.Response:
    """The answer of the process `pid`."""
    connection = HTTPConnection("127.0.0.1", relay.http, timeout=20)
    connection.sock = connect_to(relay, pid)
    try:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return httpx.Response(answer.status, headers=answer.getheaders(), content=answer.read())
    finally:
        connection.close()


def await_ready(relay: Relay) -> None:
    """Wait until all workers serve."""
    ready = lambda: httpx.get(f"http://{relay.address}/readyz").status_code == 200  # noqa: E731
    until("all workers serve", ready)


def read_metric(port: int, name: str) -> float:
    """The sum of a metric's samples, whatever their labels."""
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    found = re.findall(rf"^{name}(?:{{[^}}]*}})? (\S+)$", text, re.MULTILINE)
    return sum(map(float, found))
