"""Connects the core to sockets, clocks and stores: carries out its actions, and calls it when its timer is
due.

The core always has the newest state. A state store shares it with other processes.
"""

from __future__ import annotations

import asyncio
import logging
import random
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol
from uuid import UUID

from posecast_wire import Close

from posecast_relay.core.actions import (
    Abort,
    Action,
    CloseConnection,
    Fault,
    Persist,
    RequestSnapshot,
    Send,
    SubscribeRobot,
    VerifyToken,
)
from posecast_relay.core.hub import Hub
from posecast_relay.core.load import NO_CEILING
from posecast_relay.core.policy import FULL
from posecast_relay.core.stream import Stream
from posecast_relay.core.viewer import Viewer
from posecast_relay.kit import Histogram
from posecast_relay.runtime.fan_out import SLICE, FanOut

log = logging.getLogger("posecast_relay")


class StateStore(Protocol):
    """A state store.

    `keep` always returns at once, so that viewers never wait for the store.
    """

    def keep(self, stream: Stream) -> None:
        """Note that a stream has changed. The store writes its newest state later."""

    def find_trouble(self) -> str | None:
        """Return the store's present problem, in one line; None if it works."""

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return how long exchanges with the server took and how often it was lost; None without a server."""

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return the robots that other processes hear, as documents; None if this process hears them."""

    def count_viewers_elsewhere(self, robot: str) -> int:
        """Return how many viewers a robot has in other processes."""


class MemoryStore:
    """A state store for a single process. It stores nothing."""

    def keep(self, stream: Stream) -> None:
        """Do nothing: the stream already has its newest state."""

    def find_trouble(self) -> str | None:
        """Return None: nothing can fail here."""
        return None

    def get_exchanges(self) -> tuple[Histogram, int] | None:
        """Return None: there is no server."""
        return None

    def list_robots(self) -> list[dict[str, Any]] | None:
        """Return None: this process hears all robots itself."""
        return None

    def count_viewers_elsewhere(self, robot: str) -> int:  # noqa: ARG002
        """Return 0: there are no other processes."""
        return 0


WATCH_S = 0.1
MEASURE_S = 1.0
AGAIN_S = 0.1  # after the core has failed
GRAIN_S = 0.002  # a timer this close is not changed
BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def _find_clock_start() -> float:
    """Return the reading of the core's clock when this machine started, in seconds: a random number.

    Viewers compare stamps from several requests. If these reach relays on two machines that started at nearly
    the same time, their clocks must still be told apart.
    """
    try:
        return float(UUID(BOOT_ID.read_text().strip()).int % 2**30)  # a double still resolves microseconds
    except (OSError, ValueError):
        return 0.0


CLOCK_START_S = _find_clock_start()


def _log_ended(viewer: Viewer, close: Close, reason: str) -> None:
    if log.isEnabledFor(logging.INFO):
        more = {"conn": viewer.number, "robot": viewer.robot, "code": int(close), "reason": reason}
        log.info("viewer disconnected", extra=more)


class RobotSource(Protocol):
    """A source of robots: their agents, or other relays. It feeds the dispatcher's hub."""

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:
        """Ask for the snapshots of these views. The answers go to the hub like all messages."""

    def subscribe(self, robot: str) -> None:
        """Start to listen to a robot that got its first viewer, if the source subscribes to each robot."""

    async def open(self, robot: str) -> None:
        """For an HTTP request: wait a moment until this process hears a robot that other relays hear."""


class NoSource:
    """The RobotSource of a hub without a source. All its methods do nothing."""

    def request_snapshots(self, robot: str, views: Sequence[str]) -> None:
        """Do nothing."""

    def subscribe(self, robot: str) -> None:
        """Do nothing."""

    async def open(self, robot: str) -> None:
        """Do nothing."""


def _ignore(*_what: object) -> None:
    """Do nothing: the default callback."""


