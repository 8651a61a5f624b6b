"""The gateway's side of Redis: passes robots' states from other processes to the core.

The gateway subscribes to a robot first and then reads its state, so it misses nothing in between. It
subscribes only to robots with viewers.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Sequence
from functools import partial
from typing import Any

from posecast_relay.core.actions import Action, Fault
from posecast_relay.core.hub import Hub
from posecast_relay.core.policy import PUBLIC
from posecast_relay.core.replica import Presence, ReplicaFeed, StreamState
from posecast_relay.core.stream import FrameOutcome, Stream
from posecast_relay.redis.client import (
    REDIS_ERRORS,
    STATUS_MS,
    RedisClient,
    RedisUser,
    cancel_tasks,
    channel,
    state_key,
    status_key,
)
from posecast_relay.redis.directory import BOARD, FRESH_S, RedisDirectory
from posecast_relay.redis.messages import unpack, unpack_state
from posecast_relay.runtime.dispatcher import Dispatcher

log = logging.getLogger("posecast_relay")

BEAT_S = 1.0  # between two signs of life
RETRY_S = 0.2  # while Redis is away
GRACE_S = 10.0  # how long an unwatched robot stays subscribed
AT_ONCE = 32  # robots in one exchange, so that it stays within the timeout
OPEN_S = 0.6  # how long an HTTP request waits for a robot's state
UNHEARD_S = STATUS_MS / 1000  # a robot without messages for this long is checked


class _Watched:
    """A robot that this gateway subscribes to."""

    def __init__(self, now: float) -> None:
        self.wanted_at = now  # when it was last watched or requested
        self.opened = asyncio.Event()  # it is subscribed, and its state was read


class RedisGateway(RedisUser):
    """A gateway's StateStore, which keeps nothing, and its RobotSource, which feeds the hub from Redis."""

    _dispatcher: Dispatcher  # from `start` on

    def __init__(
        self, url: str, hub: Hub, now: Callable[[], float], pinned: Callable[[], Iterable[str]] = tuple
    ) -> None:
        """`pinned` returns the robots that are subscribed to even without viewers."""
        super().__init__(url)
        self.directory = RedisDirectory(self.link, now)
        self.failures = 0
        self._now = now
        self._pinned = pinned
        self._replica = ReplicaFeed(hub)
        self._subscriber = RedisSubscriber(
            self.link, self._take_message, self._record_loss, self._handle_fault
        )
        self._watched: dict[str, _Watched] = {}
        self._unheard: dict[str, None] = {}  # robots to subscribe to
        self._unread: dict[str, None] = {}  # robots to read
        self._asked = asyncio.Event()
        self._reader: asyncio.Task[None] | None = None
        self._failure: BaseException | None = None
        self._wake = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    # ---- a store ----------------------------------------------------------

    def keep(self, stream: Stream) -> None:
        """Do nothing: Redis already has the state."""

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return the robots of the directory, as documents."""
        return self.directory.list_documents()

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has in other processes; 0 while Redis is away."""
        return 0 if self._trouble else self.directory.count_viewers_elsewhere(robot)

    async def start(self, dispatcher: Dispatcher) -> None:
        """Start to feed the dispatcher's hub. Redis need not be running yet."""
        self._dispatcher = dispatcher
        dispatcher.carry_out(self._replica.mark_disconnected(self._now()))
        self._task = asyncio.create_task(self._work(), name="redis gateway")

    async def stop(self) -> None:
        """Stop the tasks and close all connections."""
        await cancel_tasks(self._task, self._reader)
        await self._subscriber.close()
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
                if self.link.note_success():
                    log.warning("redis is back")
            except Exception as e:  # for any error: start over
                await self._handle_failure(e)
                await asyncio.sleep(RETRY_S)
                continue
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(BEAT_S):
                    await self._wake.wait()
            self._wake.clear()

    async def _connect(self) -> None:
        await self.link.connect(BOARD)
        await self._run_part(self._exchange)  # Redis's clock first: it gives the age of everything else
        self._failure = None
        self._unheard = dict.fromkeys(self._watched)
        self._unread.clear()
        await self._catch_up()
        if self._failure is not None:
            raise self._failure
        self._reader = asyncio.create_task(self._read_on(), name="redis reader")
        self._trouble = None
        self._dispatcher.carry_out(self._replica.mark_connected(self._now()))

    async def _handle_failure(self, error: BaseException) -> None:
        if why := self.note_failure(error):
            log.warning("redis: %s; viewers see STALE; retrying", why)
        self.failures += 1
        self._failure = None
        self._dispatcher.carry_out(self._replica.mark_disconnected(self._now()))
        await cancel_tasks(self._reader)
        subscriber, self._subscriber = (
            self._subscriber,
            RedisSubscriber(self.link, self._take_message, self._record_loss, self._handle_fault),
        )
        await subscriber.close()
        self._failure = None  # closing a subscriber may say so
        await self.link.reset()

    def _record_loss(self, error: BaseException) -> None:
        self._failure = error if isinstance(error, Exception) else ConnectionError(str(error))
        self._wake.set()

    async def _exchange(self) -> None:
        robots = self._dispatcher.hub.robots.values()
        viewers = {robot.name: robot.count_viewers() for robot in robots if robot.has_viewers()}
        await self.directory.exchange(viewers, None)

    async def _beat(self) -> None:
        for part in (self._exchange, self._watch_pinned):
            await self._run_part(part)
        for robot in tuple(self._watched):
            await self._run_part(partial(self._maintain, robot), robot)

    async def _run_part(self, part: Callable[[], Awaitable[None]], robot: str | None = None) -> None:
        """Run a part of the work. Redis errors concern all parts; other exceptions end only this part."""
        try:
            await part()
        except REDIS_ERRORS:
            raise
        except Exception as e:
            self._handle_fault(robot, e)

    async def _watch_pinned(self) -> None:
        for robot in self._pinned():
            if robot in self.directory.robots:
                self.subscribe(robot)

    async def _maintain(self, robot: str) -> None:
        now, of = self._now(), self._dispatcher.hub.robots.get(robot)
        watched = self._watched[robot]
        if of is not None and of.has_viewers():
            watched.wanted_at = now
        elif now - watched.wanted_at > GRACE_S and watched.opened.is_set():
            del self._watched[robot]
            self._replica.forget_robot(robot)
            await self._subscriber.unsubscribe(robot)
            return
        if not self._subscriber.is_subscribed(robot):
            self._plan_subscription(robot)
        self._check_silence(robot, now)

    def _check_silence(self, robot: str, now: float) -> None:
        """Find out why a robot is silent: it has left, its relay is gone, or this connection is dead."""
        source = self._replica.get_source(robot)
        if source.told_at is None or now - source.told_at <= UNHEARD_S:
            return
        if self.directory.ages_s.get(robot, FRESH_S) < FRESH_S / 2:
            source.record_presence(now)
            self._plan_subscription(robot)  # which fails, and all is begun anew, if the connection is dead
        elif self.directory.ingests:  # a relay is there and does not know this robot
            source.record_presence(None)
            self._dispatcher.carry_out(self._replica.clear_token(robot, now))
        else:
            self._dispatcher.carry_out(self._replica.set_degraded(True, now, robot))

    def _handle_fault(self, robot: str | None, error: Exception) -> None:
        """Report an exception. If it concerns a robot, read that robot's state again."""
        self._dispatcher.hub.outcomes[FrameOutcome.FAULT.value] += 1
        self._dispatcher.carry_out([Fault(f"redis: {robot}" if robot else "redis", error)])
        if robot is not None:
            self._dispatcher.carry_out(self._replica.request_state(robot, self._now()))

    # ---- robots wanted ------------------------------------------------------

    def subscribe(self, robot: str) -> None:
        """Subscribe to a robot from now on."""
        watched = self._watched.get(robot)
        if watched is not None:
            watched.wanted_at = self._now()
            return
        self._watched[robot] = _Watched(self._now())
        self._plan_subscription(robot)

    def _plan_subscription(self, robot: str) -> None:
        self._unheard[robot] = None
        self._asked.set()

    async def open(self, robot: str) -> None:
        """For an HTTP request: subscribe to a robot that is on air, and wait a moment for its state."""
        if robot not in self._watched and robot not in self.directory.robots:
            return
        self.subscribe(robot)
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._watched[robot].opened.wait(), OPEN_S)

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:  # noqa: ARG002 — all are read
        """Read the state of a robot from Redis soon."""
        self._unread[robot] = None
        self._asked.set()

    async def _read_on(self) -> None:
        """Read requested robots, one exchange after the other."""
        try:
            while True:
                await self._asked.wait()
                await self._catch_up()
        except Exception as e:  # Redis is away, or a bug in the relay: start over
            self._record_loss(e)

    async def _catch_up(self) -> None:
        self._asked.clear()
        while self._unheard or self._unread:
            new = self._take_next(self._unheard)
            if new:
                await self._subscriber.subscribe(*new)
            await self._read(*new or self._take_next(self._unread))
            for robot in new:
                if robot in self._watched:
                    self._watched[robot].opened.set()

    def _take_next(self, waiting: dict[str, None]) -> list[str]:
        taken = list(waiting)[:AT_ONCE]
        for robot in taken:
            del waiting[robot]
        return [robot for robot in taken if robot in self._watched]

    def _list_views(self, robot: str) -> Sequence[str]:
        of = self._dispatcher.hub.robots.get(robot)
        return (*{PUBLIC, *(of.rooms if of else ())},)

    # ---- what comes from Redis: a stranger's ----------------------------------

    async def _read(self, *robots: str) -> None:
        """Read the robots' states and status from Redis, in one exchange."""
        asked = [
            (robot, self._list_views(robot), self._replica.get_source(robot).generation) for robot in robots
        ]
        if not asked:
            return

        def ask(pipe: Any) -> None:
            for robot, views, _ in asked:
                pipe.get(status_key(robot))
                for view in views:
                    pipe.hgetall(state_key(robot, view))

        answers = iter(await self.link.read_all(ask))
        for robot, views, generation in asked:
            standing, states = next(answers), {view: next(answers) for view in views}
            if robot not in self._watched:
                continue
            self._run_guarded(robot, partial(self._take_states, robot, states, generation))
            if isinstance(standing, bytes):  # when the picture that it speaks of has gone out
                self._run_guarded(robot, partial(self._read_message, robot, standing, was_read=True))

    def _take_states(self, robot: str, states: dict[str, Any], asked_generation: int) -> list[Action]:
        found: dict[str, StreamState] = {}
        for view, fields in states.items():
            try:
                if isinstance(fields, dict) and fields:  # else there is none, or something of another type
                    found[view] = unpack_state(fields)
            except ValueError as e:
                self._record_bad(robot, e)
        if found:
            newest = max(state.generation for state in found.values())
            self._replica.set_generation(robot, newest, asked_generation)
        now, out = self._now(), []
        for view, state in found.items():
            try:
                out += self._replica.take_state(robot, view, state, now)
            except ValueError as e:
                self._record_bad(robot, e)
        return out

    def _take_message(self, robot: str, data: bytes) -> None:
        """Process a message from the robot's channel."""
        if robot in self._watched:
            self._run_guarded(robot, partial(self._read_message, robot, data))

    def _run_guarded(self, robot: str, take: Callable[[], list[Action]]) -> None:
        try:
            self._dispatcher.carry_out(take())
            self._dispatcher.flush()
        except Exception as e:
            self._handle_fault(robot, e)

    def _read_message(self, robot: str, data: bytes, was_read: bool = False) -> list[Action]:
        now = self._now()
        try:
            message = unpack(data)
            under_way_s = self.directory.clock.compute_elapsed(message.sent_s, now)
            if was_read and under_way_s is None:  # it may be arbitrarily old
                return []
            if isinstance(message, Presence):
                return self._replica.take_presence(robot, message, under_way_s, now)
            return self._replica.take_update(robot, message, under_way_s, now)
        except ValueError as e:
            self._record_bad(robot, e)
            return []

    def _record_bad(self, robot: str, error: ValueError) -> None:
        self._dispatcher.hub.outcomes[FrameOutcome.BAD.value] += 1
        log.info("%s from redis: %.200s", robot, error)


