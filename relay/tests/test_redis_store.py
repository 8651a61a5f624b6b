"""The newest state in a real Redis, and a relay that does not mind when Redis is gone."""

from __future__ import annotations

import asyncio
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import redis
from posecast_relay.redis.client import generation_key, state_key
from posecast_testing import until
from posecast_wire import Decoder

from .certificates import certificates
from .operator_pages import DOCS
from .redis_server import Redis
from .stage import Relay, Watcher

STATE = "posecast:{r}:public:state"


def client(server: Redis) -> Any:
    """A plain client."""
    return redis.Redis(port=server.port, socket_timeout=5)


def ready(relay: Relay) -> dict[str, str]:
    """What /readyz says; always 200 here."""
    answer = httpx.get(f"http://{relay.address}/readyz")
    assert answer.status_code == 200
    return dict(answer.json())


def decoded_seq(server: Redis) -> int:
    """The newest state in Redis, decoded as a reader would; -1 while there is none."""
    state = client(server).hgetall(STATE)
    if not state:
        return -1
    decoder = Decoder()
    decoder.add_schema(state[b"schema"].decode())
    decoder.decode(state[b"key"])
    assert state[b"ref"] == b"", "a relay of before refuses a state without it"
    frame = decoder.decode(state[b"frame"])
    assert frame.seq == int(state[b"seq"])
    return frame.seq


def test_names() -> None:
    assert state_key("r", "public") == STATE
    assert generation_key("r") == "posecast:{r}:generation"


async def test_the_newest_state_stands_in_redis(relays: Any, edges: Any, redis_server: Redis) -> None:
    relay = relays("--store", redis_server.url)
    edge = edges(relay.zenoh)
    edge.edge.info = {"mode": "walking"}
    edge.event("jam")
    await asyncio.to_thread(until, "frames", lambda: edge.seq > 40)
    edge.event("jam", "off")
    edge.silent = True
    last = edge.seq
    await asyncio.to_thread(until, "the newest", lambda: decoded_seq(redis_server) == last)
    store = client(redis_server)
    state = store.hgetall(STATE)
    assert state[b"run"] == b"000000000000000e"
    assert state[b"generation"] == store.get("posecast:{r}:generation")
    assert 3500 < store.ttl(STATE) <= 3600
    await asyncio.to_thread(until, "events", lambda: len(json.loads(store.hget(STATE, "events"))) == 2)
    assert ready(relay) == {"status": "ready"}


async def test_a_new_run_has_the_next_generation(relays: Any, edges: Any, redis_server: Redis) -> None:
    relay = relays("--store", redis_server.url)
    edges(relay.zenoh)
    await asyncio.to_thread(until, "a state", lambda: decoded_seq(redis_server) > 5)
    store = client(redis_server)
    before = int(store.hget(STATE, "generation"))
    edges(relay.zenoh, run_id=0xF)
    await asyncio.to_thread(until, "the new run", lambda: store.hget(STATE, "run") == b"000000000000000f")
    assert int(store.hget(STATE, "generation")) > before
    assert store.get("posecast:{r}:generation") == store.hget(STATE, "generation")


async def test_viewers_notice_nothing_when_redis_dies_and_it_is_filled_again(
    relays: Any, edges: Any, redis_server: Redis
) -> None:
    relay = relays("--store", redis_server.url)
    edge = edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        await asyncio.to_thread(until, "a state", lambda: decoded_seq(redis_server) > 5)
        await asyncio.to_thread(redis_server.kill)
        seq = viewer.frames[-1][1].seq
        await asyncio.to_thread(until, "degraded", lambda: ready(relay)["status"] == "degraded")
        await viewer.until("three more seconds", lambda v: v.frames[-1][1].seq > seq + 90)
        seqs = [frame.seq for _, frame in viewer.frames if frame.seq > seq]
        # Of about 91; 12 if it waited for Redis. Two loaded cores lose some before the relay.
        assert len(seqs) > 45
        await asyncio.to_thread(redis_server.start)
        behind = edge.seq
        await asyncio.to_thread(until, "filled again", lambda: decoded_seq(redis_server) > behind, 4.0)
        assert ready(relay) == {"status": "ready"}


