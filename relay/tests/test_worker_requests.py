"""What a further worker is asked over HTTP: by a crowd at one moment, and of the past."""

from __future__ import annotations

import asyncio
import errno
import signal
import socket
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from posecast_relay.server.workers.forwarder import AWAY, CROWDED, Forwarder
from posecast_relay.streaming.http_connection import AnswerAborted
from posecast_testing import free_port, until

from .open_files import allow_files
from .stage import Model, Relay, ZenohEdge
from .test_past_deletion_relay import run_past
from .test_past_relay import await_segment
from .worker_crew import SLOW_S, ask_at, connect_to, list_pids, read_metric

Relays = Callable[..., Relay]
Edges = Callable[..., ZenohEdge]
PAST = "/api/v1/robots/r/past"
CROWD = 400
HELD = "posecast_past_held_requests"


@pytest.fixture
def many_files() -> Iterator[None]:
    """One for each of the crowd."""
    with allow_files(CROWD + 600):
        yield


@pytest.mark.full  # with one process: `test_past_held`, `test_past_deletion_relay`
@pytest.mark.usefixtures("many_files")
async def test_a_crowd_that_asks_at_one_moment_is_answered(relays: Relays, edges: Edges) -> None:
    relay = relays("--workers", "2", "--max-viewers", "1")
    second = list_pids(relay)[1]
    edge = edges(relay.zenoh, model=Model({"robot.urdf": (b"<robot/>", "application/xml")}))
    assert edge.model is not None
    await asyncio.to_thread(await_segment, relay, edge)
    manifest = f"/api/v1/robots/r/model/{edge.model.digest}/manifest.json"
    for _ in range(3):
        asking = asyncio.create_task(ask_at_one_moment(relay, PAST))
        others = [await asyncio.to_thread(ask_at, relay, second, path) for path in (manifest, "/livez")]
        assert [answer.status_code for answer in others] == [200, 200]
        assert others[0].content == edge.model.manifest
        assert await asking == {"200": CROWD}


@pytest.mark.full  # with one process: `test_past_held`, `test_past_deletion_relay`
async def test_at_a_further_worker_requests_are_held_and_give_their_places_back(
    relays: Relays, edges: Edges
) -> None:
    port = free_port()
    relay = relays("--workers", "2", "--metrics-port", str(port))
    second = list_pids(relay)[1]
    edge = edges(relay.zenoh)
    newest = await asyncio.to_thread(await_segment, relay, edge)
    async with hold_at(relay, second, newest) as held:  # what is kept already comes at once
        assert await read_status(held) == 200
    newest["index"] += 1
    async with hold_at(relay, second, newest) as held:  # the next one when it is there
        edge.force_key = True
        assert await read_status(held) == 200
    edge.close()
    status = 200
    while status == 200:  # what came until it went; then nothing does
        newest["index"] += 1
        async with hold_at(relay, second, newest) as held:
            status = await read_status(held)
    assert status == 204
    async with hold_at(relay, second, newest):
        await until_held(port, 1)
    await until_held(port, 0)  # who asked has gone
    async with AsyncExitStack() as stack:
        links = [await stack.enter_async_context(hold_at(relay, second, newest)) for _ in range(3)]
        await until_held(port, 3)
        relay.process.send_signal(signal.SIGTERM)
        assert [await read_status(held) for held in links] == [204] * 3
    assert await asyncio.to_thread(relay.stop) == 0


