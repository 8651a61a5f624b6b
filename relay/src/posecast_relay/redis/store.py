"""Writes the newest state of every stream to Redis, from a process that hears robots.

One task writes, and nobody waits for it. Its queue is the set of changed streams. Each stream is read only
when it is written, so a slow or dead Redis costs states, but never memory or a viewer's frame. The same write
publishes the change on the robot's channel. So a process that subscribes and then reads misses nothing.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from typing import Any, NamedTuple, TypeVar

from posecast_relay.core.hub import Hub
from posecast_relay.core.replica import Presence
from posecast_relay.core.robot import RETURN_AFTER_S, Robot
from posecast_relay.core.stream import FrameOutcome, Stream
from posecast_relay.redis.client import (
    REDIS_ERRORS,
    Call,
    RedisUser,
    cancel_tasks,
    channel,
    generation_key,
    state_key,
    status_key,
    writer_key,
)
from posecast_relay.redis.directory import BOARD, RedisDirectory
from posecast_relay.redis.messages import (
    Value,
    WrittenState,
    compute_ns,
    describe_written,
    list_lasting_values,
    make_presence,
    make_update,
    pack,
    unpack,
    unpack_events,
)
from posecast_relay.redis.scripts import CLAIM, GUARD, INCOMPLETE, LEASE_MS, OUTRUN, REFUSED, STATUS, STORED

log = logging.getLogger("posecast_relay")


def make_state_call(
    stream: Stream,
    before: WrittenState | None,
    generation: int,
    writer: str,
    now: float,
    sent_s: float | None,
) -> tuple[WrittenState, Call]:
    """Make the call that writes a stream's newest state and publishes its changes; also return that state.

    `before`: what this process wrote last; None: write the whole state. `writer`: the process's name.
    `sent_s`: Redis's clock.
    """
    newest, state = stream.newest, describe_written(stream, generation)
    assert newest is not None
    light = before == state
    names = f"{writer}:{stream.version}", stream.numbering
    values: list[Value] = ["frame", newest.payload, "stamp", compute_ns(newest)]
    if not light:
        values += list_lasting_values(stream, names, state.is_heard)
    update = make_update(stream, before, generation, names, now, sent_s)
    keys = [state_key(stream.robot, stream.view), generation_key(stream.robot)]
    keys += [channel(stream.robot), writer_key(stream.robot)]
    args = [generation, newest.seq, "0" if light else "1", state.key.id, pack(update), *values]
    return state, (GUARD, keys, args)


def make_presence_call(
    robot: Robot, generation: int, written: Iterable[str], now: float, sent_s: float | None
) -> Call:
    """Make the call that publishes a robot's presence.

    `written`: the views whose states should be in Redis.
    """
    packed = pack(make_presence(robot, now, sent_s))
    name = robot.name
    names = [status_key(name), channel(name), writer_key(name), generation_key(name)]
    return STATUS, [*names, *(state_key(name, view) for view in written)], [generation, packed]


def gives_way(stored: object, has_token: bool) -> bool:
    """Whether this presence comes from a relay that should give the robot to another one.

    It has heard no frame for long, or does not see the robot's agent while the other one does (`has_token`).
    """
    try:
        presence = unpack(stored) if isinstance(stored, bytes) else None
    except ValueError:
        return False
    if not isinstance(presence, Presence):
        return False
    if has_token and not presence.token:
        return True
    return all(age_s is None or age_s > RETURN_AFTER_S for age_s in presence.ages_s.values())


T = TypeVar("T")
Describe = Callable[[Robot], dict[str, Any]]


ROUND_S = 0.005  # between two rounds, so that many robots share a round
BEAT_S = 1.0  # between two signs of life
LOOK_S = 0.25  # between two checks whether other processes still write their robots
SETTLE_S = 1.0  # after a change of writer, or when Redis is back: the other's data may still be under way
BACKOFF_S = (0.1, 0.4)  # first and longest wait after a failure
STOP_S = 1.0
UNCLAIMED = REFUSED  # instead of a generation


class _Turn(NamedTuple):
    """This process's claim to write a robot."""

    run_id: int
    generation: int


