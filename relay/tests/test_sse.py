"""Other ways in: decoded JSON over the WebSocket, and server-sent events. One core, one send rule."""

from __future__ import annotations

import asyncio
import base64
import json
import socket
from itertools import pairwise
from typing import Any

import httpx
import pytest
import websockets
from posecast_relay.core import messages
from posecast_relay.http.robots import StateReader
from posecast_relay.kit import CREDIT_S
from posecast_relay.net.encodings import (
    CHANNELS_PER_S,
    ROBOT_CHANNELS_PER_S,
    DecodeCache,
    EventStreamEncoding,
    JsonEncoding,
)
from posecast_testing import free_port, until
from posecast_wire import Close, Decoder, Schema, build_schema_text

from .sim import World, mixed, schema, split
from .stage import Relay, Watcher
from .test_websocket import endings, stride


def parse_events(text: str) -> list[tuple[str, str]]:
    """Names and data of whole events, as a browser reads them (WHATWG HTML §9.2.6)."""
    found = []
    for block in text.split("\n\n")[:-1]:
        lines = [line.partition(": ")[::2] for line in block.split("\n")]
        if any(name == "data" for name, _ in lines):
            data = "\n".join(value for name, value in lines if name == "data")
            found.append((next((v for n, v in lines if n == "event"), "message"), data))
    return found


# ---- forms, by plain calls ------------------------------------------------------


def test_a_decoded_frame_is_made_once_for_all_and_needs_no_key() -> None:
    world = World()
    edge = world.on_air(mixed())
    world.run(edge, 0.5)
    stream = world.hub.robots["r"].rooms["public"].stream
    codes = [150, (1 << 28) * -1, 3, 0]
    world.publish(edge, edge.frame(world.now, codes))
    form, newest = JsonEncoding(DecodeCache()), stream.newest
    assert newest is not None
    assert newest.key is not None
    whole = stream.make_description(-1) + newest.key.packed + newest.packed
    found = [(op, json.loads(payload)) for op, payload in split(form.encode(whole, stream))]
    assert [(op, doc["type"]) for op, doc in found] == [(1, "schema"), (1, "frame")]
    assert found[1][1] == {
        "type": "frame", "seq": edge.seq, "t": round(newest.t_s, 6),
        "values": {"pos": [1.5, None], "flags": [3, 0]},
    }  # fmt: skip
    once = form.encode(newest.packed, stream)
    assert form.encode(newest.packed, stream) is once
    assert form.encode(messages.PING, stream) == messages.PING


def test_frames_that_do_not_decode_are_left_out_and_the_next_good_one_is_read() -> None:
    world = World()
    edge = world.on_air()
    stream = world.hub.robots["r"].rooms["public"].stream
    decoded = DecodeCache()
    good = edge.frame(world.now)
    world.publish(edge, good[:-1] if len(good) > 8 else good + b"\x80")
    assert decoded.make_text(stream) is None
    world.publish(edge)
    text = decoded.make_text(stream)
    assert text is not None
    assert json.loads(text)["seq"] == edge.seq


def test_every_message_becomes_an_event_named_by_its_type() -> None:
    world = World()
    edge = world.on_air()
    stream = world.hub.robots["r"].rooms["public"].stream
    data = (
        messages.make_status("online", 12, 3, now=0.0)
        + messages.make_text('{"type":"x",\n"a":"b\u2028"}')
        + messages.PING
    )
    assert stream.newest is not None
    events = parse_events(EventStreamEncoding().encode(data + stream.newest.packed, stream).decode())
    assert [name for name, _ in events] == ["status", "x", "frame"]
    assert json.loads(events[1][1]) == {"type": "x", "a": "b\u2028"}
    assert base64.b64decode(events[2][1]) == stream.newest.payload
    assert stream.newest.seq == edge.seq


def test_a_viewer_of_decoded_frames_counts_them_in_its_acknowledgements() -> None:
    world = World()
    edge = world.on_air()
    viewer, _ = world.join()
    viewer.decoded = True
    before = viewer.sent
    for _ in range(20):
        world.pass_time(0.1)
        world.publish(edge, edge.frame(world.now, force_key=edge.seq % 3 == 0))
    assert viewer.sent - before == 20


