"""Feeds a gateway's hub with data from the relays that hear the edges. Its events are already numbered.

It decides two things. *Which writer is right*: messages about a robot carry the generation of the process
that wrote them. The highest generation says which run is current, even if this hub would judge the frames
differently. *What is a sign of life*: a frame that was read from the store, or took long to arrive, is only
a picture. It becomes a sign of life only through an age reported by the relay that hears the robot. What
the hub already held when the connection was lost never does.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from posecast_wire import Snapshot, Stamp

from posecast_relay.core.actions import Action, RequestSnapshot
from posecast_relay.core.hub import Hub
from posecast_relay.core.policy import PUBLIC
from posecast_relay.core.robot import Robot
from posecast_relay.core.stream import FrameOutcome, StoredFrame, Stream


class StreamUpdate(NamedTuple):
    """A stream has changed.

    `version` identifies schema, info and model: a new value means that they changed. `numbering` identifies
    the count of events: a new value means that it restarted at 1.
    """

    view: str
    generation: int  # of the writer: a higher one takes over
    run_id: int
    version: str
    numbering: str
    late_s: float  # the age of the newest frame when this was sent
    frames: tuple[
        tuple[int, bytes], ...
    ]  # ns since the run began by the edge's clock, and the frame; a KEY comes first
    events: tuple[str, ...]  # numbered, as sent to viewers
    sent_s: float | None = None


class Presence(NamedTuple):
    """Whether a robot's edge is present, and the age of its newest frame in seconds, by view.

    An age is None before any live frame. `newest`: the run and seq of that frame.
    """

    token: bool
    ages_s: Mapping[str, float | None]
    newest: Mapping[str, tuple[int, int]] = {}
    sent_s: float | None = None


class StreamState(NamedTuple):
    """The complete stored state of a stream, of any age."""

    generation: int
    run_id: int
    stamp_ns: int  # of the newest frame, since the run began by the edge's clock
    version: str
    numbering: str
    snapshot: Snapshot
    newest: bytes
    events: tuple[str, ...]
    is_heard: bool = True  # frames of this run have arrived, not only an answer


ASK_S = 1.0  # between two requests for one robot's state
AGAIN_S = 0.2  # if the answer was empty: it may have been read a moment too early


class ReplicaSource:
    """What other relays have sent about one robot. Times are seconds of this process's clock."""

    def __init__(self) -> None:
        self.generation = 0  # of the newest process that was heard from
        self.versions: dict[str, str] = {}  # by view: identifies the schema, info and model that are here
        self.told_at: float | None = None  # when its presence was last received
        self.sent_s: float | None = None  # by the store's clock, which can jump at any time
        self.asked_at = float("-inf")  # when the stored state was requested
        self.was_fed = False  # whether the answer brought any
        self.before: dict[str, StoredFrame | None] | None = (
            None  # by view: what was here when the connection was lost
        )

    def record_presence(self, at: float | None) -> None:
        """Note when its presence was last received; None: the sending relay no longer knows the robot."""
        self.told_at = at


