"""Receives frames, events, tokens and snapshots from robots, in Zenoh's threads, for the event loop.

Zenoh calls back in one thread per subscriber. These threads only copy the bytes into the robot's inbox, and
wake the loop if no wake-up is pending. The loop empties the inboxes in turns. Each pass is bounded, so that
viewers are served in between.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial

import zenoh
from posecast_wire import Echo, Snapshot, Stamp, check_name
from posecast_wire.keys import PREFIX, STAMP, snapshot_key

from posecast_relay.core.stream import FrameOutcome
from posecast_relay.runtime.dispatcher import Dispatcher
from posecast_relay.zenoh.router import RouterSession

log = logging.getLogger("posecast_relay")

MESSAGES_MAX = 512  # in one inbox; then the oldest of the least important are dropped
BYTES_MAX = 1 << 21  # in one inbox; enough for one of the largest messages that Zenoh lets in
ROBOTS_MAX = 4096  # inboxes at once; messages of further robots are dropped
OTHERS = ""  # the name under which those messages are counted


class Importance(IntEnum):
    """What a full inbox drops first: the lowest."""

    FRAME = 0  # the next one replaces it
    ANSWER = 1  # a snapshot or an echo: the question is repeated
    EVENT = 2  # also info and changes of model: each is sent once
    TOKEN = 3  # without it, a robot that is silent counts as offline


@dataclass(slots=True)
class Message:
    """A message of `size` bytes. `take_in` processes it, on the event loop.

    `cost`: its processing time, in frames.
    """

    take_in: Callable[[], None]
    size: int
    importance: Importance
    cost: int = 1


@dataclass(slots=True)
class _Inbox:
    queues: dict[Importance, deque[tuple[int, Message]]] = field(default_factory=dict)  # none is empty
    count: int = 0
    size: int = 0

    def append(self, number: int, message: Message) -> None:
        """`number`: higher than that of any earlier message."""
        queue = self.queues.get(message.importance)
        if queue is None:
            queue = self.queues[message.importance] = deque()
        queue.append((number, message))
        self.count += 1
        self.size += message.size

    def pop_oldest(self) -> Message:
        queues = self.queues
        if len(queues) == 1:  # nearly always
            return self._pop(next(iter(queues)))
        return self._pop(min(queues, key=lambda importance: queues[importance][0][0]))

    def pop_least_important(self) -> Message:
        return self._pop(min(self.queues))

    def drop_frames(self) -> int:
        """Return how many were dropped."""
        frames = self.queues.pop(Importance.FRAME, ())
        self.count -= len(frames)
        self.size -= sum(message.size for _, message in frames)
        return len(frames)

    def _pop(self, importance: Importance) -> Message:
        queue = self.queues[importance]
        _, message = queue.popleft()
        if not queue:
            del self.queues[importance]
        self.count -= 1
        self.size -= message.size
        return message


class Inboxes:
    """One inbox per robot, filled by threads, emptied by the loop. A robot that floods loses only its own
    messages.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._waiting: OrderedDict[str, _Inbox] = OrderedDict()  # non-empty inboxes; the next one first
        self._number = 0  # of the newest message: they leave their inbox in this order
        self._closed_until: dict[str, float] = {}  # until then frames are dropped
        self._lost: Counter[str] = Counter()  # by robot

    def put(self, robot: str, message: Message, now: float) -> None:
        """Queue a message until its robot's turn. If the inbox is full, drop its oldest frames; if it has
        none, the oldest messages of the next importance.
        """
        with self._lock:
            if message.importance is Importance.FRAME and robot in self._closed_until:
                if now < self._closed_until[robot]:
                    self._lost[robot] += 1
                    return
                del self._closed_until[robot]
            inbox = self._waiting.get(robot)
            if inbox is None:
                if len(self._waiting) >= ROBOTS_MAX:
                    self._lost[OTHERS] += 1
                    return
                inbox = self._waiting[robot] = _Inbox()
            self._number += 1
            inbox.append(self._number, message)
            while inbox.count > MESSAGES_MAX or (inbox.size > BYTES_MAX and inbox.count > 1):
                inbox.pop_least_important()
                self._lost[robot] += 1

    def pop(self) -> Message | None:
        """Take the oldest message of the robot whose turn it is, if any. Then it is the next robot's turn."""
        with self._lock:
            if not self._waiting:
                return None
            robot, inbox = next(iter(self._waiting.items()))
            message = inbox.pop_oldest()
            if inbox.count:
                self._waiting.move_to_end(robot)
            else:
                del self._waiting[robot]
            return message

    def close(self, robot: str, now: float, until: float) -> None:
        """Drop this robot's queued frames, and those that arrive before `until`. Times are in seconds."""
        with self._lock:
            if len(self._closed_until) >= ROBOTS_MAX:  # remove robots that never sent another frame
                self._closed_until = {r: end for r, end in self._closed_until.items() if now < end}
            self._closed_until[robot] = until
            inbox = self._waiting.get(robot)
            if inbox is None:
                return
            self._lost[robot] += inbox.drop_frames()
            if not inbox.count:
                del self._waiting[robot]

    def take_lost(self) -> Counter[str]:
        """Return how many messages were dropped since the last call, by robot."""
        with self._lock:
            lost, self._lost = self._lost, Counter()
            return lost

    def __bool__(self) -> bool:
        """Return whether any message waits."""
        return bool(self._waiting)