def test_a_viewer_that_cannot_speak_is_neither_pinged_nor_cut_for_silence() -> None:
    world = World()
    world.on_air()
    viewer, screen = world.join()
    viewer.speaks = False
    world.pass_time(60.0)
    assert screen.was_cut is None
    assert screen.pings == 0
    viewer.pause(world.now)
    world.pass_time(6.0)
    assert screen.was_cut is Close.NO_ACK


# ---- through real sockets -------------------------------------------------------


async def test_the_stream_as_json(relay: Relay, edges: Any) -> None:
    edge = edges(relay, of=mixed())
    docs: list[dict[str, Any]] = []
    async with websockets.connect(relay.url(query="?hz=10&format=json")) as connection:
        while sum(doc["type"] == "frame" for doc in docs) < 25:
            docs.append(json.loads(await asyncio.wait_for(connection.recv(decode=True), 10)))
            count = sum(doc["type"] == "frame" for doc in docs)
            if docs[-1]["type"] == "frame" and count % 10 == 0:
                await connection.send(json.dumps({"type": "ack", "n": count}))
    assert [doc["type"] for doc in docs if doc["type"] != "status"][:3] == ["hello", "schema", "frame"]
    frames = [doc for doc in docs if doc["type"] == "frame"]
    assert stride([doc["seq"] for doc in frames]) >= 2
    for doc in frames:  # the edge of the tests puts its seq into every code
        assert doc["values"]["pos"] == pytest.approx([doc["seq"] * 0.01] * 2)
        assert doc["values"]["flags"] == [doc["seq"]] * 2
    assert edge.seq >= frames[-1]["seq"]


async def read_events(
    relay: Relay, query: str, enough: Any, deadline_s: float = 15.0
) -> tuple[httpx.Response, list[tuple[str, str]]]:
    text = ""
    async with httpx.AsyncClient(timeout=deadline_s) as client:
        url = f"{relay.api}/live.sse{query}"
        async with client.stream("GET", url) as response:
            async for part in response.aiter_text():
                text += part
                if enough(parse_events(text)):
                    break
    return response, parse_events(text)


async def test_server_sent_events_bring_the_same(relay: Relay, edges: Any) -> None:
    edge = edges(relay)

    def enough(events: list[tuple[str, str]]) -> bool:
        names = [name for name, _ in events]
        if names.count("frame") == 10:
            edge.event("jam")
        return names.count("frame") >= 30 and "event" in names

    response, events = await read_events(relay, "?hz=10", enough)
    assert response.status_code == 200
    assert response.headers["content-type"] == "text/event-stream"
    assert response.headers["cache-control"] == "no-store"
    assert response.headers["access-control-allow-origin"] == "*"
    told = [(name, data) for name, data in events if name != "status"]
    assert [name for name, _ in told[:3]] == ["hello", "schema", "frame"]
    decoder = Decoder()
    decoder.add_schema(told[1][1])
    frames = [decoder.decode(base64.b64decode(data)) for name, data in events if name == "frame"]
    assert all(frame.codes == (frame.seq,) * 2 for frame in frames)
    assert stride([frame.seq for frame in frames][-20:]) >= 2
    assert next(json.loads(data)["text"] for name, data in events if name == "event") == "jam"
    _, decoded = await read_events(relay, "?format=json", lambda e: [n for n, _ in e].count("frame") > 5)
    seqs = [json.loads(data)["seq"] for name, data in decoded if name == "frame"]
    assert all(b > a for a, b in pairwise(seqs))
    assert httpx.get(relay.api).json()["viewers"] <= 1  # who went is not counted for long


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("r/live.sse?hz=fast", 400),
        ("r/live.sse?format=xml", 400),
        ("R*/live.sse", 404),
        ("r/live.sse?view=lab", 403),
    ],
)
def test_what_is_no_stream_gets_a_status(relay: Relay, path: str, status: int) -> None:
    answer = httpx.get(f"{relay.base}/api/v1/robots/{path}")
    assert answer.status_code == status
    assert answer.json()["error"]
    assert answer.headers["access-control-allow-origin"] == "*"


