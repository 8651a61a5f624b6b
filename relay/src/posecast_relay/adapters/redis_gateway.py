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
from posecast_relay.core.robot import PUBLIC
from posecast_relay.core.stream import Stream

log = logging.getLogger("posecast_relay")

BEAT_S = 1.0  # between two signs of life
RETRY_S = 0.2  # while Redis is gone
GRACE_S = 10.0  # a robot that nobody watches any more is listened for so long
OPEN_S = 0.6  # an HTTP request waits for a robot's state at most so long
UNHEARD_S = STATUS_MS / 1000  # a robot of which nothing was heard for so long


class _Watched:
    """A robot that is listened for."""

    def __init__(self, now: float) -> None:
        self.wanted_at = now  # somebody watched it or asked for it then
        self.told_at: float | None = None  # its standing was heard then
        self.generation = 0
        self.versions: dict[str, str] = {}  # by view, of the schema, info and model that are here
        self.opening: asyncio.Task[None] | None = None


class RedisGateway:
    """A store for the pump (nothing is kept) and the source of everything it hands out."""

    def __init__(self, url: str, pump: Pump) -> None:
        self.link = Link(url)
        self.board = Board(self.link)
        self.failures = 0
        self._pump = pump
        self._ear = Ear(self.link, self._heard, self._lost)
        self._watched: dict[str, _Watched] = {}
        self._asking: dict[str, asyncio.Task[None]] = {}
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
        pump.carry_out(pump.hub.degrade(True, pump.now()))
        self._task = asyncio.create_task(self._work(), name="redis gateway")

    async def stop(self) -> None:
        """Let go."""
        tasks = [self._task, *self._asking.values(), *(w.opening for w in self._watched.values())]
        for task in tasks:
            await end(task)
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
        for robot, watched in tuple(self._watched.items()):
            watched.generation = 0  # Redis may have forgotten it
            await self._ear.subscribe(robot)
            await self._read(robot, self._views(robot))
        if self._failure is not None:
            raise self._failure
        if self.failures:
            log.warning("redis is back")
        self._trouble = None
        self._pump.carry_out(self._pump.hub.degrade(False, self._pump.now()))

    async def _failed(self, error: BaseException) -> None:
        if self._trouble is None or not self.failures:
            log.warning("redis: %s; viewers are told, trying on", str(error) or type(error).__name__)
        self.failures += 1
        self._failure = None
        self._trouble = name_of(error)  # /readyz is public: no addresses
        self._pump.carry_out(self._pump.hub.degrade(True, self._pump.now()))
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
        for robot, watched in tuple(self._watched.items()):
            of = hub.robots.get(robot)
            if of is not None and of.has_viewers():
                watched.wanted_at = now
            elif now - watched.wanted_at > GRACE_S and (watched.opening is None or watched.opening.done()):
                del self._watched[robot]
                hub.forget(robot)
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
            pump.carry_out(pump.hub.degrade(False, now, robot))
        else:
            pump.carry_out(pump.hub.degrade(True, now, robot))

    # ---- robots wanted ------------------------------------------------------

    def _watch(self, robot: str) -> None:
        """The first viewer of a robot came."""
        watched = self._watched.get(robot)
        if watched is not None:
            watched.wanted_at = self._pump.now()
            return
        watched = self._watched[robot] = _Watched(self._pump.now())
        watched.opening = asyncio.create_task(self._listen_for(robot), name=f"redis {robot}")

    async def _open(self, robot: str) -> None:
        """For an HTTP request: listen for a robot that is on air, and wait a little for its state."""
        if robot not in self._watched and robot not in self.board.robots:
            return
        self._watch(robot)
        opening = self._watched[robot].opening
        if opening is not None and not opening.done():
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(asyncio.shield(opening), OPEN_S)

    async def _listen_for(self, robot: str) -> None:
        if self._trouble is not None:  # those watched are listened for once Redis is there
            return
        try:
            await self._ear.subscribe(robot)
            await self._read(robot, self._views(robot))
        except REDIS_ERRORS as e:
            self._lost(e)

    def _views(self, robot: str) -> Sequence[str]:
        of = self._pump.hub.robots.get(robot)
        return (*{PUBLIC, *(of.rooms if of else ())},)

    def _ask(self, robot: str, views: Sequence[str]) -> None:
        """The core lacks something."""
        if self._trouble is None and robot in self._watched and robot not in self._asking:
            task = self._asking[robot] = asyncio.create_task(self._answer(robot, views))
            task.add_done_callback(lambda _: self._asking.pop(robot, None))

    async def _answer(self, robot: str, views: Sequence[str]) -> None:
        try:
            await self._read(robot, views)
        except REDIS_ERRORS as e:
            self._lost(e)

    # ---- what comes from Redis ------------------------------------------------

    async def _read(self, robot: str, views: Sequence[str]) -> None:
        """The snapshot: the state as Redis has it, then the robot's standing."""
        client, call = self.link.client, self.link.call
        for view in views:
            state = await call(client.hgetall(state_key(robot, view)))
            if state and robot in self._watched:
                try:
                    self._take(robot, view, state)
                except (ValueError, KeyError, TypeError) as e:
                    log.info("state of %s/%s in redis: %.200s", robot, view, e)
        standing = await call(client.get(status_key(robot)))
        left_ms = await call(client.pttl(status_key(robot))) if standing else 0
        if standing and robot in self._watched:
            self._stand(robot, unpack(standing), max(0.0, (STATUS_MS - left_ms) / 1000))
        self._pump.flush()

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
        for event in json.loads(state[b"events"]):
            text = json.dumps(event, separators=(",", ":"), ensure_ascii=False)
            pump.carry_out(pump.hub.heard_of(robot, view, int(event["n"]), text))

    def _heard(self, robot: str, data: bytes) -> None:
        """A message of the robot's channel."""
        watched = self._watched.get(robot)
        if watched is None:
            return
        try:
            said = unpack(data)
        except ValueError as e:
            self._pump.hub.fates["bad"] += 1
            log.info("%s: %s", robot, e)
            return
        if isinstance(said, Standing):
            self._stand(robot, said, 0.0)
        else:
            self._update(robot, watched, said)
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
            pump.carry_out(hub.heard_of(robot, update.view, int(json.loads(text)["n"]), text))
        if watched.versions.get(update.view) != update.version:
            hub.lacks(robot)

    def _stand(self, robot: str, said: Update | Standing, age_s: float) -> None:
        if not isinstance(said, Standing):
            return
        pump, now = self._pump, self._pump.now()
        self._watched[robot].told_at = now - age_s
        ages_s = {view: None if a is None else a + age_s for view, a in said.ages_s.items()}
        pump.carry_out(pump.hub.standing(robot, said.token, ages_s, now))
        pump.carry_out(pump.hub.degrade(False, now, robot))
