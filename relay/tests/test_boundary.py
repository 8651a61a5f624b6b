"""What raises at one connection ends that connection: each function that serves one fails, one by one."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import struct
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_testing import free_port
from posecast_wire import Close

from .faulty_relay import ROBOT, TOKEN, VICTIM, functions
from .stage import UPGRADE, Relay, Watcher, ZenohEdge

BEARER = f"Authorization: Bearer {TOKEN}"
PATIENCE_S = 0.1  # without a byte: nothing more will come
WHILE_S = 0.12  # a stream is listened to at first; longer with each try, since a busy machine needs longer
SIDE_BY_SIDE = 3  # relays, each with a part of the functions
TRIES = 30  # on a busy machine not all is done in that time
# not called by anything that a viewer does while a relay runs
AT_OTHER_TIMES = {
    "LiveSocket.shutdown",
    "EventStream.shutdown",
    *("HttpConnection.shutdown", "HttpConnection.close_if_idle"),
    "HttpConnection.timeout_keep_alive_handler",
    "Access.on_policy",
    "Access._tell_recorder",
    "Access._readmit",
    "Access._apply_policy",
    "Access.renew",
    "Addresses.leave",  # of an address that is counted: not of this machine's own
    "EventStream.end",
    *("Access.tell_full", "Access._explain_no_lane", "_Http._turn_away"),  # where there is no place
    *("AnswerCache.clear", "AnswerCache.load_answer"),  # of the past, which the victim does not ask for
    "LiveSocket.pause_writing",  # what it is given when it comes pauses the connection before it is one
}
# a viewer, or an event stream, is told why it ends; who asks over HTTP gets an answer
NAMED = {
    *(
        "LiveSocket._frame",
        "LiveSocket._text",
        "LiveSocket._may_send",
        "LiveSocket._enter",
        "LiveSocket._verify_token",
    ),
    *("LiveSocket._enter_by", "LiveSocket._refuse_entry", "LiveSocket.write_as", "LiveSocket.resume_writing"),
    *(
        "EventStream.start",
        "EventStream.resume_writing",
        "EventStreamEncoding.encode",
        "JsonEncoding.encode",
        "Access.admit",
    ),
}
ANSWERED = {
    *("HttpConnection._feed", "HttpConnection.on_url", "HttpConnection.on_header", "HttpConnection._begin"),
    *("HttpConnection._start_asgi_task", "HttpConnection._answer", "HttpConnection.on_headers_complete"),
    *("_Http._upgrade", "_Http._take_over", "_Http._enter", "_Http._enter_by", "LiveSocket._handshake"),
    *(
        "AnswerCache.get_answer",
        "StateReader.read",
        "PendingRequests.wait",
        "Access.list_frame_ancestors",
        "Access.find_refusal",
        "Access.enter_address",
        "Addresses.enter",
    ),
}


def frame(text: str, opcode: int = 1, fin: bool = True) -> bytes:
    """As a viewer sends it, masked with zeros."""
    data = text.encode()
    return bytes([0x80 * fin | opcode, 0x80 | len(data)]) + bytes(4) + data


class Victim:
    """Somebody who comes from another address, and does all that a viewer can do."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.while_s = WHILE_S

    def ask(self, path: str, *lines: str, send: bytes = b"", method: str = "GET") -> bytes:
        """All that the relay says, until it says no more."""
        head = "\r\n".join([f"{method} {path} HTTP/1.1", "Host: x", *lines, "", ""]).encode()
        return self.say(head, send)

    def say(self, *parts: bytes, reset: bool = False) -> bytes:
        """Likewise, of one connection."""
        said = b""
        with socket.socket() as sock, contextlib.suppress(OSError):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
            sock.bind((VICTIM, 0))
            sock.settimeout(PATIENCE_S)
            sock.connect(("127.0.0.1", self._port))
            for part in parts:
                sock.sendall(part)
                until_s = time.monotonic() + self.while_s
                with contextlib.suppress(TimeoutError):
                    while time.monotonic() < until_s and (got := sock.recv(65536)):
                        said += got
            if reset:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        return said

    def do_everything(self) -> list[bytes]:
        """At once, each on a connection of its own; what was said on each."""
        live, state = f"/api/v1/robots/{ROBOT}/live", f"/api/v1/robots/{ROBOT}/state"
        talk = frame('{"type":"ack","n":1}') + frame("", 9) + frame('{"type":"ra', fin=False)
        talk += frame('te","hz":20}', 0)
        pipelined = b"".join(f"GET {state} HTTP/1.1\r\nHost: x\r\n\r\n".encode() for _ in range(3))
        deeds: list[Callable[[], bytes]] = [
            lambda: self.ask(live, *UPGRADE, send=talk),
            lambda: self.ask(live, *UPGRADE, send=frame('{"type":"nonsense"}')),
            lambda: self.ask(live, *UPGRADE, send=frame("", 9) * 50),
            lambda: self.ask(f"{live}?format=json", *UPGRADE, send=frame("", 8)),
            lambda: self.ask(
                f"{live}?auth=1", *UPGRADE, send=frame('{"type":"auth","token":"' + TOKEN + '"}')
            ),
            lambda: self.ask(live, *UPGRADE, BEARER),
            lambda: self.ask(live, *UPGRADE, BEARER, f"Origin: {ROBOT}"),
            lambda: self.ask(f"{live}.sse", send=b"more"),
            lambda: self.ask(f"{live}.sse?format=json"),
            lambda: self.ask(f"{live}.sse", BEARER),
            lambda: self.ask(f"{live}.sse?hz=none"),
            lambda: self.ask("/", "Transfer-Encoding: chunked", send=b"1\r\na\r\n0\r\n\r\n", method="POST"),
            lambda: self.ask("/long.js"),
            lambda: self.ask(f"/api/v1/robots/{ROBOT}"),
            lambda: self.ask(f"/embed/{ROBOT}"),
            lambda: self.ask("/livez", "Connection: upgrade", "Upgrade: h2c"),
            lambda: self.say(pipelined),
            lambda: self.say(b"nonsense\r\n\r\n"),
            lambda: self.say(f"GET {live}.sse HTTP/1.1\r\nHost: x\r\n\r\n".encode(), reset=True),
        ]
        heard = [b""] * len(deeds)

        def do(number: int) -> None:
            heard[number] = deeds[number]()

        threads = [threading.Thread(target=do, args=(number,)) for number in range(len(deeds))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return heard


def set_fault(port: int, name: str) -> int:
    """Which function raises from now on; how often the one before did."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(5.0)
        sock.sendto(name.encode(), ("127.0.0.1", port))
        return int(sock.recv(100))


async def suffer(relay: Relay, faults: int, other: ZenohEdge, names: list[str]) -> dict[str, str]:
    """Let each of these functions fail. Which did, and what the victim heard of it: `1011` and `500`."""
    victim = Victim(relay.http)
    base = f"http://{relay.address}"
    found: dict[str, str] = {}
    async with Watcher(relay.url(query="?hz=60")) as innocent, httpx.AsyncClient(base_url=base) as client:
        async with Watcher(relay.url(ROBOT)) as second:
            await second.until("frames", lambda v: v.frames)
            for number in range(40):  # given to who joins: more than its socket takes at once
                other.event(f"{number} " + "x" * 1500)
            await second.until("events", lambda v: len(v.told("event")) == 40)
        await innocent.until("frames", lambda v: len(v.frames) > 10)
        await client.get("/livez")  # its connection is one of those that stay
        first, descriptors = innocent.frames[-1][1].seq, open_files(relay)
        for known in names:
            for tried in range(1 if known in AT_OTHER_TIMES else TRIES):
                victim.while_s = WHILE_S * (1 + tried)
                set_fault(faults, known)
                heard = b"".join(await asyncio.to_thread(victim.do_everything))
                if set_fault(faults, ""):
                    found[known] = found.get(known, "") + words(heard)
                    if wanted(known) in found[known]:
                        break
            assert (await client.get("/livez")).status_code == 200, known
            assert innocent.closed is None, known
            newest = innocent.frames[-1][1].seq
            await innocent.until(f"frames after {known}", partial(has_frame, newest + 1))
        seqs = [got.seq for _, got in innocent.frames if got.seq >= first]
        assert seqs == sorted(set(seqs))
        # on a busy machine, frames that come at once replace each other
        assert len(seqs) >= 0.5 * (seqs[-1] - first), "frames of the innocent"

        async def counted() -> dict[str, int]:
            listed = (await client.get("/api/v1/robots")).json()["robots"]
            return {robot["robot"]: robot["viewers"] for robot in listed}

        async with asyncio.timeout(20):  # nothing of the victim's is left behind
            while await counted() != {"r": 1, ROBOT: 0} or open_files(relay) > descriptors:
                await asyncio.sleep(0.1)
    return found


def words(heard: bytes) -> str:
    """Of all that the relay said: how it named its fault."""
    named = f'"code":{int(Close.INTERNAL_ERROR)}'.encode() in heard
    return "1011 " * named + "500 " * (b" 500 Internal Server Error" in heard)


def wanted(function: str) -> str:
    """What the victim must hear when this function fails."""
    return "1011" if function in NAMED else "500" if function in ANSWERED else ""


def open_files(relay: Relay) -> int:
    """Sockets among them."""
    return len(os.listdir(f"/proc/{relay.process.pid}/fd"))


def has_frame(seq: int, viewer: Watcher) -> bool:
    """Whether it has this one or a newer one."""
    return viewer.frames[-1][1].seq >= seq


async def test_whatever_raises_nobody_else_notices(
    relays: Any, edges: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = tmp_path / "page"
    (page / "embed").mkdir(parents=True)
    for path in (page / "index.html", page / "embed/index.html"):
        path.write_text("page")
    (page / "long.js").write_bytes(bytes(4_000_000))
    robots = tmp_path / "robots.toml"
    robots.write_text("".join(f'[robots.{name}.anyone]\nview = "public"\n' for name in ("r", ROBOT)))
    robots.chmod(0o600)
    names = [f"{cls.__name__}.{name}" for cls, name in functions()]
    suffering = []
    for part in range(SIDE_BY_SIDE):
        faults = free_port()
        monkeypatch.setenv("FAULT_PORT", str(faults))
        flags = ("--static", str(page), "--robots", str(robots))
        relay: Relay = relays(*flags, module="relay.tests.faulty_relay")
        edges(
            relay.zenoh
        ).hz = 10.0  # this process has much to do: frames that come at once replace each other
        other = edges(relay.zenoh, robot=ROBOT)
        suffering.append(suffer(relay, faults, other, names[part::SIDE_BY_SIDE]))
    found: list[dict[str, str]] = await asyncio.gather(*suffering)
    heard = {name: said for part in found for name, said in part.items()}
    assert set(names) - set(heard) <= AT_OTHER_TIMES
    assert [name for name in names if wanted(name) not in heard.get(name, "")] == []
