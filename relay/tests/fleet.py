"""Edges, ingests, gateways and screens in one process, on an event loop whose clock may be simulated.

Edges and ingests are joined by plain calls instead of Zenoh; between ingests and gateways stand the real
Redis code and a Redis. Each screen judges as the page does and keeps what it showed.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from typing import Any
from unittest.mock import patch

from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import PUBLIC
from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Viewer
from posecast_relay.http.robots import make_robot_summary
from posecast_relay.redis import client as redis_client
from posecast_relay.redis.gateway import RedisGateway
from posecast_relay.redis.store import RedisStore
from posecast_relay.runtime.dispatcher import Dispatcher, MemoryStore, NoSource

from .page import Page
from .sim import Edge, schema

HZ = 10.0
LINK_S = 0.002  # from an edge to an ingest
DELAY_S = 3.0  # of what some pages show
LEASE_S = 2.5  # an edge that was killed is noticed after so long


class FanOut:
    """To each screen."""

    def write(self, data: bytes, viewers: Sequence[Viewer]) -> list[tuple[Viewer, Exception]]:
        """At once; at nobody it fails."""
        for viewer in viewers:
            viewer.outlet.write(data)
        return []


class LoopPump(Dispatcher):
    """By the loop's clock, simulated or not."""

    def now(self) -> float:  # type: ignore[override]
        """Of the loop."""
        return self._loop.time()


class Process:
    """A relay without its sockets."""

    dispatcher: Dispatcher

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.loop = loop
        self.hub = Hub(Limits())
        self.is_up = True

    async def kill(self) -> None:
        """At once: nothing is written any more, and connections are cut."""
        self.is_up = False
        self.dispatcher.stop()


class Ingest(Process, NoSource):
    """Hears edges, writes Redis."""

    def __init__(self, loop: asyncio.AbstractEventLoop, url: str) -> None:
        super().__init__(loop)
        self.store = RedisStore(
            url,
            self.hub,
            loop.time,
            lambda of: make_robot_summary(of, of.rooms.get(PUBLIC), loop.time()),
        )
        self.edges: list[FleetEdge] = []
        self.dispatcher = LoopPump(self.hub, self.store, FanOut(), self)  # type: ignore[arg-type]

    async def start(self) -> None:
        """Begin."""
        self.dispatcher.start()
        await self.store.start()

    async def kill(self) -> None:
        """See Process."""
        await super().kill()
        assert self.store._task is not None
        self.store._task.cancel()
        await self.store.link.reset()
        for edge in tuple(self.edges):
            edge.ingests.pop(self, None)

    def token(self, robot: str) -> None:
        """Whether any edge of this name is there."""
        there = any(edge.robot == robot for edge in self.edges)
        of = self.hub.robots.get(robot)
        if self.is_up and there != (of is not None and of.liveness.token):
            self.dispatcher.carry_out(self.hub.set_token(robot, there, self.dispatcher.now()))

    def frame(self, edge: FleetEdge, payload: bytes, stamp: Any) -> None:
        """Has come."""
        if self.is_up and edge in self.edges:
            self.hub.receive_frame(edge.robot, PUBLIC, payload, stamp, self.dispatcher.now())
            self.dispatcher.flush()

    def request_snapshots(self, robot: str, _views: Sequence[str]) -> None:
        """RobotSource: of every edge of this name."""
        asked_at = self.dispatcher.now()
        for edge in self.edges:
            if edge.robot == robot and edge.life.seq >= 0:
                answer, stamp = edge.life.snapshot(), edge.stamp()
                self.loop.call_later(2 * LINK_S, self._snapshot, edge, answer, stamp, asked_at)

    def _snapshot(self, edge: FleetEdge, answer: Any, stamp: Any, asked_at: float) -> None:
        if self.is_up and edge in self.edges:
            now = self.dispatcher.now()
            try:
                self.hub.take_snapshot(edge.robot, PUBLIC, answer, stamp, now, waited_s=now - asked_at)
            except ValueError:  # of a run that is retired
                return
            self.dispatcher.flush()


class Gateway(Process):
    """Reads Redis; pages for each robot that is looked at, live and with a delay."""

    def __init__(self, loop: asyncio.AbstractEventLoop, url: str) -> None:
        super().__init__(loop)
        self.delayed = DelayedHub(Limits())
        self.later = LoopPump(self.delayed, MemoryStore(), FanOut())  # type: ignore[arg-type]
        self.store = RedisGateway(url, self.hub, loop.time, self.delayed.list_robots)
        self.dispatcher = LoopPump(
            *(self.hub, self.store, FanOut(), self.store),  # type: ignore[arg-type]
            changed=self._note,
        )
        self.pages: dict[str, Page] = {}  # by robot
        self.later_pages: dict[str, Page] = {}
        self._viewers: list[tuple[Hub, Viewer]] = []

    async def start(self) -> None:
        """Begin."""
        self.dispatcher.start()
        self.later.start()
        await self.store.start(self.dispatcher)

    async def kill(self) -> None:
        """See Process."""
        await super().kill()
        self.later.stop()
        for task in (self.store._task, self.store._reader):
            if task is not None:
                task.cancel()
        await self.store._subscriber.close()
        await self.store.link.reset()

    def watch(self, robot: str) -> Page:
        """A page that shows this robot."""
        self.pages[robot] = self._page(self.dispatcher, robot, 0.0)
        return self.pages[robot]

    def watch_later(self, robot: str) -> Page:
        """A page that shows it with a delay."""
        self.delayed.set_delays({(name, PUBLIC): DELAY_S for name in {robot, *self.delayed.list_robots()}})
        self.later_pages[robot] = self._page(self.later, robot, DELAY_S)
        return self.later_pages[robot]

    def leave(self) -> None:
        """All pages are closed."""
        for hub, viewer in self._viewers:
            hub.remove_viewer(viewer)
        self._viewers.clear()
        self.pages.clear()
        self.later_pages.clear()

    def _page(self, dispatcher: Dispatcher, robot: str, delay_s: float) -> Page:
        page = Page(self.loop, robot, delay_s)
        viewer = Viewer(page, robot, PUBLIC, 30.0, self.hub.limits, dispatcher.now())

        def heard(doc: dict[str, Any] | None) -> None:
            viewer.record_heard(dispatcher.now())
            if self.is_up and doc is not None:
                dispatcher.carry_out(
                    dispatcher.hub.take_message(viewer, json.dumps(doc).encode(), viewer.heard_at)
                )

        page.say = heard
        self._viewers.append((dispatcher.hub, viewer))
        dispatcher.join(viewer)
        return page

    def _note(self, stream: Stream) -> None:
        robot = self.hub.robots.get(stream.robot)
        token = robot is not None and robot.liveness.token
        if self.delayed.record_stream(stream, token, self.later.now()):
            self.later.arm()


