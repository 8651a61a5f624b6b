"""The feed between workers: a further worker's hub shows what the first one's does, whatever happens."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
from posecast_relay.core.hub import Hub
from posecast_relay.core.limits import Limits
from posecast_relay.core.state.stream import Stream
from posecast_relay.core.viewer.viewer import Viewer
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.runtime.fan_out import FanOut
from posecast_relay.server.workers import feed as feed_module
from posecast_relay.server.workers.fed_source import FedSource
from posecast_relay.server.workers.feed import Feed, FeedStore
from posecast_relay.server.workers.feed_messages import (
    HEAD,
    Kind,
    pack_message,
    pack_state,
    read_message,
    unpack_state_values,
)
from posecast_relay.store_memory import MemoryStore
from posecast_wire import Close, Stamp

from .sim import Edge, schema


class _Nobody:
    """Other workers that count nobody, and the count of this one."""

    def add(self, name: str, change: int) -> None:
        """Do nothing."""

    def count_elsewhere(self, name: str) -> int:
        """Return 1 viewer."""
        return 1 if name == "robot r" else 0


class _Outlet:
    """A viewer's socket, that takes all."""

    descriptor = -1

    def __init__(self) -> None:
        self.written: list[bytes] = []

    def write(self, data: bytes) -> None:
        """Take it."""
        self.written.append(data)

    def end(self, close: Close, reason: str, retry_s: float | None, lane: str | None = None) -> None:
        """Do nothing."""

    def cut(self, close: Close) -> None:
        """Do nothing."""


