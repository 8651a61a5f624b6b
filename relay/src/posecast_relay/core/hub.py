"""The whole relay without its sockets. Calls come in with the time; what to do comes back, in order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
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
from posecast_relay.core.actions import Action, Ask, Cut, End, Keep, Send, Verify, Watch
from posecast_relay.core.drain import Drain
from posecast_relay.core.histogram import Histogram
from posecast_relay.core.limits import Limits
from posecast_relay.core.load import Load
from posecast_relay.core.policy import PUBLIC, Grant
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.roster import Roster
from posecast_relay.core.said import conflict_event, edge_said
from posecast_relay.core.stream import Fate
from posecast_relay.core.viewer import Viewer

FULL_RETRY_S = 30.0
DRAIN_RETRY_S = 10.0
RENEW_RETRY_S = 1.0  # these come one by one already
EXPIRED = "the link or sign-in has expired"
GOING = "the relay is being replaced"
FORGET_EVERY = 20  # sweeps
HELD_UP_S = 0.1  # a tick that comes later than this shows that the process stood still


class Hub(Roster):
    """What happens to the robots and viewers of one process."""

    def __init__(self, limits: Limits) -> None:
        super().__init__(limits)
        self.fates: Counter[str] = Counter()  # of messages from edges
        self.load = Load()
        self.lateness = Histogram()  # of frames from edges, as they came in
        self.joins = 0
        self.draining: Drain | None = None  # nobody is taken any more
        self._status_at = 0.0
        self._status_goes = False  # with the frames, just now
        self._sweep_at = 0.0
        self._sweeps = 0

    # ---- from the edges ---------------------------------------------------

    def frame(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, late_s: float = 0.0
    ) -> Fate:
        """Take a frame in; `flush` then hands out the newest. `late_s`: as late as another relay found it."""
        found = self.publisher(robot, view)
        if found is None:
            fate = Fate.CROWDED
        else:
            of, room = found
            fate = of.frame(room, payload, stamp, now, late_s)
            if fate is Fate.TAKEN:
                self.changed[room] = None
                self.lateness.add(of.runs.lateness_s)
            if of.lacking:
                self.ask_about(of)
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
        found = self.publisher(robot, view)
        if found is None:
            raise ValueError("snapshot: more robots or views than the relay takes")
        of, room = found
        of.snapshot(room, snapshot, stamp, now, newest)
        self.changed[room] = None

    def event(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, unix_s: float
    ) -> list[Action]:
        """An event from an edge: number it, keep it, hand it to everybody. Or the robot's info or model."""
        found = self.publisher(robot, view)
        doc = edge_said(payload, self.limits)
        if found is None or doc is None:
            self.fates[(Fate.CROWDED if found is None else Fate.BAD).value] += 1
            return []
        of, room = found
        if of.runs.is_retired(stamp.run_id, now):
            self.fates[Fate.RETIRED.value] += 1
            return []
        of.heard_at = now
        if doc["type"] in ("info", "model"):
            return self._informed(of, room, doc, stamp)
        return [*self.told(room.announce(room.stream.number(doc, unix_s))), Keep(room.stream)]

    def _informed(self, of: Robot, room: Room, doc: dict[str, object], stamp: Stamp) -> list[Action]:
        if stamp.run_id != of.runs.current:  # its first KEY will bring the snapshot, and that all of it
            return []
        try:
            if doc["type"] == "model":
                room.stream.show(cast(str, doc["hash"]))
            else:
                room.stream.inform(cast("dict[str, str]", doc["kv"]))
        except ValueError:
            self.fates[Fate.BAD.value] += 1
            return []
        return [*room.describe(), Keep(room.stream)]

    def token(self, robot: str, present: bool, now: float) -> list[Action]:
        """An edge's liveliness token came or went."""
        if present:
            found = self.admit(robot)
            if found is None:
                self.fates[Fate.CROWDED.value] += 1
                return []
            found.came(now)
            self.ask_about(found)
            return self.kept(found) + self.words_changed(found, now)
        gone = self.robots.get(robot)
        if gone is None:
            return []
        gone.liveness.left(now)
        return self.kept(gone) + self.words_changed(gone, now)

    def flush(self, now: float, unix_s: float) -> list[Action]:
        """Hand out what has changed since the last flush, each stream's newest frame only."""
        out: list[Action] = []
        changed, self.changed = self.changed, {}
        for room in changed:
            robot = self.robots[room.stream.robot]
            out += room.describe()
            out += room.offer(now)
            out.append(Keep(room.stream))
            if room.viewers:
                out += self.word_changed(robot, room, now)
                self.plan(room)
            out += self._conflict(robot, now, unix_s)
        return out

    # ---- from the viewers ---------------------------------------------------

    def join(self, viewer: Viewer, now: float, unix_s: float) -> list[Action]:
        """A viewer came; it gets all it needs in one write, or is told that the relay goes or is full."""
        self.joins += 1
        viewer.number = self.joins
        if self.draining is not None:
            self.endings[Close.DRAIN] += 1
            return [End(viewer, Close.DRAIN, GOING, DRAIN_RETRY_S)]
        if len(self.viewers) + self.elsewhere() >= self.limits.viewers:
            self.endings[Close.FULL] += 1
            return [End(viewer, Close.FULL, "as many viewers as this relay takes", FULL_RETRY_S)]
        grant = viewer.grant
        if grant is not None:
            here = self.admitted[grant.robot, grant.by]
            if grant.viewers is not None and here >= grant.viewers:
                self.endings[Close.FULL] += 1
                return [End(viewer, Close.FULL, "as many viewers as this robot takes", FULL_RETRY_S)]
            self.admitted[grant.robot, grant.by] = here + 1
        viewer.hz = min(viewer.asked_hz, self.load.ceiling_hz)
        robot = self.robots.get(viewer.robot)
        if robot is None:  # it may come later; bounded by the number of viewers
            robot = self.robots[viewer.robot] = Robot(viewer.robot, self.limits)
        room = robot.room(viewer.view)
        self.viewers[viewer] = room
        self.words.setdefault(room, robot.word(room, now))
        room.degraded = self.degraded or robot.degraded
        watch: list[Action] = [] if robot.has_viewers() else [Watch(robot.name)]
        return [room.join(viewer, robot.word(room, now), now, unix_s), *watch]

    def message(self, viewer: Viewer, payload: bytes, now: float) -> list[Action]:
        """A text message from a viewer."""
        room = self.viewers.get(viewer)
        if room is None:
            return []
        if not viewer.take_token(now):
            return self.end(viewer, Close.TOO_MANY, "too many messages", 10.0)
        try:
            return self._answer(viewer, room, parse_viewer_message(payload), now)
        except MessageError as e:
            return self.end(viewer, e.close, str(e), None)

    def _answer(self, viewer: Viewer, room: Room, said: ViewerMessage, now: float) -> list[Action]:
        match said:
            case Ack(n):
                was_blocked = viewer.blocked
                viewer.acked(n, now)
                return room.drained(viewer) if was_blocked else []
            case Rate(hz):
                viewer.asked_hz = min(hz, viewer.max_hz)
                granted = min(viewer.asked_hz, self.load.ceiling_hz)
                room.set_rate(viewer, granted, now)
                self.plan(room)
                reason = "asked" if granted == hz else "limit" if granted == viewer.asked_hz else "overload"
                return self.told(room.tell(viewer, messages.rate(granted, reason)))
            case Ping(t):
                return self.told(room.tell(viewer, messages.pong(t)))
            case Auth(token):
                return [Verify(viewer, token)]

    def refuse(self, viewer: Viewer, close: Close, reason: str) -> list[Action]:
        """Let a viewer go because of what it sent (found below the messages: binary data)."""
        return self.end(viewer, close, reason, None)

    def regrant(self, viewer: Viewer, grant: Grant, now: float) -> list[Action]:
        """What a viewer may see has been judged anew. Another view or delay takes another connection."""
        before, room = viewer.grant, self.viewers.get(viewer)
        if room is None or before is None:
            return []
        if (before.view, before.delay_s, before.by) != (grant.view, grant.delay_s, grant.by):
            return self.end(viewer, Close.AGE_LIMIT, "what you may see has changed", RENEW_RETRY_S)
        viewer.grant = grant
        viewer.max_hz = min(self.limits.max_hz, grant.hz)
        if viewer.asked_hz <= viewer.max_hz:
            return []
        viewer.asked_hz = viewer.max_hz
        granted = min(viewer.asked_hz, self.load.ceiling_hz)
        room.set_rate(viewer, granted, now)
        self.plan(room)
        return self.told(room.tell(viewer, messages.rate(granted, "limit")))

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
                out += self.end(viewer, Close.DRAIN, GOING, DRAIN_RETRY_S)
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
                out += self.told(room.tell(viewer, messages.rate(granted, reason)))
            else:
                told.setdefault(granted, []).append(viewer)
        out += [Send(messages.rate(hz, reason), viewers) for hz, viewers in told.items()]
        for room in set(self.viewers.values()):
            self.plan(room)
        return out

    # ---- time ---------------------------------------------------------------

    def tick(self, now: float, unix_s: float) -> list[Action]:
        """Everything that time alone brings. Sets `wake_at` anew."""
        out: list[Action] = []
        held_up_s = now - self._sweep_at  # a tick is due by then at the latest
        if held_up_s > HELD_UP_S and self._sweeps:
            for viewer in self.viewers:
                viewer.forgive(held_up_s, now)
        for room in self.flushes.due(now):
            out += room.flush(now)
            self.plan(room)
        for robot in self.questions.due(now):
            out += self._ask(robot, now)
        if now >= self._status_at:
            out += self._report(now)
        if now >= self._sweep_at:
            for robot in self.robots.values():
                out += self._ask(robot, now)
                out += self.words_changed(robot, now)
                out += self._conflict(robot, now, unix_s)
            out += self._sweep(now)
            self._sweep_at = now + self.limits.sweep_s
        self.wake_at = min(self.flushes.next_at, self.questions.next_at, self._sweep_at, self._status_at)
        if self.draining is not None:
            out += self._move_away(self.draining, now)
        return out

    def _ask(self, robot: Robot, now: float) -> list[Action]:
        asks = robot.asks(now) and self.robots.get(robot.name) is robot
        if robot.lacking and robot.ask_at > now:
            self.ask_about(robot)
        return [Ask(robot.name, (*{PUBLIC, *robot.rooms},))] if asks else []

    def _report(self, now: float) -> list[Action]:
        """The status travels with the next frame; those who get none within a moment are told by itself."""
        out: list[Action] = []
        self._status_goes = not self._status_goes
        for robot in self.robots.values():
            for room in robot.rooms.values():
                if not room.viewers:
                    continue
                if self._status_goes:
                    room.owe_status(robot.word(room, now))
                else:
                    out += room.settle_status(now)
        alone_s = self.limits.status_alone_s
        self._status_at = now + (alone_s if self._status_goes else self.limits.status_s - alone_s)
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
            elif now >= viewer.expires_at:
                out += self.end(viewer, Close.TOKEN, EXPIRED, None)
            elif now >= viewer.until:
                out += self.end(viewer, Close.AGE_LIMIT, "time for a new connection", RENEW_RETRY_S)
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
                    self.drop(robot)
        return out

    # ---- two edges with one name ----------------------------------------------

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
            out += self.told(room.announce(room.stream.number(doc, unix_s)))
        return out + self.kept(robot)
