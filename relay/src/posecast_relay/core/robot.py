"""Measures how late a run's messages are, although the edge's clock and the relay's have different zeros.

Lateness is (arrival − stamp) minus the smallest such difference of the run. This is right while both clocks
run. A clock that stops (a sleeping laptop, a paused virtual machine) increases every later difference for
good, just as a congested uplink would. Only an answer to a question tells the two apart: it was stamped after
the question was sent, so it can't be later than the time since then.
"""

from __future__ import annotations

from collections import OrderedDict

from posecast_wire import Snapshot, Stamp
from posecast_wire.messages import RobotStatus

from posecast_relay.core.limits import Limits
from posecast_relay.core.room import Room
from posecast_relay.core.stream import FrameOutcome
from posecast_relay.kit import TokenBucket

# Measures how late a run's messages are, although the edge's clock and the relay's have different zeros.
#
# Lateness is (arrival − stamp) minus the smallest such difference of the run. This is right while both
# clocks run. A clock that stops (a sleeping laptop, a paused virtual machine) increases every later
# difference for good, just as a congested uplink would. Only an answer to a question tells the two apart:
# it was stamped after the question was sent, so it can't be later than the time since then.

DRIFT = 1e-4  # two clocks drift apart by up to 100 ppm; ignoring that, lateness would grow all day
DOUBT_S = 0.5  # a message later than the one before by this much: is it late, or did its clock stop?
DOUBT_WAITS_S = (
    1.0,
    2.0,
    4.0,
    8.0,
    16.0,
    32.0,
)  # between questions about it; the last one repeats
DOUBT_ENDS_S = 60.0  # without a question; then the intervals start again


class Lateness:
    """Measures the lateness of one run's messages. `seconds` is the lateness of the newest one."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._least_s = float("inf")  # of arrival − stamp
        self._least_at = 0.0
        self._doubted = False
        self._questions = 0  # since the current doubt began
        self._question_at = float("-inf")  # earliest time for the next question

    def record_arrival(self, stamp_s: float, now: float) -> float:
        """Note a message's arrival and return its lateness in seconds.

        `stamp_s`: when it was made, by the edge's clock.
        """
        offset_s = now - stamp_s
        before_s = self.seconds
        self._raise_least(now)
        self._least_s = min(self._least_s, offset_s)
        self.seconds = offset_s - self._least_s
        self._doubted = self.seconds > DOUBT_S and (self._doubted or self.seconds - before_s > DOUBT_S)
        return self.seconds

    def record_answer(self, stamp_s: float, waited_s: float, now: float) -> None:
        """Note an answer that came `waited_s` seconds after its question. It can't be later than that."""
        self._raise_least(now)
        self._least_s = max(self._least_s, now - stamp_s - waited_s)
        self.record_arrival(stamp_s, now)

    def should_ask(self, now: float) -> bool:
        """Whether to send the edge a question now, to find out if its clock stopped.

        The intervals grow to save uplink bandwidth.
        """
        return self._doubted and now >= self._question_at

    def record_question(self, now: float) -> None:
        """Note that a question was sent. The next one waits longer."""
        if now - self._question_at > DOUBT_ENDS_S:
            self._questions = 0
        self._question_at = now + DOUBT_WAITS_S[min(self._questions, len(DOUBT_WAITS_S) - 1)]
        self._questions += 1

    def _raise_least(self, now: float) -> None:
        self._least_s += DRIFT * max(0.0, now - self._least_at)
        self._least_at = now


REVIVE_S = 1.0  # a frame this long after the token vanished means that the edge is alive


class Liveness:
    """Follows one robot's token.

    `online`: frames arrive; `silent`: the edge is connected but sends no frames; `offline`: the edge is gone.
    """

    def __init__(self) -> None:
        self.token = False
        self._lost_at = float("-inf")

    def set_token(self) -> None:
        """Note that the edge's token has appeared."""
        self.token = True

    def clear_token(self, now: float) -> None:
        """Note that the edge's token is gone: it stopped, crashed, or was disconnected for longer than the
        lease.
        """
        self.token = False
        self._lost_at = now

    def compute_status(self, live_at: float | None, age_s: float | None, silent_s: float) -> RobotStatus:
        """Return the robot's status.

        `live_at`: when the newest live frame arrived; `age_s`: its age, including transit; `silent_s`: the
        age from which a robot counts as silent. All in seconds.
        """
        fresh = age_s is not None and age_s <= silent_s
        if not self.token:
            # two edges with one robot id share a token: the remaining one still sends frames
            revived = fresh and live_at is not None and live_at > self._lost_at + REVIVE_S
            return "online" if revived else "offline"
        return "online" if fresh else "silent"


# The runs of one robot: which run of its edge counts, and how late its messages are.
#
# A run is a random number, so neither its value nor a clock orders runs: the run heard first is the older
# one. A new run becomes current with its first KEY and retires the previous one. So two edges that claim
# one robot do not alternate: the newest wins, and frames of the other count as a conflict. If the newest
# falls silent while the other still sends, the other becomes current again.

RETIRED_MAX = 64  # remembered runs; one forgotten after 64 restarts could return as new
CONFLICT_AFTER_S = 1.0  # earlier frames of a retired run were still in transit, so no conflict
CONFLICT_FOR_S = 3.0  # how long a conflict lasts after its last frame
RETURN_AFTER_S = 3.0  # without a frame the current run has ended: this exceeds a link's lease