class _Two:
    """A first worker's hub and a further one's, in one process, with a real socket between."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "feed"
        self.limits = Limits()
        self.first = Hub(self.limits)
        self.feed = Feed(self.path, self.first, Dispatcher.now, _Nobody())
        self.store = FeedStore(MemoryStore(), self.feed, _Nobody())
        self.here = Dispatcher(self.first, self.store, FanOut(None))
        self.second = Hub(self.limits)
        self.source = FedSource(self.path, self.second, Dispatcher.now)
        self.there = Dispatcher(self.second, self.source, FanOut(None), self.source)
        self.edge = Edge(0xE, schema(), began_s=Dispatcher.now())

    async def start(self) -> None:
        """With a viewer at the further worker."""
        await self.feed.start()
        self.source.start(self.there)
        self.here.start()
        self.there.start()
        viewer = Viewer(_Outlet(), "r", "public", 60.0, self.limits, Dispatcher.now(), float("inf"), False)
        self.there.join(viewer)

    def stop(self) -> None:
        """All of it."""
        self.source.stop()
        self.feed.stop()
        self.here.stop()
        self.there.stop()

    def say(self) -> None:
        """A frame of the robot, and its snapshot where that is lacking."""
        now = Dispatcher.now()
        frame, stamp = self.edge.frame(now), self.edge.stamp(now)
        self.first.take_edge_frame("r", "public", frame, stamp, now)
        if self.first.robots["r"].lacking:
            self.first.take_snapshot("r", "public", self.edge.snapshot(), stamp, now, waited_s=0.0)
        self.here.flush()

    def find(self, hub: Hub) -> Stream | None:
        """The stream, as a hub has it."""
        robot = hub.robots.get("r")
        room = None if robot is None else robot.rooms.get("public")
        return None if room is None else room.stream

    async def until(self, what: str, probe: Callable[[], object], says: bool = True) -> None:
        """Wait for something, while the robot goes on."""
        end_s = time.monotonic() + 10
        while not probe():
            assert time.monotonic() < end_s, what
            if says:
                self.say()
            await asyncio.sleep(0.01)

    def agrees(self) -> bool:
        """Whether both have the same newest frame, live."""
        one, two = self.find(self.first), self.find(self.second)
        if one is None or two is None or one.newest is None or two.newest is None or not two.is_live:
            return False
        return one.newest.payload == two.newest.payload


@pytest.fixture
async def two(tmp_path: Path) -> AsyncIterator[_Two]:
    """Started, and ended."""
    made = _Two(tmp_path)
    await made.start()
    yield made
    made.stop()


async def test_frames_events_and_presence_come_through(two: _Two) -> None:
    await two.until("the same frame", two.agrees)
    assert two.store.count_viewers_elsewhere("r") == 1
    doc = b'{"type":"event","t":1.0,"level":"fault","source":"RKN","text":"hot","state":"on"}'
    now = Dispatcher.now()
    stamp = Stamp(0xE, round((now - two.edge.began_s) * 1e9))
    for _ in range(3):
        two.here.carry_out(two.first.take_event("r", "public", doc, stamp, now, 1.0))

    def texts(hub: Hub) -> list[str]:
        stream = two.find(hub)
        return [] if stream is None else [event.text for event in stream.events]

    await two.until("the events", lambda: len(texts(two.second)) == 3, says=False)
    assert texts(two.second) == texts(two.first)
    two.here.carry_out(two.first.set_token("r", True, now))
    await two.until("its token", lambda: two.second.robots["r"].liveness.token, says=False)
    two.here.carry_out(two.first.set_token("r", False, now))
    await two.until("it is gone", lambda: not two.second.robots["r"].liveness.token, says=False)


async def test_a_robot_that_began_anew_is_followed(two: _Two) -> None:
    await two.until("the same frame", two.agrees)
    two.edge = Edge(0xF, schema(), began_s=Dispatcher.now())
    await two.until("the new run", lambda: two.second.robots["r"].runs.current == 0xF and two.agrees())
    doc = b'{"type":"event","t":1.0,"level":"fault","source":"RKN","text":"hot","state":"on"}'

    def happen() -> None:
        stamp = two.edge.stamp(Dispatcher.now())
        two.here.carry_out(two.first.take_event("r", "public", doc, stamp, 1.0, 1.0))

    def has_events(count: int) -> bool:
        stream = two.find(two.second)
        return stream is not None and len(stream.events) == count

    for _ in range(2):
        happen()
    await two.until("its events", lambda: has_events(2))
    robot = two.first.robots["r"]
    two.first.drop_robot(robot)  # as after an hour: then it comes back, and its events begin at 1
    two.edge = Edge(0x10, schema(), began_s=Dispatcher.now())
    await two.until("another run", lambda: two.second.robots["r"].runs.current == 0x10 and two.agrees())
    happen()
    await two.until("its event", lambda: has_events(1))


async def test_a_worker_that_takes_nothing_is_cut_and_told_all_anew(
    two: _Two, monkeypatch: pytest.MonkeyPatch
) -> None:
    await two.until("the same frame", two.agrees)
    monkeypatch.setattr(feed_module, "STUCK_S", 0.3)
    reader, writer = await asyncio.open_unix_connection(two.path)
    reader._transport.pause_reading()  # type: ignore[attr-defined]
    for _ in range(2000):  # asks for much, and takes none of it
        writer.write(pack_message(Kind.WANT, "r"))
    await two.until("it listens", lambda: len(two.feed._listeners) == 2)

    def flood() -> bool:
        doc = (
            b'{"type":"event","t":1.0,"level":"fault","source":"RKN","text":"'
            + b"x" * 1900
            + b'","state":"on"}'
        )
        stamp = two.edge.stamp(Dispatcher.now())
        for _ in range(20):
            two.here.carry_out(two.first.take_event("r", "public", doc, stamp, Dispatcher.now(), 1.0))
        if not writer.transport.is_closing():
            writer.write(pack_message(Kind.AGAIN, "r") * 50)
        return len(two.feed._listeners) == 1

    await two.until("it is cut", flood)
    await two.until("the other one is not", two.agrees)
    writer.transport.abort()
    for listener in tuple(two.feed._listeners):  # and the worker's own connection is lost, too
        listener.abort()
    await two.until("it is degraded or back", lambda: two.source.find_trouble() is None)
    await two.until("the same frame again", two.agrees)
    await two.until("nobody is told that it may be old", lambda: not two.second.degraded)


async def test_messages_are_what_was_packed_or_are_refused() -> None:
    reader = asyncio.StreamReader()
    reader.feed_data(pack_message(Kind.SAID, "hubo", b"body") + pack_message(Kind.LEAVE, "r"))
    assert await read_message(reader) == (Kind.SAID, "hubo", b"body")
    assert await read_message(reader) == (Kind.LEAVE, "r", b"")
    for head in (HEAD.pack(1 << 30, Kind.SAID, 1), HEAD.pack(0, 99, 1)):
        reader = asyncio.StreamReader()
        reader.feed_data(head + b"r")
        with pytest.raises(ValueError, match=r"feed|99"):
            await read_message(reader)
    state = pack_state("public", ["seq", 5, "frame", b"\x00\xff", "empty", ""])
    assert unpack_state_values(state) == ("public", {b"seq": b"5", b"frame": b"\x00\xff", b"empty": b""})
    for cut in (2, 7, len(state) - 3):
        with pytest.raises(ValueError, match="cut short"):
            unpack_state_values(state[:cut])
    with pytest.raises(ValueError, match="argument"):  # a name without its value
        unpack_state_values(pack_state("public", ["seq"]))