class FleetEdge:
    """One edge process: a run of its own, frames at HZ to every ingest it is connected to.

    Its clock may stand still, be ahead, or run by another rate; each pose says when it was made, truly.
    """

    _runs = count(0x100)

    def __init__(self, loop: asyncio.AbstractEventLoop, robot: str) -> None:
        self.loop = loop
        self.robot = robot
        self.life = Edge(next(self._runs), schema(), began_s=0.0)
        self.ingests: dict[Ingest, None] = {}
        self.sends = True
        self.was_killed = False
        self.rate = 1.0
        self.clock_s = 0.0
        self._clock_at = loop.time()
        self._timer: asyncio.TimerHandle | None = None
        self._tick()

    def stamp(self) -> Any:
        """By its clock."""
        now = self.loop.time()
        self.clock_s += (now - self._clock_at) * self.rate
        self._clock_at = now
        return self.life.stamp(self.clock_s)

    def run_clock(self, rate: float) -> None:
        """From now on; 0: it stands still."""
        self.stamp()
        self.rate = rate

    def connect(self, ingest: Ingest) -> None:
        """A link."""
        if ingest not in self.ingests:
            self.ingests[ingest] = None
            ingest.edges.append(self)
            self._send(force_key=True)
            ingest.token(self.robot)

    def disconnect(self, ingest: Ingest) -> None:
        """No more."""
        self.ingests.pop(ingest, None)
        if self in ingest.edges:
            ingest.edges.remove(self)
            ingest.token(self.robot)

    def stop(self, killed: bool = False) -> None:
        """Tell so, or leave it to the lease."""
        if self._timer is not None:
            self._timer.cancel()
        self.sends = False
        self.was_killed = killed
        for ingest in tuple(self.ingests):
            self.loop.call_later(LEASE_S if killed else LINK_S, self.disconnect, ingest)

    def _tick(self) -> None:
        self._timer = self.loop.call_later(1 / HZ, self._tick)
        self._send()

    def _send(self, force_key: bool = False) -> None:
        if self.sends and self.ingests:
            now = self.loop.time()
            seq = self.life.seq + 1
            payload = self.life.frame(now, [self.life.run_id, seq % 1000], force_key)
            stamp = self.stamp()
            for ingest in self.ingests:
                self.loop.call_later(LINK_S, ingest.frame, self, payload, stamp)


@contextmanager
def linked(link: Callable[[str], Any] | None) -> Iterator[None]:
    """What is made inside reaches Redis by this; None: as it does everywhere."""
    if link is None:
        yield
        return
    with patch.object(redis_client, "RedisClient", link):
        yield


class Fleet:
    """All of it. `link`: see `linked`."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, url: str, link: Callable[[str], Any] | None = None
    ) -> None:
        self.loop = loop
        self.url = url
        self._link = link
        self.edges: list[FleetEdge] = []
        self.ingests: list[Ingest] = []
        self.gateways: list[Gateway] = []

    async def ingest(self) -> Ingest:
        """One more; edges that are on air connect to it."""
        with linked(self._link):
            ingest = Ingest(self.loop, self.url)
        self.ingests.append(ingest)
        await ingest.start()
        return ingest

    async def gateway(self) -> Gateway:
        """One more."""
        with linked(self._link):
            gateway = Gateway(self.loop, self.url)
        self.gateways.append(gateway)
        await gateway.start()
        return gateway

    def edge(self, robot: str, *ingests: Ingest) -> FleetEdge:
        """One more, connected to these."""
        edge = FleetEdge(self.loop, robot)
        self.edges.append(edge)
        for ingest in ingests:
            edge.connect(ingest)
        return edge

    async def kill(self, process: Ingest | Gateway) -> None:
        """One of them."""
        (self.ingests if isinstance(process, Ingest) else self.gateways).remove(process)  # type: ignore[arg-type]
        await process.kill()

    def stop(self, edge: FleetEdge, killed: bool = False) -> None:
        """One of them."""
        self.edges.remove(edge)
        edge.stop(killed)

    def look(self) -> None:
        """At every screen."""
        for gateway in self.gateways:
            for page in (*gateway.pages.values(), *gateway.later_pages.values()):
                page.look()

    async def end(self) -> None:
        """All of it."""
        for edge in tuple(self.edges):
            self.stop(edge)
        for ingest in tuple(self.ingests):
            await self.kill(ingest)
        for gateway in tuple(self.gateways):
            await self.kill(gateway)
