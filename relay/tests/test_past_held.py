"""Requests that wait for the next segment: how many, for how long, and what ends them."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
import uvicorn
from posecast_relay.core.policy import Audience, Policy, Rule
from posecast_relay.http.metrics import RelayCollector
from posecast_relay.past import routes
from posecast_relay.past.service import HELD_MAX, REPORTED_EVERY_S, WOKEN_PER_TURN, HeldRequests
from posecast_relay.redis.gateway import GRACE_S
from posecast_relay.server.http_server import RelayServer
from posecast_testing import until, until_async
from posecast_wire.segment import decode_segment

from .open_files import allow_files
from .past_doors import PAGE_MS, TAKE, PastDoors, address_of, link
from .past_redis import PastFleet, running
from .redis_server import Redis
from .stage import Relay, ZenohEdge
from .test_past_relay import await_segment, write

A, L = Audience.ANYONE, Audience.LINK
NEXT = f"public/{TAKE:016x}/1"


@pytest.fixture
async def doors() -> AsyncIterator[PastDoors]:
    """Open to anyone, with one segment."""
    async with PastDoors({"r": {A: Rule(), L: Rule("lab", past_s=600)}}) as found:
        found.keep(0, PAGE_MS)
        found.unix_ms = PAGE_MS + 10_000
        yield found


@pytest.fixture
def many_files() -> Iterator[None]:
    """Both ends of each connection are here."""
    with allow_files(2 * (HELD_MAX + 50) + 400):
        yield


async def test_the_next_one_is_held_until_it_is_there(doors: PastDoors) -> None:
    held = [asyncio.create_task(doors.ask(NEXT)) for _ in range(20)]
    await doors.until_held(20)
    doors.keep(0, PAGE_MS, robot="other", audiences=frozenset(Audience))  # wakes nobody
    doors.keep(0, PAGE_MS, view="lab")
    assert doors.service.held.count == 20
    segment = doors.keep(1, PAGE_MS + 4000)
    for answer in await asyncio.gather(*held):
        assert (answer.status_code, answer.content) == (200, segment.data)
        assert answer.headers["cache-control"] == "public, max-age=1794"
    assert doors.service.held.count == 0


async def test_who_asks_keeps_a_gateway_listening_to_that_robot(
    doors: PastDoors, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert routes.HOLD_S < GRACE_S
    monkeypatch.setattr(routes, "HOLD_S", 0.02)
    opened: list[str] = []

    async def open_robot(robot: str) -> None:
        opened.append(robot)

    monkeypatch.setattr(doors.access.live, "open_robot", open_robot)
    assert (await doors.ask(NEXT)).status_code == 204
    assert opened == ["r", "r"]  # before it was held, and after


async def test_when_a_take_is_over_the_next_one_is_named(doors: PastDoors) -> None:
    held = asyncio.create_task(doors.ask(NEXT))
    await doors.until_held(1)
    first = doors.keep(0, PAGE_MS + 4000, take=0xB)
    answer = await held
    assert answer.json() == {"next": {"take": f"{0xB:016x}", "index": 0}}
    assert answer.headers["cache-control"] == "public, max-age=1"
    assert (await doors.ask(NEXT)).json() == answer.json()
    assert (await doors.ask(address_of(first))).content == first.data
    assert (await doors.ask(f"public/{TAKE:016x}/2")).status_code == 404


async def test_not_yet_is_said_after_a_while_and_at_once_to_head(
    doors: PastDoors, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert routes.HOLD_S <= 8.0
    head = await doors.ask(NEXT, method="HEAD")
    monkeypatch.setattr(routes, "HOLD_S", 0.05)
    for answer in (head, await doors.ask(NEXT)):
        assert (answer.status_code, answer.content) == (204, b"")
        assert answer.headers["retry-ms"] == "1000"
        assert answer.headers["cache-control"] == "public, max-age=1"
        assert answer.headers["access-control-expose-headers"] == "age, date, etag, retry-ms, retry-after"
    assert doors.service.held.count == doors.service.held.turned_away == 0


@pytest.mark.usefixtures("many_files")
async def test_no_more_are_held_than_may_be_and_further_ones_are_answered_at_once(
    doors: PastDoors, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(routes, "HOLD_S", 60.0)  # all come meanwhile, however slow the machine is
    head = f"GET /api/v1/robots/r/past/{NEXT} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
    links = []
    for _ in range(HELD_MAX + 50):
        links.append(await asyncio.open_connection("127.0.0.1", doors.port))
        links[-1][1].write(head)
    await doors.until_held(HELD_MAX)
    answers = [asyncio.create_task(reader.readuntil(b"\r\n")) for reader, _ in links]
    told: set[asyncio.Task[bytes]] = set()
    while len(told) < 50:
        done, _ = await asyncio.wait(set(answers) - told, return_when=asyncio.FIRST_COMPLETED, timeout=10)
        assert done
        told |= done
    assert {answer.result() for answer in told} == {b"HTTP/1.1 204 No Content\r\n"}
    assert (len(told), doors.service.held.count, doors.service.held.turned_away) == (50, HELD_MAX, 50)
    told_of = {
        sample.name: sample.value
        for family in RelayCollector([doors.access.live], held=doors.service.held).collect()
        for sample in family.samples
    }
    assert told_of["posecast_past_held_requests"] == HELD_MAX
    assert told_of["posecast_past_turned_away_requests_total"] == 50
    assert (await doors.ask("")).status_code == 200  # nobody else notices
    for _, writer in links:
        writer.transport.abort()
    await doors.until_held(0)
    assert not doors.service.held._waiting
    await asyncio.gather(*answers, return_exceptions=True)


async def test_who_leaves_is_held_no_longer(doors: PastDoors) -> None:
    for how in (socket.SHUT_WR, None):
        with socket.create_connection(("127.0.0.1", doors.port), 5) as sock:
            sock.sendall(f"GET /api/v1/robots/r/past/{NEXT} HTTP/1.1\r\nHost: x\r\n\r\n".encode())
            await doors.until_held(1)
            if how is not None:
                sock.shutdown(how)
                await doors.until_held(0)
        await doors.until_held(0)


async def test_all_are_let_go_when_the_relay_stops(doors: PastDoors) -> None:
    held = [asyncio.create_task(doors.ask(NEXT)) for _ in range(10)]
    await doors.until_held(10)
    doors.service.held.release()
    assert {answer.status_code for answer in await asyncio.gather(*held)} == {204}
    assert (await doors.ask(NEXT)).status_code == 204
    assert doors.service.held.turned_away == 0


async def test_who_waits_is_judged_anew_at_once_when_the_rules_change(doors: PastDoors) -> None:
    doors.keep(0, PAGE_MS, view="lab")
    anyone = [asyncio.create_task(doors.ask(NEXT)) for _ in range(5)]
    holder = asyncio.create_task(doors.ask(f"lab/{TAKE:016x}/1", link("r")))
    await doors.until_held(6)
    doors.access.set_policy(Policy({"r": {A: Rule(past_s=900), L: Rule("lab", past_s=600)}}))
    asked = doors.service.held.count
    doors.access.set_policy(Policy({"r": {A: Rule(blackout=True), L: Rule("lab", past_s=600)}}))
    assert asked == 6
    assert {answer.status_code for answer in await asyncio.gather(*anyone)} == {404}
    await doors.until_held(1)  # for the link nothing has changed
    dark = doors.keep(1, PAGE_MS + 4000, audiences=frozenset())
    assert (await doors.ask(NEXT)).status_code == 404
    doors.allow({"r": {A: Rule(), L: Rule("lab", past_s=600)}})
    doors.unix_ms = PAGE_MS + 30_000
    again = asyncio.create_task(doors.ask(NEXT))  # what is dark has no answer, and the next one is to come
    await doors.until_held(2)
    doors.keep(2, PAGE_MS + 8000)
    assert (await again).json() == {"next": {"take": f"{TAKE:016x}", "index": 2}}
    assert (await doors.ask(address_of(dark))).json()["next"]["index"] == 2
    segment = doors.keep(1, PAGE_MS + 4000, view="lab", audiences=frozenset({L}))
    assert (await holder).content == segment.data


async def test_what_is_not_the_next_one_is_not_held(doors: PastDoors) -> None:
    doors.keep(7, PAGE_MS, take=0xC)  # of another recorder
    for path in (
        f"public/{TAKE:016x}/2",
        f"public/{TAKE:016x}/4294967295",
        f"public/{0xC:016x}/9",
        f"public/{0xD:016x}/0",
    ):
        assert (await doors.ask(path)).status_code == 404, path
    assert (await doors.ask("/new/past/" + NEXT)).status_code == 404  # a robot that was never here
    held = [asyncio.create_task(doors.ask(f"public/{0xC:016x}/8")), asyncio.create_task(doors.ask(NEXT))]
    await doors.until_held(1)  # the first take is over, the other one goes on
    assert (await held[1]).json() == {"next": {"take": f"{0xC:016x}", "index": 7}}
    segment = doors.keep(8, PAGE_MS + 4000, take=0xC)
    assert (await held[0]).content == segment.data
    assert doors.service.held.answers == {"none": 4, "next": 1, "segment": 1}


async def test_what_caches_go_by(doors: PastDoors, monkeypatch: pytest.MonkeyPatch) -> None:
    """A Date of when it was asked would make what was held old before it comes."""
    held = asyncio.create_task(doors.ask(NEXT))
    await doors.until_held(1)
    before = (await doors.ask("")).headers["date"]
    async with asyncio.timeout(10):
        while (await doors.ask("")).headers["date"] == before:
            await asyncio.sleep(0.05)
    now = (await doors.ask("")).headers["date"]
    doors.keep(1, PAGE_MS + 4000)
    segment = await held
    assert segment.headers["date"] >= now > before
    monkeypatch.setattr(routes, "HOLD_S", 0.02)
    not_yet = await doors.ask(f"public/{TAKE:016x}/2")
    doors.keep(0, PAGE_MS + 4000, take=0xB)
    following = await doors.ask(f"public/{TAKE:016x}/2")
    assert [each.status_code for each in (segment, not_yet, following)] == [200, 204, 200]
    for answer in (segment, not_yet, following):
        assert answer.headers["cache-control"].startswith("public, max-age=")
        assert answer.headers["access-control-allow-origin"] == "*"
        assert len(answer.headers.get_list("date")) == 1
        assert not {"vary", "set-cookie", "age", "expires", "pragma"} & set(answer.headers)


async def test_a_date_is_of_the_moment_however_long_uvicorn_keeps_one(doors: PastDoors) -> None:
    """Made anew at each tick, of which there are ten a second."""
    server = RelayServer(uvicorn.Config(doors.app), [], lambda: None, lambda: None)
    for counter in range(10, 20):
        server.server_state.default_headers = []
        await server.on_tick(counter)
        assert dict(server.server_state.default_headers).keys() == {b"date"}, counter


async def test_a_thousand_who_are_held_and_leave_take_nobodys_place(doors: PastDoors) -> None:
    head = f"GET /api/v1/robots/r/past/{NEXT} HTTP/1.1\r\nHost: x\r\n\r\n".encode()
    for _ in range(3):
        links = [await asyncio.open_connection("127.0.0.1", doors.port) for _ in range(334)]
        for _, writer in links:
            writer.write(head)
        await doors.until_held(334)
        for _, writer in links:
            writer.transport.abort()
        await doors.until_held(0)
    assert not doors.service.held._waiting
    await until_async("no request is under way", lambda: not doors.server.server_state.tasks)
    held = [asyncio.create_task(doors.ask(NEXT)) for _ in range(20)]
    await doors.until_held(20)
    segment = doors.keep(1, PAGE_MS + 4000)
    assert {answer.content for answer in await asyncio.gather(*held)} == {segment.data}


async def test_a_relay_that_goes_closes_the_connection_on_which_it_answers(doors: PastDoors) -> None:
    """So that a proxy's next request goes to another relay."""
    held = asyncio.create_task(doors.ask(NEXT))
    await doors.until_held(1)
    assert "connection" not in (await doors.ask("")).headers
    doors.service.held.release()
    doors.access.live.drain()
    for answer in (await held, await doors.ask(NEXT), await doors.ask(f"public/{TAKE:016x}/0")):
        assert answer.headers["connection"] == "close"
        assert answer.headers["cache-control"].startswith("public, max-age=")
    assert (await held).status_code == 204
    assert doors.service.held.count == 0