def test_public_routes_may_be_read_from_any_page(relay: Relay) -> None:
    base = f"{relay.base}/api/v1/robots"
    for path in ("", "/r", "/r/state", "/r/model/x/manifest.json", "/r/live.sse?hz=x", "/../nothing"):
        answer = httpx.get(base + path, headers={"Origin": "https://elsewhere.example"})
        assert answer.headers["access-control-allow-origin"] == "*", path
        assert "access-control-allow-credentials" not in answer.headers
        preflight = httpx.options(base + path, headers={"Access-Control-Request-Method": "GET"})
        assert preflight.status_code == 204
        assert preflight.headers["access-control-allow-methods"] == "GET, OPTIONS"
        assert preflight.headers["access-control-allow-origin"] == "*"


async def test_full_and_drain_are_told_with_when_to_come_again(relays: Any) -> None:
    relay = relays("--max-viewers", "1")
    url = f"{relay.api}/live.sse"
    async with httpx.AsyncClient(timeout=10) as client, client.stream("GET", url) as first:
        parts = first.aiter_text()
        text = await anext(parts)
        second = (await client.get(url)).text
        ((name, data),) = parse_events(second)
        assert (name, json.loads(data)["code"], json.loads(data)["retry_s"]) == ("bye", Close.FULL, 30.0)
        assert 30_000 <= int(second.rsplit("retry: ", 1)[1]) <= 45_000
        relay.process.terminate()
        async for part in parts:
            text += part
    name, data = parse_events(text)[-1]
    assert (name, json.loads(data)["code"]) == ("bye", Close.DRAIN)
    assert await asyncio.to_thread(relay.process.wait, 10) == 0


async def test_a_reader_that_stops_is_cut_and_hurts_nobody(relays: Any, edges: Any) -> None:
    port = free_port()
    relay = relays("--metrics-port", str(port))
    edges(relay, of=schema([f"J{n}" for n in range(3000)]))
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.connect(("127.0.0.1", relay.http))
        sock.sendall(
            b"GET /api/v1/robots/r/live.sse?hz=60 HTTP/1.1\r\nHost: x\r\n\r\n" + b"GET / HTTP/1.1\r\n\r\n"
        )
        async with Watcher(relay.url()) as viewer:
            cut = 'code="4409"} 1.0'
            await asyncio.to_thread(until, "it is cut", lambda: cut in endings(relay, port), 60.0)
            assert viewer.closed is None


