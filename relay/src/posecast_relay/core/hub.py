"""The relay without sockets. Each call takes the current time and returns the actions to execute in order.

Messages from edges that are ignored are counted by reason.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence, Sized
from dataclasses import replace
from functools import partial
from typing import Protocol, cast

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
from posecast_wire.frame import TAG_KEY

from posecast_relay.core import messages
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
from posecast_relay.core.limits import Limits
from posecast_relay.core.load import LoadShedder
from posecast_relay.core.messages import make_conflict_event, read_edge_message
from posecast_relay.core.policy import (
    DRAIN_RETRY_S,
    GOING,
    PUBLIC,
    Grant,
    Occupancy,
    Policy,
    Refusal,
    RetryPace,
    find_no_room,
)
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Event, FrameOutcome
from posecast_relay.core.viewer import Viewer
from posecast_relay.kit import Histogram, TimerQueue

RENEW_RETRY_S = 1.0  # these viewers already return one at a time
EXPIRED = "the link or sign-in has expired"
FORGET_EVERY = 20  # sweeps
# When the limit on robots is reached, robots that are gone make room for new ones. Robots that never sent
# anything are forgotten just as early.
FORGET_FULL_S = 5.0
QUESTIONS_MAX = 8  # robots asked per tick, about 3 ms; the others wait for the next tick,
QUESTIONS_S = 0.005  # which comes this much later
HELD_UP_S = 0.1  # a tick later than this means that the process stood still


class Headcount:
    """Counts the viewers of all hubs in one process, which share one limit."""

    def __init__(self) -> None:
        self._hubs: list[Sized] = []

    def include(self, viewers: Sized) -> None:
        """Add a hub's viewers. Their number is read at every count."""
        self._hubs.append(viewers)

    def count_viewers(self) -> int:
        """Return how many viewers all hubs have now."""
        return sum(map(len, self._hubs))


class RecordsPast(Protocol):
    """Records what a hub accepts, for viewers who may look back. It raises nothing: see `take_faults`."""

    faults: Counter[str]  # recordings that failed, by error type

    @property
    def next_at(self) -> float:
        """When to call `close_due` at the latest, in seconds of the core's clock."""

    def set_policy(self, policy: Policy, now: float) -> None:
        """Set who may see what. Streams that nobody may look back on are no longer recorded."""

    def record_frame(self, robot: Robot, room: Room, now: float) -> None:
        """Record the newest frame of a stream, which was just accepted, and the robot's status."""

    def record_event(
        self, robot: Robot, room: Room, event: Event, doc: dict[str, object], now: float
    ) -> None:
        """Record an event that was just numbered. `doc`: its content."""

    def record_description(self, robot: Robot, room: Room, now: float) -> None:
        """Record the info and model of a stream if they have changed."""

    def record_statuses(self, robot: Robot, now: float) -> None:
        """Record the robot's status, if it has changed, in those of its streams that are being recorded."""

    def close_due(self, now: float) -> None:
        """Close the segments that are long enough."""

    def close_all(self, now: float) -> None:
        """Close all open segments, because the process is stopping."""

    def forget_robot(self, robot: Robot, now: float) -> None:
        """Close a robot's open segments, because the hub forgets the robot."""

    def take_faults(self) -> list[tuple[str, Exception]]:
        """Return the failures since the last call, each with its place."""