async def test_what_may_be_seen_is_judged_anew_when_it_is_there(doors: PastDoors) -> None:
    doors.keep(0, PAGE_MS, view="lab")
    asked = [
        asyncio.create_task(doors.ask(NEXT)),
        asyncio.create_task(doors.ask(f"lab/{TAKE:016x}/1", link("r"))),
    ]
    await doors.until_held(2)
    doors.tokens.set_link_keys({"r": "x" * 43})
    doors.access.set_policy(Policy({"r": {A: Rule(blackout=True), L: Rule("lab", past_s=600)}}))
    for view in ("public", "lab"):
        doors.keep(1, PAGE_MS + 4000, view=view, audiences=frozenset(Audience))
    assert [answer.status_code for answer in await asyncio.gather(*asked)] == [404, 401]


async def test_who_waits_is_let_go_a_few_at_a_time_so_that_live_goes_on() -> None:
    held, over = HeldRequests(), 0

    async def hold() -> None:
        nonlocal over
        with held.hold():
            await held.wait("r", "public", 60)
            over += 1

    tasks = [asyncio.create_task(hold()) for _ in range(100)]
    await asyncio.sleep(0)
    for _ in range(3):  # once more, before all have gone
        held.wake("r", "public")
    held.wake_all()
    tasks[-1].cancel()
    most = 0
    async with asyncio.timeout(10):
        while held.count:
            before = over
            await asyncio.sleep(0)
            most = max(most, over - before)
    assert over == 99
    assert most <= WOKEN_PER_TURN
    assert not held._woken
    assert not held._waiting
    await asyncio.gather(*tasks, return_exceptions=True)


