"""Takes what edges send: frames, snapshots, events and tokens. Ignored messages are counted by reason."""

from __future__ import annotations

from collections import Counter
from typing import cast

from posecast_wire import Snapshot, Stamp
from posecast_wire.frame import TAG_KEY

from posecast_relay.core.actions import Action, Persist
from posecast_relay.core.edge_messages import read_edge_message
from posecast_relay.core.limits import Limits
from posecast_relay.core.past.recorder import Recorder
from posecast_relay.core.roster import Headcount, Roster
from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.room import Room
from posecast_relay.core.state.stream import FrameOutcome
from posecast_relay.kit import Histogram


class Uplink(Roster):
    """The half of the hub that handles edges. The other half, `Hub`, handles viewers."""

    def __init__(
        self, limits: Limits, headcount: Headcount | None = None, recorder: Recorder | None = None
    ) -> None:
        super().__init__(limits, headcount, recorder)
        self.outcomes: Counter[str] = Counter()  # of messages from edges
        self.lateness = Histogram()  # of frames from edges, on arrival

    def take_edge_frame(
        self, robot: str, view: str, payload: bytes, stamp: Stamp, now: float
    ) -> FrameOutcome:
        """Take a frame directly from an edge. It is dropped if its robot exceeds its share."""
        found = self.admit_view(robot, view)
        hashed = len(payload) > 0 and payload[0] == TAG_KEY
        if found is not None and not found[0].share.allow_frame(view, len(payload), hashed, now):
            self.outcomes[FrameOutcome.OVER_SHARE.value] += 1
            return FrameOutcome.OVER_SHARE
        return self.take_frame(robot, view, payload, stamp, now)

    def take_frame(
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
            outcome = of.take_frame(room, payload, stamp, now, late_s)
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
