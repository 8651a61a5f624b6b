"""Edges in: frames, events, tokens and snapshots from Zenoh's threads to the event loop.

Zenoh calls back in a thread per subscriber. Those threads only take the bytes out and put them into bounded
inboxes; one wake-up of the loop is pending at most, and works off all that has come meanwhile.
"""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

import zenoh
from posecast_wire import Echo, Snapshot, Stamp, check_name
from posecast_wire.keys import PREFIX, snapshot_key

from posecast_relay.adapters.pump import Pump
from posecast_relay.adapters.zenoh_door import Door

log = logging.getLogger("posecast_relay")

FRAMES_MAX = 8192  # waiting for a stalled loop; the oldest go, the newest state is what counts
OTHERS_MAX = 8192  # events, tokens, answers: likewise
SNAPSHOT_TIMEOUT_S = 2.0
RETURN_S = (
    3.0  # after the door was opened anew a robot has so long to come back; edges try at least once a second
)
COMPLAIN_S = 10.0  # between two log lines about bad messages


class ZenohIngest:
    """Subscriptions, the echo, and the questions about snapshots."""

    def __init__(self, door: Door, pump: Pump) -> None:
        self._door = door
        self._pump = pump
        self._loop = asyncio.get_running_loop()
        self._frames: deque[tuple[str, str, bytes, bytes]] = deque(maxlen=FRAMES_MAX)
        self._others: deque[Callable[[], None]] = deque(maxlen=OTHERS_MAX)
        self._woken = False
        self._complained_at = float("-inf")
        self._declared: list[object] = []
        self._opening = 0  # which session it is; tokens of one that is gone mean nothing
        self._missing: set[str] = set()  # were here before the door was opened anew
        self._given_up: asyncio.TimerHandle | None = None

    def start(self) -> None:
        """Subscribe. From here on edges are heard."""
        self._pump.ask = self._ask
        self._door.closing, self._door.opened = self._leave_off, self._go_on
        self._declare()

    def stop(self) -> None:
        """No more timers."""
        if self._given_up is not None:
            self._given_up.cancel()

    def _leave_off(self) -> None:
        self._opening += 1
        self._declared = []

    def _go_on(self) -> None:
        robots = self._pump.hub.robots.values()
        self._missing |= {robot.name for robot in robots if robot.liveness.token}
        self._declare()
        self.stop()
        self._given_up = self._loop.call_later(RETURN_S, self._give_up)

    def _give_up(self) -> None:
        missing, self._missing = self._missing, set()
        for robot in sorted(missing):
            self._token(robot, False)

    def _declare(self) -> None:
        session = self._door.session
        on_token = partial(self._on_token, self._opening)
        self._declared = [
            session.declare_subscriber(f"{PREFIX}/*/*/frame", self._on_frame),
            session.declare_subscriber(f"{PREFIX}/*/*/event", self._on_event),
            session.declare_queryable(f"{PREFIX}/*/echo", self._on_echo),
            session.liveliness().declare_subscriber(f"{PREFIX}/*/alive", on_token, history=True),
        ]

    # ---- in Zenoh's threads ---------------------------------------------------

    def _on_frame(self, sample: zenoh.Sample) -> None:
        chunks = str(sample.key_expr).split("/")
        stamp = sample.attachment.to_bytes() if sample.attachment is not None else b""
        self._frames.append((chunks[2], chunks[3], sample.payload.to_bytes(), stamp))
        self._wake()

    def _on_event(self, sample: zenoh.Sample) -> None:
        chunks = str(sample.key_expr).split("/")
        stamp = sample.attachment.to_bytes() if sample.attachment is not None else b""
        payload = sample.payload.to_bytes()
        self._later(lambda: self._event(chunks[2], chunks[3], payload, stamp))

    def _on_token(self, opening: int, sample: zenoh.Sample) -> None:
        robot = str(sample.key_expr).split("/")[2]
        present = sample.kind == zenoh.SampleKind.PUT

        def told() -> None:
            if opening == self._opening:
                self._missing.discard(robot)
                self._token(robot, present)

        self._later(told)

    def _on_echo(self, query: zenoh.Query) -> None:
        self._later(lambda: self._echo(query))

    def _on_snapshot(self, reply: zenoh.Reply) -> None:
        sample = reply.ok
        if sample is None:
            return
        chunks = str(sample.key_expr).split("/")
        stamp = sample.attachment.to_bytes() if sample.attachment is not None else b""
        payload = sample.payload.to_bytes()
        self._later(lambda: self._snapshot(chunks[2], chunks[3], payload, stamp))

    def _later(self, call: Callable[[], None]) -> None:
        self._others.append(call)
        self._wake()

    def _wake(self) -> None:
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._work_off)
            except RuntimeError:  # the loop has closed: the relay is stopping
                return

    # ---- on the event loop ------------------------------------------------------

    def _work_off(self) -> None:
        self._woken = False  # before looking: what comes from now on wakes again
        hub, now = self._pump.hub, self._pump.now()
        for _ in range(len(self._frames)):
            robot, view, payload, stamp = self._frames.popleft()
            try:
                check_name("robot", robot)
                check_name("view", view)
                hub.frame(robot, view, payload, Stamp.unpack(stamp), now)
            except ValueError as e:
                self._complain(f"{robot}/{view}/frame", e)
        for _ in range(len(self._others)):
            self._others.popleft()()
        self._pump.flush()

    def _event(self, robot: str, view: str, payload: bytes, stamp: bytes) -> None:
        pump = self._pump
        try:
            check_name("robot", robot)
            check_name("view", view)
            at = Stamp.unpack(stamp)
        except ValueError as e:
            self._complain(f"{robot}/{view}/event", e)
            return
        pump.carry_out(pump.hub.event(robot, view, payload, at, pump.now(), pump.unix_s()))

    def _token(self, robot: str, present: bool) -> None:
        try:
            check_name("robot", robot)
        except ValueError as e:
            self._complain(f"{robot}/alive", e)
            return
        log.info("robot %s %s", robot, "on air" if present else "gone")
        self._pump.carry_out(self._pump.hub.token(robot, present, self._pump.now()))

    def _snapshot(self, robot: str, view: str, payload: bytes, stamp: bytes) -> None:
        try:
            check_name("robot", robot)
            check_name("view", view)
            snapshot, at = Snapshot.unpack(payload), Stamp.unpack(stamp)
            self._pump.hub.snapshot(robot, view, snapshot, at, self._pump.now())
        except ValueError as e:
            self._complain(f"{robot}/{view}/snapshot", e)

    def _echo(self, query: zenoh.Query) -> None:
        key = str(query.key_expr)
        robot = self._pump.hub.robots.get(key.split("/")[2])
        run_id = robot.runs.current if robot else 0
        of_run = [r.stream.newest for r in robot.rooms.values() if r.stream.newest] if robot else []
        seq = max((held.seq for held in of_run if held.run_id == run_id), default=0)
        try:
            query.reply(key, Echo(run_id, seq, self._pump.unix_s()).pack())
        except zenoh.ZError as e:
            log.debug("echo to %s: %s", key, e)
        query.drop()  # type: ignore[no-untyped-call]

    def _ask(self, robot: str, views: Sequence[str]) -> None:
        for view in views:  # not `*`: the edge's `model/**` would match it too
            try:
                self._door.session.get(
                    snapshot_key(robot, view), self._on_snapshot, timeout=SNAPSHOT_TIMEOUT_S
                )
            except zenoh.ZError as e:
                log.warning("snapshot of %s/%s: %s", robot, view, e)

    def _complain(self, where: str, error: Exception) -> None:
        """Count every bad message, log one now and then."""
        self._pump.hub.fates["bad"] += 1
        now = self._pump.now()
        if now - self._complained_at >= COMPLAIN_S:
            self._complained_at = now
            log.warning("%.120s: %.200s", where, error)
