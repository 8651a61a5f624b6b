"""A model's file on its way out: in pieces, as long as it is kept, and as long as its asker is there."""

from __future__ import annotations

import asyncio
import gzip
import os
import socket
import threading
from functools import partial
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from fastapi import Request
from posecast_relay.http.models import PIECE_BYTES, GzipCache, make_model_answer, make_packed_name
from posecast_relay.models.cache import RANGE_BYTES, ModelCache
from posecast_relay.models.memory import ENTRY_BYTES, IN_USE_S, ModelMemory
from posecast_relay.net.http1 import AnswerAborted
from posecast_testing import until

from .stage import Model, Relay
from .test_http_connection import asking
from .test_model_cache import Edge, bytes_of

MB = 1_000_000


def request(**headers: str) -> Request:
    """With these headers."""
    raw = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return Request({"type": "http", "method": "GET", "headers": raw})


class Reader:
    """Takes an answer's messages."""

    def __init__(self) -> None:
        self.body = b""
        self.sizes: list[int] = []
        self.start: dict[str, Any] = {}

    async def send(self, message: Any) -> None:
        """As ASGI has it."""
        if message["type"] == "http.response.start":
            self.start = {k.decode(): v.decode() for k, v in message["headers"]}
        else:
            self.body += message["body"]
            self.sizes.append(len(message["body"]))


async def never() -> Any:
    """Nothing is received."""
    raise AssertionError


async def answered(models: ModelCache, edge: Edge, path: str, **headers: str) -> Reader:
    """The whole answer."""
    found = await models.load_file("r", edge.digest, path)
    response = await make_model_answer(request(**headers), models, GzipCache(models.room), "r", found)
    reader = Reader()
    await response({"type": "http", "method": "GET"}, never, reader.send)
    return reader


async def test_it_travels_in_small_pieces() -> None:
    data = bytes_of(1, MB)
    edge = Edge({"a.stl": data})
    reader = await answered(ModelCache(edge, 3 * MB), edge, "a.stl")
    assert reader.body == data
    assert max(reader.sizes) == PIECE_BYTES
    assert reader.start["content-length"] == str(MB)


async def test_packed_likewise() -> None:
    data = b"joint " * 100_000
    edge = Edge({"a.stl": data})
    models = ModelCache(edge, 3 * MB)
    reader = await answered(models, edge, "a.stl", accept_encoding="gzip")
    assert gzip.decompress(reader.body) == data
    assert reader.start["content-encoding"] == "gzip"
    assert (await answered(models, edge, "a.stl")).body == data


async def test_an_empty_file_is_an_answer() -> None:
    edge = Edge({"a.stl": b""})
    assert (await answered(ModelCache(edge, MB), edge, "a.stl")).sizes == [0]


async def test_what_has_to_go_meanwhile_breaks_off() -> None:
    clock = SimpleNamespace(now=0.0)
    edge = Edge({"a.stl": bytes_of(1, 600_000), "b.stl": bytes_of(2, 600_000)})
    models = ModelCache(edge, MB, lambda: clock.now)
    found = await models.load_file("r", edge.digest, "a.stl")
    response = await make_model_answer(request(), models, GzipCache(models.room), "r", found)
    taken = 0

    async def send(message: Any) -> None:
        nonlocal taken
        taken += len(message.get("body", b""))
        if taken >= 5 * PIECE_BYTES:
            clock.now += IN_USE_S
            await models.load_file("r", edge.digest, "b.stl")

    with pytest.raises(AnswerAborted):
        await response({"type": "http", "method": "GET"}, never, send)
    assert taken == 5 * PIECE_BYTES


class Gated(Model):
    """Answers for the first range only when it is let."""

    def __init__(self, size: int) -> None:
        super().__init__({"a.glb": (bytes_of(1, size), "model/gltf-binary")})
        self.begun, self.let = threading.Event(), threading.Event()
        self.offsets: list[int] = []

    def answer(self, key: str, parameters: dict[str, str]) -> bytes | None:
        """As an edge does."""
        if not key.endswith("manifest"):
            self.offsets.append(int(parameters["off"]))
            self.begun.set()
            assert self.let.wait(20)
        return super().answer(key, parameters)


