"""The past of a relay by its routes: what the asker may see, bounded, verified, asked for again."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import hashlib
import json
import threading
import time
from collections.abc import AsyncIterator, Callable
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past import documents
from posecast_relay.recording import http_source
from posecast_relay.recording.collector import Collector
from posecast_relay.recording.http_source import HttpSource
from posecast_relay.recording.source import ListedSegment, PartAway, PastDamaged, PastUnreadable
from posecast_wire.recording import PastRecording

from .past_doors import PAGE_MS, PastDoors, link
from .recording_stage import NO_WORDS

OPEN = {"r": {Audience.ANYONE: Rule(), Audience.LINK: Rule(past_s=1800.0)}}
SUMMARY = json.dumps(
    {"view": "public", "past_ms": 1, "from_ms": PAGE_MS, "to_ms": PAGE_MS + 1, "newest": {}, "days": []}
).encode()


@pytest.fixture
async def doors() -> AsyncIterator[PastDoors]:
    """A relay in this process."""
    async with PastDoors(OPEN) as made:
        yield made


async def collect(doors: PastDoors, folder: Path, token: str | None = None) -> PastRecording:
    """All that there is for the bearer of a token."""
    source = HttpSource(f"http://127.0.0.1:{doors.port}", "r", None, token)
    try:
        assert await source.find_span() is not None
        folder.mkdir()
        return await Collector(source, folder).collect(PAGE_MS - 1_800_000, PAGE_MS + 1_800_000, NO_WORDS)
    finally:
        await source.close()


async def test_nothing_of_another_audience(doors: PastDoors, tmp_path: Path) -> None:
    both, one = frozenset(Audience), frozenset((Audience.LINK,))
    for index in range(12):
        doors.unix_ms += 4000
        doors.keep(index, audiences=one if index % 3 == 1 else both)
    assert [each.index for each in (await collect(doors, tmp_path / "anyone")).segments] == [
        0, 2, 3, 5, 6, 8, 9, 11,
    ]  # fmt: skip
    with_link = await collect(doors, tmp_path / "link", link("r"))
    assert [each.index for each in with_link.segments] == [*range(12)]
    names = sorted(path.name for path in (tmp_path / "anyone/segments").rglob("*.segment"))
    assert "1.segment" not in names


async def test_an_index_in_parts_and_pages_of_several_ten_minutes(
    doors: PastDoors, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(documents, "INDEX_BYTES_MAX", 2000)
    for index in range(40):
        doors.unix_ms += 40_000
        doors.keep(index)
    recording = await collect(doors, tmp_path / "to")
    assert [each.index for each in recording.segments] == [*range(40)]
    assert len({path.name for path in (tmp_path / "to/keys").iterdir()}) == 3


async def test_a_past_that_is_not_there(doors: PastDoors) -> None:
    doors.keep(0)
    at = f"http://127.0.0.1:{doors.port}"
    for robot, view, says in (
        ("nobody", None, "no such robot, or you may not see it"),
        ("r", "lab", "you may not see this view"),
    ):
        source = HttpSource(at, robot, view, None)
        with pytest.raises(PastUnreadable) as caught:
            await source.find_span()
        assert str(caught.value).startswith(f"{at}/api/v1/robots/{robot}/past")
        assert says in str(caught.value)
        await source.close()
    doors.allow({"r": {Audience.ANYONE: Rule(past_s=0.0)}})
    source = HttpSource(at, "r", None, None)
    with pytest.raises(PastUnreadable) as caught:
        await source.find_span()
    assert str(caught.value).endswith("/past: no past is kept there, or none that you may see")
    await source.close()


Script = Callable[["Answers", int], None]


class Answers(BaseHTTPRequestHandler):
    """Answers as a script says, which is told how often it was asked before."""

    protocol_version = "HTTP/1.1"
    script: Script
    asked: list[str]

    def do_GET(self) -> None:
        """One answer."""
        self.asked.append(self.path)
        type(self).script(self, len(self.asked) - 1)

    def send(self, status: int, body: bytes = b"", **headers: str) -> None:
        """Send one."""
        self.send_response(status)
        for name, value in ({"content_length": str(len(body))} | headers).items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Silence."""


@contextlib.asynccontextmanager
async def answering(script: Script, ask_s: float = 0.0) -> AsyncIterator[tuple[HttpSource, list[str]]]:
    """A source at a server that follows a script, and what that was asked.

    By the source's clock each request takes `ask_s`, and nothing else takes any time.
    """
    asked: list[str] = []
    handler = type("Scripted", (Answers,), {"script": staticmethod(script), "asked": asked})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    source = HttpSource(
        f"http://127.0.0.1:{server.server_port}/below", "r", "public", "token", lambda: ask_s * len(asked)
    )
    try:
        yield source, asked
    finally:
        await source.close()
        server.shutdown()
        server.server_close()
        thread.join()