class Runs:
    """The current run (0 = none yet), the retired runs, and the current run's lateness."""

    def __init__(self) -> None:
        self.current = 0
        self.adopted = 0  # how often a run of this robot became current
        self.lateness = Lateness()
        self._heard_at = float("-inf")  # the current run's newest frame
        self._retired: OrderedDict[int, float] = OrderedDict()  # run → when it was retired
        self._conflict_until = float("-inf")

    @property
    def lateness_s(self) -> float:
        """Lateness of the newest frame, in seconds."""
        return self.lateness.seconds

    def is_retired(self, run_id: int, now: float) -> bool:
        """Whether to drop messages of this run. If the run continues to send, that is noted as a conflict.

        A run is no longer retired once the run that replaced it has sent no frame for RETURN_AFTER_S.
        """
        retired_at = self._retired.get(run_id)
        if retired_at is None:
            return False
        if now - max(self._heard_at, retired_at) > RETURN_AFTER_S:
            return False
        if now - retired_at > CONFLICT_AFTER_S:
            self._conflict_until = now + CONFLICT_FOR_S
        return True

    def may_adopt(self, run_id: int, now: float) -> bool:
        """Whether an answer alone, without a frame, may make this run current.

        Not while the current run sends, and not if this run was current before: the answer may be older than
        what was already shown of it.
        """
        if self.current in (0, run_id):
            return True
        return run_id not in self._retired and now - self._heard_at > RETURN_AFTER_S

    def adopt(self, run_id: int, now: float) -> None:
        """Make a run current. The caller has seen a KEY of that run."""
        if self.current:
            self._retired[self.current] = now
            if len(self._retired) > RETIRED_MAX:
                self._retired.popitem(last=False)
        self._retired.pop(run_id, None)
        self.current = run_id
        self.adopted += 1
        self._heard_at = now
        self.lateness = Lateness()

    def is_in_conflict(self, now: float) -> bool:
        """Whether another edge currently claims this robot."""
        return now < self._conflict_until

    def record_arrival(self, stamp: Stamp, now: float) -> float:
        """Note a frame of the current run and return its lateness in seconds."""
        self._heard_at = now
        return self.lateness.record_arrival(stamp.elapsed_ns / 1e9, now)

    def record_answer(self, stamp: Stamp, waited_s: float, now: float) -> None:
        """Note an answer that came `waited_s` seconds after its question, if it belongs to the current
        run."""
        if stamp.run_id == self.current:
            self.lateness.record_answer(stamp.elapsed_ns / 1e9, waited_s, now)


# One robot's share of the relay: how much it may send per second, so that it does not crowd out others.
#
# A robot that exceeds its share loses some of its own frames, and its status says so. It is within its share
# again as soon as it sends less.

OVER_FOR_S = 3.0  # after the last dropped message: a flood is one status, not one per frame
HASHED = 2  # a KEY costs twice its bytes: it is hashed and kept


class Share:
    """How much one robot may send. `dropped` counts its messages beyond that."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._messages = TokenBucket(limits.robot_messages_per_s)
        self._bytes = TokenBucket(limits.robot_bytes_per_s, least=HASHED * limits.frame_bytes)
        self._events = TokenBucket(limits.robot_events_per_s, least=limits.robot_events_burst)
        self._snapshot_bytes = TokenBucket(limits.snapshot_bytes_per_s, least=limits.snapshot_bytes_burst)
        self._views: dict[str, TokenBucket] = {}
        self.limit = ""  # the limit that was exceeded last
        self._over_until = float("-inf")
        self.dropped = 0

    def allow_frame(self, view: str, size: int, hashed: bool, now: float) -> bool:
        """Whether a frame of `size` bytes is within the share. If so, counts it."""
        frames = self._views.get(view)
        if frames is None:
            frames = self._views[view] = TokenBucket(self._limits.view_frames_per_s)
        cost = HASHED * size if hashed else size
        if not frames.has(1, now):
            return self._drop(f"{self._limits.view_frames_per_s:g} frames a second in a view", now)
        if not self.allow_message(cost, now):
            return False
        frames.take(1)
        return True

    def allow_message(self, size: float, now: float) -> bool:
        """Whether another message of `size` bytes is within the share. If so, counts it."""
        if not self._messages.has(1, now):
            return self._drop(f"{self._limits.robot_messages_per_s:g} messages a second", now)
        if not self._bytes.has(size, now):
            return self._drop(f"{self._limits.robot_bytes_per_s:,.0f} bytes a second", now)
        self._messages.take(1)
        self._bytes.take(size)
        return True

    def allow_event(self, size: float, now: float) -> bool:
        """Whether an event, info or model of `size` bytes is within the share. If so, counts it."""
        if not self._events.has(1, now):
            return self._drop(f"{self._limits.robot_events_per_s:g} events a second", now)
        if not self.allow_message(size, now):
            return False
        self._events.take(1)
        return True

    def allow_snapshot(self, size: int, now: float) -> bool:
        """Whether a snapshot of `size` bytes is within the share. If so, counts it.

        Snapshots have a limit of their own because parsing them costs more.
        """
        if not self._snapshot_bytes.has(size, now):
            return self._drop(f"{self._limits.snapshot_bytes_per_s:,.0f} bytes of snapshots a second", now)
        self._snapshot_bytes.take(size)
        return True

    def record_lost(self, count: int, reason: str, now: float) -> None:
        """Count messages that were dropped earlier because too many were queued. `reason`: the limit
        exceeded."""
        self.dropped += count
        self.limit = reason
        self._over_until = now + OVER_FOR_S

    def find_exceeded_limit(self, now: float) -> str:
        """Return the limit that the robot currently exceeds, as text; "" if none."""
        return self.limit if now < self._over_until else ""

    def _drop(self, reason: str, now: float) -> bool:
        self.record_lost(1, reason, now)
        return False


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

    def adopt_frame(
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
        outcome = stream.store_frame(payload, header, stamp.run_id, stamp.elapsed_ns / 1e9, now, late_s)
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