PREFIX, SUFFIX = "posecast:{", "}:live"


class RedisSubscriber:
    """Calls `heard(robot, message)` in the order of each robot's messages, and `lost(error)` if a connection
    fails. Then `close` it and make a new one. It calls `failed(robot, error)` if a bug prevents a robot's
    subscription. None of the three may raise.
    """

    def __init__(
        self,
        link: RedisClient,
        heard: Callable[[str, bytes], None],
        lost: Callable[[BaseException], None],
        failed: Callable[[str, Exception], None],
    ) -> None:
        self._link = link
        self._heard = heard
        self._lost = lost
        self._failed = failed
        self._at: dict[tuple[str, int], tuple[Any, asyncio.Task[None]]] = {}
        self._asking = asyncio.Lock()
        self._confirmed: dict[str, asyncio.Future[None]] = {}
        self._pubsubs: dict[str, Any] = {}
        self._leaving: Counter[str] = Counter()  # robots whose unsubscription has not been confirmed

    async def subscribe(self, *robots: str) -> None:
        """Subscribe to robots. After this returns, no message is missed. Raises REDIS_ERRORS."""
        async with self._asking:  # the first caller opens a server's only connection
            asked = [robot for robot in robots if await self._guarded(robot)]
        await self._link.call(asyncio.gather(*(self._confirmed[robot] for robot in asked)))

    def is_subscribed(self, robot: str) -> bool:
        """Whether this robot is subscribed."""
        return robot in self._pubsubs

    async def _guarded(self, robot: str) -> bool:
        try:
            await self._ask(robot)
        except REDIS_ERRORS:
            raise
        except Exception as e:
            self._pubsubs.pop(robot, None)
            self._failed(robot, e)
            return False
        return True

    async def _ask(self, robot: str) -> None:
        address, client = self._link.open_listener(robot)
        self._confirmed[robot] = asyncio.get_running_loop().create_future()
        known = self._at.get(address)
        pubsub = client.pubsub() if known is None else known[0]
        self._pubsubs[robot] = pubsub
        await self._link.call(pubsub.ssubscribe(channel(robot)))
        if known is None:
            self._at[address] = (pubsub, asyncio.create_task(self._listen(pubsub), name="redis ear"))

    async def unsubscribe(self, robot: str) -> None:
        """Unsubscribe from a robot. Raises REDIS_ERRORS."""
        async with self._asking:
            pubsub = self._pubsubs.pop(robot, None)
            self._confirmed.pop(robot, None)
            if pubsub is not None:
                self._leaving[robot] += 1
                await self._link.call(pubsub.sunsubscribe(channel(robot)))

    async def close(self) -> None:
        """Drop all connections."""
        listening, self._at = self._at, {}
        await cancel_tasks(*(task for _, task in listening.values()))
        for pubsub, _ in listening.values():
            with contextlib.suppress(*REDIS_ERRORS):
                await self._link.call(pubsub.aclose())

    async def _listen(self, pubsub: Any) -> None:
        try:
            while True:
                message = await pubsub.get_message(timeout=None)
                if message is not None:
                    self._take(message["type"], _read_robot(message["channel"]), message["data"])
        except Exception as e:  # a connection that is lost, or closed under way; a message that is none
            self._lost(e)

    def _take(self, kind: str, robot: str, data: Any) -> None:
        if kind == "smessage":
            self._heard(robot, data)
        elif kind == "ssubscribe":
            confirmed = self._confirmed.get(robot)
            if confirmed is not None and not confirmed.done():
                confirmed.set_result(None)
        elif kind == "sunsubscribe" and self._leaving[robot] > 0:
            self._leaving[robot] -= 1
            if not self._leaving[robot]:
                del self._leaving[robot]
        elif kind == "sunsubscribe" and robot in self._pubsubs:
            raise ConnectionError("the channel has moved to another node")


def _read_robot(name: bytes) -> str:
    return name.decode().removeprefix(PREFIX).removesuffix(SUFFIX)