class ReplicaFeed:
    """Passes what other relays send to a hub. Frames and snapshots are handled like those of an edge.

    `under_way_s`: how many seconds ago a message was sent; None if unknown.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self.sources: dict[str, ReplicaSource] = {}

    def get_source(self, robot: str) -> ReplicaSource:
        """Return the source of this robot, created if it is new."""
        return self.sources.setdefault(robot, ReplicaSource())

    # ---- what is sent -----------------------------------------------------

    def take_update(
        self, robot: str, update: StreamUpdate, under_way_s: float | None, now: float
    ) -> list[Action]:
        """Apply the changes of a stream. Raises ValueError if an event in it is invalid."""
        hub, source = self._hub, self.get_source(robot)
        if update.generation < source.generation:
            hub.outcomes[FrameOutcome.RETIRED.value] += 1
            return self.request_state(robot, now)  # the stored state shows whether the store has lost count
        found = hub.admit_view(robot, update.view)
        if found is None:
            hub.outcomes[FrameOutcome.CROWDED.value] += 1
            return []
        of, room = found
        if update.frames:
            adopt_run(of, update.run_id, now)
        source.generation = update.generation
        late_s = update.late_s + (under_way_s or 0.0)
        for ns, payload in update.frames:
            stamp = Stamp(update.run_id, ns)
            # a KEY can be older than the newest frame
            age_s = late_s + max(0, update.frames[-1][0] - ns) / 1e9
            if under_way_s is not None:  # then the lateness is absolute, not relative to the smallest seen
                of.runs.record_answer(stamp, age_s, now)
            hub.receive_frame(robot, update.view, payload, stamp, now, age_s)
        out: list[Action] = []
        if source.before is not None and room.stream.newest is not source.before.get(update.view):
            source.before = None
            of.set_degraded(False)
            room.set_degraded(False)
            room.defer_status(of.compute_status(room, now))  # sent with the frame that shows it, in one write
            out = self.set_degraded(False, now, robot)
        for text in update.events:
            out += self.take_event(robot, update.view, update.numbering, text)
        if of.lacking or source.versions.get(update.view) != update.version:
            out += self.request_state(robot, now)
        return out

    def set_generation(self, robot: str, generation: int, asked: int) -> None:
        """Note the generation of the newest state that the store holds.

        `asked`: the source's generation when the state was requested. A generation lower than the source's
        current one was overtaken by a message on its way here. One lower than `asked` means that the store
        has lost count, so the stored state wins.
        """
        source = self.get_source(robot)
        if generation > source.generation or generation < asked:
            source.generation = generation

    def take_state(self, robot: str, view: str, stored: StreamState, now: float) -> list[Action]:
        """Apply the complete stored state of a stream. Raises ValueError if it can't be used."""
        hub, source = self._hub, self.get_source(robot)
        found = hub.admit_view(robot, view)
        if found is None:
            hub.outcomes[FrameOutcome.CROWDED.value] += 1
            return []
        of, room = found
        if stored.run_id != of.runs.current:
            if stored.generation != source.generation:  # no process writes this view any more
                return []
            if not stored.is_heard and room.stream.newest is not None:  # what is here is at least as new
                return []
            adopt_run(of, stored.run_id, now)
        stamp = Stamp(stored.run_id, stored.stamp_ns)
        hub.take_snapshot(robot, view, stored.snapshot, stamp, now, stored.newest)
        source.versions[view] = stored.version
        source.was_fed = True
        out: list[Action] = []
        for text in stored.events:
            out += self.take_event(robot, view, stored.numbering, text)
        return out

    def take_presence(
        self, robot: str, presence: Presence, under_way_s: float | None, now: float
    ) -> list[Action]:
        """Apply the presence of a robot: its token and the ages of its frames."""
        found = self._hub.admit_robot(robot)
        if found is None:
            return []
        source, late_s = self.get_source(robot), under_way_s or 0.0
        if (
            presence.sent_s is not None and presence.sent_s == source.sent_s
        ):  # received before, so its age is measured from then
            return []
        source.sent_s = presence.sent_s
        found.record_heard(now)
        source.told_at = now - late_s
        for view, age_s in presence.ages_s.items():
            room = found.rooms.get(view)
            if room is not None and age_s is not None and under_way_s is not None:
                _confirm_age(room.stream, presence.newest.get(view), age_s + late_s, now)
        if found.liveness.token != presence.token:
            out = self._hub.set_token(robot, presence.token, now)
        else:
            out = self._hub.report_statuses(found, now)
        if source.before is None or not self._awaits_frame(found, source, presence, late_s):
            source.before = None
            out += self.set_degraded(False, now, robot)
        return out

    def clear_token(self, robot: str, now: float) -> list[Action]:
        """Note that no relay hears this robot any more."""
        source = self.get_source(robot)
        source.before = None
        return self._hub.set_token(robot, False, now) + self.set_degraded(False, now, robot)

    def take_event(self, robot: str, view: str, numbering: str, text: str) -> list[Action]:
        """Take an event that another relay has numbered. An event received before is ignored.

        Raises ValueError if it is invalid.
        """
        found = self._hub.admit_view(robot, view)
        if found is None:
            return []
        _, room = found
        event = room.stream.append_numbered(numbering, text)
        return [] if event is None else self._hub.remove_ended(room.send_event(event))

    # ---- what is lacking ----------------------------------------------------

    def request_state(self, robot: str, now: float) -> list[Action]:
        """Request the stored state of a robot because something is missing. Requests are rate-limited."""
        of, source = self._hub.robots.get(robot), self.sources.get(robot)
        if of is None or source is None:
            return []
        of.mark_lacking()
        if now - source.asked_at < (ASK_S if source.was_fed else AGAIN_S):
            self._hub.plan_question(of)
            return []
        source.asked_at, source.was_fed = now, False
        return [RequestSnapshot(robot, (*{PUBLIC, *of.rooms},))]

    def mark_disconnected(self, now: float) -> list[Action]:
        """Note that the connection to the relays that hear robots is lost. All viewers are notified."""
        for name, source in self.sources.items():
            of = self._hub.robots.get(name)
            if of is not None:
                source.before = {view: room.stream.newest for view, room in of.rooms.items()}
        return self.set_degraded(True, now)

    def mark_connected(self, now: float) -> list[Action]:
        """Note that the connection is back. Each robot stays degraded until new data about it arrives."""
        for name, source in self.sources.items():
            of = self._hub.robots.get(name)
            source.told_at = now  # judge it again, but give it time to be heard
            if of is not None and source.before is not None:
                of.set_degraded(True)
        return self.set_degraded(False, now)

    def _awaits_frame(self, of: Robot, source: ReplicaSource, presence: Presence, late_s: float) -> bool:
        """Whether frames are arriving, so that one newer than the frame here will come in a moment."""
        before = source.before or {}
        limit_s = self._hub.limits.silent_s
        ages_s = [presence.ages_s.get(view) for view in of.rooms]
        come = any(age_s is not None and age_s + late_s <= limit_s for age_s in ages_s)
        return come and all(room.stream.newest is before.get(view) for view, room in of.rooms.items())

    def set_degraded(self, degraded: bool, now: float, robot: str | None = None) -> list[Action]:
        """Set whether this relay can't hear one robot, or all robots (`robot` None). Viewers are notified."""
        hub = self._hub
        if robot is None:
            hub.set_degraded(degraded)
            concerned = list(hub.robots.values())
        else:
            concerned = [hub.robots[robot]] if robot in hub.robots else []
            for of in concerned:
                of.set_degraded(degraded)
        out: list[Action] = []
        for of in concerned:
            for room in of.rooms.values():
                if room.degraded != (hub.degraded or of.degraded):
                    room.set_degraded(not room.degraded)
                    out += room.send_status(of.compute_status(room, now), now)
        return out

    def forget_robot(self, robot: str) -> None:
        """Forget a robot that is no longer subscribed to, unless it has viewers."""
        self.sources.pop(robot, None)
        of = self._hub.robots.get(robot)
        if of is not None and not of.has_viewers():
            self._hub.drop_robot(of)


def adopt_run(of: Robot, run_id: int, now: float) -> None:
    """Make this run the robot's current one, as the relay that hears the robot did."""
    if of.runs.current != run_id:
        of.runs.adopt(run_id, now)
        of.mark_lacking()  # its info and model may differ


def _confirm_age(stream: Stream, named: tuple[int, int] | None, age_s: float, now: float) -> None:
    """Set the age of the newest frame: the frame of this run and seq has this age, and ours is no older."""
    newest = stream.newest
    if newest is None or named is None or newest.run_id != named[0] or newest.seq < named[1]:
        return
    known_s = stream.compute_age_s(now)
    if known_s is None or age_s < known_s:
        stream.set_age(age_s, now)
