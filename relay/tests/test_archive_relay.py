"""The archive of a real relay: after a stop, after kill -9, from a gateway, and while the store is away."""

from __future__ import annotations

import json
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.archive.names import ArchivedName, read_segment_key
from posecast_testing import until
from posecast_wire.segment import decode_segment

from .archive_world import break_store
from .stage import Relay, ZenohEdge
from .test_past_relay import await_segment, find_newest, write

Start = Callable[..., Relay]
Edges = Callable[..., ZenohEdge]
POLICY = "[robots.r]\nkeep = '30d'\n[robots.r.anyone]\npast = '30d'\n"


@pytest.fixture
def start(tmp_path: Path, relays: Start) -> Start:
    """Start a relay that keeps `r` in the folder `store`."""
    write(tmp_path / "robots.toml", POLICY)
    (tmp_path / "store").mkdir()

    def run(*flags: str) -> Relay:
        return relays(
            *("--past", f"file://{tmp_path}/store", "--robots", str(tmp_path / "robots.toml")), *flags
        )

    return run


def list_there(folder: Path) -> dict[tuple[int, int], ArchivedName]:
    """The segments in the store, by take and index."""
    keys = [path.relative_to(folder).as_posix() for path in folder.rglob("*.segment")]
    names = [name for key in keys if (name := read_segment_key(key)) is not None]
    assert len(names) == len(keys)
    return {(name.name.take, name.name.index): name for name in names}


def check_readable(folder: Path) -> None:
    """Every segment is whole, and what is under another name is nothing that counts."""
    for name in list_there(folder).values():
        data = (folder / name.key).read_bytes()
        assert len(data) == name.size
        assert decode_segment(data).start.index == name.name.index
    for path in folder.rglob("*.json"):
        json.loads(path.read_bytes())


def list_shown(relay: Relay) -> set[tuple[int, int]]:
    """What the routes show, by take and index."""
    base = f"http://{relay.address}/api/v1/robots/r/past"
    shown: set[tuple[int, int]] = set()
    for day in httpx.get(base).json()["days"]:
        for minute in httpx.get(f"{base}/public/{day}").json()["minutes"]:
            page = httpx.get(f"{base}/public/{minute['minute'][:15]}0Z").json()
            shown |= {(int(each["take"], 16), each["index"]) for each in page["segments"]}
    return shown


def test_what_was_recorded_is_there_after_a_stop(tmp_path: Path, start: Start, edges: Edges) -> None:
    store = tmp_path / "store"
    relay = start()
    edge = edges(relay.zenoh)
    newest = await_segment(relay, edge, 2)
    address = f"/api/v1/robots/r/past/public/{newest['take']}/1"
    before = httpx.get(f"http://{relay.address}{address}")
    assert before.status_code == 200
    assert relay.stop() == 0
    there = list_there(store)
    take = int(newest["take"], 16)
    assert {(take, index) for index in range(newest["index"] + 1)} <= set(there)  # the open one, too
    check_readable(store)
    assert len(list(store.rglob("index.json"))) == len({name.page_ms for name in there.values()})
    assert len(list(store.rglob("day.json"))) >= 1
    again = start()
    until("the robot's past is there", lambda: list_shown(again) == set(there) or None)
    answer = httpx.get(f"http://{again.address}{address}")
    assert answer.content == before.content
    assert answer.headers["etag"] == before.headers["etag"]
    assert httpx.get(f"http://{again.address}/readyz").json()["status"] in ("ready", "degraded")


def kill_at_random(tmp_path: Path, start: Start, edges: Edges, rounds: int, seed: int) -> None:
    draw, store = random.Random(seed), tmp_path / "store"
    for _ in range(rounds):
        relay = start()
        edge = edges(relay.zenoh)
        await_segment(relay, edge, 0)
        kill_at = time.monotonic() + draw.uniform(0.0, 4.0)
        newest = find_newest(relay)
        while time.monotonic() < kill_at:
            edge.force_key = True
            time.sleep(0.02)
            newest = find_newest(relay)
        relay.stop(signal.SIGKILL)
        edge.silent = True
        assert newest is not None
        check_readable(store)
        there = set(list_there(store))
        take = int(newest["take"], 16)
        for index in range(newest["index"]):  # all that was closed but the one that was being put
            assert (take, index) in there
    again = start()
    until("all of it is shown", lambda: list_shown(again) == set(list_there(store)) or None, 30.0)
    pages = {name.page_ms for name in list_there(store).values()}
    until("indexes are made anew", lambda: len(list(store.rglob("index.json"))) >= len(pages) or None, 30.0)