async def test_a_real_edge_is_asked_no_longer_than_somebody_waits(relay: Relay, edges: Any) -> None:
    model = Gated(4 * RANGE_BYTES)
    edges(relay, model=model)
    path = f"{relay.path}/model/{model.digest}/a.glb"

    def ask_and_leave() -> None:
        until("it is announced", partial(is_announced, relay))
        with asking(relay, path) as sock:
            assert model.begun.wait(20)
            sock.shutdown(socket.SHUT_WR)
            assert sock.recv(1) == b""  # the relay knows
        model.let.set()

    await asyncio.to_thread(ask_and_leave)
    answer = await asyncio.to_thread(httpx.get, relay.base + path)
    assert answer.content == bytes_of(1, 4 * RANGE_BYTES)
    assert model.offsets == [0, 0, RANGE_BYTES, 2 * RANGE_BYTES, 3 * RANGE_BYTES]


def is_announced(relay: Relay) -> bool:
    """Whether its robot has a model."""
    answer = httpx.get(relay.api)
    return answer.status_code == 200 and answer.json()["model"] is not None


def ask_manifest(relay: Relay, model: Model) -> httpx.Response:
    """When it can be asked for."""
    until("it is announced", partial(is_announced, relay))
    return httpx.get(f"{relay.api}/model/{model.digest}/manifest.json", timeout=20)


@pytest.mark.parametrize(("size", "ranges"), [(2 * RANGE_BYTES - 1, 2), (2 * RANGE_BYTES, 3), (1 << 20, 5)])
async def test_a_large_manifest_comes_in_ranges(size: int, ranges: int, relay: Relay, edges: Any) -> None:
    files = {"a.glb": (b"a", "model/gltf-binary")}
    model = Model(files, note="n" * (size - len(Model(files, note="").manifest)))
    assert len(model.manifest) == size
    edges(relay, model=model)
    answer = await asyncio.to_thread(ask_manifest, relay, model)
    assert answer.content == model.manifest
    assert model.asked == ["manifest"] * ranges


async def test_a_manifest_that_is_too_large_is_said_to_be(relay: Relay, edges: Any) -> None:
    model = Model({}, note="n" * (1 << 20))
    edges(relay, model=model)
    answer = await asyncio.to_thread(ask_manifest, relay, model)
    assert answer.status_code == 503
    assert "more than 1048576 bytes" in answer.text


# ---- packing once, within bounds -----------------------------------------------------


def room_with(**files: bytes) -> ModelMemory:
    """What is kept of a robot."""
    room = ModelMemory(1_000_000, lambda: 0.0)
    for name, data in files.items():
        claim = room.claim("r", len(data), lambda: None)
        assert claim is not None
        room.keep(claim, name, data, len(data))
        room.release(claim)
    return room


async def test_what_shrinks_is_packed_once_and_unpacks_to_the_same() -> None:
    text = b"joint " * 1000
    room = room_with(a=text)
    packed = GzipCache(room)
    sizes = await asyncio.gather(packed.pack("r", "a"), packed.pack("r", "a"))
    made = room.get(make_packed_name("a"))
    assert isinstance(made, bytes)
    assert set(sizes) == {len(made)}
    assert gzip.decompress(made) == text
    assert await packed.pack("r", "a") == len(made) < 100
    assert room.get(make_packed_name("a")) is made
    assert room.used == len(text) + len(made) + 2 * ENTRY_BYTES


async def test_what_does_not_shrink_is_left_alone_and_not_tried_twice() -> None:
    room = room_with(noise=os.urandom(10_000))
    packed = GzipCache(room)
    assert await packed.pack("r", "noise") == 0
    assert room.get(make_packed_name("noise")) == b""
    assert await packed.pack("r", "noise") == 0
    assert room.used == 10_000 + 2 * ENTRY_BYTES


async def test_what_is_not_here_is_not_packed_and_all_stays_within_the_room() -> None:
    room = room_with(a=b"joint " * 100_000)
    assert await GzipCache(room).pack("r", "b") == 0
    assert room.claim("other", 300_000, lambda: None)
    assert (
        await GzipCache(room).pack("r", "a") > 0
    )  # beside the other's there was room for one of the two only
    assert room.get("a") is None
    assert room.used < room.most
