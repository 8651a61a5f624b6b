"""A relay of several workers in tests: which process has which connection, and viewers at each of them."""

from __future__ import annotations

import re
import socket
import struct
from contextlib import AsyncExitStack, suppress
from functools import partial
from http.client import HTTPConnection
from pathlib import Path

import httpx
from posecast_testing import until

from .stage import Relay, Watcher

SLOW_S = 20.0  # that an answer may take on a loaded machine
NETLINK_SOCK_DIAG, SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST = 4, 20, 1


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
    name = f"socket:[{_find_inode(relay.http, port)}]"
    for pid in list_pids(relay):
        for each in Path(f"/proc/{pid}/fd").iterdir():
            with suppress(OSError):
                if str(each.readlink()) == name:
                    return pid
    return None


def _find_inode(here: int, there: int) -> int:
    """Of the socket at port `here` that is connected with port `there`; 0 while nobody has accepted it. By
    sock_diag(7): /proc/net/tcp is slow where others have thousands of sockets.
    """
    address = socket.inet_aton("127.0.0.1") + bytes(12)
    ask = struct.pack(">HH", here, there) + 2 * address + struct.pack("=III", 0, 0xFFFFFFFF, 0xFFFFFFFF)
    body = struct.pack("=BBBxI", socket.AF_INET, socket.IPPROTO_TCP, 0, 0xFFFFFFFF) + ask
    head = struct.pack("=IHHII", 16 + len(body), SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST, 1, 0)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_SOCK_DIAG) as asked:
        asked.send(head + body)
        answer = asked.recv(4096)
    _, kind = struct.unpack_from("=IH", answer)
    return int(struct.unpack_from("=I", answer, 84)[0]) if kind == SOCK_DIAG_BY_FAMILY else 0


async def watch_at(
    relay: Relay, pid: int, stack: AsyncExitStack, query: str = "", robot: str = "r"
) -> Watcher:
    """A viewer at the process `pid`."""
    return await stack.enter_async_context(Watcher(relay.url(robot, query), sock=connect_to(relay, pid)))


def ask_at(relay: Relay, pid: int, path: str, method: str = "GET", **headers: str) -> httpx.Response:
    """The answer of the process `pid`."""
    connection = HTTPConnection("127.0.0.1", relay.http, timeout=SLOW_S)
    connection.sock = connect_to(relay, pid)
    try:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return httpx.Response(answer.status, headers=answer.getheaders(), content=answer.read())
    finally:
        connection.close()


def await_ready(relay: Relay) -> None:
    """Wait until all workers serve."""

    def is_ready() -> bool:
        answer = httpx.get(f"http://{relay.address}/readyz", timeout=SLOW_S)
        return bool(answer.json() == {"status": "ready"})

    until("all workers serve", is_ready, 60.0)


def read_metric(port: int, name: str) -> float:
    """The sum of a metric's samples, whatever their labels."""
    text = httpx.get(f"http://127.0.0.1:{port}/metrics", timeout=SLOW_S).text
    found = re.findall(rf"^{name}(?:{{[^}}]*}})? (\S+)$", text, re.MULTILINE)
    return sum(map(float, found))


def until_metric(port: int, name: str, least: float, most: float | None = None) -> None:
    """Wait until a metric is so much, or lies between two figures: a worker that is slow to tell its own is
    left out.
    """
    most = least if most is None else most
    until(f"{name} {least:g}", lambda: least <= read_metric(port, name) <= most, SLOW_S)
