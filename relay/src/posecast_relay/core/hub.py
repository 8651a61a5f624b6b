"""The whole relay without its sockets. Calls come in with the time; what to do comes back, in order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import cast

from posecast_wire import (
    Ack,
    Auth,
    Close,
    MessageError,
    Ping,
    Rate,
    Snapshot,
    Stamp,
    ViewerMessage,
    parse_viewer_message,
)

from posecast_relay.core import messages
from posecast_relay.core.actions import Action, Ask, Cut, End, Keep, Send, Watch
from posecast_relay.core.drain import Drain
from posecast_relay.core.histogram import Histogram
from posecast_relay.core.limits import Limits
from posecast_relay.core.load import Load
from posecast_relay.core.robot import PUBLIC, Robot
from posecast_relay.core.room import NEVER, Room
from posecast_relay.core.said import conflict_event, edge_said
from posecast_relay.core.stream import Fate
from posecast_relay.core.viewer import Viewer

FULL_RETRY_S = 30.0
DRAIN_RETRY_S = 10.0
RENEW_RETRY_S = 1.0  # these come one by one already
GOING = "the relay is being replaced"
FORGET_EVERY = 20  # sweeps
HELD_UP_S = 0.1  # a tick that comes later than this shows that the process stood still


class Hub:
    """All robots and viewers of one process."""

    def __init__(self, limits: Limits) -> None:
        self.limits = limits
        self.robots: dict[str, Robot] = {}
        self.viewers: dict[Viewer, Room] = {}
        self.fates: Counter[str] = Counter()  # of messages from edges
        self.endings: Counter[int] = Counter()  # of viewers, by close code
        self.load = Load()
        self.lateness = Histogram()  # of frames from edges, as they came in
        self.joins = 0
        self.delivered = 0  # by rooms that are forgotten; and so on
        self.skipped = 0
        self.draining: Drain | None = None  # nobody is taken any more
        self.degraded = False  # no robot is heard of, for a reason of this relay's own
        self.wake_at = 0.0  # `tick` wants to be called then, or a little later
        self._changed: dict[Room, None] = {}
        self._status_at = 0.0
        self._sweep_at = 0.0
        self._sweeps = 0
        self._words: dict[Room, str] = {}

    # ---- from the edges ---------------------------------------------------

    def frame(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, late_s: float = 0.0
    ) -> Fate:
        """Take a frame in; `flush` then hands out the newest. `late_s`: as late as another relay found it."""
        found = self._publisher(robot, view)
        if found is None:
            fate = Fate.CROWDED
        else:
            of, room = found
            fate = of.frame(room, payload, stamp, now, late_s)
            if fate is Fate.TAKEN:
                self._changed[room] = None
                self.lateness.add(of.runs.lateness_s)
            if of.lacking:
                self.wake_at = min(self.wake_at, of.ask_at)
        self.fates[fate.value] += 1
        return fate

    def snapshot(
        self,
        robot: str,
        view: str,
        snapshot: Snapshot,
        stamp: Stamp,
        now: float,
        newest: bytes | None = None,
    ) -> None:
        """Take in what an edge, or another relay with its `newest` frame, answered. ValueError, one line,
        when it is of no use."""
        found = self._publisher(robot, view)
        if found is None:
            raise ValueError("snapshot: more robots or views than the relay takes")
        of, room = found
        of.snapshot(room, snapshot, stamp, now, newest)
        self._changed[room] = None

    def event(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, unix_s: float
    ) -> list[Action]:
        """An event from an edge: number it, keep it, hand it to everybody. Or the robot's info."""
        found = self._publisher(robot, view)
        doc = edge_said(payload, self.limits)
        if found is None or doc is None:
            self.fates[(Fate.CROWDED if found is None else Fate.BAD).value] += 1
            return []
        of, room = found
        if of.runs.is_retired(stamp.run_id, now):
            self.fates[Fate.RETIRED.value] += 1
            return []
        of.heard_at = now
        if doc["type"] == "info":
            return self._informed(of, room, doc["kv"], stamp)
        return [*self._told(room.announce(room.stream.number(doc, unix_s))), Keep(room.stream)]

    def _informed(self, of: Robot, room: Room, kv: object, stamp: Stamp) -> list[Action]:
        if stamp.run_id != of.runs.current:  # its first KEY will bring the snapshot, and that the info
            return []
        try:
            room.stream.inform(cast("dict[str, str]", kv))
        except ValueError:
            self.fates[Fate.BAD.value] += 1
            return []
        return [*room.describe(), Keep(room.stream)]

    def token(self, robot: str, present: bool, now: float) -> list[Action]:
        """An edge's liveliness token came or went."""
        if present:
            found = self._robot(robot)
            if found is None:
                self.fates[Fate.CROWDED.value] += 1
                return []
            found.came(now)
            self.wake_at = min(self.wake_at, found.ask_at)
            return self._kept(found) + self._words_changed(found, now)
        gone = self.robots.get(robot)
        if gone is None:
            return []
        gone.liveness.left(now)
        return self._kept(gone) + self._words_changed(gone, now)

    def flush(self, now: float, unix_s: float) -> list[Action]:
        """Hand out what has changed since the last flush, each stream's newest frame only."""
        out: list[Action] = []
        changed, self._changed = self._changed, {}
        for room in changed:
            robot = self.robots[room.stream.robot]
            out += room.describe()
            out += room.offer(now)
            out.append(Keep(room.stream))
            if room.viewers:
                out += self._word_changed(robot, room, now)
                self.wake_at = min(self.wake_at, room.wake_at())
            out += self._conflict(robot, now, unix_s)
        return out

    # ---- from other relays --------------------------------------------------

    def heard_of(self, robot: str, view: str, n: int, text: str) -> list[Action]:
        """An event that another relay has numbered. One that came before is left out."""
        found = self._publisher(robot, view)
        if found is None:
            return []
        _, room = found
        event = room.stream.heard_of(n, text)
        return [] if event is None else self._told(room.announce(event))

    def standing(
        self, robot: str, token: bool, ages_s: Mapping[str, float | None], now: float
    ) -> list[Action]:
        """How a robot is, told by a relay that hears it; `ages_s` by view."""
        found = self._robot(robot)
        if found is None:
            return []
        found.heard_at = now
        for view, age_s in ages_s.items():
            room = found.rooms.get(view)
            if room is not None and age_s is not None:
                room.stream.aged(age_s, now)
        if found.liveness.token != token:
            return self.token(robot, token, now)
        return self._words_changed(found, now)

    def lacks(self, robot: str) -> None:
        """Something of this robot changed that only a snapshot brings: ask, at most once a second."""
        of = self.robots.get(robot)
        if of is not None:
            of.lacking = True
            self.wake_at = min(self.wake_at, of.ask_at)

    def degrade(self, degraded: bool, now: float, robot: str | None = None) -> list[Action]:
        """This relay ceases, or begins again, to hear of one robot or of all of them. Viewers are told."""
        if robot is None:
            self.degraded = degraded
        elif robot in self.robots:
            self.robots[robot].degraded = degraded
        out: list[Action] = []
        for of in self.robots.values():
            for room in of.rooms.values():
                if room.degraded != (self.degraded or of.degraded):
                    room.degraded = not room.degraded
                    out += room.report(of.word(room, now), now)
        return out

    def forget(self, robot: str) -> None:
        """Nobody here watches it, and this relay stops listening for it."""
        of = self.robots.get(robot)
        if of is not None and not of.has_viewers():
            self._forget(of)

    # ---- from the viewers ---------------------------------------------------

    def join(self, viewer: Viewer, now: float, unix_s: float) -> list[Action]:
        """A viewer came; it gets all it needs in one write, or is told that the relay goes or is full."""
        self.joins += 1
        viewer.number = self.joins
        if self.draining is not None:
            self.endings[Close.DRAIN] += 1
            return [End(viewer, Close.DRAIN, GOING, DRAIN_RETRY_S)]
        if len(self.viewers) >= self.limits.viewers:
            self.endings[Close.FULL] += 1
            return [End(viewer, Close.FULL, "as many viewers as this relay takes", FULL_RETRY_S)]
        viewer.hz = min(viewer.asked_hz, self.load.ceiling_hz)
        robot = self.robots.get(viewer.robot)
        if robot is None:  # it may come later; bounded by the number of viewers
            robot = self.robots[viewer.robot] = Robot(viewer.robot, self.limits)
        room = robot.room(viewer.view)
        self.viewers[viewer] = room
        self._words.setdefault(room, robot.word(room, now))
        room.degraded = self.degraded or robot.degraded
        watch: list[Action] = [] if robot.has_viewers() else [Watch(robot.name)]
        return [room.join(viewer, robot.word(room, now), now, unix_s), *watch]

    def leave(self, viewer: Viewer) -> None:
        """A viewer's connection is gone; harmless when it was let go of before."""
        room = self.viewers.pop(viewer, None)
        if room is None:
            return
        room.leave(viewer)
        robot = self.robots.get(viewer.robot)
        if robot is not None and robot.heard_at is None and not robot.has_viewers():
            self._forget(robot)

    def message(self, viewer: Viewer, payload: bytes, now: float) -> list[Action]:
        """A text message from a viewer."""
        room = self.viewers.get(viewer)
        if room is None:
            return []
        if not viewer.take_token(now):
            return self._end(viewer, Close.TOO_MANY, "too many messages", 10.0)
        try:
            return self._answer(viewer, room, parse_viewer_message(payload), now)
        except MessageError as e:
            return self._end(viewer, e.close, str(e), None)

    def _answer(self, viewer: Viewer, room: Room, said: ViewerMessage, now: float) -> list[Action]:
        match said:
            case Ack(n):
                was_blocked = viewer.blocked
                viewer.acked(n, now)
                return room.drained(viewer) if was_blocked else []
            case Rate(hz):
                viewer.asked_hz = min(hz, self.limits.max_hz)
                granted = min(viewer.asked_hz, self.load.ceiling_hz)
                room.set_rate(viewer, granted, now)
                self.wake_at = min(self.wake_at, room.wake_at())
                reason = "asked" if granted == hz else "limit" if granted == viewer.asked_hz else "overload"
                return self._told(room.tell(viewer, messages.rate(granted, reason)))
            case Ping(t):
                return self._told(room.tell(viewer, messages.pong(t)))
            case Auth():  # public views need none
                return []

    def refuse(self, viewer: Viewer, close: Close, reason: str) -> list[Action]:
        """Let a viewer go because of what it sent (found below the messages: binary data)."""
        return self._end(viewer, close, reason, None)

    def drained(self, viewer: Viewer) -> list[Action]:
        """A viewer's socket has taken everything."""
        viewer.paused_at = None
        room = self.viewers.get(viewer)
        return room.drained(viewer) if room else []

    def drain(self, order: Sequence[Viewer], now: float) -> list[Action]:
        """The relay goes: all viewers are told and let go in this order, over some seconds."""
        self.draining = Drain(order, now)
        return self._move_away(self.draining, now)

    def _move_away(self, drain: Drain, now: float) -> list[Action]:
        out: list[Action] = []
        for viewer in drain.due(now):
            if viewer in self.viewers:
                out += self._end(viewer, Close.DRAIN, GOING, DRAIN_RETRY_S)
        self.wake_at = min(self.wake_at, drain.wake_at)
        return out

    def judge_load(self, busy: float, now: float) -> list[Action]:
        """Once a second: serve less often, or as often again. `busy`: share of it that the loop computed."""
        before = self.load.ceiling_hz
        full = sum(1 for viewer in self.viewers if viewer.paused_at is not None)
        fastest_hz = max((viewer.asked_hz for viewer in self.viewers), default=0.0)
        if not self.load.judge(busy, full, len(self.viewers), fastest_hz, now):
            return []
        reason = "overload" if self.load.ceiling_hz < before else "recovered"
        out: list[Action] = []
        told: dict[float, list[Viewer]] = {}
        for viewer, room in tuple(self.viewers.items()):
            granted = min(viewer.asked_hz, self.load.ceiling_hz)
            if granted == viewer.hz:
                continue
            room.set_rate(viewer, granted, now)
            if viewer.blocked:
                out += self._told(room.tell(viewer, messages.rate(granted, reason)))
            else:
                told.setdefault(granted, []).append(viewer)
        out += [Send(messages.rate(hz, reason), viewers) for hz, viewers in told.items()]
        for room in set(self.viewers.values()):
            self.wake_at = min(self.wake_at, room.wake_at())
        return out

    # ---- time ---------------------------------------------------------------

    def tick(self, now: float, unix_s: float) -> list[Action]:
        """Everything that time alone brings. Sets `wake_at` anew."""
        out: list[Action] = []
        held_up_s = now - self._sweep_at  # a tick is due by then at the latest
        if held_up_s > HELD_UP_S and self._sweeps:
            for viewer in self.viewers:
                viewer.forgive(held_up_s, now)
        sweep = now >= self._sweep_at
        report = now >= self._status_at
        wake_at = NEVER
        for robot in self.robots.values():
            if robot.asks(now):
                out.append(Ask(robot.name, (*{PUBLIC, *robot.rooms},)))
            if robot.lacking:
                wake_at = min(wake_at, robot.ask_at)
            for room in robot.rooms.values():
                if not room.viewers:
                    continue
                out += room.flush(now)
                wake_at = min(wake_at, room.wake_at())
                out += self._word_changed(robot, room, now)
                if report:
                    out += room.report(robot.word(room, now), now)
            if sweep:
                out += self._conflict(robot, now, unix_s)
        if sweep:
            out += self._sweep(now)
            self._sweep_at = now + self.limits.sweep_s
        if report:
            self._status_at = now + self.limits.status_s
        self.wake_at = min(wake_at, self._sweep_at, self._status_at)
        if self.draining is not None:
            out += self._move_away(self.draining, now)
        return out

    def _sweep(self, now: float) -> list[Action]:
        out: list[Action] = []
        pings: list[Viewer] = []
        for viewer in tuple(self.viewers):
            close = viewer.overdue(now)
            if close is not None:
                self.leave(viewer)
                self.endings[close] += 1
                out.append(Cut(viewer, close))
            elif now >= viewer.until:
                out += self._end(viewer, Close.AGE_LIMIT, "time for a new connection", RENEW_RETRY_S)
            elif viewer.speaks and now - max(viewer.heard_at, viewer.ping_at) >= self.limits.ping_s:
                viewer.ping_at = now
                pings.append(viewer)
        if pings:
            out.append(Send(messages.PING, pings))
        self._sweeps += 1
        if self._sweeps % FORGET_EVERY == 0:
            for robot in tuple(self.robots.values()):
                gone = robot.heard_at is None or now - robot.heard_at > self.limits.forget_s
                if gone and not robot.liveness.token and not robot.has_viewers():
                    self._forget(robot)
        return out

    # ---- small things ---------------------------------------------------------

    def _robot(self, name: str) -> Robot | None:
        robot = self.robots.get(name)
        if robot is None:
            known = sum(1 for r in self.robots.values() if r.heard_at is not None)
            if known >= self.limits.robots:
                return None
            robot = self.robots[name] = Robot(name, self.limits)
        return robot

    def _publisher(self, name: str, view: str) -> tuple[Robot, Room] | None:
        robot = self._robot(name)
        if robot is None or (view not in robot.rooms and len(robot.rooms) >= self.limits.views):
            return None
        return robot, robot.room(view)

    def _forget(self, robot: Robot) -> None:
        del self.robots[robot.name]
        for room in robot.rooms.values():
            self.delivered += room.delivered
            self.skipped += room.skipped
            self._words.pop(room, None)
            self._changed.pop(room, None)

    def _end(self, viewer: Viewer, close: Close, reason: str, retry_s: float | None) -> list[Action]:
        self.leave(viewer)
        self.endings[close] += 1
        return [End(viewer, close, reason, retry_s)]

    def _told(self, actions: list[Action]) -> list[Action]:
        """What a room returned; whoever it had to let go of is counted."""
        for action in actions:
            if isinstance(action, End):
                self.leave(action.viewer)
                self.endings[action.close] += 1
        return actions

    @staticmethod
    def _kept(robot: Robot) -> list[Action]:
        return [Keep(room.stream) for room in robot.rooms.values()]

    def _words_changed(self, robot: Robot, now: float) -> list[Action]:
        out: list[Action] = []
        for room in robot.rooms.values():
            if room.viewers:
                out += self._word_changed(robot, room, now)
        return out

    def _word_changed(self, robot: Robot, room: Room, now: float) -> list[Action]:
        word = robot.word(room, now)
        if self._words.get(room) == word:
            return []
        self._words[room] = word
        return room.report(word, now)

    def _conflict(self, robot: Robot, now: float, unix_s: float) -> list[Action]:
        """Tell when a second edge begins or ceases to claim this robot."""
        conflict = robot.runs.conflict(now)
        if conflict == robot.in_conflict:
            return []
        robot.in_conflict = conflict
        out: list[Action] = []
        for room in robot.rooms.values():
            newest = room.stream.newest
            doc = conflict_event(newest.t_s if newest else 0.0, conflict)
            out += self._told(room.announce(room.stream.number(doc, unix_s)))
        return out + self._kept(robot)