class Dispatcher:
    """Carries out one hub's actions on the event loop, and keeps its timer."""

    def __init__(
        self,
        hub: Hub,
        store: StateStore,
        fan_out: FanOut,
        source: RobotSource | None = None,
        verify: Callable[[Viewer, str], None] = _ignore,
        changed: Callable[[Stream], None] = _ignore,
        full: Callable[[Viewer, str | None], None] = _ignore,
    ) -> None:
        """`verify` is called with a viewer and its new token; `changed` with each stream that has changed;
        `full` with each viewer for which this process has no place, and the lane to which it is sent.
        """
        self.hub = hub
        self.store = store
        self._fan_out = fan_out
        self._source = NoSource() if source is None else source
        self._verify = verify
        self._changed = changed
        self._full = full
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._armed_at = float("inf")
        self._watcher: asyncio.TimerHandle | None = None
        self._todo: deque[Action] = deque()  # not carried out yet
        self._sending: tuple[bytes, Sequence[Viewer]] | None = None  # rest of a Send; goes before those
        self._walking = False
        self._flush_waits = False
        self._flushed_at: float | None = None
        self._measured_at = self.now()
        self._used_s = time.thread_time()
        self.loop_lag = Histogram()
        self.fan_out = Histogram()  # of frames: deciding and writing
        self.handshakes: Counter[str] = Counter()
        self.faults: Counter[str] = Counter()  # of the relay's own code, by the error's type

    @property
    def has_ring(self) -> bool:
        """Whether frames are sent with io_uring."""
        return self._fan_out.has_ring

    @staticmethod
    def now() -> float:
        """Return the core's clock in seconds: one for all processes of a machine, and never set. The
        event loop's clock would not advance within one turn.
        """
        return CLOCK_START_S + time.monotonic()

    @classmethod
    def compute_expiry(cls, until_s: float) -> float:
        """Return a unix time as seconds of the core's clock."""
        return cls.now() + until_s - cls.unix_s()

    @staticmethod
    def unix_s() -> float:
        """Return the wall clock in unix seconds. It is only shown, never compared."""
        return time.time()

    @property
    def tasks(self) -> int:
        """The number of asyncio tasks; may be read in another thread."""
        return len(asyncio.all_tasks(self._loop))

    def start(self) -> None:
        """Start the core's timer, and measure how late the event loop is."""
        self.arm()
        self._watch(self.now())

    def stop(self) -> None:
        """Stop all timers."""
        for timer in (self._timer, self._watcher):
            if timer is not None:
                timer.cancel()

    def _watch(self, due: float) -> None:
        now = self.now()
        late_s = max(0.0, now - due)
        self.loop_lag.add(late_s)
        self.hub.load.record_lag(late_s)
        if now - self._measured_at >= MEASURE_S:
            busy = (time.thread_time() - self._used_s) / (now - self._measured_at)
            self._measured_at, self._used_s = now, time.thread_time()
            before = self.hub.load.ceiling_hz
            self.carry_out(self._decide(lambda: self.hub.measure_load(busy, now)))
            if self.hub.load.ceiling_hz != before:
                ceiling_hz = self.hub.load.ceiling_hz
                what = "overload" if ceiling_hz < before else "less load"
                rates = "not limited" if ceiling_hz == NO_CEILING else f"limited to {ceiling_hz:g} Hz"
                log.warning("%s: frame rates %s", what, rates)
        self._watcher = self._loop.call_later(WATCH_S, self._watch, now + WATCH_S)

    def carry_out(self, actions: Iterable[Action]) -> None:
        """Carry out the core's actions in order, and set the timer for its next call.

        Many viewers are served in slices, one per turn of the loop. Until the last slice is done, the core is
        not called again: newer frames replace older ones there, so nothing piles up here.
        """
        self._todo.extend(actions)
        if not self._walking:
            if self._todo:
                self._walk()
            else:
                self.arm()

    def _walk(self) -> None:
        self._walking = True
        left = SLICE
        try:
            while (self._todo or self._sending is not None) and left > 0:
                if self._sending is None:
                    left -= 1
                    self._begin(self._todo.popleft())
                if self._sending is not None:
                    data, viewers = self._sending
                    part = viewers[: max(1, left)]
                    self._sending = (data, viewers[len(part) :]) if len(viewers) > len(part) else None
                    left -= len(part)
                    for viewer, error in self._fan_out.write(data, part):
                        self._drop(viewer, error)
        finally:
            self._walking = bool(self._todo or self._sending is not None)
            if self._walking:
                self._loop.call_soon(self._walk)
            else:
                self._finish_walk()

    def report_fault(self, where: str, error: Exception) -> None:
        """Count an error of the relay's own code, and log it with its place."""
        self.faults[type(error).__name__] += 1
        log.error("internal error%s", f" at {where}" if where else "", exc_info=error)

    def _decide(self, decide: Callable[[], list[Action]]) -> list[Action]:
        """Return the core's actions. If the core fails, return none and call it again soon."""
        try:
            return decide()
        except Exception as e:
            self.report_fault("", e)
            self.hub.set_wake(self.now() + AGAIN_S)
            return []

    def _begin(self, action: Action) -> None:
        """Carry out one action. An exception ends the viewer concerned, or is counted."""
        try:
            self._act(action)
        except Exception as e:
            match action:
                case Send(_, (viewer,)) | CloseConnection(viewer) | Abort(viewer) | VerifyToken(viewer):
                    self._drop(viewer, e)
                case _:
                    self.report_fault(type(action).__name__, e)

    def _drop(self, viewer: Viewer, error: Exception) -> None:
        """Remove a viewer whose connection can't be written to."""
        self.report_fault(f"{viewer.robot}/{viewer.view}", error)
        try:
            self.hub.count_ending(Close.INTERNAL_ERROR)
            self.hub.remove_viewer(viewer)
            viewer.outlet.cut(Close.INTERNAL_ERROR)
        except Exception as e:
            self.report_fault(f"{viewer.robot}/{viewer.view}", e)

    def _act(self, action: Action) -> None:
        match action:
            case Send(data, (viewer,)):
                viewer.outlet.write(data)
            case Fault(where, error):
                self.report_fault(where, error)
            case Send(data, viewers):
                self._sending = data, viewers
            case Persist(stream):
                try:
                    self.store.keep(stream)
                finally:
                    self._changed(stream)
            case CloseConnection(viewer, close, reason, retry_s, lane):
                viewer.outlet.end(close, reason, retry_s, lane)
                if reason == FULL.reason:
                    self._full(viewer, lane)
                _log_ended(viewer, close, reason)
            case Abort(viewer, close):
                viewer.outlet.cut(close)
                _log_ended(viewer, close, "cut")
            case RequestSnapshot(robot, views):
                self._source.request_snapshots(robot, views)
            case VerifyToken(viewer, token):
                self._verify(viewer, token)
            case SubscribeRobot(robot):
                self._source.subscribe(robot)

    def _finish_walk(self) -> None:
        if self._flushed_at is not None:
            self.fan_out.add(self.now() - self._flushed_at)
            self._flushed_at = None
        if self._flush_waits:
            self.flush()
        else:
            self.arm()

    async def open_robot(self, robot: str) -> None:
        """Wait a moment for a robot's state, if it has any."""
        await self._source.open(robot)

    def join(self, viewer: Viewer) -> None:
        """Add a viewer that has connected."""
        self.carry_out(self.hub.join(viewer, self.now(), self.unix_s()))
        here = viewer in self.hub.viewers
        self.handshakes["accepted" if here else "told to go"] += 1
        if here:
            log.info("viewer connected", extra={"conn": viewer.number, "robot": viewer.robot})

    def flush(self) -> None:
        """Send new messages to viewers."""
        self._flush_waits = self._walking
        if not self._walking:
            self._flushed_at = self.now()
            self.carry_out(self._decide(lambda: self.hub.flush(self.now(), self.unix_s())))

    def arm(self) -> None:
        """Set the timer for the core's next `tick`, unless it is early enough already."""
        wake_at = self.hub.wake_at
        if self._walking or wake_at >= self._armed_at - GRAIN_S:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._armed_at = wake_at
        self._timer = self._loop.call_later(max(0.0, wake_at - self.now()), self._tick)

    def _tick(self) -> None:
        self._armed_at = float("inf")
        self._timer = None
        if not self._walking:  # otherwise it is set again when the walk is done
            self.carry_out(self._decide(lambda: self.hub.tick(self.now(), self.unix_s())))

    def drain(self) -> None:
        """Begin to close all viewers, because this relay stops. Does nothing if that has already begun."""
        if self.hub.draining is None:
            order = list(self.hub.viewers)
            random.shuffle(order)
            self.carry_out(self.hub.drain(order, self.now()))

    @property
    def draining(self) -> bool:
        """Whether this relay is about to stop."""
        return self.hub.draining is not None

    @property
    def drained(self) -> bool:
        """Whether all viewers have been told, so that the relay may stop."""
        return self.draining and not self.hub.viewers and not self._walking
