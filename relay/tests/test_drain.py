"""The relay goes: who is told when, on a clock of the test's own and in a process."""

from __future__ import annotations

import asyncio
import signal
import threading
from itertools import pairwise
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock

import pytest
import uvicorn
from posecast_relay.server.http_server import RelayServer
from posecast_wire import Close

from .sim import World
from .stage import Watcher

BYE = (Close.DRAIN, "the relay is being replaced", 0.5)


def test_a_few_viewers_are_told_at_once_and_nobody_is_taken_any_more() -> None:
    world = World()
    world.on_air()
    seats = [world.join() for _ in range(5)]
    world.do(world.hub.drain([viewer for viewer, _ in seats], world.now))
    assert {screen.ended for _, screen in seats} == {BYE}
    assert world.hub.viewers == {}
    _, late = world.join()
    assert late.ended == BYE
    assert late.texts == []
    assert world.hub.endings[Close.DRAIN] == 6


def test_many_are_moved_away_evenly_in_the_order_given_within_eight_seconds() -> None:
    world = World()
    edge = world.on_air()
    seats = [world.join(1.0) for _ in range(2000)]
    order = seats[::-1]
    began = world.now
    world.do(world.hub.drain([viewer for viewer, _ in order], began))
    left = [len(world.hub.viewers)]
    while world.hub.viewers:
        world.pass_time(0.1)
        for viewer in world.hub.viewers:
            viewer.record_heard(world.now)
        world.publish(edge)
        left.append(len(world.hub.viewers))
        told = [screen.ended is not None for _, screen in order]
        assert told == sorted(told, reverse=True)  # those first in the order first
    assert 6.0 <= world.now - began <= 8.0
    assert max(a - b for a, b in pairwise(left)) <= 2000 * 0.1 / 6.0
    assert {screen.ended for _, screen in seats} == {BYE}
    assert order[-1][1].states[-1].seq >= edge.seq - 11  # served to its last moment


def test_who_left_by_itself_is_not_told() -> None:
    world = World()
    seats = [world.join() for _ in range(300)]
    world.do(world.hub.drain([viewer for viewer, _ in seats], world.now))
    viewer, screen = seats[-1]
    world.hub.remove_viewer(viewer)
    world.pass_time(5.0)
    assert screen.ended is None
    assert world.hub.endings[Close.DRAIN] == 299


async def test_a_process_moves_its_viewers_away_takes_no_new_ones_and_ends_with_0(
    relays: Any, edges: Any
) -> None:
    relay = relays()
    edges(relay.zenoh)
    viewers = [Watcher(relay.url(query="?hz=1")) for _ in range(200)]
    await asyncio.gather(*(v.__aenter__() for v in viewers))
    host, port = relay.address.split(":")

    async def is_open() -> bool:
        """A proxy goes to another relay at once where it can't connect."""
        try:
            _, writer = await asyncio.open_connection(host, int(port))
        except OSError:
            return False
        writer.close()
        return True

    async def ask(connection: tuple[asyncio.StreamReader, asyncio.StreamWriter]) -> None:
        connection[1].write(b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n")
        assert b"200 OK" in await connection[0].readuntil(b"ok\n")

    idle = await asyncio.open_connection(host, int(port))
    busy = await asyncio.open_connection(host, int(port))
    await ask(busy)
    busy[1].write(b"GET /readyz HTTP/1.1\r\n")  # on its way, as the relay is told to go
    await ask(idle)  # so the relay has read that by now
    assert await is_open()
    relay.process.send_signal(signal.SIGTERM)
    async with asyncio.timeout(30):
        while await is_open():
            pass
    assert any(v.closed is None for v in viewers)
    assert await idle[0].read() == b"", "what a proxy keeps open is closed, so that it is not used again"
    busy[1].write(b"Host: x\r\n\r\n")
    answer = await busy[0].read()
    assert answer.startswith(b"HTTP/1.1 503"), answer
    assert b"draining" in answer
    ends: dict[int, int] = {}  # by the look at which it had ended
    looks = 0
    async with asyncio.timeout(60):
        while len(ends) < len(viewers):
            for n, viewer in enumerate(viewers):
                if viewer.closed is not None and n not in ends:
                    ends[n] = looks
                    assert viewer.closed[0] == Close.DRAIN
            looks += 1
            await asyncio.sleep(0.01)
    assert len(set(ends.values())) > 5  # not all at once
    assert list(ends) != sorted(ends)  # shuffled
    assert await asyncio.to_thread(relay.process.wait, 30) == 0
    assert "connections are still open" not in relay.errors()


def test_after_a_second_signal_nobody_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading, "Timer", MagicMock())  # it would end this process
    dispatcher: Any = SimpleNamespace(draining=False)
    dispatcher.drain = lambda: setattr(dispatcher, "draining", True)
    server = RelayServer(uvicorn.Config("no:app"), [dispatcher], lambda: None, lambda: None)
    for ends in (False, True):
        server.leave()
        assert (server.should_exit, server.force_exit, dispatcher.draining) == (ends, ends, True)


@pytest.mark.full
async def test_a_second_signal_ends_it_at_once(relays: Any, edges: Any) -> None:
    relay = relays()
    edge = edges(relay.zenoh)
    viewers = [Watcher(relay.url(query="?hz=1")) for _ in range(600)]  # six seconds' worth
    for n in range(0, len(viewers), 50):  # all at once may take longer than the relay lets anybody ask
        await asyncio.gather(*(v.__aenter__() for v in viewers[n : n + 50]))
    relay.process.send_signal(signal.SIGINT)
    await viewers[0].until("the first goes", lambda _: any(v.closed for v in viewers))
    began = edge.seq
    relay.process.send_signal(signal.SIGINT)
    assert await asyncio.to_thread(relay.process.wait, 30) == 0
    for viewer in viewers:
        await viewer.until("its end", lambda v: v.closed is not None)
    assert edge.seq - began < 150  # frames of 30 a second: it did not wait for all to have gone one by one


async def test_connections_of_a_process_are_renewed(relays: Any, edges: Any) -> None:
    relay = relays("--max-connection-age", "2")
    edges(relay.zenoh)
    async with Watcher(relay.url()) as viewer:
        await viewer.until("the end", lambda v: v.closed is not None)
        assert viewer.closed is not None
        assert viewer.closed[0] == Close.AGE_LIMIT
        assert viewer.texts[0]["limits"]["max_age_s"] == 2.0
        assert (viewer.texts[-1]["type"], viewer.texts[-1]["code"]) == ("bye", Close.AGE_LIMIT)
