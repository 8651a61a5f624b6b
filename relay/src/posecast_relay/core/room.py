"""One stream and its viewers, and the rule for sending them frames.

When a viewer is due by its rate and its socket has drained, it gets any schema and KEY it lacks, then the
newest frame, in one write. Joining, rates and slow viewers all follow from this rule.
"""

from __future__ import annotations

from collections.abc import Iterable

from posecast_wire import Close
from posecast_wire.messages import RobotStatus

from posecast_relay.core import messages
from posecast_relay.core.actions import Action, CloseConnection, Fault, Send
from posecast_relay.core.limits import Limits
from posecast_relay.core.stream import Event, StoredFrame, Stream
from posecast_relay.core.viewer import Viewer
from posecast_relay.kit import NEVER

WHOLE = 0.05  # a ratio of rates this close to a whole number, relatively, counts as whole
BURST = 0.5  # frames that were delayed and arrive together go out at least this part of a period apart


class RateTimer:
    """Decides which frames of one stream are due at one rate.

    The edge's clock (the stamp on each frame) decides, not the arrival time. So network jitter does not turn
    every third frame into every second or fourth. If the source's rate is close to a whole multiple of the
    viewer's, exactly every n-th frame is due. Otherwise due times advance by the period, so the mean rate is
    right.
    """

    def __init__(self, hz: float) -> None:
        self.period_s = 1.0 / hz
        self.sent_at = float("-inf")  # by the relay's clock
        self._due_s = float("-inf")  # by the edge's clock
        self._run_id = 0

    def is_due(self, run_id: int, stamp_s: float, interval_s: float, now: float) -> bool:
        """Whether a frame stamped `stamp_s` that arrives at `now` is due at this rate."""
        if run_id != self._run_id:
            return True
        ratio = self.period_s / interval_s if interval_s else 1.0
        if ratio <= 1.0 + WHOLE:
            return True
        return stamp_s >= self._due_s - interval_s / 2 and now >= self.sent_at + BURST * self.period_s

    def record_sent(self, run_id: int, stamp_s: float, interval_s: float, now: float) -> None:
        """Note that this frame was sent."""
        ratio = self.period_s / interval_s if interval_s else 1.0
        counted = run_id == self._run_id and abs(stamp_s - self._due_s) <= self.period_s
        whole = abs(ratio - round(ratio)) <= WHOLE * ratio
        self._due_s = (self._due_s if counted and not whole else stamp_s) + self.period_s
        self._run_id = run_id
        self.sent_at = now


class RateGroup:
    """The viewers of a room with the same rate."""

    def __init__(self, hz: float) -> None:
        self.pace = RateTimer(hz)
        self.viewers: dict[Viewer, None] = {}  # in the order in which they joined
        self.behind: set[Viewer] = set()  # viewers that could not take the frame they were due
        self.frame: StoredFrame | None = None  # the last one sent
        self.flush_at = NEVER  # when to send the newest frame, because one is waiting until the group is due
        self.retry_at = NEVER  # when to retry those behind, if no newer frame has arrived


