"""One robot: its runs, its token, its views, and when to request snapshots from its edge."""

from __future__ import annotations

from posecast_wire import Snapshot, Stamp
from posecast_wire.messages import RobotStatus

from posecast_relay.core.limits import Limits
from posecast_relay.core.state.liveness import Liveness
from posecast_relay.core.state.room import Room
from posecast_relay.core.state.runs import Runs
from posecast_relay.core.state.share import Share
from posecast_relay.core.state.stream import FrameOutcome

SETTLE_S = 0.05  # between a token and the first request: the edge's declarations arrive one by one
HEARD_S = 10.0  # an edge without a token may still answer if it was heard this recently
UNANSWERED_S_MAX = 30.0  # between requests to an edge that never answers and sends no frame
REFRESH_S = 10.0  # how often to ask for a watched robot: a model can change without a frame


class Robot:
    """The state of one robot.

    `heard_at`: when its edge was last heard; None for a robot that only viewers have named.
    """

    def __init__(self, name: str, limits: Limits) -> None:
        self.name = name
        self.limits = limits
        self.runs = Runs()
        self.share = Share(limits)
        self.counted = False  # counted as publishing
        self.liveness = Liveness()
        self.rooms: dict[str, Room] = {}
        self.heard_at: float | None = None
        self.lacking = False  # something is missing that only a snapshot brings
        self.ask_at = float("-inf")  # earliest time for the next request
        self._unanswered = 0  # requests since anything arrived
        self.in_conflict = False
        self.followed = False  # it has viewers at another relay
        self.degraded = False  # the relays that hear it do not answer

    def get_room(self, view: str) -> Room:
        """Return the room of a view, created if it is new."""
        room = self.rooms.get(view)
        if room is None:
            room = self.rooms[view] = Room(self.name, view, self.limits)
        return room

    def set_token(self, now: float) -> None:
        """Note that the edge's token has appeared.

        Requests its snapshots, because everything may be new.
        """
        self.heard_at = now
        self.liveness.set_token()
        self.lacking = True
        self._unanswered = 0
        self.ask_at = max(self.ask_at, now + SETTLE_S)

    def record_heard(self, now: float) -> None:
        """Note that its edge was heard, here or at another relay."""
        self.heard_at = now

    def mark_counted(self) -> None:
        """Count this robot as publishing."""
        self.counted = True

    def mark_lacking(self) -> None:
        """Note that something is missing that only a snapshot brings."""
        self.lacking = True

    def set_degraded(self, degraded: bool) -> None:
        """Set whether the relays that hear it can't be reached."""
        self.degraded = degraded

    def set_followed(self, followed: bool) -> None:
        """Set whether it has viewers at another relay."""
        self.followed = followed

    def set_conflict(self, conflict: bool) -> None:
        """Set whether two edges claim it."""
        self.in_conflict = conflict

    def take_frame(
        self, room: Room, payload: bytes, stamp: Stamp, now: float, late_s: float = 0.0
    ) -> FrameOutcome:
        """Take a frame that just arrived. `late_s`: the lateness measured by another relay."""
        stream = room.stream
        header = stream.check_frame(payload)
        if isinstance(header, FrameOutcome):
            return header
        self.heard_at = now
        self._unanswered = 0
        if self.runs.is_retired(stamp.run_id, now):
            return FrameOutcome.RETIRED
        if stamp.run_id != self.runs.current:
            if not header.is_key:
                self.lacking = True
                stream.hold_for_base(payload, stamp.run_id, stamp.elapsed_ns / 1e9, now, late_s)
                return FrameOutcome.NO_BASE
            self._adopt(stamp.run_id, now)
        late_s = max(late_s, self.runs.record_arrival(stamp, now))
        outcome = stream.take_frame(payload, header, stamp.run_id, stamp.elapsed_ns / 1e9, now, late_s)
        if outcome in (FrameOutcome.NO_BASE, FrameOutcome.NO_SCHEMA):
            self.lacking = True
        return outcome

    def take_snapshot(
        self,
        room: Room,
        snapshot: Snapshot,
        stamp: Stamp,
        now: float,
        newest: bytes | None = None,
        waited_s: float | None = None,
    ) -> None:
        """Take a snapshot that came `waited_s` seconds after it was requested (None: from another relay).

        Raises ValueError if it is inconsistent, its run is retired, or another run is sending.
        """
        self.heard_at = now
        self._unanswered = 0
        if self.runs.is_retired(stamp.run_id, now):
            raise ValueError("snapshot: its run is retired")
        if waited_s is not None:
            if not room.stream.awaits_base(stamp.run_id) and not self.runs.may_adopt(stamp.run_id, now):
                raise ValueError("snapshot: its run sends no frames")
            self.runs.record_answer(stamp, waited_s, now)
        room.stream.apply_snapshot(snapshot, stamp.run_id, stamp.elapsed_ns / 1e9, newest)
        if stamp.run_id != self.runs.current:
            self._adopt(stamp.run_id, now)
        self.lacking = False

    def _adopt(self, run_id: int, now: float) -> None:
        self.runs.adopt(run_id, now)
        self.lacking = True  # its info and model may differ even if its schema does not

    def should_ask(self, now: float) -> bool:
        """Whether to request snapshots from its edge now."""
        there = self.liveness.token or (self.heard_at is not None and now - self.heard_at < HEARD_S)
        if now < self.ask_at or not there:
            return False
        return self.lacking or self._is_stale(now) or self.runs.lateness.should_ask(now)

    def record_question(self, now: float) -> None:
        """Note that snapshots were requested.

        An edge that neither answers nor sends is asked less and less often.
        """
        if self.runs.lateness.should_ask(now):
            self.runs.lateness.record_question(now)
        self.ask_at = now + min(self.limits.ask_s * 2 ** max(0, self._unanswered - 2), UNANSWERED_S_MAX)
        self._unanswered = min(self._unanswered + 1, 16)

    def _is_stale(self, now: float) -> bool:
        watched = self.followed or self.has_viewers()
        return watched and self.liveness.token and now >= self.ask_at + REFRESH_S

    def compute_status(self, room: Room | None, now: float) -> RobotStatus:
        """Return the robot's status by the frames of one view. `room` None: that view has no frames yet."""
        if room is None:
            return "silent" if self.liveness.token else "offline"
        stream = room.stream
        return self.liveness.compute_status(stream.live_at, stream.compute_age_s(now), self.limits.silent_s)

    def has_viewers(self) -> bool:
        """Whether any of its views has viewers."""
        return any(room.viewers for room in self.rooms.values())

    def count_viewers(self) -> int:
        """Return how many viewers it has in all views."""
        return sum(len(room.viewers) for room in self.rooms.values())