async def test_a_million_who_want_to_wait_leave_nothing_behind() -> None:
    held = HeldRequests()

    async def hold() -> None:
        with held.hold() as may_wait:
            assert may_wait
            await held.wait("r", "public", 60)

    tasks = [asyncio.create_task(hold()) for _ in range(HELD_MAX)]
    await asyncio.sleep(0)
    for _ in range(1_000_000):
        with held.hold() as may_wait:
            assert not may_wait
    assert (held.count, held.turned_away) == (HELD_MAX, 1_000_000)
    held.wake("r", "lab")
    await asyncio.sleep(0)
    assert held.count == HELD_MAX
    held.release()
    await asyncio.gather(*tasks)
    assert held.count == 0
    assert not held._waiting


def test_the_log_says_once_a_minute_that_places_are_full(caplog: pytest.LogCaptureFixture) -> None:
    now_s = 1000.0
    held = HeldRequests(1, lambda: now_s)

    def knock(times: int) -> list[str]:
        caplog.clear()
        for _ in range(times):
            with held.hold() as may_wait:
                assert not may_wait
        return [record.getMessage() for record in caplog.records]

    with held.hold():
        full = "the past: 1 requests wait for the next segment, the limit: %d answered at once so far"
        assert knock(1000) == [full % 1]
        now_s += REPORTED_EVERY_S - 1
        assert knock(1000) == []
        now_s += 1
        assert knock(2) == [full % 2001]
        held.release()
        now_s += REPORTED_EVERY_S
        assert knock(2) == []


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