def busy_first(answer: Answers, before: int) -> None:
    if before == 0:
        answer.send(200, SUMMARY)
    elif before == 1:
        answer.send(503, b'{"error":"busy"}', retry_after="0")
    elif before == 2:  # the connection breaks off within the answer
        answer.send(200, b"", content_length="500")
        answer.close_connection = True
    else:
        answer.send(200, SUMMARY)


async def test_what_may_pass_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_source, "WAIT_S", 0.01)
    async with answering(busy_first) as (source, asked):
        assert await source.find_span() == (PAGE_MS, PAGE_MS + 1)
        assert await source.find_span() == (PAGE_MS, PAGE_MS + 1)
        assert asked == ["/below/api/v1/robots/r/past?view=public"] * 4


async def test_at_last_it_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_source, "WAIT_S", 0.01)
    away: Script = lambda answer, _: answer.send(503, b'{"error":"away"}')  # noqa: E731
    async with answering(away, ask_s=20.0) as (source, asked):
        with pytest.raises(PastUnreadable) as caught:
            await source.find_span()
        assert str(caught.value).endswith("/past?view=public: gave up after 60 s: away")
        assert len(asked) == 3  # within the minute


@pytest.mark.parametrize(
    ("status", "requests"),
    [
        ((200, b'{"status":"online"}'), 5),
        ((200, b'{"status":"offline"}'), 3),
        ((404, b"{}"), 3),
        ((503, b"{}"), 5),
    ],
)
async def test_one_file_is_waited_for_unless_the_robot_is_off(
    monkeypatch: pytest.MonkeyPatch, status: tuple[int, bytes], requests: int
) -> None:
    monkeypatch.setattr(http_source, "WAIT_S", 0.01)
    away: Script = lambda answer, _: answer.send(  # noqa: E731
        *((503, b'{"error":"away"}') if "/model/" in answer.path else status)
    )
    async with answering(away, ask_s=20.0) as (source, asked):
        waited = "gave up after 60 s: " if requests > 3 else ""
        with pytest.raises(PartAway, match=rf"manifest\.json: {waited}away$"):
            await source.load_manifest("5c" * 32)
        assert len(asked) == requests
        for _ in range(2):
            with pytest.raises(PartAway, match=r"a\.glb: away$"):
                await source.load_model_file("5c" * 32, "a.glb", "5c" * 32, 1)
        assert len(asked) == requests + 2


SEGMENT = ListedSegment(10, 0, PAGE_MS, PAGE_MS + 1, "5c" * 32)


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (lambda answer, _: answer.send(200, b"x" * (4 << 20) + b"xx"), "the answer is over 4194304 bytes"),
        (lambda answer, _: answer.send(200, b"[]"), "not the answer of a relay"),
        (lambda answer, _: answer.send(200, b"<html>"), "not the answer of a relay"),
        (lambda answer, _: answer.send(200, b'{"view":"../x"}'), "not the answer of a relay (view)"),
        (
            lambda answer, _: answer.send(200, SUMMARY.replace(str(PAGE_MS).encode(), b'"now"')),
            "not the answer of a relay (from_ms, to_ms, days)",
        ),
        (lambda answer, _: answer.send(302, location="https://other.example/"), "status 302"),
        (lambda answer, _: answer.send(401, b'{"error":"the token has expired"}'), "the token has expired"),
        (lambda answer, _: answer.send(403, b'{"error":"' + "\u202e".encode() + b'"}'), "\\u{202e}"),
        (lambda answer, _: answer.send(500, b"x" * 10_000_000), "status 500"),
    ],
)
async def test_an_odd_answer_is_one_line(script: Script, says: str) -> None:
    async with answering(script) as (source, asked):
        with pytest.raises(PastUnreadable) as caught:
            await source.find_span()
        said = str(caught.value)
        assert said.endswith(f"/past?view=public: {says}")
        assert said.isprintable()
        assert len(asked) == 1


async def test_bytes_of_another_hash_are_asked_for_twice_and_refused() -> None:
    def lying(answer: Answers, before: int) -> None:
        answer.send(200, b"other", content_type="application/octet-stream")

    async with answering(lying) as (source, asked):
        for load in (
            source.load_segment(SEGMENT),
            source.load_schema("5c" * 32),
            source.load_manifest("5c" * 32),
            source.load_model_file("5c" * 32, "a b.glb", "5c" * 32, 5),
        ):
            with pytest.raises(PastUnreadable) as caught:
                await load
            assert str(caught.value).endswith(": damaged twice in transit: its SHA-256 does not match")
        assert len(asked) == 8
        assert asked[-1].endswith(f"/model/{'5c' * 32}/a%20b.glb")


