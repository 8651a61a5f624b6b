"""What anybody may send to the relay's own port: HTTP, and what looks like it."""

from __future__ import annotations

import itertools
import random
import socket
import threading
import time
from contextlib import suppress
from datetime import UTC, datetime

from tests.attack.by_frames import AS_FAST_AS_IT_GOES
from tests.attack.hostile_crowd import Crowd, get, stream
from tests.attack.target import Steps, Target, attack

HEADERS_BYTES = 10_000_000


def pour(at: Target, data: bytes, most: int) -> int:
    """One request, until it is refused or read; bytes that were taken of it."""
    sent = 0
    with suppress(OSError), socket.create_connection(at.address, 2.0) as link:
        link.settimeout(at.seconds)
        while sent < most and not at.over():
            sent += link.send(data)
        link.recv(65536)
    return sent


def poured(at: Target, requests: list[tuple[bytes, bytes]], most: int) -> str:
    """Each in a thread of its own: its beginning, then its rest over and over."""
    taken: list[int] = []

    def one(head: bytes, rest: bytes) -> None:
        taken.append(pour(at, head + rest, most))

    threads = [threading.Thread(target=one, args=request, daemon=True) for request in requests]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(max(0.0, at.end_s - time.monotonic()))
    return f"{sum(taken) / 1e6:,.0f} MB taken of {len(requests)} requests"