TURN = 256  # frames, or messages of the same cost, in one turn of the loop: about 3 ms
PARSED_BYTES = 1 << 10  # of a snapshot; parsing them costs as much as one frame
CLOSED_S = 0.01  # how long a robot above its share has to wait
TOKENS_S = 0.1  # minimum time between two reported changes of one robot's token
SNAPSHOT_TIMEOUT_S = 2.0
RETURN_S = 3.0  # time for robots to return after a new session; agents retry at least once a second
COMPLAIN_S = 10.0  # between two log lines about bad messages of a robot
WHY = {  # why a frame is dropped; for the robot's developer
    FrameOutcome.BAD: "a frame does not fit its schema",
    FrameOutcome.VERSION: "a frame has an unknown wire format version",
    FrameOutcome.OVERSIZED: "a frame is too large",
}
LOST = "there is room for"


class _Token:
    """A robot's token: whether it was last seen as present, and when the hub was last told."""

    def __init__(self) -> None:
        self.present = False
        self.told_at = float("-inf")
        self.timer: asyncio.TimerHandle | None = None


class _Question:
    """A request for one view's snapshot. Only the first answer counts."""

    def __init__(self, asked_at: float) -> None:
        self.asked_at = asked_at
        self.answered = False


class ZenohIngest:
    """A RobotSource for robots' agents: subscribes to their messages, answers echoes, requests snapshots."""

    _dispatcher: Dispatcher  # from `start` on

    def __init__(self, router: RouterSession) -> None:
        self._router = router
        self._loop = asyncio.get_running_loop()
        self._inboxes = Inboxes()
        self._woken = False
        self._complained_at: dict[str, float] = {}  # by robot; unknown robots share one entry
        self._declared: list[object] = []
        self._opening = 0  # the session's number; tokens of earlier sessions are ignored
        self._tokens: dict[str, _Token] = {}
        self._missing: set[str] = set()  # were present before the new session
        self._waiting: set[str] = set()  # are present, but the relay had no place for them
        self._given_up: asyncio.TimerHandle | None = None

    def start(self, dispatcher: Dispatcher) -> None:
        """Subscribe. From now on, the dispatcher's hub gets the robots' messages."""
        self._dispatcher = dispatcher
        self._declare()

    def stop(self) -> None:
        """Stop the timer for robots that have not come back after a new session."""
        if self._given_up is not None:
            self._given_up.cancel()

    async def admit(self, secrets: dict[str, str]) -> None:
        """Let only these robots publish, by name and secret: see RouterSession."""
        await self._router.admit(secrets, self._leave_off, self._go_on)

    def _leave_off(self) -> None:
        self._opening += 1
        self._declared = []
        self._waiting.clear()
        robots = self._dispatcher.hub.robots.values()
        self._missing |= {robot.name for robot in robots if robot.liveness.token}
        self._wait_for_robots()  # until the new session is open; if it can't be opened, they are gone

    def _go_on(self) -> None:
        self._declare()
        self._wait_for_robots()

    def _wait_for_robots(self) -> None:
        self.stop()
        self._given_up = self._loop.call_later(RETURN_S, self._give_up)

    def _give_up(self) -> None:
        missing, self._missing = self._missing, set()
        for robot in sorted(missing):
            self._token(robot, False)

    def _declare(self) -> None:
        session = self._router.session
        on_token = partial(self._on_token, self._opening)
        self._declared = [
            session.declare_subscriber(f"{PREFIX}/*/*/frame", self._on_frame),
            session.declare_subscriber(f"{PREFIX}/*/*/event", self._on_event),
            session.declare_queryable(f"{PREFIX}/*/echo", self._on_echo),
            session.liveliness().declare_subscriber(f"{PREFIX}/*/alive", on_token, history=True),
        ]

    # ---- in Zenoh's threads ---------------------------------------------------

    def _on_frame(self, sample: zenoh.Sample) -> None:
        self._put(sample, self._frame, self._dispatcher.hub.limits.frame_bytes, Importance.FRAME)

    def _on_event(self, sample: zenoh.Sample) -> None:
        limits = self._dispatcher.hub.limits
        self._put(sample, self._event, max(limits.event_bytes, limits.info_bytes), Importance.EVENT)

    def _on_snapshot(self, question: _Question, reply: zenoh.Reply) -> None:
        sample = reply.ok
        if sample is None or question.answered:
            return
        question.answered = True
        cost = 1 + len(sample.payload) // PARSED_BYTES
        take_in = partial(self._snapshot, question.asked_at)
        self._put(sample, take_in, self._dispatcher.hub.limits.snapshot_bytes, Importance.ANSWER, cost)

    def _put(
        self,
        sample: zenoh.Sample,
        take_in: Callable[[str, str, bytes, bytes], None],
        bytes_max: int,
        importance: Importance,
        cost: int = 1,
    ) -> None:
        robot, view = _names(sample.key_expr)
        size = len(sample.payload)
        # a message that is too large is truncated here; the code that counts it refuses its length
        payload = sample.payload.to_bytes() if size <= bytes_max else bytes(bytes_max + 1)
        attached = sample.attachment
        stamp = attached.to_bytes() if attached is not None and len(attached) == STAMP.size else b""
        take_in = partial(take_in, robot, view, payload, stamp)
        self._later(robot, Message(take_in, len(payload), importance, cost))

    def _on_token(self, opening: int, sample: zenoh.Sample) -> None:
        robot, _ = _names(sample.key_expr)
        present = sample.kind == zenoh.SampleKind.PUT
        self._later(robot, Message(partial(self._heard_token, opening, robot, present), 0, Importance.TOKEN))

    def _on_echo(self, query: zenoh.Query) -> None:
        robot, _ = _names(query.key_expr)
        self._later(robot, Message(partial(self._echo, robot, query), 0, Importance.ANSWER))

    def _later(self, robot: str, message: Message) -> None:
        self._inboxes.put(robot, message, self._dispatcher.now())
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._work_off)
            except RuntimeError:  # the loop has closed: the relay is stopping
                return

    # ---- on the event loop ------------------------------------------------------

    def _work_off(self) -> None:
        self._woken = False  # reset first, so that later messages wake the loop again
        left = TURN
        while left > 0 and (message := self._inboxes.pop()) is not None:
            left -= message.cost
            try:
                message.take_in()
            except Exception as e:
                self._dispatcher.hub.outcomes[FrameOutcome.FAULT.value] += 1
                self._dispatcher.report_fault("ingest", e)
        self._count_lost()
        self._dispatcher.flush()
        if self._inboxes and not self._woken:
            self._woken = True
            self._loop.call_soon(self._work_off)

    def _count_lost(self) -> None:
        hub, now = self._dispatcher.hub, self._dispatcher.now()
        for robot, count in self._inboxes.take_lost().items():
            outcome = FrameOutcome.CROWDED if robot == OTHERS else FrameOutcome.OVER_SHARE
            hub.outcomes[outcome.value] += count
            of = hub.robots.get(robot)
            if of is not None:
                of.share.record_lost(count, of.share.limit or LOST, now)

    def _frame(self, robot: str, view: str, payload: bytes, stamp: bytes) -> None:
        now = self._dispatcher.now()
        try:
            check_name("robot", robot)
            check_name("view", view)
            outcome = self._dispatcher.hub.take_edge_frame(robot, view, payload, Stamp.unpack(stamp), now)
        except ValueError as e:
            self._complain(robot, f"{view}/frame", e)
            return
        if outcome is FrameOutcome.OVER_SHARE:
            self._inboxes.close(robot, now, now + CLOSED_S)
        elif outcome in WHY:
            self._say(robot, f"{view}/frame", WHY[outcome])
        elif robot in self._waiting and outcome is not FrameOutcome.CROWDED:
            self._token(robot, True)

    def _event(self, robot: str, view: str, payload: bytes, stamp: bytes) -> None:
        dispatcher = self._dispatcher
        try:
            check_name("robot", robot)
            check_name("view", view)
            at = Stamp.unpack(stamp)
        except ValueError as e:
            self._complain(robot, f"{view}/event", e)
            return
        bad = dispatcher.hub.outcomes[FrameOutcome.BAD.value]
        dispatcher.carry_out(
            dispatcher.hub.take_event(robot, view, payload, at, dispatcher.now(), dispatcher.unix_s())
        )
        if dispatcher.hub.outcomes[FrameOutcome.BAD.value] > bad:
            self._say(robot, f"{view}/event", "not a valid event, info or model message (see wire/SPEC.md)")

    def _heard_token(self, opening: int, robot: str, present: bool) -> None:
        """Report whether a token is present, at most once in TOKENS_S seconds per robot."""
        if opening != self._opening:
            return
        self._missing.discard(robot)
        try:
            check_name("robot", robot)
        except ValueError as e:
            self._complain(robot, "alive", e)
            return
        token = self._tokens.get(robot)
        if token is None:
            if not present and robot not in self._dispatcher.hub.robots:
                return
            token = self._tokens[robot] = _Token()
        token.present = present
        if token.timer is not None:
            return
        wait_s = token.told_at + TOKENS_S - self._dispatcher.now()
        if wait_s <= 0:
            self._tell_token(robot, token)
        else:
            token.timer = self._loop.call_later(wait_s, self._tell_token, robot, token)

    def _tell_token(self, robot: str, token: _Token) -> None:
        token.timer = None
        token.told_at = self._dispatcher.now()
        if not token.present:
            self._tokens.pop(robot, None)
        self._token(robot, token.present)

    def _token(self, robot: str, present: bool) -> None:
        hub = self._dispatcher.hub
        self._dispatcher.carry_out(hub.set_token(robot, present, self._dispatcher.now()))
        if present and robot not in hub.robots:
            self._waiting.add(robot)
            self._say(robot, "alive", "the relay has no place for another robot (--max-robots)")
            return
        self._waiting.discard(robot)
        log.info("robot %s %s", robot, "on air" if present else "gone")

    def _snapshot(self, asked_at: float, robot: str, view: str, payload: bytes, stamp: bytes) -> None:
        hub, now = self._dispatcher.hub, self._dispatcher.now()
        try:
            check_name("robot", robot)
            check_name("view", view)
            if len(payload) > hub.limits.snapshot_bytes:
                raise ValueError(f"snapshot: over {hub.limits.snapshot_bytes} bytes")
            at = Stamp.unpack(stamp)
            hub.check_snapshot(robot, len(payload), now)
            hub.take_snapshot(robot, view, Snapshot.unpack(payload), at, now, waited_s=now - asked_at)
        except ValueError as e:
            self._complain(robot, f"{view}/snapshot", e)

    def _echo(self, robot: str, query: zenoh.Query) -> None:
        now = self._dispatcher.now()
        try:
            check_name("robot", robot)
        except ValueError as e:
            self._complain(robot, "echo", e)
            return  # unanswered
        of = self._dispatcher.hub.robots.get(robot)
        if of is not None and not of.share.allow_message(0, now):
            self._dispatcher.hub.outcomes[FrameOutcome.OVER_SHARE.value] += 1
            return  # unanswered
        run_id = of.runs.current if of else 0
        of_run = [r.stream.newest for r in of.rooms.values() if r.stream.newest] if of else []
        seq = max((held.seq for held in of_run if held.run_id == run_id), default=0)
        over = of.share.find_exceeded_limit(now) if of else ""
        key = str(query.key_expr)
        try:
            query.reply(key, Echo(run_id, seq, self._dispatcher.unix_s(), over).pack())
        except zenoh.ZError as e:
            log.debug("echo to %s: %s", key, e)
        query.drop()  # type: ignore[no-untyped-call]

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:
        """Ask the robot's agent for the snapshots of these views. The answers go to the hub."""
        for view in views:  # not `*`: that would also match the agent's `model/**`
            on_snapshot = partial(self._on_snapshot, _Question(self._dispatcher.now()))
            try:
                self._router.session.get(snapshot_key(robot, view), on_snapshot, timeout=SNAPSHOT_TIMEOUT_S)
            except zenoh.ZError as e:
                log.warning("snapshot of %s/%s: %s", robot, view, e)

    def subscribe(self, robot: str) -> None:
        """Do nothing: the relay already listens to all robots."""

    async def open(self, robot: str) -> None:
        """Return at once: this process hears every robot on air."""

    def _complain(self, robot: str, what: str, error: Exception) -> None:
        """Count an invalid message, and sometimes log one."""
        self._dispatcher.hub.outcomes[FrameOutcome.BAD.value] += 1
        self._say(robot, what, error)

    def _say(self, robot: str, what: str, why: Exception | str) -> None:
        """Log a problem, unless this robot had a line within COMPLAIN_S: one robot must not fill the log."""
        now, known = self._dispatcher.now(), robot if robot in self._dispatcher.hub.robots else ""
        if now - self._complained_at.get(known, float("-inf")) < COMPLAIN_S:
            return
        if len(self._complained_at) > 2 * self._dispatcher.hub.limits.robots:
            self._complained_at.clear()  # most of these robots have left
        self._complained_at[known] = now
        log.warning("%.120s: %.200s", f"{robot}/{what}", why)


def _names(key: zenoh.KeyExpr) -> tuple[str, str]:
    """Return the robot and the view of a key. Callers check them: `posecast/**` allows any text."""
    _, _, robot, view, *_ = *str(key).split("/"), "", "", "", ""
    return robot, view