async def test_a_segment_that_is_not_there_any_more() -> None:
    said = [
        (404, b'{"error":"gone"}', "application/json"),
        (204, b"", ""),
        (200, b'{"next":{"take":"000000000000000b","index":0}}', "application/json"),
    ]

    def gone(answer: Answers, before: int) -> None:
        status, body, kind = said[before]
        answer.send(status, body, content_type=kind)

    async with answering(gone) as (source, _):
        for _ in said:
            assert await source.load_segment(SEGMENT) is None


async def test_a_segment_of_another_content_type_says_so() -> None:
    def mistaken(answer: Answers, before: int) -> None:
        answer.send(200, b"segment", content_type="text/html")

    named = dataclasses.replace(SEGMENT, sha256=hashlib.sha256(b"segment").hexdigest())
    async with answering(mistaken) as (source, _):
        with pytest.raises(PastDamaged) as caught:
            await source.load_segment(named)
    assert str(caught.value) == "not a segment: its Content-Type is text/html, not application/octet-stream"


@pytest.mark.parametrize(
    "head", [b"HTTP/1.1 200 OK\r\ncontent-length: 9000\r\n\r\n", b"HTTP/1.1 200 OK\r\nx: "]
)
async def test_an_answer_in_drops_is_given_up(monkeypatch: pytest.MonkeyPatch, head: bytes) -> None:
    monkeypatch.setattr(http_source, "SLOW_S", 0.3)
    monkeypatch.setattr(http_source, "AGAIN_S", 0.1)

    def drip(answer: Answers, before: int) -> None:
        if before == 0:
            answer.send(404)
            return
        with contextlib.suppress(OSError):
            answer.wfile.write(head)
            for _ in range(8000):
                answer.wfile.write(b"x")
                time.sleep(0.01)

    async with answering(drip) as (source, _):
        assert await source.load_schema("5c" * 32) is None
        with pytest.raises(PastUnreadable) as caught:
            await asyncio.wait_for(source.load_schema("5c" * 32), 10)
    assert "too slow: under 10 kB/s after 0.3 s" in str(caught.value)


async def test_a_connection_is_kept_for_the_next_answer() -> None:
    ports: set[int] = set()

    def whole(answer: Answers, before: int) -> None:
        ports.add(answer.client_address[1])
        answer.send(200, b"text" * 50_000)

    sha256 = hashlib.sha256(b"text" * 50_000).hexdigest()
    async with answering(whole) as (source, asked):
        for _ in range(20):
            assert await source.load_schema(sha256) == "text" * 50_000
    assert len(asked) == 20
    assert len(ports) <= http_source.AT_ONCE


def send_ok(body: bytes, answer: Answers, _: int) -> None:
    answer.send(200, body)


async def test_an_index_that_goes_on_for_ever_or_lies_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_source, "PARTS_MAX", 10)
    entry = {"take": "a" * 16, "index": 1, "from_ms": PAGE_MS, "to_ms": PAGE_MS, "sha256": "5c" * 32}

    def endless(answer: Answers, _: int) -> None:
        answer.send(200, json.dumps({"segments": [entry], "more": True}).encode())

    async with answering(endless) as (source, asked):
        with pytest.raises(PastUnreadable) as caught:
            await source.list_segments(PAGE_MS, PAGE_MS + 1)
        assert str(caught.value).endswith(": the index does not end")
        assert asked[1].endswith("?after=aaaaaaaaaaaaaaaa,1")
    for wrong in ({"take": "A" * 16}, {"index": -1}, {"index": 1 << 32}, {"from_ms": 1.5}, {"sha256": None}):
        body = json.dumps({"segments": [entry | wrong], "more": False}).encode()
        script = partial(send_ok, body)
        async with answering(script) as (source, _):
            with pytest.raises(PastUnreadable):
                await source.list_segments(PAGE_MS, PAGE_MS + 1)


async def test_requests_are_bounded_and_an_end_does_not_wait() -> None:
    release = threading.Event()

    def hold(answer: Answers, _: int) -> None:
        release.wait(20)
        answer.send(404)

    async with answering(hold) as (source, asked):
        tasks = [asyncio.create_task(source.load_segment(SEGMENT)) for _ in range(30)]
        while len(asked) < http_source.AT_ONCE:
            await asyncio.sleep(0.01)
        await source.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert len(asked) == http_source.AT_ONCE
        release.set()


@pytest.mark.parametrize(
    "address",
    [
        "",
        "relay",
        "ftp://x",
        "http://",
        "http://x:99999",
        "http://u:p@x",
        "http://x?y",
        "http://x#y",
        "http://\n",
    ],
)
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(PastUnreadable) as caught:
        HttpSource(address, "r", None, None)
    assert str(caught.value).isprintable()
    assert str(caught.value).endswith(": not the address of a relay: use http://HOST:PORT or https://HOST")
