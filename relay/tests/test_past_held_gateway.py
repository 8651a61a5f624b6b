"""Requests that wait for the next segment at gateways, with a real Redis; and through a real blackout."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from posecast_relay.core.policy import Audience, Rule
from posecast_relay.past import routes
from posecast_testing import until
from posecast_wire.segment import decode_segment

from .past_doors import PAGE_MS, TAKE, address_of
from .past_redis import PastFleet, running
from .redis_server import Redis
from .stage import Relay, ZenohEdge
from .test_past_relay import await_segment, write

A, L = Audience.ANYONE, Audience.LINK
NEXT = f"public/{TAKE:016x}/1"


@contextlib.asynccontextmanager
async def holding(server: Redis, each: int = 3) -> AsyncIterator[tuple[PastFleet, list[asyncio.Task[Any]]]]:
    """Two gateways at each of which some requests for the next segment are held."""
    async with running(server, {"r": {A: Rule(), L: Rule("lab", past_s=60.0)}}) as fleet:
        await fleet.keep(0, PAGE_MS)
        for door in fleet.doors:
            door.unix_ms = PAGE_MS + 30_000
        held = [asyncio.create_task(gateway.ask(NEXT)) for gateway in fleet.gateways for _ in range(each)]
        for gateway in fleet.gateways:
            await gateway.until_held(each)
        yield fleet, held
        await asyncio.gather(*held, return_exceptions=True)


async def collect(held: list[asyncio.Task[Any]]) -> list[Any]:
    """The answers."""
    return list(await asyncio.wait_for(asyncio.gather(*held), 5))


async def test_a_take_that_ends(redis_server: Redis) -> None:
    async with holding(redis_server) as (fleet, held):
        first = await fleet.keep(0, PAGE_MS + 4000, take=0xB)
        for answer in await collect(held):
            assert answer.json() == {"next": {"take": f"{0xB:016x}", "index": 0}}
            assert answer.headers["cache-control"] == "public, max-age=1"
        assert (await fleet.ask_gateway(address_of(first))).content == first.data


async def test_a_robot_that_pauses(redis_server: Redis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(routes, "HOLD_S", 0.05)
    async with running(redis_server, None) as fleet:
        await fleet.keep(0, PAGE_MS)
        fleet.ingest.unix_ms = PAGE_MS + 10_000
        for _ in range(3):
            for answer in await fleet.ask(NEXT):
                assert (answer.status_code, answer.content) == (204, b"")
                assert answer.headers["retry-ms"] == "1000"
                assert answer.headers["cache-control"] == "public, max-age=1"
                assert "vary" not in answer.headers
        assert all(door.service.held.answers == {"not yet": 3} for door in fleet.doors)


async def test_a_gateway_that_goes_lets_its_own_go_and_another_holds_them(redis_server: Redis) -> None:
    async with holding(redis_server) as (fleet, held):
        going, other = fleet.gateways
        going.service.held.release()
        going.access.live.drain()
        for answer in await collect(held[:3]):
            assert (answer.status_code, answer.headers["connection"]) == (204, "close")
            assert answer.headers["cache-control"] == "public, max-age=1"
        assert other.service.held.count == 3
        moved = asyncio.create_task(other.ask(NEXT))
        await other.until_held(4)
        segment = await fleet.keep(1, PAGE_MS + 4000)
        for answer in await collect([moved, *held[3:]]):
            assert answer.content == segment.data


async def test_who_leaves(redis_server: Redis) -> None:
    async with holding(redis_server) as (fleet, held):
        for task in held[:3]:
            task.cancel()
        await fleet.gateways[0].until_held(0)
        assert fleet.gateways[1].service.held.count == 3
        assert fleet.gateways[0].service.held.list_waiting() == []
        await fleet.keep(1, PAGE_MS + 4000)
        assert {answer.status_code for answer in await collect(held[3:])} == {200}


async def test_a_blackout(redis_server: Redis) -> None:
    async with holding(redis_server) as (fleet, held):
        for door in fleet.doors:
            door.allow({"r": {A: Rule(blackout=True), L: Rule("lab", past_s=60.0)}})
        for answer in await collect(held):
            assert answer.status_code == 404
            assert answer.headers["cache-control"] == "public, max-age=1"
        await fleet.keep(1, PAGE_MS + 4000)
        assert (await fleet.ask_gateway(NEXT)).status_code == 404
        for door in fleet.doors:
            door.allow({"r": {A: Rule(), L: Rule("lab", past_s=60.0)}})
        again = [asyncio.create_task(gateway.ask(NEXT)) for gateway in fleet.gateways]
        for gateway in fleet.gateways:
            await gateway.until_held(1)
        await fleet.keep(2, PAGE_MS + 8000)
        for answer in await collect(again):
            assert answer.json() == {"next": {"take": f"{TAKE:016x}", "index": 2}}


async def test_what_another_gateway_has_told_a_moment_ago_is_known_here(
    redis_server: Redis, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A viewer behind a cache asks one gateway for a segment, and the next one for the segment behind it."""
    async with running(redis_server, None) as fleet:
        await fleet.keep(0, PAGE_MS)
        quick, slow = fleet.gateways
        for door in fleet.doors:
            door.unix_ms = PAGE_MS + 20_000
        assert (await slow.ask(f"public/{TAKE:016x}/0")).status_code == 200
        looked_at = fleet.readers[1]._views["r", "public"].looked_at
        monkeypatch.setattr(fleet.readers[1], "_now", lambda: looked_at)  # for it no time passes
        second = await fleet.keep(1, PAGE_MS + 4000)
        assert (await quick.ask(NEXT)).content == second.data
        held = asyncio.create_task(slow.ask(f"public/{TAKE:016x}/2"))
        await slow.until_held(1)
        await fleet.keep(0, PAGE_MS + 8000, take=0xB)
        monkeypatch.setattr(fleet.readers[1], "_now", lambda: looked_at + 1.0)
        assert (await collect([held]))[0].json() == {"next": {"take": f"{0xB:016x}", "index": 0}}
        last = await fleet.keep(0, PAGE_MS + 12_000, take=0xC)
        assert (await slow.ask(address_of(last))).content == last.data
        looks: list[object] = []
        look = fleet.readers[1]._look

        async def count(robot: str, view: str) -> None:
            looks.append(view)
            await look(robot, view)

        monkeypatch.setattr(fleet.readers[1], "_look", count)
        answers = await asyncio.gather(*(slow.ask(f"public/{n:016x}/0") for n in range(100, 200)))
        assert {answer.status_code for answer in answers} == {404}
        assert len(looks) <= 100  # at most one for each, and fewer for those who ask at once