async def test_a_store_that_is_not_there_is_degraded_and_joined_later(
    relays: Any, edges: Any, redis_server: Redis
) -> None:
    redis_server.kill()
    relay = relays("--store", redis_server.url)
    gateway = relays("--role", "gateway", "--store", redis_server.url)
    edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer, Watcher(gateway.url()) as beside:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        assert all("degraded" not in said for said in viewer.told("status"))
        await beside.until("its word", lambda v: v.told("status"))
        assert beside.told("status")[0]["degraded"] is True
        for each in (relay, gateway):
            said = ready(each)
            live, _, past = said.pop("why").partition("; the past: ")
            assert said == {"status": "degraded"}
            assert live == "redis: ConnectionError"
            assert past == ("" if each is relay else live)  # who records reads its own
            lines = [line for line in each.errors().splitlines() if "Error 111 connecting" in line]
            # each of its connections says it once
            assert sorted("the past" in line for line in lines) == [False, True]
            assert sum("viewers" in line for line in lines) == 1
        await asyncio.to_thread(redis_server.start)
        await asyncio.to_thread(until, "a state", lambda: decoded_seq(redis_server) > 5)
        await beside.until("frames", lambda v: len(v.frames) > 20)
        assert "degraded" not in beside.told("status")[-1]
    for each in (relay, gateway):
        await asyncio.to_thread(until, "ready", lambda each=each: ready(each) == {"status": "ready"})


async def test_what_others_left_in_redis_upsets_nobody(relays: Any, edges: Any, redis_server: Redis) -> None:
    store = client(redis_server)
    seconds = store.time()[0]
    for rest in ("{not json", "[]", "\xff", "7", ""):
        for board in ("robots", "viewers", "ingests"):
            store.hset(f"posecast:{{-}}:{board}", f"odd {rest}", f"{seconds} {rest}")
    odd = {"events": "[7]", "numbering": "x", "generation": 0, "schema": "none", "key": b"k"}
    store.hset(STATE, mapping=odd)
    relay = relays("--store", redis_server.url)
    gateway = relays("--role", "gateway", "--store", redis_server.url)
    async with Watcher(gateway.url()) as viewer:
        edge = edges(relay.zenoh)
        await viewer.until("frames", lambda v: len(v.frames) > 20)
        edge.event("jam")
        await viewer.until("an event", lambda v: [e["n"] for e in v.told("event")] == [1])
        robots = f"http://{gateway.address}/api/v1/robots"

        def listed() -> bool:  # the gateway reads the list once a second
            return [robot["robot"] for robot in httpx.get(robots).json()["robots"]] == ["r"]

        await asyncio.to_thread(until, "the robot in the list, alone", listed)
    for each in (relay, gateway):
        await asyncio.to_thread(until, "ready", lambda each=each: ready(each) == {"status": "ready"})


PAGE = (DOCS / "how-to/scale/redis.md").read_text(encoding="utf-8")


def test_redis_runs_as_the_page_configures_it(redis_server: Redis) -> None:
    (block,) = re.findall(r"^```text\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    wanted = dict(line.split(" ", 1) for line in block.splitlines())
    with redis.Redis.from_url(redis_server.url, decode_responses=True) as client:
        for name, value in wanted.items():
            client.config_set(name, value.strip('"'))
        client.auth(wanted["requirepass"])
        found = {name: client.config_get(name)[name] for name in wanted}
    assert found == wanted | {"save": "", "maxmemory": str(512 << 20)}


PASSWORD = "CANARY-7319"


@pytest.fixture
def tls_redis(tmp_path: Path) -> Iterator[Redis]:
    """Speaks TLS only."""
    if shutil.which("redis-server") is None:
        pytest.skip("no redis-server here")
    certificates(tmp_path, "redis")
    server = Redis(tmp_path, "--requirepass", PASSWORD, "--tls-auth-clients", "no")
    server.start(tls=tmp_path)
    server.url = f"rediss://:{PASSWORD}@127.0.0.1:{server.port}?ssl_ca_certs={tmp_path / 'ca.pem'}"
    yield server
    server.kill()


async def test_roles_meet_over_tls_and_whoever_cannot_check_the_server_does_not_talk_to_it(
    relays: Any, edges: Any, tls_redis: Redis
) -> None:
    ingest = relays("--role", "ingest", "--store", tls_redis.url)
    gateway = relays("--role", "gateway", "--store", tls_redis.url)
    stranger = relays("--role", "gateway", "--store", tls_redis.url.partition("?")[0])
    edges(ingest.zenoh)
    async with Watcher(gateway.url()) as viewer:
        await viewer.until("frames", lambda v: len(v.frames) > 20)
    ready = f"http://{gateway.address}/readyz"
    until("the past is read, too", lambda: httpx.get(ready).json() == {"status": "ready"})
    until("it says why", lambda: "CERTIFICATE_VERIFY_FAILED" in stranger.errors())
    said = httpx.get(f"http://{stranger.address}/readyz").json()
    assert said["status"] == "degraded"
    for relay in (ingest, gateway, stranger):
        assert PASSWORD not in relay.errors() + str(said)