async def test_events_after_another_answer_on_one_connection(relay: Relay, edges: Any) -> None:
    edges(relay)
    reader, writer = await asyncio.open_connection("127.0.0.1", relay.http)
    writer.write(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
    assert (await asyncio.wait_for(reader.readuntil(b"ok\n"), 10)).startswith(b"HTTP/1.1 200")
    writer.write(f"GET {relay.path}/live.sse HTTP/1.1\r\nHost: x\r\n\r\n".encode())
    text = (await asyncio.wait_for(reader.readuntil(b"event: frame\n"), 10)).decode()
    assert "text/event-stream" in text
    writer.close()


def test_every_write_tells_when_it_was_made(relay: Relay, edges: Any) -> None:
    edges(relay)
    stamps: list[int] = []
    with httpx.stream("GET", f"{relay.api}/live.sse?hz=30", timeout=15) as answer:
        for line in answer.iter_lines():
            if line.startswith("id: "):
                stamps.append(int(line[4:]))
            if len(stamps) >= 10:
                break
    assert stamps == sorted(stamps)
    assert stamps[-1] > stamps[0]


async def test_stream_and_ping_tell_one_clock(relay: Relay, edges: Any) -> None:
    edges(relay)
    base = f"{relay.base}/api/v1"
    told: list[int] = []

    async def ask(client: httpx.AsyncClient) -> None:
        answer = await client.get(f"{base}/ping?t=1732790000123.25")
        assert answer.headers["cache-control"] == "no-store"
        assert answer.headers["access-control-allow-origin"] == "*"
        doc = answer.json()
        assert (doc["type"], doc["t"]) == ("pong", 1732790000123.25)
        told.append(doc["clock_ms"])

    async with httpx.AsyncClient(timeout=15) as client:
        await ask(client)
        async with client.stream("GET", f"{relay.api}/live.sse") as events:
            lines = events.aiter_lines()
            told.append(int((await anext(line async for line in lines if line.startswith("id: ")))[4:]))
        await ask(client)
        async with websockets.connect(relay.url()) as connection:
            docs = [json.loads(await connection.recv()) for _ in range(2)]
            told.append(docs[1]["clock_ms"])  # its status
            await connection.send('{"type":"ping","t":42}')
            while docs[-1]["type"] != "pong":
                said = await connection.recv()
                docs += [json.loads(said)] if isinstance(said, str) else []
            told.append(docs[-1]["clock_ms"])
        await ask(client)
        for wrong in ("x", "nan", "1e999", ""):
            assert (await client.get(f"{base}/ping?t={wrong}")).status_code == 400
    assert told == sorted(told)
    assert told[-1] - told[0] < 60_000


# ---- decoding for those who ask ------------------------------------------------------


def wide(channels: int) -> Schema:
    """A schema of so many."""
    fields: list[dict[str, object]] = [{"name": "pos", "labels": "joint", "unit": "rad", "scale": 0.001}]
    return Schema.parse(build_schema_text("sim", {"joint": [f"j{n}" for n in range(channels)]}, fields))


def decoded_in(
    world: World, decoded: DecodeCache, channels: int, robots: int, seconds: float
) -> dict[str, int]:
    """Frames at 60 Hz of robots that are all asked for: how many were decoded of each."""
    edges = {f"r{n}": world.on_air(wide(channels), robot=f"r{n}") for n in range(robots)}
    found = dict.fromkeys(edges, 0)
    for _ in range(round(60 * seconds)):
        world.pass_time(1 / 60)
        for name, edge in edges.items():
            world.publish(edge, robot=name)
            found[name] += decoded.make_text(world.hub.robots[name].rooms["public"].stream) is not None
    return found


def test_a_humanoid_is_decoded_at_every_rate() -> None:
    world = World()
    assert decoded_in(world, DecodeCache(lambda: world.now), 244, 1, 2.0)["r0"] == 120


def test_a_robot_of_many_channels_has_its_share() -> None:
    world = World()
    found = decoded_in(world, DecodeCache(lambda: world.now), 4096, 1, 4.0)["r0"]
    most = ROBOT_CHANNELS_PER_S * (4.0 + CREDIT_S) / 4096
    assert 0.7 * most - 3 <= found <= most + 1


def test_many_of_them_share_what_there_is() -> None:
    world = World()
    found = decoded_in(world, DecodeCache(lambda: world.now), 1000, 10, 4.0)
    each = CHANNELS_PER_S / 10 * 4.0 / 1000
    assert sum(found.values()) <= 1.3 * 10 * each
    assert min(found.values()) >= 0.6 * each


def test_a_state_that_was_not_decoded_anew_says_how_old_it_is() -> None:
    world = World()
    edge = world.on_air(wide(4096))
    reader = StateReader(lambda: world.now, DecodeCache(lambda: world.now))
    robot = world.hub.robots["r"]
    ages, seqs = set[int](), set[int]()
    for _ in range(60):
        world.pass_time(1 / 60)
        world.publish(edge)
        doc = json.loads(reader.read(robot, robot.rooms["public"], 60.0))
        assert set(doc) == {"robot", "view", "status", "age_ms", "info", "seq", "t", "fields"}
        assert (edge.seq - doc["seq"]) * 1000 / 60 <= doc["age_ms"] + 1
        ages.add(doc["age_ms"])
        seqs.add(doc["seq"])
    assert len(seqs) < 20
    assert max(ages) >= 100


def test_a_document_with_half_a_character_is_an_answer() -> None:
    world = World()
    world.on_air(wide(2))
    robot = world.hub.robots["r"]
    robot.rooms["public"].stream.info = {"name": "\ud800"}
    body = StateReader(lambda: world.now, DecodeCache(lambda: world.now)).read(
        robot, robot.rooms["public"], 60.0
    )
    assert json.loads(body)["info"] == {"name": "?"}
