"""The relay without sockets. Each call takes the current time and returns the actions to execute in order."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from posecast_wire import (
    Ack,
    Auth,
    Close,
    MessageError,
    Ping,
    Rate,
    ViewerMessage,
    parse_viewer_message,
)

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
from posecast_relay.core.drain import Drain
from posecast_relay.core.edge_messages import make_conflict_event
from posecast_relay.core.limits import Limits
from posecast_relay.core.load_shedder import LoadShedder
from posecast_relay.core.past.recorder import Recorder
from posecast_relay.core.policy.admission import (
    DRAIN_RETRY_S,
    GOING,
    Occupancy,
    find_no_room,
)
from posecast_relay.core.policy.policy import PUBLIC, Grant
from posecast_relay.core.roster import Headcount
from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.room import Room
from posecast_relay.core.uplink import Uplink
from posecast_relay.core.viewer import messages
from posecast_relay.core.viewer.viewer import Viewer

RENEW_RETRY_S = 1.0  # these viewers already return one at a time
EXPIRED = "the link or sign-in has expired"
FORGET_EVERY = 20  # sweeps
# When the limit on robots is reached, robots that are gone make room for new ones. Robots that never sent
# anything are forgotten just as early.
FORGET_FULL_S = 5.0
QUESTIONS_MAX = 8  # robots asked per tick, about 3 ms; the others wait for the next tick,
QUESTIONS_S = 0.005  # which comes this much later
HELD_UP_S = 0.1  # a tick later than this means that the process was stalled


class Hub(Uplink):
    """All robots and viewers of one process, and every decision about them."""

    def __init__(
        self, limits: Limits, headcount: Headcount | None = None, recorder: Recorder | None = None
    ) -> None:
        super().__init__(limits, headcount, recorder)
        self.load = LoadShedder()
        self.joins = 0
        self.draining: Drain | None = None  # set: no viewer may join
        self._status_at = 0.0
        self._status_goes = False  # sent along with the frames of this flush
        self._sweep_at = 0.0
        self._sweeps = 0

    # ---- from the edges to the viewers ---------------------------------------

    def flush(self, now: float, unix_s: float) -> list[Action]:
        """Send what has changed since the last flush. Of each stream only the newest frame is sent."""
        out: list[Action] = []
        changed, self.changed = self.changed, {}
        for room in changed:
            try:
                self._hand_out(room, now, unix_s, out)
            except Exception as error:
                out += self.end_after_fault(room, error)
        return out

    def _hand_out(self, room: Room, now: float, unix_s: float, out: list[Action]) -> None:
        robot = self.robots[room.stream.robot]
        out += room.send_description()
        age_s = room.stream.compute_age_s(now)
        is_old = not room.stream.is_live or age_s is None or age_s > self.limits.silent_s
        is_news = bool(room.viewers) and (self.record_status(robot, room, now) or is_old)
        if is_news:  # sent with the frame, so that no viewer mistakes an old frame for a live one
            room.defer_status(robot.compute_status(room, now))
        out += self.remove_ended(room.offer(now))
        out.append(Persist(room.stream))
        if is_news:
            out += room.send_deferred_status(now)
        if room.viewers:
            self.plan_flush(room)
        out += self._report_conflict(robot, now, unix_s)

    # ---- from the viewers ---------------------------------------------------

    def join(self, viewer: Viewer, now: float, unix_s: float) -> list[Action]:
        """Add a viewer and send it everything it needs in one write.

        The viewer is closed at once if the relay is stopping or full.
        """
        return self.guard(viewer, partial(self._join, viewer, now, unix_s))

    def _join(self, viewer: Viewer, now: float, unix_s: float) -> list[Action]:
        self.joins += 1
        viewer.set_number(self.joins)
        grant = viewer.grant
        occupancy = self._count_occupancy(grant)
        refusal = find_no_room(grant, occupancy)
        if refusal is not None:
            told = self.count_refusal(refusal, now)
            return [CloseConnection(viewer, told.close, told.reason, told.retry_s, told.lane)]
        viewer.set_rate(min(viewer.asked_hz, self.load.ceiling_hz))
        robot = self.robots.get(viewer.robot)
        if robot is None:  # the robot may appear later; bounded by the number of viewers
            robot = self.robots[viewer.robot] = Robot(viewer.robot, self.limits)
        room = robot.get_room(viewer.view)
        self.add_viewer(viewer, room)
        self.statuses.setdefault(room, robot.compute_status(room, now))
        room.set_degraded(self.degraded or robot.degraded)
        watch: list[Action] = [] if robot.has_viewers() else [SubscribeRobot(robot.name)]
        return [room.join(viewer, robot.compute_status(room, now), now, unix_s), *watch]

    def _count_occupancy(self, grant: Grant | None) -> Occupancy:
        by = None if grant is None else (grant.robot, grant.by)
        return Occupancy(
            viewers=self.headcount.count_viewers(),
            viewers_max=self.limits.viewers,
            of_audience=0 if by is None else self.admitted[by],
            is_draining=self.draining is not None,
        )

    def take_message(self, viewer: Viewer, payload: bytes, now: float) -> list[Action]:
        """Handle a text message from a viewer. An invalid message, or too many, end the connection."""
        room = self.viewers.get(viewer)
        if room is None:
            return []
        if not viewer.allow_message(now):
            return self.end_viewer(viewer, Close.TOO_MANY, "too many messages", 10.0)
        try:
            return self._answer(viewer, room, parse_viewer_message(payload), now)
        except MessageError as e:
            return self.end_viewer(viewer, e.close, str(e), None)
        except Exception as error:
            return self.end_after_fault(viewer, error)

    def _answer(self, viewer: Viewer, room: Room, said: ViewerMessage, now: float) -> list[Action]:
        match said:
            case Ack(n):
                was_blocked = viewer.blocked
                viewer.record_ack(n, now)
                return room.send_waiting(viewer) if was_blocked else []
            case Rate(hz):
                viewer.set_asked_rate(hz)
                granted = min(viewer.asked_hz, self.load.ceiling_hz)
                room.set_rate(viewer, granted, now)
                self.plan_flush(room)
                limited = "limit" if hz > viewer.max_hz else "asked"
                reason = limited if granted == viewer.asked_hz else "overload"
                return self.remove_ended(room.send_message(viewer, messages.make_rate(granted, reason)))
            case Ping(t):
                return self.remove_ended(room.send_message(viewer, messages.make_pong(t, now)))
            case Auth(token):
                return [VerifyToken(viewer, token)]

    def refuse(self, viewer: Viewer, close: Close, reason: str) -> list[Action]:
        """End a viewer for a reason found outside the core, for example because it sent binary data."""
        return self.end_viewer(viewer, close, reason, None)

    def replace_grant(self, viewer: Viewer, grant: Grant, now: float) -> list[Action]:
        """Replace a viewer's grant.

        If the view, delay or audience differs, the connection ends, so that the viewer reconnects.
        """
        before, room = viewer.grant, self.viewers.get(viewer)
        if room is None or before is None:
            return []
        if (before.view, before.delay_s, before.by) != (grant.view, grant.delay_s, grant.by):
            return self.end_viewer(viewer, Close.AGE_LIMIT, "your access has changed", RENEW_RETRY_S)
        if not viewer.set_grant(grant):
            return []
        granted = min(viewer.asked_hz, self.load.ceiling_hz)
        room.set_rate(viewer, granted, now)
        self.plan_flush(room)
        return self.remove_ended(room.send_message(viewer, messages.make_rate(granted, "limit")))

    def resume_viewer(self, viewer: Viewer) -> list[Action]:
        """Note that a viewer's socket has drained, and send what was waiting."""
        viewer.resume()
        room = self.viewers.get(viewer)
        return self.guard(viewer, partial(room.send_waiting, viewer)) if room else []

    def drain(self, order: Sequence[Viewer], now: float) -> list[Action]:
        """Start to stop: close all viewers in this order, spread over some seconds."""
        self.draining = Drain(order, now)
        if self.recorder is not None:
            self.recorder.close_all(now)
        return self._move_away(self.draining, now)

    def _move_away(self, drain: Drain, now: float) -> list[Action]:
        out: list[Action] = []
        for viewer in drain.take_due(now):
            if viewer in self.viewers:
                out += self.end_viewer(viewer, Close.DRAIN, GOING, DRAIN_RETRY_S)
        self.wake_at = min(self.wake_at, drain.wake_at)
        return out

    def judge_load(self, busy: float, now: float) -> list[Action]:
        """Adapt the rates to the load. Call it once a second.

        `busy`: the share of that second, 0 to 1, that the event loop spent computing.
        """
        before = self.load.ceiling_hz
        behind = sum(room.count_behind() for robot in self.robots.values() for room in robot.rooms.values())
        fastest_hz = max((viewer.asked_hz for viewer in self.viewers), default=0.0)
        if not self.load.judge(busy, behind, len(self.viewers), fastest_hz, now):
            return []
        reason = "overload" if self.load.ceiling_hz < before else "recovered"
        out: list[Action] = []
        told: dict[float, list[Viewer]] = {}
        for viewer, room in tuple(self.viewers.items()):
            granted = min(viewer.asked_hz, self.load.ceiling_hz)
            if granted == viewer.hz:
                continue
            try:
                room.set_rate(viewer, granted, now)
                if viewer.blocked:
                    out += self.remove_ended(room.send_message(viewer, messages.make_rate(granted, reason)))
                else:
                    told.setdefault(granted, []).append(viewer)
            except Exception as error:
                out += self.end_after_fault(viewer, error)
        out += [Send(messages.make_rate(hz, reason), viewers) for hz, viewers in told.items()]
        for room in set(self.viewers.values()):
            out += self.guard(room, partial(self._plan_only, room))
        return out

    def _plan_only(self, room: Room) -> list[Action]:
        self.plan_flush(room)
        return []

    # ---- time ---------------------------------------------------------------

    def tick(self, now: float, unix_s: float) -> list[Action]:
        """Do what is due at `now`: waiting frames, questions, statuses, timeouts. Updates `wake_at`."""
        out: list[Action] = []
        held_up_s = now - self._sweep_at  # a tick was due by then
        if held_up_s > HELD_UP_S and self._sweeps:
            for viewer in tuple(self.viewers):
                try:
                    viewer.shift_deadlines(held_up_s, now)
                except Exception as error:
                    out += self.end_after_fault(viewer, error)
        for room in self.flushes.take_due(now):
            out += self.guard(room, partial(self._flush, room, now))
        for robot in self.questions.take_due(now, QUESTIONS_MAX):
            out += self.guard(None, partial(self._ask, robot, now))
        if now >= self._status_at:
            out += self._report(now)
        if now >= self._sweep_at:
            self._sweep_at = now + self.limits.sweep_s
            for robot in tuple(self.robots.values()):
                if robot.should_ask(now):
                    self.questions.put(robot, now + QUESTIONS_S)
                out += self.report_statuses(robot, now)
                if self.recorder is not None:
                    self.recorder.record_statuses(robot, now)
                out += self.guard(None, partial(self._report_conflict, robot, now, unix_s))
            out += self._sweep(now)
        questions_at = max(self.questions.next_at, now + QUESTIONS_S)
        self.wake_at = min(self.flushes.next_at, questions_at, self._sweep_at, self._status_at)
        if self.recorder is not None:
            out += self._close_segments(self.recorder, now)
        if self.draining is not None:
            out += self._move_away(self.draining, now)
        return out

    def _close_segments(self, recorder: Recorder, now: float) -> list[Action]:
        recorder.close_due(now)
        self.wake_at = min(self.wake_at, recorder.next_at)
        return [Fault(where, error) for where, error in recorder.take_faults()]

    def _flush(self, room: Room, now: float) -> list[Action]:
        out = self.remove_ended(room.flush(now))
        self.plan_flush(room)
        return out

    def _ask(self, robot: Robot, now: float) -> list[Action]:
        asks = robot.should_ask(now) and self.robots.get(robot.name) is robot
        if asks:
            robot.record_question(now)
        if robot.lacking and robot.ask_at > now:
            self.plan_question(robot)
        return [RequestSnapshot(robot.name, (*{PUBLIC, *robot.rooms},))] if asks else []

    def _report(self, now: float) -> list[Action]:
        """Send the statuses, with the next frame or alone to viewers that get no frame soon."""
        out: list[Action] = []
        self._status_goes = not self._status_goes
        for robot in self.robots.values():
            for room in robot.rooms.values():
                if not room.viewers:
                    continue
                out += self.guard(room, partial(self._report_room, robot, room, now))
        alone_s = self.limits.status_alone_s
        self._status_at = now + (alone_s if self._status_goes else self.limits.status_s - alone_s)
        return out

    def _report_room(self, robot: Robot, room: Room, now: float) -> list[Action]:
        if not self._status_goes:
            return room.send_deferred_status(now)
        room.defer_status(robot.compute_status(room, now))
        return []

    def _check_deadlines(self, viewer: Viewer, now: float, pings: list[Viewer]) -> list[Action]:
        close = viewer.find_overdue(now)
        if close is not None:
            self.remove_viewer(viewer)
            self.count_ending(close)
            return [Abort(viewer, close)]
        if now >= viewer.expires_at:
            return self.end_viewer(viewer, Close.TOKEN, EXPIRED, None)
        if now >= viewer.until:
            return self.end_viewer(viewer, Close.AGE_LIMIT, "maximum connection age reached", RENEW_RETRY_S)
        if viewer.take_ping(now):
            pings.append(viewer)
        return []

    def _sweep(self, now: float) -> list[Action]:
        out: list[Action] = []
        pings: list[Viewer] = []
        for viewer in tuple(self.viewers):
            out += self.guard(viewer, partial(self._check_deadlines, viewer, now, pings))
        if pings:
            out.append(Send(messages.PING, pings))
        self._sweeps += 1
        is_full = self.publishers >= self.limits.robots
        if is_full or self._sweeps % FORGET_EVERY == 0:
            forget_s = FORGET_FULL_S if is_full else self.limits.forget_s
            for robot in tuple(self.robots.values()):
                kept_s = forget_s if robot.rooms else FORGET_FULL_S
                gone = robot.heard_at is None or now - robot.heard_at > kept_s
                if gone and not robot.liveness.token and not robot.has_viewers():
                    if self.recorder is not None:
                        self.recorder.forget_robot(robot, now)
                    self.drop_robot(robot)
        return out

    # ---- two edges with one name ----------------------------------------------

    def _report_conflict(self, robot: Robot, now: float, unix_s: float) -> list[Action]:
        """Send an event when a second edge begins or stops claiming this robot."""
        conflict = robot.runs.is_in_conflict(now)
        if conflict == robot.in_conflict:
            return []
        robot.set_conflict(conflict)
        out: list[Action] = []
        for room in robot.rooms.values():
            newest = room.stream.newest
            doc = make_conflict_event(newest.t_s if newest else 0.0, conflict)
            out += self.announce_event(robot, room, doc, now, unix_s)
        return out
