"""The first worker's side of the feed: sends further workers the robots that they subscribe to.

Each connection has its own task, and nobody waits for it. Its queue is the set of streams that have changed.
Each stream is read only when it is sent. So a slow worker misses states, but never costs memory, and never
delays viewers of other workers.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import weakref
from collections.abc import Callable
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

from posecast_relay.core.histogram import Histogram
from posecast_relay.core.hub import Hub
from posecast_relay.core.roster import CountsElsewhere, name_robot
from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.stream import FrameOutcome, Stream
from posecast_relay.redis.messages import pack
from posecast_relay.redis.stream_updates import (
    Value,
    WrittenState,
    compute_ns,
    describe_written,
    list_lasting_values,
    make_presence,
    make_update,
)
from posecast_relay.server.workers.feed_messages import Kind, pack_message, pack_state, read_message
from posecast_relay.store import StateStore

T = TypeVar("T")

log = logging.getLogger("posecast_relay")

BEAT_S = 1.0  # between two signs of life of a robot
STUCK_S = 5.0  # a worker that reads nothing for this long is disconnected
BUFFER_BYTES = 1 << 18  # unread bytes of one worker; above this, the next message has to wait
GENERATION = 1  # constant, because there is only one writer
WANTED_MAX = 20_000  # subscriptions of one worker; its viewers and --max-robots limit them


class FeedStore:
    """A state store that also feeds further workers. `elsewhere`: their counts."""

    def __init__(self, store: StateStore, feed: Feed, elsewhere: CountsElsewhere) -> None:
        self._store = store
        self._feed = feed
        self._elsewhere = elsewhere

    def keep(self, stream: Stream) -> None:
        """Note that a stream has changed."""
        try:
            self._store.keep(stream)
        finally:
            self._feed.note(stream)

    def find_trouble(self) -> str | None:
        """Return the store's present problem; None if it works."""
        return self._store.find_trouble()

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return how long the store's exchanges took, and how often it was lost."""
        return self._store.get_exchanges()

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return what the store lists."""
        return self._store.list_robots()

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has in other workers and other processes."""
        return self._store.count_viewers_elsewhere(robot) + self._elsewhere.count_elsewhere(name_robot(robot))


class Feed:
    """The connections of further workers. `path`: where they connect."""

    def __init__(self, path: Path, hub: Hub, now: Callable[[], float], elsewhere: CountsElsewhere) -> None:
        self._path = path
        self._hub = hub
        self._now = now
        self._elsewhere = elsewhere
        self._listeners: set[_Listener] = set()
        self._numberings: weakref.WeakKeyDictionary[Stream, int] = weakref.WeakKeyDictionary()
        self._counts = count(1)
        self._server: asyncio.Server | None = None
        self._beating: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Accept connections. Raises OSError."""
        self._server = await asyncio.start_unix_server(self._serve, path=self._path)
        self._beating = asyncio.create_task(self._beat(), name="feed")

    def stop(self) -> None:
        """Accept no more connections, and close the present ones."""
        if self._server is not None:
            self._server.close()
        if self._beating is not None:
            self._beating.cancel()
        for listener in tuple(self._listeners):
            listener.abort()

    def note(self, stream: Stream) -> None:
        """Queue a stream for all workers that subscribe to its robot. Returns at once."""
        for listener in self._listeners:
            listener.note(stream)

    def find_names(self, stream: Stream) -> tuple[str, str]:
        """Return the names of a stream's version and numbering: one that began anew has others."""
        number = self._numberings.get(stream)
        if number is None:
            number = self._numberings[stream] = next(self._counts)
        return f"{number}:{stream.version}", f"{number}:{stream.numbering}"[:64]

    async def _beat(self) -> None:
        while True:
            await asyncio.sleep(BEAT_S)
            for robot in tuple(
                self._hub.robots.values()
            ):  # its edge is asked now and then while anybody watches
                robot.set_followed(self._elsewhere.count_elsewhere(name_robot(robot.name)) > 0)
            for listener in tuple(self._listeners):
                listener.beat()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        listener = _Listener(self, self._hub, self._now, writer)
        self._listeners.add(listener)
        telling = asyncio.create_task(listener.tell(), name="feed of a worker")
        try:
            while True:
                kind, robot, _ = await read_message(reader)
                listener.take(kind, robot)
        except (
            EOFError,
            OSError,
            ValueError,
            asyncio.CancelledError,
        ):  # the worker is gone, or the relay ends
            pass
        finally:
            self._listeners.discard(listener)
            telling.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await telling
            writer.close()