@pytest.mark.full  # with one process: `test_past_held`, `test_past_deletion_relay`
async def test_what_is_deleted_is_gone_at_all_workers(relays: Relays, edges: Edges, tmp_path: Path) -> None:
    path = tmp_path / "relay.sock"
    relay = relays("--workers", "2", "--past-socket", str(path))
    first, second = list_pids(relay)
    newest = await asyncio.to_thread(await_segment, relay, edges(relay.zenoh))
    segment = f"{PAST}/public/{newest['take']}/{newest['index']}"
    assert {ask_at(relay, pid, segment).status_code for pid in (first, second)} == {200}
    asked_ms = time.time_ns() // 1_000_000
    said = await asyncio.to_thread(
        run_past, "delete", "--robot", "r", "--all", "--yes", "--past-socket", str(path)
    )
    assert said.returncode == 0, said

    def is_gone(pid: int) -> bool:
        from_ms = ask_at(relay, pid, PAST).json().get("from_ms")
        return from_ms is None or from_ms >= asked_ms

    for pid in (first, second):
        until("nothing of before", partial(is_gone, pid), SLOW_S)
        assert ask_at(relay, pid, segment).status_code != 200


@pytest.mark.parametrize("code", [errno.EMFILE, errno.ENOENT])
async def test_why_the_first_worker_was_not_asked_is_true(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_family: int) -> socket.socket:
        raise OSError(code, "no more")

    if code == errno.EMFILE:
        monkeypatch.setattr("socket.socket", fail)
    told = await forward(tmp_path / "nobody")
    monkeypatch.undo()
    assert told[0]["status"] == 503
    assert (b"retry-after", b"1") in told[0]["headers"]
    assert told[1]["body"] == (CROWDED if code == errno.EMFILE else AWAY)


async def test_what_the_first_worker_cuts_is_cut(tmp_path: Path) -> None:
    for said in (b"", b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\n\r\nhal", b"what?\r\n\r\n"):

        async def cut(_: asyncio.StreamReader, writer: asyncio.StreamWriter, said: bytes = said) -> None:
            writer.write(said)
            writer.close()

        path = tmp_path / "door"
        async with await asyncio.start_unix_server(cut, path):
            with pytest.raises(AnswerAborted):
                await forward(path)
        path.unlink(missing_ok=True)


async def forward(path: Path) -> list[Any]:
    """What a further worker sends who asks at this door."""
    told: list[Any] = []

    async def send(message: Any) -> None:
        told.append(message)

    scope = {"method": "GET", "raw_path": b"/x", "query_string": b"", "headers": [(b"host", b"x")]}
    await Forwarder(path)(scope, None, send)
    return told


async def ask_at_one_moment(relay: Relay, path: str) -> Counter[str]:
    """How a crowd is answered whose connections, at all workers, ask together."""
    head = f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
    async with asyncio.timeout(60):
        while True:
            async with AsyncExitStack() as stack:
                links = []
                for _ in range(CROWD):
                    links.append(await asyncio.open_connection("127.0.0.1", relay.http))
                    stack.callback(links[-1][1].transport.abort)
                for _, writer in links:
                    writer.write(head)
                lines = [reader.readline() for reader, _ in links]
                said = await asyncio.gather(*lines, return_exceptions=True)
            found = Counter(line.split()[1].decode() for line in said if isinstance(line, bytes) and line)
            if found.total() == CROWD or set(found) - {"200"}:
                return found  # else the machine was so busy that some came too late to ask


@asynccontextmanager
async def hold_at(relay: Relay, pid: int, name: dict[str, object]) -> AsyncIterator[asyncio.StreamReader]:
    """Ask a worker for a segment, and take nothing yet."""
    reader, writer = await asyncio.open_connection(sock=await asyncio.to_thread(connect_to, relay, pid))
    try:
        path = f"{PAST}/public/{name['take']}/{name['index']}"
        writer.write(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
        yield reader
    finally:
        writer.transport.abort()


async def read_status(held: asyncio.StreamReader) -> int:
    """What a request was answered with, once it is."""
    return int((await asyncio.wait_for(held.readline(), SLOW_S)).split()[1])


async def until_held(port: int, count: int) -> None:
    """Wait until the relay holds so many requests."""
    holds = lambda: read_metric(port, HELD) == count  # noqa: E731
    await asyncio.to_thread(until, f"{count} held", holds, SLOW_S)