async def test_a_lane_goes_on_behind_a_blackout_and_shows_nothing_of_it(
    tmp_path: Path, relays: Callable[..., Relay], edges: Callable[..., ZenohEdge]
) -> None:
    file = tmp_path / "robots.toml"
    write(file, "[robots.r.anyone]\n")
    relay = relays("--robots", str(file))
    edge = edges(relay.zenoh)
    at = await asyncio.to_thread(await_segment, relay, edge)
    base = f"http://{relay.address}/api/v1/robots/r/past/public"
    shown: list[int] = []

    async def follow(client: httpx.AsyncClient) -> httpx.Response:
        """Read one part, as a page in the lane does."""
        answer = await client.get(f"{base}/{at['take']}/{at['index']}")
        if answer.status_code == 200 and answer.headers["content-type"] == "application/json":
            at.update(answer.json()["next"])
        elif answer.status_code == 200:
            shown.extend(frame.seq for frame in decode_segment(answer.content).frames)
            at["index"] += 1
        return answer

    async with httpx.AsyncClient(timeout=20) as client:
        edge.force_key = True
        while not shown:
            assert (await follow(client)).status_code == 200
        held = asyncio.create_task(follow(client))
        await asyncio.wait([held], timeout=0.3)
        write(file, "[robots.r.anyone]\nblackout = true\n")
        while (await held).status_code != 404:  # it was there before the rules were read
            held = asyncio.create_task(follow(client))
        dark_from = edge.seq
        await asyncio.to_thread(until, "frames in the dark", lambda: edge.seq > dark_from + 60)
        edge.force_key = True
        assert (await follow(client)).status_code == 404
        dark_to = edge.seq
        write(file, "[robots.r.anyone]\n")
        before = len(shown)
        async with asyncio.timeout(30):
            while len(shown) < before + 60:
                edge.force_key = True
                if (await follow(client)).status_code == 404:  # the rules are read within a second
                    await asyncio.sleep(0.1)
    assert not set(shown) & set(range(dark_from, dark_to + 1))
    assert shown == sorted(set(shown))  # none twice, and never back
    assert shown[before] > dark_to