class Hub:
    """All robots and viewers of one process, and every decision about them."""

    def __init__(
        self, limits: Limits, headcount: Headcount | None = None, recorder: RecordsPast | None = None
    ) -> None:
        """`headcount` is shared by all hubs of a process; None: this is the only hub.

        `recorder` gets everything that is accepted; None: nothing is recorded.
        """
        self.limits = limits
        self.headcount = Headcount() if headcount is None else headcount
        self.recorder = recorder
        self.robots: dict[str, Robot] = {}
        self.publishers = 0  # of the robots, those that have sent something
        self.viewers: dict[Viewer, Room] = {}
        self.admitted: Counter[tuple[str, str]] = Counter()  # viewers by robot and audience
        self.headcount.include(self.viewers)
        self.endings: Counter[int] = Counter()  # of viewers, by close code
        self.sent_to_lane = 0  # of the viewers that were refused
        self._retry_pace = RetryPace()
        self.delivered = 0  # by rooms that are gone
        self.skipped = 0  # by rooms that are gone
        self.degraded = False  # this relay can't hear any robot, through its own problem
        self.wake_at = 0.0  # call `tick` then, or a little later
        self.flushes = TimerQueue[Room]()  # frames that wait until a viewer is due
        self.questions = TimerQueue[Robot]()  # snapshots to request
        self.changed: dict[Room, None] = {}  # since the last flush
        self.statuses: dict[Room, str] = {}  # the last status sent to its viewers
        self.outcomes: Counter[str] = Counter()  # of messages from edges
        self.lateness = Histogram()  # of frames from edges, on arrival
        self.load = LoadShedder()
        self.joins = 0
        self.draining: Drain | None = None  # set: no viewer may join
        self._status_at = 0.0
        self._status_due = False  # sent along with the frames of this flush
        self._sweep_at = 0.0
        self._sweeps = 0

    # ---- robots and viewers ------------------------------------------------

    def admit_robot(self, name: str) -> Robot | None:
        """Return the publishing robot with this name, created if it is new.

        None if the limit is reached.
        """
        robot = self.robots.get(name)
        if robot is not None and robot.counted:
            return robot
        if self.publishers >= self.limits.robots:
            return None
        if robot is None:
            robot = self.robots[name] = Robot(name, self.limits)
        robot.mark_counted()
        self.publishers += 1
        return robot

    def admit_view(self, name: str, view: str) -> tuple[Robot, Room] | None:
        """Return a robot and the room of one of its views.

        None if a limit on robots or views is reached.
        """
        robot = self.admit_robot(name)
        if robot is None or (view not in robot.rooms and len(robot.rooms) >= self.limits.views):
            return None
        return robot, robot.get_room(view)

    def drop_robot(self, robot: Robot) -> None:
        """Forget a robot. It must have no viewers."""
        del self.robots[robot.name]
        self.publishers -= robot.counted
        for room in robot.rooms.values():
            self.delivered += room.delivered
            self.skipped += room.skipped
            self.statuses.pop(room, None)
            self.changed.pop(room, None)

    def add_viewer(self, viewer: Viewer, room: Room) -> None:
        """Count a viewer, which is about to join this room."""
        if viewer.grant is not None:
            self.admitted[viewer.robot, viewer.grant.by] += 1
        self.viewers[viewer] = room

    def remove_viewer(self, viewer: Viewer) -> None:
        """Remove a viewer whose connection is gone. Does nothing if it was already removed."""
        room = self.viewers.pop(viewer, None)
        if room is None:
            return
        room.leave(viewer)
        if viewer.grant is not None:
            self.admitted[viewer.robot, viewer.grant.by] -= 1
        robot = self.robots.get(viewer.robot)
        if robot is not None and robot.heard_at is None and not robot.has_viewers():
            self.drop_robot(robot)

    def set_degraded(self, degraded: bool) -> None:
        """Set whether this relay can hear any robot at all. ReplicaFeed tells the viewers."""
        self.degraded = degraded

    # ---- from the edges ----------------------------------------------------

    def take_edge_frame(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float
    ) -> FrameOutcome:
        """Take a frame directly from an edge. It is dropped if its robot exceeds its share."""
        found = self.admit_view(robot, view)
        hashed = len(payload) > 0 and payload[0] == TAG_KEY
        if found is not None and not found[0].share.allow_frame(view, len(payload), hashed, now):
            self.outcomes[FrameOutcome.OVER_SHARE.value] += 1
            return FrameOutcome.OVER_SHARE
        return self.receive_frame(robot, view, payload, stamp, now)

    def receive_frame(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, late_s: float = 0.0
    ) -> FrameOutcome:
        """Take a frame. The next `flush` sends the newest one.

        `late_s`: the lateness measured by another relay.
        """
        found = self.admit_view(robot, view)
        if found is None:
            outcome = FrameOutcome.CROWDED
        else:
            of, room = found
            outcome = of.adopt_frame(room, payload, stamp, now, late_s)
            if outcome is FrameOutcome.TAKEN:
                self.changed[room] = None
                self.lateness.add(of.runs.lateness_s)
                if self.recorder is not None:
                    self.recorder.record_frame(of, room, now)
            if of.lacking:
                self.plan_question(of)
        self.outcomes[outcome.value] += 1
        return outcome

    def check_snapshot(self, robot: str, size: int, now: float) -> None:
        """Check a snapshot of `size` bytes before it is parsed.

        Raises ValueError if the robot is unknown or has used up its share of snapshot bytes.
        """
        of = self.robots.get(robot)
        if of is None:
            raise ValueError("snapshot: unknown robot")
        if not of.share.allow_snapshot(size, now):
            raise ValueError(f"snapshot: {size} bytes exceed this robot's share")

    def take_snapshot(
        self,
        robot: str,
        view: str,
        snapshot: Snapshot,
        stamp: Stamp,
        now: float,
        newest: bytes | None = None,
        waited_s: float | None = None,
    ) -> None:
        """Take a snapshot that an edge sent `waited_s` after the request, or that another relay sent.

        `newest`: the newest frame, if another relay sent it along. Raises ValueError with a one-line message
        if the snapshot can't be used.
        """
        found = self.admit_view(robot, view)
        if found is None:
            raise ValueError("snapshot: exceeds the relay's limit on robots or views")
        of, room = found
        self._check_room(room, len(snapshot.schema))
        before = room.stream.newest
        of.take_snapshot(room, snapshot, stamp, now, newest, waited_s)
        self.changed[room] = None
        if self.recorder is not None:
            self.recorder.record_description(of, room, now)
            if room.stream.is_live and room.stream.newest is not before:  # a frame was waiting for its base
                self.recorder.record_frame(of, room, now)

    def _check_room(self, room: Room, size: int) -> None:
        """Raise ValueError if a schema of `size` bytes would exceed the limit for all long schemas."""
        free = self.limits.schema_bytes_free
        if size <= free:
            return
        others = (
            of.stream.schema
            for robot in self.robots.values()
            for of in robot.rooms.values()
            if of is not room
        )
        lengths = (len(schema.text) for schema in others if schema is not None)
        if size + sum(length for length in lengths if length > free) > self.limits.schemas_bytes:
            raise ValueError(f"snapshot: no room for another schema of {size} bytes")

    def take_event(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float, unix_s: float
    ) -> list[Action]:
        """Take a message from an edge. An event is numbered and sent to all; info or a model replaces the old
        one.
        """
        found = self.admit_view(robot, view)
        if found is None:
            self.outcomes[FrameOutcome.CROWDED.value] += 1
            return []
        of, room = found
        if not of.share.allow_event(len(payload), now):
            self.outcomes[FrameOutcome.OVER_SHARE.value] += 1
            return []
        doc = read_edge_message(payload, self.limits)
        if doc is None:
            self.outcomes[FrameOutcome.BAD.value] += 1
            return []
        if of.runs.is_retired(stamp.run_id, now):
            self.outcomes[FrameOutcome.RETIRED.value] += 1
            return []
        of.record_heard(now)
        if doc["type"] in ("info", "model"):
            return self._set_description(of, room, doc, stamp, now)
        return self.announce_event(of, room, doc, now, unix_s)

    def announce_event(
        self, of: Robot, room: Room, doc: dict[str, object], now: float, unix_s: float
    ) -> list[Action]:
        """Number a robot's event and send it to all viewers of the room.

        If that fails, only the event is dropped.
        """
        try:
            event = room.stream.number_event(doc, unix_s)
        except Exception as error:
            self.outcomes[FrameOutcome.FAULT.value] += 1
            return self.end_after_fault(None, error)
        if self.recorder is not None:
            self.recorder.record_event(of, room, event, doc, now)
        return [*self.guard(room, lambda: self.remove_ended(room.send_event(event))), Persist(room.stream)]

    def _set_description(
        self, of: Robot, room: Room, doc: dict[str, object], stamp: Stamp, now: float
    ) -> list[Action]:
        if stamp.run_id != of.runs.current:  # its first KEY will trigger a snapshot, which brings it all
            return []
        try:
            if doc["type"] == "model":
                room.stream.set_model(cast(str, doc["hash"]))
            else:
                room.stream.set_info(cast("dict[str, str]", doc["kv"]))
        except ValueError:
            self.outcomes[FrameOutcome.BAD.value] += 1
            return []
        if self.recorder is not None:
            self.recorder.record_description(of, room, now)
        return [*self.guard(room, room.send_description), Persist(room.stream)]

    def set_token(self, robot: str, present: bool, now: float) -> list[Action]:
        """Note whether the liveliness token of a robot's edge is present."""
        if present:
            found = self.admit_robot(robot)
            if found is None:
                self.outcomes[FrameOutcome.CROWDED.value] += 1
                return []
            found.set_token(now)
            self.plan_question(found)
            if self.recorder is not None:
                self.recorder.record_statuses(found, now)
            return self.persist_views(found) + self.report_statuses(found, now)
        gone = self.robots.get(robot)
        if gone is None:
            return []
        gone.liveness.clear_token(now)
        if self.recorder is not None:
            self.recorder.record_statuses(gone, now)
        return self.persist_views(gone) + self.report_statuses(gone, now)

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

    # ---- from the edges to the viewers -------------------------------------

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

    @staticmethod
    def persist_views(robot: Robot) -> list[Action]:
        """Return one action per view that saves this robot's streams in the store."""
        return [Persist(room.stream) for room in robot.rooms.values()]

    def report_statuses(self, robot: Robot, now: float) -> list[Action]:
        """Send the robot's status to the viewers of each room where it has changed."""
        out: list[Action] = []
        for room in robot.rooms.values():
            if room.viewers:
                out += self.guard(room, partial(self.report_status, robot, room, now))
        return out

    def report_status(self, robot: Robot, room: Room, now: float) -> list[Action]:
        """Send the robot's status to the viewers of one room, if it has changed."""
        if room in self.changed:
            return []  # its frame has not been sent yet: `flush` sends both together
        return (
            room.send_status(robot.compute_status(room, now), now)
            if self.record_status(robot, room, now)
            else []
        )

    def record_status(self, robot: Robot, room: Room, now: float) -> bool:
        """Note the robot's status in a room. Returns True if it has changed, so that the caller must send
        it."""
        status, over_share = robot.compute_status(room, now), bool(robot.share.find_exceeded_limit(now))
        if self.statuses.get(room) == status and room.over_share == over_share:
            return False
        self.statuses[room] = status
        room.set_over_share(over_share)
        return True

    # ---- from the viewers --------------------------------------------------

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
            refused = self.count_refusal(refusal, now)
            return [CloseConnection(viewer, refused.close, refused.reason, refused.retry_s, refused.lane)]
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

    def _answer(self, viewer: Viewer, room: Room, message: ViewerMessage, now: float) -> list[Action]:
        match message:
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

    def measure_load(self, busy: float, now: float) -> list[Action]:
        """Adapt the rates to the load. Call it once a second.

        `busy`: the share of that second, 0 to 1, that the event loop spent computing.
        """
        before = self.load.ceiling_hz
        behind = sum(room.count_behind() for robot in self.robots.values() for room in robot.rooms.values())
        fastest_hz = max((viewer.asked_hz for viewer in self.viewers), default=0.0)
        if not self.load.measure_load(busy, behind, len(self.viewers), fastest_hz, now):
            return []
        reason = "overload" if self.load.ceiling_hz < before else "recovered"
        out: list[Action] = []
        by_rate: dict[float, list[Viewer]] = {}
        for viewer, room in tuple(self.viewers.items()):
            granted = min(viewer.asked_hz, self.load.ceiling_hz)
            if granted == viewer.hz:
                continue
            try:
                room.set_rate(viewer, granted, now)
                if viewer.blocked:
                    out += self.remove_ended(room.send_message(viewer, messages.make_rate(granted, reason)))
                else:
                    by_rate.setdefault(granted, []).append(viewer)
            except Exception as error:
                out += self.end_after_fault(viewer, error)
        out += [Send(messages.make_rate(hz, reason), viewers) for hz, viewers in by_rate.items()]
        for room in set(self.viewers.values()):
            out += self.guard(room, partial(self._plan_only, room))
        return out

    def _plan_only(self, room: Room) -> list[Action]:
        self.plan_flush(room)
        return []

    # ---- time --------------------------------------------------------------

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

    def _close_segments(self, recorder: RecordsPast, now: float) -> list[Action]:
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
        self._status_due = not self._status_due
        for robot in self.robots.values():
            for room in robot.rooms.values():
                if not room.viewers:
                    continue
                out += self.guard(room, partial(self._report_room, robot, room, now))
        alone_s = self.limits.status_alone_s
        self._status_at = now + (alone_s if self._status_due else self.limits.status_s - alone_s)
        return out

    def _report_room(self, robot: Robot, room: Room, now: float) -> list[Action]:
        if not self._status_due:
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

    def plan_flush(self, room: Room) -> None:
        """Schedule the next `flush` of a room, and make `wake_at` earlier if needed."""
        self.flushes.put(room, room.find_wake_at())
        self.wake_at = min(self.wake_at, self.flushes.next_at)

    def plan_question(self, robot: Robot) -> None:
        """Schedule the next request for this robot's snapshots, and make `wake_at` earlier if needed."""
        self.questions.put(robot, robot.ask_at)
        self.wake_at = min(self.wake_at, self.questions.next_at)

    def set_wake(self, at: float) -> None:
        """Set the time of the next `tick`, in seconds of the core's clock."""
        self.wake_at = at

    # ---- boundaries --------------------------------------------------------

    def guard(self, of: Viewer | Room | None, call: Callable[[], list[Action]]) -> list[Action]:
        """Return what `call` returns.

        If it raises, only this viewer, or the viewers of this room, are ended.
        """
        try:
            return call()
        except Exception as error:
            return self.end_after_fault(of, error)

    def end_after_fault(self, of: Viewer | Room | None, error: Exception) -> list[Action]:
        """End the viewer, or all viewers of the room, for which the relay's own code has failed."""
        viewers = [of] if isinstance(of, Viewer) else list(of.viewers) if of is not None else []
        where = "" if of is None else f"{of.robot}/{of.view}"
        out: list[Action] = [Fault(where, error)]
        for viewer in viewers:
            room = self.viewers.get(viewer)
            try:
                self.remove_viewer(viewer)
            except Exception as e:
                out.append(Fault(where, e))
                if room is not None:
                    room.evict(viewer)
            self.count_ending(Close.INTERNAL_ERROR)
            out.append(CloseConnection(viewer, Close.INTERNAL_ERROR, "internal error of the relay", None))
        return out

    def end_viewer(self, viewer: Viewer, close: Close, reason: str, retry_s: float | None) -> list[Action]:
        """Remove a viewer, count the reason, and close its connection."""
        self.remove_viewer(viewer)
        self.count_ending(close)
        return [CloseConnection(viewer, close, reason, retry_s)]

    def count_ending(self, close: int) -> None:
        """Count that a viewer was disconnected or refused, by close code."""
        self.endings[close] += 1

    def count_refusal(self, refusal: Refusal, now: float) -> Refusal:
        """Count a refusal by close code, and whether it names the lane.

        Returns what to send: if many viewers are sent to the lane, a longer time until they retry.
        """
        self.count_ending(refusal.close)
        if refusal.lane is None or refusal.retry_s is None:
            return refusal
        self.sent_to_lane += 1
        return replace(refusal, retry_s=self._retry_pace.choose_retry_s(refusal.retry_s, now))

    def remove_ended(self, actions: list[Action]) -> list[Action]:
        """Remove and count the viewers that these actions close. Returns the actions unchanged."""
        for action in actions:
            if isinstance(action, CloseConnection):
                self.remove_viewer(action.viewer)
                self.count_ending(action.close)
        return actions


SPREAD_S = 6.5  # platforms kill a process 10 s after SIGTERM; closing politely takes up to 2 s more
PER_S = 100.0  # a small number of viewers finishes sooner
STEP_S = 0.1


class Drain:
    """Disconnects viewers gradually when a relay stops, so that they do not all reconnect at once.

    It returns viewers in `order`. The caller shuffles it: viewers that joined together should not return
    together.
    """

    def __init__(self, order: Sequence[Viewer], now: float) -> None:
        self._order = order
        self._began = now
        self._spread_s = min(SPREAD_S, len(order) / PER_S)
        self._gone = 0
        self.wake_at = now

    def take_due(self, now: float) -> Sequence[Viewer]:
        """Return the viewers to close now, and set `wake_at` to when the next ones are due."""
        if now < self.wake_at:
            return ()
        elapsed_s = now + STEP_S - self._began
        upto = len(self._order)
        if elapsed_s < self._spread_s:
            upto = int(upto * elapsed_s / self._spread_s)
        due = self._order[self._gone : upto]
        self._gone = upto
        self.wake_at = float("inf") if upto == len(self._order) else now + STEP_S
        return due
