"""The gateway's side of Redis: what other processes hear of robots, fed to the core by the calls that an
edge's own messages take. Subscribe, then read: joining leaves no gap. Only robots that somebody watches are
listened for.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections.abc import Sequence
from typing import Any

from posecast_wire import Snapshot, Stamp

from posecast_relay.adapters.pump import Pump
from posecast_relay.adapters.redis_board import BOARD, FRESH_S, Board
from posecast_relay.adapters.redis_ear import Ear
from posecast_relay.adapters.redis_link import (
    REDIS_ERRORS,
    STATUS_MS,
    Link,
    end,
    name_of,
    state_key,
    status_key,
)
from posecast_relay.adapters.relayed import Standing, Update, unpack
from posecast_relay.core.histogram import Histogram
from posecast_relay.core.policy import PUBLIC
from posecast_relay.core.secondhand import Secondhand
from posecast_relay.core.stream import Stream

log = logging.getLogger("posecast_relay")

BEAT_S = 1.0  # between two signs of life
RETRY_S = 0.2  # while Redis is gone
GRACE_S = 10.0  # a robot that nobody watches any more is listened for so long
AT_ONCE = 32  # robots in one exchange, so that it keeps within its time
OPEN_S = 0.6  # an HTTP request waits for a robot's state at most so long
UNHEARD_S = STATUS_MS / 1000  # a robot of which nothing was heard for so long


class _Watched:
    """A robot that is listened for."""

    def __init__(self, now: float) -> None:
        self.wanted_at = now  # somebody watched it or asked for it then
        self.told_at: float | None = None  # its standing was heard then
        self.generation = 0
        self.versions: dict[str, str] = {}  # by view, of the schema, info and model that are here
        self.opened = asyncio.Event()  # it is listened for, and was read


class RedisGateway:
    """A store for the pump (nothing is kept) and the source of everything it hands out."""

    def __init__(self, url: str, pump: Pump) -> None:
        self.link = Link(url)
        self.board = Board(self.link)
        self.failures = 0
        self.losses = 0  # times that Redis, having been there, was not any more
        self._pump = pump
        self._said = Secondhand(pump.hub)
        self._ear = Ear(self.link, self._heard, self._lost)
        self._watched: dict[str, _Watched] = {}
        self._unheard: dict[str, None] = {}  # robots to listen for
        self._unread: dict[str, None] = {}  # robots to read
        self._asked = asyncio.Event()
        self._reader: asyncio.Task[None] | None = None
        self._trouble: str | None = "redis: not connected yet"
        self._failure: BaseException | None = None
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    # ---- a store ----------------------------------------------------------

    def keep(self, stream: Stream) -> None:
        """Redis has it already."""

    def trouble(self) -> str | None:
        """What is wrong with Redis, if anything."""
        return self._trouble

    def exchanges(self) -> tuple[Histogram, int] | None:
        """With Redis."""
        return self.link.seconds, self.losses

    def robots(self) -> list[dict[str, Any]] | None:
        """As the board says."""
        return self.board.documents(self._pump.now())

    def viewers_elsewhere(self, robot: str) -> int:
        """As the board says; none while Redis is gone."""
        return 0 if self._trouble else self.board.viewers_elsewhere(robot)

    async def start(self) -> None:
        """Begin to listen; Redis may come later."""
        pump = self._pump
        pump.ask, pump.watch, pump.open = self._ask, self._watch, self._open
        pump.carry_out(self._said.degrade(True, pump.now()))
        self._task = asyncio.create_task(self._work(), name="redis gateway")

    async def stop(self) -> None:
        """Let go."""
        await end(self._task, self._reader)
        await self._ear.close()
        await self.link.close()

    # ---- signs of life ------------------------------------------------------

    async def _work(self) -> None:
        while True:
            try:
                if self._failure is not None:
                    raise self._failure
                if self._trouble is not None:
                    await self._connect()
                await self._beat()
            except REDIS_ERRORS as e:
                await self._failed(e)
                await asyncio.sleep(RETRY_S)
                continue
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(BEAT_S):
                    await self._wake.wait()
            self._wake.clear()

    async def _connect(self) -> None:
        await self.link.connect(BOARD)
        self._failure = None
        self._unheard = dict.fromkeys(self._watched)
        self._unread.clear()
        for watched in self._watched.values():
            watched.generation = 0  # Redis may have forgotten it
            if watched.told_at is not None:
                watched.told_at = self._pump.now()  # judged anew, but not before it can have been heard
        await self._catch_up()
        if self._failure is not None:
            raise self._failure
        self._reader = asyncio.create_task(self._read_on(), name="redis reader")
        if self.failures:
            log.warning("redis is back")
        self._trouble = None
        self._pump.carry_out(self._said.degrade(False, self._pump.now()))

    async def _failed(self, error: BaseException) -> None:
        if why := self.link.news(error):
            log.warning("redis: %s; viewers are told, trying on", why)
        self.failures += 1
        self.losses += self._trouble is None
        self._failure = None
        self._trouble = name_of(error)  # /readyz is public: no addresses
        self._pump.carry_out(self._said.degrade(True, self._pump.now()))
        await end(self._reader)
        ear, self._ear = self._ear, Ear(self.link, self._heard, self._lost)
        await ear.close()
        self._failure = None  # closing an ear may say so
        await self.link.reset()

    def _lost(self, error: BaseException) -> None:
        self._failure = error if isinstance(error, REDIS_ERRORS) else ConnectionError(str(error))
        self._wake.set()

    async def _beat(self) -> None:
        hub, now = self._pump.hub, self._pump.now()
        viewers = {r.name: r.viewer_count() for r in hub.robots.values() if r.has_viewers()}
        await self.board.exchange(now, viewers, None)
        for robot in self._pump.pinned():
            if robot in self.board.robots:
                self._watch(robot)
        for robot, watched in tuple(self._watched.items()):
            of = hub.robots.get(robot)
            if of is not None and of.has_viewers():
                watched.wanted_at = now
            elif now - watched.wanted_at > GRACE_S and watched.opened.is_set():
                del self._watched[robot]
                self._said.forget(robot)
                await self._ear.unsubscribe(robot)
                continue
            self._judge(robot, watched, now)

    def _judge(self, robot: str, watched: _Watched, now: float) -> None:
        """A robot whose relay tells nothing any more: has it left, is that relay gone, or am I deaf?"""
        if watched.told_at is None or now - watched.told_at <= UNHEARD_S:
            return
        pump = self._pump
        if self.board.ages_s.get(robot, FRESH_S) < FRESH_S / 2:
            self._lost(ConnectionError("the subscription is dead"))
        elif self.board.ingests:  # a relay is there and does not know this robot
            watched.told_at = None
            pump.carry_out(pump.hub.token(robot, False, now))
            pump.carry_out(self._said.degrade(False, now, robot))
        else:
            pump.carry_out(self._said.degrade(True, now, robot))

    # ---- robots wanted ------------------------------------------------------

    def _watch(self, robot: str) -> None:
        """The first viewer of a robot came."""
        watched = self._watched.get(robot)
        if watched is not None:
            watched.wanted_at = self._pump.now()
            return
        self._watched[robot] = _Watched(self._pump.now())
        self._unheard[robot] = None
        self._asked.set()

    async def _open(self, robot: str) -> None:
        """For an HTTP request: listen for a robot that is on air, and wait a little for its state."""
        if robot not in self._watched and robot not in self.board.robots:
            return
        self._watch(robot)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._watched[robot].opened.wait(), OPEN_S)

    def _ask(self, robot: str, _views: Sequence[str]) -> None:
        """The core lacks something."""
        self._unread[robot] = None
        self._asked.set()

    async def _read_on(self) -> None:
        """One exchange after the other, however many robots are asked for at once."""
        try:
            while True:
                await self._asked.wait()
                await self._catch_up()
        except REDIS_ERRORS as e:
            self._lost(e)

    async def _catch_up(self) -> None:
        self._asked.clear()
        while self._unheard or self._unread:
            new = self._next(self._unheard)
            if new:
                await self._ear.subscribe(*new)
            await self._read(*new or self._next(self._unread))
            for robot in new:
                if robot in self._watched:
                    self._watched[robot].opened.set()

    def _next(self, waiting: dict[str, None]) -> list[str]:
        taken = list(waiting)[:AT_ONCE]
        for robot in taken:
            del waiting[robot]
        return [robot for robot in taken if robot in self._watched]

    def _views(self, robot: str) -> Sequence[str]:
        of = self._pump.hub.robots.get(robot)
        return (*{PUBLIC, *(of.rooms if of else ())},)

    # ---- what comes from Redis ------------------------------------------------

    async def _read(self, *robots: str) -> None:
        """The snapshots: states as Redis has them, and the robots' standing, in one exchange."""
        if not robots:
            return
        pipe = self.link.client.pipeline(transaction=False)
        asked = [(robot, self._views(robot)) for robot in robots]
        for robot, views in asked:
            for view in views:
                pipe.hgetall(state_key(robot, view))
            pipe.get(status_key(robot)).pttl(status_key(robot))
        answers = iter(await self.link.call(pipe.execute()))
        for robot, views in asked:
            self._taken(robot, {view: next(answers) for view in views}, next(answers), next(answers))
        self._pump.flush()

    def _taken(
        self, robot: str, states: dict[str, dict[bytes, bytes]], standing: bytes | None, left_ms: int
    ) -> None:
        if robot not in self._watched:
            return
        for view, state in states.items():
            try:
                if state:
                    self._take(robot, view, state)
            except (ValueError, KeyError, TypeError) as e:
                log.info("state of %s/%s in redis: %.200s", robot, view, e)
        with contextlib.suppress(ValueError):  # as good as none
            if standing:
                self._stand(robot, unpack(standing), max(0.0, (STATUS_MS - left_ms) / 1000))

    def _take(self, robot: str, view: str, state: dict[bytes, bytes]) -> None:
        pump, watched = self._pump, self._watched[robot]
        generation = int(state[b"generation"])
        if generation < watched.generation:
            return
        watched.generation = generation
        watched.versions[view] = state[b"version"].decode()
        snapshot = Snapshot(
            state[b"schema"].decode(),
            json.loads(state[b"info"]),
            state[b"key"],
            state[b"ref"] or None,
            state[b"model"].decode() or None,
        )
        stamp = Stamp(int(state[b"run"], 16), int(state[b"stamp"]))
        pump.hub.snapshot(robot, view, snapshot, stamp, pump.now(), state[b"frame"])
        numbering = state[b"numbering"].decode()
        for event in json.loads(state[b"events"]):
            text = json.dumps(event, separators=(",", ":"), ensure_ascii=False)
            pump.carry_out(self._said.event(robot, view, numbering, text))

    def _heard(self, robot: str, data: bytes) -> None:
        """A message of the robot's channel."""
        watched = self._watched.get(robot)
        if watched is None:
            return
        try:
            said = unpack(data)
            if isinstance(said, Standing):
                self._stand(robot, said, 0.0)
            else:
                self._update(robot, watched, said)
        except ValueError as e:
            self._pump.hub.fates["bad"] += 1
            log.info("%s: %s", robot, e)
        self._pump.flush()

    def _update(self, robot: str, watched: _Watched, update: Update) -> None:
        if update.generation < watched.generation:
            self._pump.hub.fates["retired"] += 1
            return
        watched.generation = update.generation
        pump, hub = self._pump, self._pump.hub
        now = pump.now()
        for ns, payload in update.frames:
            hub.frame(robot, update.view, payload, Stamp(update.run_id, ns), now, update.late_s)
        for text in update.events:
            pump.carry_out(self._said.event(robot, update.view, update.numbering, text))
        if watched.versions.get(update.view) != update.version:
            self._said.lacks(robot)

    def _stand(self, robot: str, said: Update | Standing, age_s: float) -> None:
        if not isinstance(said, Standing):
            return
        pump, now = self._pump, self._pump.now()
        self._watched[robot].told_at = now - age_s
        ages_s = {view: None if a is None else a + age_s for view, a in said.ages_s.items()}
        pump.carry_out(self._said.standing(robot, said.token, ages_s, now))
        pump.carry_out(self._said.degrade(False, now, robot))