class _Listener:
    """One further worker that listens."""

    def __init__(self, feed: Feed, hub: Hub, now: Callable[[], float], writer: asyncio.StreamWriter) -> None:
        self._feed = feed
        self._hub = hub
        self._now = now
        self._writer = writer
        self._wanted: set[str] = set()
        self._whole: dict[str, None] = {}  # robots to be told whole
        self._changed: dict[Stream, None] = {}
        self._presences: dict[str, None] = {}  # robots whose presence is due
        self._told: dict[Stream, WrittenState] = {}
        self._tokens: dict[str, bool] = {}
        self._wake = asyncio.Event()
        writer.transport.set_write_buffer_limits(high=BUFFER_BYTES)

    def abort(self) -> None:
        """End the connection."""
        self._writer.transport.abort()

    def note(self, stream: Stream) -> None:
        """A stream has changed."""
        if stream.robot in self._wanted:
            self._changed[stream] = None
            self._wake.set()

    def beat(self) -> None:
        """Send each robot's presence, and forget robots that have left."""
        self._presences |= dict.fromkeys(self._wanted & self._hub.robots.keys())
        for stream in [each for each in self._told if not self._is_here(each)]:
            del self._told[stream]
        self._wake.set()

    def take(self, kind: Kind, robot: str) -> None:
        """Carry out the worker's request."""
        if kind is Kind.LEAVE:
            self._wanted.discard(robot)
            self._tokens.pop(robot, None)
        elif kind in (Kind.WANT, Kind.AGAIN) and (robot in self._wanted or len(self._wanted) < WANTED_MAX):
            self._wanted.add(robot)
            self._whole[robot] = None
            self._wake.set()

    async def tell(self) -> None:
        """Send changes until cancelled, or until the worker stops reading."""
        try:
            while True:
                await self._wake.wait()
                self._wake.clear()
                while self._whole or self._changed or self._presences:
                    self._tell_next()
                    async with asyncio.timeout(STUCK_S):
                        await self._writer.drain()
        except TimeoutError:
            log.warning("a worker reads nothing: disconnecting it")
            self.abort()
        except OSError:
            self.abort()

    def _tell_next(self) -> None:
        """Write the next change. An exception at one robot is counted, and affects only that robot."""
        if self._whole:
            robot = _take_first(self._whole)
            self._guard(robot, partial(self._tell_whole, robot))
        elif self._changed:
            stream = _take_first(self._changed)
            self._guard(stream.robot, partial(self._tell_change, stream))
        else:
            robot = _take_first(self._presences)
            self._guard(robot, partial(self._tell_presence, robot))

    def _guard(self, robot: str, tell: Callable[[], None]) -> None:
        try:
            tell()
        except Exception as e:
            self._hub.outcomes[FrameOutcome.FAULT.value] += 1
            log.error("feed: %s", robot, exc_info=e)

    def _tell_whole(self, robot: str) -> None:
        of = self._hub.robots.get(robot)
        if of is None or robot not in self._wanted:
            return
        for view, room in of.rooms.items():
            stream = room.stream
            if not self._is_current(of, stream) or stream.newest is None:
                continue
            written, names = describe_written(stream, GENERATION), self._feed.find_names(stream)
            values: list[Value] = ["generation", GENERATION, "frame", stream.newest.payload]
            values += ["stamp", compute_ns(stream.newest)]
            values += list_lasting_values(stream, names, written.is_heard)
            self._write(Kind.STATE, robot, pack_state(view, values))
            self._told[stream] = written
            self._changed.pop(stream, None)
        self._tell_presence(robot)

    def _tell_change(self, stream: Stream) -> None:
        of = self._hub.robots.get(stream.robot)
        if of is None or stream.robot not in self._wanted:
            return
        if self._is_current(of, stream):
            before, names, now = self._told.get(stream), self._feed.find_names(stream), self._now()
            update = make_update(stream, before, GENERATION, names, now, now)
            self._told[stream] = describe_written(stream, GENERATION)
            self._write(Kind.SAID, stream.robot, pack(update))
        if self._tokens.get(stream.robot) != of.liveness.token:
            self._tell_presence(stream.robot)

    def _tell_presence(self, robot: str) -> None:
        of, now = self._hub.robots.get(robot), self._now()
        if of is not None and of.heard_at is not None and robot in self._wanted:
            self._tokens[robot] = of.liveness.token
            self._write(Kind.SAID, robot, pack(make_presence(of, now, now)))

    def _write(self, kind: Kind, robot: str, body: bytes) -> None:
        self._writer.write(pack_message(kind, robot, body))

    def _is_here(self, stream: Stream) -> bool:
        of = self._hub.robots.get(stream.robot)
        room = None if of is None else of.rooms.get(stream.view)
        return stream.robot in self._wanted and room is not None and room.stream is stream

    @staticmethod
    def _is_current(of: Robot, stream: Stream) -> bool:
        """Whether there is something to send. Workers keep a view's state from an earlier run as it is."""
        return stream.newest is not None and stream.key is not None and stream.run_id == of.runs.current


def _take_first(waiting: dict[T, None]) -> T:
    first = next(iter(waiting))
    del waiting[first]
    return first