@attack(seconds=2.4)
def headers_of_10_mb(at: Target) -> Steps:
    """12 requests, each with 10 MB of header lines"""
    line = b"a:b\r\n" * (HEADERS_BYTES // 5)
    yield
    return poured(at, [(b"GET / HTTP/1.1\r\nHost: x\r\n", line)] * 12, HEADERS_BYTES)


@attack(seconds=2.4)
def lines_of_10_mb(at: Target) -> Steps:
    """12 requests with one header, target, method, chunk or body of 10 MB"""
    rest = b"a" * HEADERS_BYTES
    heads = [
        b"GET / HTTP/1.1\r\nHost: x\r\na:",
        b"GET /",
        b"G",
        b"POST /api/v1/robots HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n1;x=",
        b"POST /api/v1/robots HTTP/1.1\r\nHost: x\r\nContent-Length: 100000000\r\n\r\n",
        stream()[:-2] + b"x:",
    ]
    yield
    return poured(at, [(head, rest) for head in heads * 2], HEADERS_BYTES)


@attack()
def malformed(at: Target) -> Steps:
    """malformed requests, 1,000 a second, each on a new connection"""
    draw = random.Random(6)
    broken = [
        b"\x00\x01\x02\r\n\r\n",
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
        b"GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
        b"GET / HTTP/1.1\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"GET / HTTP/1.1\r\na b: c\r\n\r\n",
        b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
        stream().replace(b"Key: dGhl", b"Key: "),
        stream().replace(b"Version: 13", b"Version: 12"),
        b"GET /api/v1/robots/%ff%00/live?hz=1 HTTP/1.1\r\nHost: x\r\n\r\n",
        b"GET /api/v1/robots/innocent/state?view=%ed%a0%80 HTTP/1.1\r\nHost: \xff\r\n\r\n",
    ]
    crowd = Crowd(at, lambda _n: draw.choice(broken) if draw.random() < 0.9 else draw.randbytes(100))
    n = itertools.count()
    yield

    def knock() -> None:
        crowd.open([next(n)])
        crowd.read()
        if len(crowd.sockets) > 200:
            crowd.drop(next(iter(crowd.sockets)), reset=True)

    return at.paced(1000, knock)


@attack(seconds=2.8)
def answers_never_read(at: Target) -> Steps:
    """2,500 connections that request the page's largest file and more, and read nothing"""
    with socket.create_connection(at.address, 5.0) as link:
        link.sendall(get("/", "Connection: close"))
        page = b"".join(iter(lambda: link.recv(65536), b""))
    assets = [part.split(b'"')[0].decode() for part in page.split(b"/assets/")[1:]]
    asked = [f"/assets/{name}" for name in assets] or ["/openapi.json"]
    request = b"".join(get(path) for path in [*asked, "/openapi.json"]) * 3
    crowd = Crowd(at, lambda _n: request, small=True)
    n = itertools.count()
    yield
    count = 2500

    def come() -> None:
        if crowd.opened < count:
            crowd.open([next(n)])

    at.paced(1500, come)
    return f"{crowd.opened:,} askers of {asked[0].rsplit('/', 1)[-1]}"


@attack(seconds=2.4)
def drop_by_drop(at: Target) -> Steps:
    """1,000 requests sent one byte at a time (slowloris)"""
    request = get("/api/v1/robots", *(f"X-{n}: {n}" for n in range(50)))
    crowd = Crowd(at, lambda _n: request[:1])
    crowd.open(range(1000))
    progress = dict.fromkeys(range(1000), 1)
    turns = itertools.cycle(range(1000))
    yield

    def drop() -> None:
        number = next(turns)
        place = progress[number] = progress[number] % len(request) + 1
        crowd.write(number, request[place - 1 : place])
        if number == 0:
            crowd.reopen()

    return f"{at.paced(4000, drop)} bytes, {crowd.ended:,} let go"


def hammered(at: Target, connections: int, per_s: float, paths: list[str]) -> Steps:
    """Connections that stay, each of which asks for one of these, however long answers take."""
    requests = [get(path, "Accept-Encoding: gzip") for path in paths]
    crowd = Crowd(at, lambda n: requests[n % len(requests)])
    crowd.open(range(connections))
    crowd.until_heard()
    turns = itertools.count()
    yield

    def ask() -> None:
        n = next(turns)
        crowd.write(n % connections, requests[n % len(requests)])
        if n % 50 == 0:
            crowd.reopen()

    return f"{at.paced(per_s, ask)} asked"


@attack()
def states_1000(at: Target) -> Steps:
    """states and absent paths requested 1,000 times a second, with targets of up to 16 kB"""
    states = ["/api/v1/robots/innocent/state"] * 100
    paths = [f"/api/v1/robots/innocent/model/{n:064x}/manifest.json" for n in range(50)]
    paths += [f"/api/v1/robots/{'x' * n}/state" for n in range(48)]
    paths += ["/api/" + "y" * 16_000, "/" + "%2e/" * 4000]
    both = [path for pair in zip(states, paths, strict=True) for path in pair]
    return (yield from hammered(at, 40, 1000, both))


@attack()
def lists_unpaced(at: Target) -> Steps:
    """list, document, state and openapi.json requested on 500 connections at full speed"""
    paths = ["/api/v1/robots", "/openapi.json", "/api/v1/robots/innocent", "/api/v1/robots/innocent/state"]
    return (yield from hammered(at, 500, AS_FAST_AS_IT_GOES, paths))


@attack()
def past_unpaced(at: Target) -> Steps:
    """days, ten minutes, KEYs and takes of the past requested on 500 connections at full speed"""
    past, now = "/api/v1/robots/innocent/past", datetime.now(UTC)
    page = f"{past}/public/{now:%Y-%m-%dT%H}:{now.minute // 10}0Z"
    paths = [past, f"{past}/public/{now:%Y-%m-%d}", page, f"{past}/public/{'0' * 16}/7"]
    paths += [f"{page}?after={n:016x},{n}" for n in range(100)] + [
        f"{page}/keys?every={n}" for n in range(1, 50)
    ]
    return (yield from hammered(at, 500, AS_FAST_AS_IT_GOES, paths))


@attack(guarded=True)
def bad_tokens(at: Target) -> Steps:
    """viewers with invalid tokens of up to 7 kB, 500 a second"""
    draw = random.Random(7)
    shapes = ["x" * 7000, "a.b.c", "eyJhbGciOiJub25lIn0.e30.", "pc1.innocent.9999999999.x", "é", "." * 7000]
    paths = ["/api/v1/robots", "/api/v1/robots/innocent", "/api/v1/robots/innocent/live.sse"]

    def ask(n: int) -> bytes:
        token = f"Authorization: Bearer {draw.choice(shapes)}"
        if n % 2:
            return get(draw.choice(paths), token)
        return stream(query="hz=30")[:-2] + f"{token}\r\n\r\n".encode()

    crowd = Crowd(at, ask)
    n = itertools.count()
    yield

    def knock() -> None:
        crowd.open([next(n)])
        crowd.read()
        if len(crowd.sockets) > 100:
            crowd.drop(next(iter(crowd.sockets)))

    return at.paced(500, knock)