class RedisStore(RedisUser):
    """Writes all streams to Redis. `describe` returns a robot's document for the directory."""

    def __init__(self, url: str, hub: Hub, now: Callable[[], float], describe: Describe) -> None:
        self.failures = 0
        super().__init__(url)
        self.directory = RedisDirectory(self.link, now)
        self._hub = hub
        self._now = now
        self._describe = describe
        self._dirty: dict[Stream, None] = {}
        self._written: dict[Stream, WrittenState] = {}
        self._turns: dict[str, _Turn] = {}  # by robot
        self._tokens: dict[str, bool] = {}  # as told last
        self._superseded: dict[str, float] = {}  # robots that another process writes; when it last did
        self._look_at = 0.0  # whether it still does
        self._resumed: set[Stream] = set()
        self._sent_n: dict[Stream, int] = {}  # its newest event that reached Redis
        self._counts = count(1)
        self._wake = asyncio.Event()
        self._beat_at = 0.0
        self._task: asyncio.Task[None] | None = None

    def keep(self, stream: Stream) -> None:
        """Queue a stream for writing. Returns at once."""
        self._dirty[stream] = None
        self._wake.set()

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return None: this process hears the robots itself."""
        return None

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has in other processes; 0 while Redis is away."""
        return 0 if self._trouble else self.directory.count_viewers_elsewhere(robot)

    async def start(self) -> None:
        """Start the writing task. Redis need not be running yet."""
        self._task = asyncio.create_task(self._work(), name="redis")

    async def stop(self) -> None:
        """Write the last changes, then close all connections."""
        await cancel_tasks(self._task)
        with contextlib.suppress(Exception):  # best effort
            async with asyncio.timeout(STOP_S):
                if self._trouble is None:
                    await self._write_changed()
        await self.link.close()

    async def _work(self) -> None:
        wait_s = BACKOFF_S[0]
        while True:
            try:
                if self._trouble is not None:
                    await self._connect()
                await self._write_changed()
                if self._superseded and self._now() >= self._look_at:
                    self._look_at = self._now() + LOOK_S
                    await self._check_superseded()
                if self._now() >= self._beat_at:
                    self._beat_at = self._now() + BEAT_S
                    await self._beat()
                wait_s = BACKOFF_S[0]
                if self.link.note_success():
                    log.warning("redis is back")
            except Exception as e:  # for any error: write everything again
                await self._handle_failure(e)
                await asyncio.sleep(wait_s)
                wait_s = min(2 * wait_s, BACKOFF_S[1])
                continue
            await asyncio.sleep(ROUND_S)
            next_at = min(self._beat_at, self._look_at) if self._superseded else self._beat_at
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(0.0, next_at - self._now())):
                    await self._wake.wait()
            self._wake.clear()

    async def _connect(self) -> None:
        await self.link.connect(CLAIM, GUARD, STATUS, BOARD)
        await self._exchange([])  # Redis's clock first: gateways use it to compute ages
        self._written.clear()  # write whole states, whatever Redis has
        self._look_at = self._now() + SETTLE_S
        for robot in self._hub.robots.values():
            self._dirty |= {room.stream: None for room in robot.rooms.values()}
        self._beat_at = 0.0
        self._trouble = None

    async def _handle_failure(self, error: BaseException) -> None:
        if why := self.note_failure(error):
            log.warning("redis: %s; viewers here are not affected; retrying", why)
        self.failures += 1
        await self.link.reset()

    def _handle_fault(self, robot: str, error: Exception) -> None:
        """Count an error in one robot's data, so that the others are still written."""
        self._hub.outcomes[FrameOutcome.FAULT.value] += 1
        log.error("redis: %s", robot, exc_info=error)

    def _run_guarded(self, robot: str, make: Callable[[], T]) -> T | None:
        """Return the result of `make` for this robot; None if it raises an exception."""
        try:
            return make()
        except Exception as e:
            self._handle_fault(robot, e)
            return None

    # ---- what changed ------------------------------------------------------

    async def _write_changed(self) -> None:
        """Write every stream that changed."""
        batch, self._dirty = self._dirty, {}
        try:
            await self._write(batch)
        except BaseException:
            self._dirty = batch | self._dirty
            self._written.clear()
            raise

    async def _write(self, batch: Iterable[Stream]) -> None:
        current = [
            stream for stream in batch if self._run_guarded(stream.robot, partial(self._is_current, stream))
        ]
        await self._claim(current)
        mine = [s for s in current if s.robot in self._turns and s.robot not in self._superseded]
        await self._resume(mine)
        calls = {
            stream: self._run_guarded(stream.robot, partial(self._make_state_call, stream)) for stream in mine
        }
        made = {stream: call for stream, call in calls.items() if call is not None}
        for stream, result in zip(made, await self.link.run_all(list(made.values())), strict=True):
            self._record_result(stream, result)
        told = {stream.robot: self._hub.robots.get(stream.robot) for stream in batch}
        await self._tell([r for r in told.values() if r and self._tokens.get(r.name) != r.liveness.token])

    def _is_current(self, stream: Stream) -> bool:
        """Whether there is something to write. Redis keeps a view's state from an earlier run as it is."""
        robot = self._hub.robots.get(stream.robot)
        there = stream.newest is not None and stream.key is not None
        return there and robot is not None and stream.run_id == robot.runs.current

    def _record_result(self, stream: Stream, result: object) -> None:
        if result == STORED:
            self._sent_n[stream] = self._written[stream].event_n
            return
        self._written.pop(stream, None)
        if isinstance(result, Exception):
            self._handle_fault(stream.robot, result)  # it is tried again with the next frame
        elif result == REFUSED:
            self._supersede(stream.robot)
        else:
            if result == OUTRUN:
                self._turns.pop(stream.robot, None)
            self.keep(stream)

    async def _claim(self, streams: Iterable[Stream]) -> None:
        """Claim every robot that has a new run, or that this process has not written yet."""
        claimed: dict[str, tuple[int, list[str]]] = {}
        hears: dict[str, bool] = {}
        for stream in streams:
            robot, turn = stream.robot, self._turns.get(stream.robot)
            if robot not in hears:
                hears[robot] = bool(
                    self._run_guarded(robot, partial(self._hears_frames, self._hub.robots[robot]))
                )
            waits = turn is not None and turn.generation == UNCLAIMED and hears[robot]
            if turn is None or turn.run_id != stream.run_id or waits:
                _, states = claimed.setdefault(robot, (stream.run_id, []))
                states.append(state_key(robot, stream.view))
        calls: list[Call] = []
        for robot, (_, states) in claimed.items():
            keys = [generation_key(robot), writer_key(robot), *states]
            calls.append((CLAIM, keys, ["1" if hears[robot] else "0"]))
        for robot, generation in zip(claimed, await self.link.run_all(calls), strict=True):
            if isinstance(generation, Exception):
                self._handle_fault(robot, generation)
                continue
            self._turns[robot] = _Turn(claimed[robot][0], int(generation))
            if generation == UNCLAIMED:  # another process writes it, and this one hears no frames
                self._supersede(robot)
            else:
                self._superseded.pop(robot, None)
                self._tokens.pop(robot, None)  # told with this write

    def _supersede(self, robot: str) -> None:
        self._superseded[robot] = self._now()
        self._look_at = self._now() + SETTLE_S

    async def _resume(self, streams: Iterable[Stream]) -> None:
        """Continue the numbering of these streams' events where an earlier process stopped."""
        new = [stream for stream in streams if stream not in self._resumed]
        if not new:
            return

        def ask(pipe: Any) -> None:
            for stream in new:
                pipe.hmget(state_key(stream.robot, stream.view), ["events", "numbering"])

        for stream, found in zip(new, await self.link.read_all(ask), strict=True):
            self._run_guarded(stream.robot, partial(self._resume_from, stream, found))
            self._resumed.add(stream)

    def _resume_from(self, stream: Stream, found: Any) -> None:
        stream.set_numbering(f"{self.directory.id}:{next(self._counts)}")  # unless somebody's count is there
        texts, numbering = found if isinstance(found, list) else (None, None)  # else it is no hash
        if not texts or not numbering:
            return
        try:
            stream.resume_events(numbering.decode(), unpack_events(texts), self._sent_n.get(stream, 0))
        except ValueError as e:
            log.warning("events of %s/%s in redis: %.200s", stream.robot, stream.view, e)

    def _make_state_call(self, stream: Stream) -> Call:
        now, generation = self._now(), self._turns[stream.robot].generation
        before, here = self._written.get(stream), self.directory
        state, call = make_state_call(stream, before, generation, here.id, now, here.clock.estimate_time(now))
        self._written[stream] = state
        return call

    # ---- signs of life -----------------------------------------------------

    async def _check_superseded(self) -> None:
        """Take over robots that another process has stopped writing, or no longer hears."""
        for robot in self._superseded.keys() - self._hub.robots.keys():
            del self._superseded[robot]
        robots = list(self._superseded)
        if not robots:
            return

        def ask(pipe: Any) -> None:
            for robot in robots:
                pipe.pttl(writer_key(robot)).get(status_key(robot))

        answers = iter(await self.link.read_all(ask))
        for robot in robots:
            lease_ms, told = next(answers), next(answers)
            self._run_guarded(robot, partial(self._renew_lease, robot, 0 < lease_ms <= LEASE_MS, told))

    def _renew_lease(self, robot: str, is_written: bool, stored: object) -> None:
        of, now = self._hub.robots.get(robot), self._now()
        if of is None:
            return
        if is_written:
            self._superseded[robot] = now
        if is_written and not gives_way(stored, of.liveness.token):
            return
        if (
            self._hears_frames(of) or now - self._superseded[robot] > SETTLE_S
        ):  # who hears its frames comes first
            self._turns.pop(robot, None)
            del self._superseded[robot]
            for room in of.rooms.values():
                self._resumed.discard(room.stream)
                self.keep(room.stream)

    def _hears_frames(self, robot: Robot) -> bool:
        """Whether this robot is sending frames now."""
        ages_s = [room.stream.compute_age_s(self._now()) for room in robot.rooms.values()]
        return any(age_s is not None and age_s <= robot.limits.silent_s for age_s in ages_s)

    async def _beat(self) -> None:
        """Publish every robot's presence."""
        heard = [robot for robot in self._hub.robots.values() if robot.heard_at is not None]
        mine = await self._tell(heard)
        known = {robot.name for robot in heard}
        for stream in {s for s in (*self._resumed, *self._sent_n) if s.robot not in known}:  # by the core
            self._written.pop(stream, None)
            self._sent_n.pop(stream, None)
            self._resumed.discard(stream)
            self._turns.pop(stream.robot, None)
        for name in self._tokens.keys() - known:
            del self._tokens[name]
        await self._exchange(mine)
        for of_mine in heard:
            of_mine.set_followed(self.directory.count_viewers_elsewhere(of_mine.name) > 0)

    async def _exchange(self, mine: Iterable[Robot]) -> None:
        viewers = {r.name: n for r in self._hub.robots.values() if (n := r.count_viewers()) > 0}
        found = {robot.name: self._run_guarded(robot.name, partial(self._describe, robot)) for robot in mine}
        told = {name: document for name, document in found.items() if document is not None}
        try:
            await self.directory.exchange(viewers, told)
        except REDIS_ERRORS:
            raise
        except Exception as e:
            self._handle_fault("the board", e)

    async def _tell(self, robots: Iterable[Robot]) -> list[Robot]:
        """Publish robots' presence. Return the robots that no other process writes."""
        told: dict[Robot, Call] = {}
        for robot in robots:
            if robot.name not in self._superseded:
                call = self._run_guarded(robot.name, partial(self._make_presence_call, robot))
                if call is not None:
                    told[robot] = call
        mine = []
        for robot, result in zip(told, await self.link.run_all(list(told.values())), strict=True):
            if isinstance(result, Exception):
                self._handle_fault(robot.name, result)
                continue
            self._tokens[robot.name] = robot.liveness.token
            if result == INCOMPLETE:  # something of it was lost
                for room in robot.rooms.values():
                    self._written.pop(room.stream, None)
                    self.keep(room.stream)
            if result != REFUSED:
                mine.append(robot)
        return mine

    def _make_presence_call(self, robot: Robot) -> Call:
        now, turn = self._now(), self._turns.get(robot.name)
        written = [view for view, room in robot.rooms.items() if room.stream in self._written]
        generation = turn.generation if turn else 0
        return make_presence_call(robot, generation, written, now, self.directory.clock.estimate_time(now))