class Room:
    """A stream with its viewers, grouped by rate, and everything sent to them."""

    def __init__(self, robot: str, view: str, limits: Limits) -> None:
        self.robot = robot
        self.view = view
        self.stream = Stream(robot, view, limits)
        self.limits = limits
        self.viewers: dict[Viewer, None] = {}
        self.groups: dict[float, RateGroup] = {}
        self.delivered = 0  # frames times viewers
        self.skipped = 0  # frames times viewers that were due but could not take them
        self.degraded = False  # this relay can't hear the robot now, through its own problem
        self.over_share = False  # the robot sends more than its share of this relay
        self._owed: RobotStatus | None = None  # the status to send with the next frame
        self._sent_to: set[RateGroup] = set()  # the groups that have it

    # ---- coming, going, changing rate -------------------------------------

    def join(self, viewer: Viewer, status: RobotStatus, now: float, unix_s: float) -> Send:
        """Add a viewer and return all it needs in one write.

        The frame comes before the events, because they can be long.
        """
        stream = self.stream
        self.viewers[viewer] = None
        parts = [
            messages.make_hello(
                unix_s,
                robot=stream.robot,
                view=stream.view,
                hz=viewer.hz,
                model=stream.model,
                limits=self.limits,
                max_hz=viewer.max_hz,
                delay_s=viewer.grant.delay_s if viewer.grant else 0.0,
            ),
            self._make_status(status, now),
        ]
        if stream.schema is not None:
            parts.append(
                stream.make_description(viewer.schema_n, with_model=False)
            )  # hello already names the model
        viewer.record_description(stream.version, stream.schema_n)
        group = self._enter(viewer)
        if group is not None and stream.newest is not None:
            parts.append(self._collect_lacking(viewer, stream.newest))
            self._record_given(viewer, stream.newest)
            if group.frame is None:
                self._record_sent(group, stream.newest, now)
        unasked = sum(map(len, parts))
        for event in stream.events:
            if viewer.speaks and unasked >= self.limits.ping_bytes:  # lets a slow reader prove that it reads
                parts.append(messages.PING)
                unasked = 0
            parts.append(event.packed)
            unasked += len(event.packed)
        data = b"".join(parts)
        viewer.begin_join_burst(len(data), now)
        return Send(data, (viewer,))

    def leave(self, viewer: Viewer) -> None:
        """Remove a viewer. Does nothing if it is already gone."""
        self.viewers.pop(viewer, None)
        self._exit(viewer)

    def evict(self, viewer: Viewer) -> None:
        """Remove a viewer from every group, after `leave` has failed."""
        self.viewers.pop(viewer, None)
        for group in self.groups.values():
            group.viewers.pop(viewer, None)
            group.behind.discard(viewer)

    def set_rate(self, viewer: Viewer, hz: float, now: float) -> None:
        """Change a viewer's rate.

        A frame that it lacks comes with the next one, or within a period.
        """
        self._exit(viewer)
        viewer.set_rate(hz)
        group = self._enter(viewer)
        if group is not None:
            self._sent_to.discard(group)
        if group is not None and viewer.frame is not self.stream.newest:
            group.behind.add(viewer)
            group.retry_at = min(group.retry_at, now + group.pace.period_s)

    def _enter(self, viewer: Viewer) -> RateGroup | None:
        if viewer.hz <= 0:
            return None
        group = self.groups.get(viewer.hz)
        if group is None:
            group = self.groups[viewer.hz] = RateGroup(viewer.hz)
        group.viewers[viewer] = None
        return group

    def _exit(self, viewer: Viewer) -> None:
        group = self.groups.get(viewer.hz)
        if group is None:
            return
        group.viewers.pop(viewer, None)
        group.behind.discard(viewer)
        if not group.viewers:
            del self.groups[viewer.hz]
            self._sent_to.discard(group)

    # ---- the robot's status ----------------------------------------------

    def set_degraded(self, degraded: bool) -> None:
        """Set whether this relay can't hear the robot now. The next status reports it."""
        self.degraded = degraded

    def set_over_share(self, over_share: bool) -> None:
        """Set whether the robot sends more than its share. The next status reports it."""
        self.over_share = over_share

    # ---- frames -----------------------------------------------------------

    def offer(self, now: float) -> list[Action]:
        """Send the newest frame to every group that is due. Called after the stream has changed."""
        out: list[Action] = []
        newest = self.stream.newest
        interval_s = self.stream.cadence.interval_s
        for group in tuple(self.groups.values()):
            if newest is None or group.frame is newest:
                continue
            try:
                if group.pace.is_due(newest.run_id, newest.stamp_s, interval_s, now):
                    self._send_frame(group, group.viewers, newest, now, out)
                elif group.flush_at == NEVER:
                    group.flush_at = now + group.pace.period_s
            except Exception as error:
                out += self._end_after_fault(group.viewers, error)
        return out

    def flush(self, now: float) -> list[Action]:
        """Send the newest frame to the viewers whose period has passed."""
        out: list[Action] = []
        newest = self.stream.newest
        for group in tuple(self.groups.values()):
            try:
                if newest is not None and group.frame is not newest:
                    if now >= group.flush_at:
                        self._send_frame(group, group.viewers, newest, now, out)
                    elif now >= group.retry_at:
                        group.retry_at = NEVER  # the waiting frame will also go to those behind
                elif newest is not None and now >= group.retry_at:
                    self._send_frame(group, tuple(group.behind), newest, now, out)
            except Exception as error:
                out += self._end_after_fault(group.viewers, error)
        return out

    def _end_after_fault(self, viewers: Iterable[Viewer], error: Exception) -> list[Action]:
        """End the viewers for which the relay's own code has failed; the others in this room stay."""
        out: list[Action] = [Fault(f"{self.robot}/{self.view}", error)]
        for viewer in tuple(viewers):
            self.leave(viewer)
            out.append(CloseConnection(viewer, Close.INTERNAL_ERROR, "internal error of the relay", None))
        return out

    def find_wake_at(self) -> float:
        """Return when `flush` is next needed; NEVER if it is not."""
        return min((min(g.flush_at, g.retry_at) for g in self.groups.values()), default=NEVER)

    def count_behind(self) -> int:
        """Return how many viewers could not take their last frame."""
        return sum(len(group.behind) for group in self.groups.values())

    def _send_frame(
        self, group: RateGroup, viewers: Iterable[Viewer], frame: StoredFrame, now: float, out: list[Action]
    ) -> None:
        """Send a frame to viewers that are due, in one pass. Nearly all hold the KEY and share the frame's
        bytes."""
        ready: list[Viewer] = []
        lacking: list[Viewer] = []
        behind: set[Viewer] = set()
        status = b""
        if self._owed is not None and group not in self._sent_to:
            status = self._make_status(self._owed, now)
            self._sent_to.add(group)
        failed = Viewer.share_frame(
            iter(viewers), frame, self.stream.version, now, ready=ready, lacking=lacking, behind=behind
        )
        for viewer in lacking:
            try:
                out.append(Send(status + self._collect_lacking(viewer, frame), (viewer,)))
                self._record_given(viewer, frame)
            except Exception as e:
                failed.append((viewer, e))
        if ready:
            self.delivered += len(ready)
            out.append(Send(status + frame.packed, ready))
        if group.frame is not frame:
            self.skipped += len(behind)  # once per frame, however often it is retried
            self._record_sent(group, frame, now)
        group.behind = behind
        group.flush_at = NEVER
        group.retry_at = now + group.pace.period_s if behind else NEVER
        for viewer, error in failed:
            out += self._end_after_fault((viewer,), error)

    def _record_sent(self, group: RateGroup, frame: StoredFrame, now: float) -> None:
        group.frame = frame
        group.pace.record_sent(frame.run_id, frame.stamp_s, self.stream.cadence.interval_s, now)

    def _collect_lacking(self, viewer: Viewer, frame: StoredFrame) -> bytes:
        """Return `frame`, preceded by what this viewer needs to decode it."""
        parts: list[bytes] = []
        if viewer.version != self.stream.version:
            parts.append(self.stream.make_description(viewer.schema_n))
        if frame.key is not None and viewer.key is not frame.key:
            parts.append(frame.key.packed)
        parts.append(frame.packed)
        return b"".join(parts)

    def _record_given(self, viewer: Viewer, frame: StoredFrame) -> None:
        """Note that a viewer was sent `frame` and what it needs to decode it."""
        viewer.record_description(self.stream.version, self.stream.schema_n)
        viewer.record_frame(frame)
        self.delivered += 1

    # ---- everything else --------------------------------------------------

    def send_description(self) -> list[Action]:
        """Send a changed schema, info or model to the viewers that can take it now, to others with their next
        frame.
        """
        stream = self.stream
        ready: dict[int, list[Viewer]] = {}  # by the schema that they hold
        for viewer in self.viewers:
            if viewer.version != stream.version and not viewer.blocked:
                ready.setdefault(viewer.schema_n, []).append(viewer)
                viewer.record_description(stream.version, stream.schema_n)
        return [Send(stream.make_description(held), viewers) for held, viewers in ready.items()]

    def send_event(self, event: Event) -> list[Action]:
        """Send an event to all viewers, at once or through their reliable queue."""
        ready: list[Viewer] = []
        out: list[Action] = []
        for viewer in tuple(self.viewers):
            if viewer.blocked:
                out += self._enqueue(viewer, event.packed)
            else:
                ready.append(viewer)
        return [*out, Send(event.packed, ready)] if ready else out

    def send_message(self, viewer: Viewer, data: bytes) -> list[Action]:
        """Send one viewer a message that must arrive, at once or through its reliable queue."""
        return self._enqueue(viewer, data) if viewer.blocked else [Send(data, (viewer,))]

    def _enqueue(self, viewer: Viewer, data: bytes) -> list[Action]:
        if viewer.enqueue(data):
            return []
        self.leave(viewer)
        return [CloseConnection(viewer, Close.EVENTS_FULL, "too slow to receive events", None)]

    def send_waiting(self, viewer: Viewer) -> list[Action]:
        """Send what is in a viewer's reliable queue if it can take data again."""
        data = viewer.release()
        if data is None:
            return []
        if viewer.version != self.stream.version and viewer.hz <= 0:
            data += self.stream.make_description(viewer.schema_n)
            viewer.record_description(self.stream.version, self.stream.schema_n)
        return [Send(data, (viewer,))] if data else []

    def send_status(self, status: RobotStatus, now: float) -> list[Action]:
        """Send the status at once to every viewer that can take it."""
        self._owed = None
        ready = [v for v in self.viewers if not v.blocked]
        return [Send(self._make_status(status, now), ready)] if ready else []

    def defer_status(self, status: RobotStatus) -> None:
        """Send the status with each group's next frame, in the same write."""
        self._owed = status
        self._sent_to.clear()

    def send_deferred_status(self, now: float) -> list[Action]:
        """Send the deferred status alone to the viewers that have not got it with a frame."""
        status, self._owed = self._owed, None
        if status is None:
            return []
        ready = [v for v in self.viewers if not v.blocked and self.groups.get(v.hz) not in self._sent_to]
        return [Send(self._make_status(status, now), ready)] if ready else []

    def _make_status(self, status: RobotStatus, now: float) -> bytes:
        age_s = self.stream.compute_age_s(now)
        newest = self.stream.newest
        age_ms = None if age_s is None else max(0, round(age_s * 1000))
        seq = newest.seq if newest else None
        return messages.make_status(status, age_ms, seq, now, self.degraded, self.over_share)