def test_after_kill_nine_nothing_is_unreadable(tmp_path: Path, start: Start, edges: Edges) -> None:
    kill_at_random(tmp_path, start, edges, 2, 1)


@pytest.mark.full
def test_after_kill_nine_at_many_moments(tmp_path: Path, start: Start, edges: Edges) -> None:
    kill_at_random(tmp_path, start, edges, 20, 2)


def away(tmp_path: Path, start: Start, edges: Edges, seconds: float) -> None:
    relay = start()
    edge = edges(relay.zenoh)
    first = await_segment(relay, edge, 1)
    mend = break_store(tmp_path / "store")
    broken_at = time.monotonic()
    base = f"http://{relay.address}"
    before = await_segment(relay, edge, 3)
    ready = until("it is said", lambda: httpx.get(f"{base}/readyz").json().get("why"), 20.0)
    assert ready == "the past: the archive: its folder is gone"
    while time.monotonic() < broken_at + seconds:  # live and the recent past go on
        newest = await_segment(relay, edge, find_newest(relay)["index"] + 1)  # type: ignore[index]
        assert httpx.get(f"{base}/api/v1/robots/r/past/public/{newest['take']}/{newest['index']}").is_success
        assert httpx.get(f"{base}/api/v1/robots/r").json()["status"] == "online"
    last = find_newest(relay)
    mend()
    assert last is not None
    assert before["take"] == last["take"] == first["take"]
    take = int(last["take"], 16)
    wanted = {(take, index) for index in range(last["index"] + 1)}
    until("all that waited is there", lambda: wanted <= set(list_there(tmp_path / "store")) or None, 30.0)
    until("all is well", lambda: httpx.get(f"{base}/readyz").json().get("why", "") != ready or None, 45.0)
    assert "; queueing up to 16 MB per robot, live data continues" in relay.errors()
    assert relay.errors().count("the archive is back; nothing was lost") == 1
    assert relay.stop() == 0
    check_readable(tmp_path / "store")


def test_while_the_store_is_away_live_goes_on(tmp_path: Path, start: Start, edges: Edges) -> None:
    away(tmp_path, start, edges, 2.0)


@pytest.mark.full
def test_a_store_that_is_away_for_a_minute_loses_nothing(tmp_path: Path, start: Start, edges: Edges) -> None:
    away(tmp_path, start, edges, 60.0)


def test_a_gateway_reads_the_archive(
    tmp_path: Path, start: Start, edges: Edges, relays: Start, redis_server: Any
) -> None:
    relay = start()
    edge = edges(relay.zenoh)
    newest = await_segment(relay, edge, 2)
    relay.stop()
    there = set(list_there(tmp_path / "store"))
    gateway = start("--role", "gateway", "--store", redis_server.url)
    base = f"http://{gateway.address}/api/v1/robots/r/past"
    until("Redis is there", lambda: httpx.get(base).status_code == 200 or None)
    assert list_shown(gateway) == there
    answer = httpx.get(f"{base}/public/{newest['take']}/1")
    assert decode_segment(answer.content).start.index == 1
    schema = decode_segment(answer.content).start.schema
    assert httpx.get(f"{base}/public/schema/{schema}").status_code == 200
    files = sorted(path for path in (tmp_path / "store").rglob("*") if path.is_file())
    gateway.stop()
    assert sorted(path for path in (tmp_path / "store").rglob("*") if path.is_file()) == files


def test_without_keep_nothing_is_written(tmp_path: Path, relays: Start, edges: Edges) -> None:
    write(tmp_path / "robots.toml", "[robots.r.anyone]\n")
    (tmp_path / "store").mkdir()
    relay = relays("--past", f"file://{tmp_path}/store", "--robots", str(tmp_path / "robots.toml"))
    edge = edges(relay.zenoh)
    await_segment(relay, edge, 1)
    write(tmp_path / "robots.toml", POLICY)
    until(
        "it is kept from now on",
        lambda: list_there(tmp_path / "store") or (await_segment(relay, edge, 0) and None),
        20.0,
    )
    assert min(index for _, index in list_there(tmp_path / "store")) > 0
    assert "r: the store keeps its past for 30 d" in relay.errors()
    write(tmp_path / "robots.toml", "[robots.r.anyone]\n")
    until("it is said", lambda: "r: `keep` was removed" in relay.errors())
    assert list_there(tmp_path / "store")
