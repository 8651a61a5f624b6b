"""A further worker's side of the feed: passes messages about robots from the first worker to this hub.

This worker subscribes only to robots that are watched here. If it reads too slowly, the first worker closes
the feed. Then this one reconnects and subscribes again; meanwhile its viewers are told that the state may be
old.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from posecast_relay.core.actions import Action, Fault
from posecast_relay.core.histogram import Histogram
from posecast_relay.core.hub import Hub
from posecast_relay.core.replica_feed import ReplicaFeed
from posecast_relay.core.replica_messages import Presence
from posecast_relay.core.state.stream import FrameOutcome, Stream
from posecast_relay.redis.messages import unpack, unpack_state
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.server.workers.feed_messages import (
    STATE_BYTES_MAX,
    FeedMessage,
    Kind,
    pack_message,
    read_message,
    unpack_state_values,
)

log = logging.getLogger("posecast_relay")

LOOK_S = 1.0  # between two checks of what is watched
GRACE_S = 10.0  # how long an unwatched robot stays subscribed
RETRY_S = 0.1
TURN = 64  # messages in one turn of the loop; viewers are served in between


class FedSource:
    """A RobotSource fed by the first worker, and a StateStore that keeps nothing."""

    _dispatcher: Dispatcher  # from `start` on

    def __init__(
        self, path: Path, hub: Hub, now: Callable[[], float], pinned: Callable[[], Iterable[str]] = tuple
    ) -> None:
        """`pinned` returns the robots that stay subscribed even without viewers."""
        self._path = path
        self._now = now
        self._pinned = pinned
        self._said = ReplicaFeed(hub)
        self._wanted_at: dict[str, float] = {}
        self._writer: asyncio.StreamWriter | None = None
        self._tasks: list[asyncio.Task[None]] = []

    # ---- a store ----------------------------------------------------------

    def keep(self, stream: Stream) -> None:
        """Do nothing: the first worker has the state."""

    def find_trouble(self) -> str | None:
        """Return the feed's present problem; None if it works."""
        return None if self._writer is not None else "the first worker does not answer"

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return None: the first worker reports on the store."""
        return None

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return None: the first worker answers for the list."""
        return None

    def count_viewers_elsewhere(self, robot: str) -> int:  # noqa: ARG002
        """Return 0: the first worker answers for the list."""
        return 0

    # ---- robots wanted ------------------------------------------------------

    def start(self, dispatcher: Dispatcher) -> None:
        """Start to feed the dispatcher's hub. The first worker need not be running yet."""
        self._dispatcher = dispatcher
        self._tasks = [
            asyncio.create_task(self._listen(), name="feed"),
            asyncio.create_task(self._look(), name="who watches"),
        ]

    def stop(self) -> None:
        """Stop listening."""
        for task in self._tasks:
            task.cancel()

    def subscribe(self, robot: str) -> None:
        """Subscribe to a robot from now on."""
        is_new = robot not in self._wanted_at
        self._wanted_at[robot] = self._now()
        if is_new:
            self._ask(Kind.WANT, robot)

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:  # noqa: ARG002 — all are told
        """Ask the first worker for a robot's whole state."""
        self._ask(Kind.AGAIN if robot in self._wanted_at else Kind.WANT, robot)
        self._wanted_at.setdefault(robot, self._now())

    async def open(self, robot: str) -> None:
        """Return at once: the first worker answers HTTP requests."""

    def _ask(self, kind: Kind, robot: str) -> None:
        if self._writer is not None:
            self._writer.write(pack_message(kind, robot))

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            with self._guarded("who watches"):
                for robot in self._pinned():
                    self.subscribe(robot)
                self._leave_unwatched(self._now())

    def _leave_unwatched(self, now: float) -> None:
        for robot, wanted_at in tuple(self._wanted_at.items()):
            of = self._dispatcher.hub.robots.get(robot)
            if of is not None and of.has_viewers():
                self._wanted_at[robot] = now
            elif now - wanted_at > GRACE_S:
                del self._wanted_at[robot]
                self._ask(Kind.LEAVE, robot)
                self._said.forget_robot(robot)

    @contextlib.contextmanager
    def _guarded(self, where: str) -> Iterator[None]:
        """Report exceptions; the work is tried again soon."""
        try:
            yield
        except Exception as e:
            self._dispatcher.report_fault(where, e)

    # ---- what is heard ------------------------------------------------------

    async def _listen(self) -> None:
        while True:
            with self._guarded("the feed"), contextlib.suppress(OSError, EOFError):
                reader, writer = await asyncio.open_unix_connection(self._path, limit=STATE_BYTES_MAX)
                try:
                    await self._follow(reader, writer)
                finally:
                    self._writer = None
                    writer.transport.abort()
                    self._dispatcher.carry_out(self._said.mark_disconnected(self._now()))
            await asyncio.sleep(RETRY_S)

    async def _follow(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        for robot in self._wanted_at:
            self._ask(Kind.WANT, robot)
        self._dispatcher.carry_out(self._said.mark_connected(self._now()))
        left = TURN
        while True:
            message = await read_message(reader)
            self._take(message)
            left -= 1
            if left == 0:
                left = TURN
                await asyncio.sleep(0)

    def _take(self, message: FeedMessage) -> None:
        """Process a message. If that fails with an exception, request the robot's state again."""
        robot = message.robot
        if robot not in self._wanted_at:
            return
        try:
            self._dispatcher.carry_out(self._read(message))
            self._dispatcher.flush()
        except ValueError as e:
            self._dispatcher.hub.outcomes[FrameOutcome.BAD.value] += 1
            log.info("%s from the first worker: %.200s", robot, e)
        except Exception as e:
            self._dispatcher.hub.outcomes[FrameOutcome.FAULT.value] += 1
            self._dispatcher.carry_out([Fault(f"feed: {robot}", e)])
            self._dispatcher.carry_out(self._said.request_state(robot, self._now()))

    def _read(self, message: FeedMessage) -> list[Action]:
        now, robot, said = self._now(), message.robot, self._said
        if message.kind is Kind.STATE:
            view, values = unpack_state_values(message.body)
            state = unpack_state(values)
            said.set_generation(robot, state.generation, said.get_source(robot).generation)
            return said.take_state(robot, view, state, now)
        told = unpack(message.body)
        under_way_s = None if told.sent_s is None else max(0.0, now - told.sent_s)  # one machine, one clock
        if isinstance(told, Presence):
            return said.take_presence(robot, told, under_way_s, now)
        return said.take_update(robot, told, under_way_s, now)
