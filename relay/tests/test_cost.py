"""What strangers write is read at a cost in proportion: 4 and 16 times as much takes 4 and 16 times as long.

The least of several runs in the process's own time counts, so that a busy machine spoils nothing; what grows
with the square takes 256 times as long and fails.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from posecast_relay.auth.access import Access
from posecast_relay.auth.addresses import find_real_address, may_show, parse_networks
from posecast_relay.config.robots_file import read_robots
from posecast_relay.core import messages
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import read_link
from posecast_relay.kit import json_bytes
from posecast_relay.logging import visible
from posecast_relay.models.manifest import read_manifest
from posecast_relay.net.encodings import DecodeCache, EventStreamEncoding
from posecast_relay.net.request import join_all, read_bearer, read_target
from posecast_relay.net.websocket import make_live_protocol, read_short_text
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore
from posecast_relay.runtime.fan_out import FanOut

from .stage import Wire, request_stream
from .test_flood import BEGUN, MASK, PIECE, PING
from .test_http_connection import CHUNKED, GET, POST, Desk

TRUSTED = parse_networks("10.0.0.0/8")
FILE = {"size": 1, "sha256": "0" * 64}


def manifest(n: int) -> bytes:
    """Of n files."""
    return json.dumps({"files": [FILE | {"path": f"meshes/{i}/a"} for i in range(n)]}).encode()


# what is read, and how to make one of size n of its worst kind
READERS: dict[str, tuple[Callable[[Any], object], Callable[[int], Any]]] = {
    "target: parameters": (read_target, lambda n: "/api/v1/robots/r/live?" + "a=1&" * n),
    "target: one parameter": (read_target, lambda n: "/api/v1/robots/r/live?hz=" + "%31" * n),
    "target: path": (read_target, lambda n: "/api/v1/robots/" * n),
    "token": (read_bearer, lambda n: "Bearer " + " " * n + "x" + " " * n),
    "share link": (lambda token: read_link(token, {}, 0.0), lambda n: "L1." + "a-" * n + "." + "1" * n),
    "origin": (lambda origin: may_show(origin, "x", ()), lambda n: "https://" + "a@:[" * n),
    "forwarded": (lambda text: find_real_address("10.0.0.1", text, TRUSTED), lambda n: "10.0.0.1, " * n),
    "headers": (join_all, lambda n: ["x"] * n),
    "short messages": (read_short_text, lambda n: b"\x81\x80" + bytes(n)),
    "manifest: files": (read_manifest, manifest),
    "manifest: one path": (
        read_manifest,
        lambda n: json.dumps({"files": [FILE | {"path": "a/" * n}]}).encode(),
    ),
    "manifest: depth": (read_manifest, lambda n: b"[" * n + b"]" * n),
    "manifest: digits": (read_manifest, lambda n: b'{"files":[{"size":' + b"9" * n + b"}]}"),
    "events: lines": (
        lambda data: EventStreamEncoding().encode(data, None),  # type: ignore[arg-type]
        lambda n: messages.make_text('{"type":"x",' + "\r" * n + '"a":1}'),
    ),
    "events: messages": (
        lambda data: EventStreamEncoding().encode(data, None),  # type: ignore[arg-type]
        lambda n: messages.make_text('{"type":"x"}') * n,
    ),
    "names": (visible, lambda n: "\u202e" * n),
    "answers": (json_bytes, lambda n: {"a": [float("nan")] * n}),
}


def least_s(work: Callable[[], object]) -> float:
    """Of several runs: process time."""
    found = []
    for _ in range(5):
        began = time.process_time()
        with suppress(ValueError):
            work()
        found.append(time.process_time() - began)
    return min(found)


def assert_in_proportion(read: Callable[[Any], object], make: Callable[[int], Any], n: int = 500) -> None:
    """With room for what does not depend on the size."""
    times = {}
    for factor in (1, 4, 16):
        data = make(n * factor)
        times[factor] = least_s(lambda data=data: read(data))  # type: ignore[misc]
    assert times[16] < 16 * 3 * times[1] + 0.003, times
    assert times[16] < 4 * 3 * times[4] + 0.003, times


@pytest.mark.parametrize("reader", READERS)
def test_of_a_reader(reader: str) -> None:
    assert_in_proportion(*READERS[reader])


ROBOTS: dict[str, Callable[[int], str]] = {
    "robots": lambda n: "".join(f"[robots.r{i}.anyone]\nview = 'public'\n" for i in range(n)),
    "origins": lambda n: "[robots.r.anyone]\nframes = [" + "'https://a.example'," * n + "]\n",
    "one name": lambda n: f"[robots.{'a' * n}]\n",
    "unknown fields": lambda n: "".join(f"a{i} = 1\n" for i in range(n)),
    "comments": lambda n: "# x\n" * n,
    "depth": lambda n: "a = " + "[" * n + "]" * n,
    "lines of a text": lambda n: 'a = """' + "\n" * n + '"""',
}


@pytest.mark.parametrize("kind", ROBOTS)
def test_of_the_robots_file(kind: str, tmp_path: Path) -> None:
    def written(n: int) -> Path:
        path = tmp_path / f"{n}.toml"
        path.write_text(ROBOTS[kind](n))
        path.chmod(0o600)
        return path

    assert_in_proportion(read_robots, written, 300)


REQUESTS: dict[str, Callable[[int], bytes]] = {
    "header lines": lambda n: GET + b"a:b\r\n" * n,
    "one header": lambda n: GET + b"a:" + b"b" * n,
    "target": lambda n: b"GET /" + b"a" * n,
    "requests": lambda n: (GET + b"\r\n") * n,
    "body": lambda n: POST + b"Content-Length: 999999\r\n\r\n" + b"a" * n,
    "chunks": lambda n: CHUNKED + b"1\r\na\r\n" * n,
    "trailer": lambda n: CHUNKED + b"0\r\n" + b"a:b\r\n" * n,
    "upgrade": lambda n: GET + b"Connection: Upgrade\r\nUpgrade: websocket\r\n" + b"a:b\r\n" * n + b"\r\n",
}


@pytest.mark.parametrize("kind", REQUESTS)
@pytest.mark.parametrize("piece", [1, 256_000], ids=["byte by byte", "at once"])
async def test_of_requests(kind: str, piece: int) -> None:
    desk = Desk()

    def read(data: bytes) -> None:
        connection, _ = desk.connect()
        for at in range(0, len(data), piece):
            connection.data_received(data[at : at + piece])
        connection.connection_lost(None)

    assert_in_proportion(read, REQUESTS[kind], 100)
    desk.dispatcher.stop()


FRAMES: dict[str, Callable[[int], bytes]] = {
    "pings": lambda n: PING * n,
    "pieces": lambda n: BEGUN + PIECE * n,
    "one message": lambda n: b"\x81\xfe" + n.to_bytes(2, "big") + MASK + b" " * n,
    "a message of many members": lambda n: _text(b'{"a":1' + b',"a":1' * n + b"}"),
    "depth": lambda n: _text(b"[" * n),
    "digits": lambda n: _text(b'{"type":"ack","n":' + b"9" * n + b"}"),
}


def _text(data: bytes) -> bytes:
    return b"\x81\xfe" + min(len(data), 65535).to_bytes(2, "big") + MASK + data


@pytest.mark.parametrize("kind", FRAMES)
@pytest.mark.parametrize("piece", [1, 256_000], ids=["byte by byte", "at once"])
async def test_of_a_viewers_messages(kind: str, piece: int) -> None:
    dispatcher = Dispatcher(Hub(Limits()), MemoryStore(), FanOut(None))
    made = make_live_protocol(Access(dispatcher), DecodeCache())

    def read(data: bytes) -> None:
        viewer: Any = made(SimpleNamespace(), SimpleNamespace(connections=set()), None)  # type: ignore[arg-type]
        viewer.connection_made(Wire())
        viewer.data_received(request_stream())
        for at in range(0, len(data), piece):
            viewer.data_received(data[at : at + piece])
        viewer.connection_lost(None)

    assert_in_proportion(read, FRAMES[kind], 100)
    dispatcher.stop()
