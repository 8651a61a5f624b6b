"""Records what a hub accepts, for viewers who may look back.

A failure here ends one recording and does not affect live data. The open segment is lost and a new take
begins.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

from posecast_relay.core.past.stream_recording import RecordingPorts, StreamRecording
from posecast_relay.core.policy import Audience, Policy
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Event
from posecast_relay.kit import TimerQueue

FAULTS_MAX = 16  # waiting to be reported; any more are only counted

ListLookers = Callable[[Policy, str, str], frozenset[Audience]]


class Recorder:
    """All recordings of one hub. It records nothing until it gets a policy."""

    def __init__(self, ports: RecordingPorts, list_lookers: ListLookers) -> None:
        """`list_lookers`: returns the audiences that may look back on live data, by policy, robot and
        view."""
        self.faults: Counter[str] = Counter()  # by error type
        self._ports = ports
        self._list_lookers = list_lookers
        self._policy: Policy | None = None
        self._recordings: dict[Room, StreamRecording | None] = {}  # None: nobody may look back
        # the audiences that could see the last KEY of a stream that is not being recorded; no entry means all
        self._seen: dict[Room, frozenset[Audience]] = {}
        self._due = TimerQueue[StreamRecording]()
        self._reports: list[tuple[str, Exception]] = []

    @property
    def next_at(self) -> float:
        """When to call `close_due` at the latest, in seconds of the core's clock."""
        return self._due.next_at

    @property
    def count(self) -> int:
        """How many streams are being recorded."""
        return sum(1 for each in list(self._recordings.values()) if each is not None)

    def set_policy(self, policy: Policy, now: float) -> None:
        """Set who may see what. Streams that nobody may look back on are no longer recorded."""
        is_first = self._policy is None
        self._policy = policy
        for room, recording in list(self._recordings.items()):
            try:
                audiences = self._list_lookers(policy, room.robot, room.view)
                if recording is not None and audiences:
                    recording.set_audiences(audiences, now)
                    continue
                del self._recordings[room]
                if not is_first:
                    self._seen[room] = frozenset()
                if recording is not None:
                    recording.drop()
            except Exception as error:
                self._end_after_fault(room, error)

    def record_frame(self, robot: Robot, room: Room, now: float) -> None:
        """Record the newest frame of a stream, which was just accepted, and the robot's status."""
        try:
            recording = self._find(robot, room, room.stream.event_n, now)
            frame, late_s = room.stream.newest, room.stream.compute_age_s(now)
            if recording is not None and frame is not None and late_s is not None:
                recording.take_frame(frame, late_s, now)
                recording.take_word(robot.compute_status(room, now), now)
                self._due.put(recording, recording.due_at)
        except Exception as error:
            self._end_after_fault(room, error)

    def record_event(
        self, robot: Robot, room: Room, event: Event, doc: dict[str, object], now: float
    ) -> None:
        """Record an event that was just numbered. `doc`: its content."""
        try:
            recording = self._find(robot, room, event.n - 1, now)
            if recording is not None:
                recording.take_event(event, doc, now)
                self._due.put(recording, recording.due_at)
        except Exception as error:
            self._end_after_fault(room, error)

    def record_description(self, robot: Robot, room: Room, now: float) -> None:
        """Record the info and model of a stream if they have changed."""
        try:
            recording = self._find(robot, room, room.stream.event_n, now)
            if recording is not None:
                recording.take_description(now)
                self._due.put(recording, recording.due_at)
        except Exception as error:
            self._end_after_fault(room, error)

    def record_statuses(self, robot: Robot, now: float) -> None:
        """Record the robot's status, if it has changed, in those of its streams that are being recorded."""
        for room in robot.rooms.values():
            try:
                recording = self._recordings.get(room)
                if recording is not None:
                    recording.take_word(robot.compute_status(room, now), now)
            except Exception as error:
                self._end_after_fault(room, error)

    def close_due(self, now: float) -> None:
        """Close the segments that are long enough."""
        for recording in self._due.take_due(now):
            try:
                if recording.due_at <= now:
                    recording.close(now)
                self._due.put(recording, recording.due_at)
            except Exception as error:
                self._end_after_fault(recording.room, error)

    def close_all(self, now: float) -> None:
        """Close all open segments, because the process is stopping."""
        for room, recording in list(self._recordings.items()):
            try:
                if recording is not None:
                    recording.close(now)
            except Exception as error:
                self._end_after_fault(room, error)

    def forget_robot(self, robot: Robot, now: float) -> None:
        """Close a robot's open segments, because the hub forgets the robot."""
        for room in robot.rooms.values():
            try:
                recording = self._recordings.pop(room, None)
                self._seen.pop(room, None)
                if recording is not None:
                    recording.close(now)
            except Exception as error:
                self._end_after_fault(room, error)

    def take_faults(self) -> list[tuple[str, Exception]]:
        """Return the failures since the last call, each with its place."""
        reports, self._reports = self._reports, []
        return reports

    def _find(self, robot: Robot, room: Room, event_n: int, now: float) -> StreamRecording | None:
        """Return a stream's recording, started if it is new; None if nobody may look back."""
        if room in self._recordings:
            return self._recordings[room]
        audiences = (
            frozenset[Audience]()
            if self._policy is None
            else self._list_lookers(self._policy, room.robot, room.view)
        )
        if not audiences:
            self._recordings[room] = None
            return None
        word = robot.compute_status(room, now)
        seen = self._seen.get(room, audiences)
        recording = StreamRecording(room, self._ports, audiences, word, event_n, now, seen)
        self._recordings[room] = recording
        self._seen.pop(room, None)
        return recording

    def _end_after_fault(self, room: Room, error: Exception) -> None:
        recording = self._recordings.pop(room, None)
        if recording is not None:
            self._seen[room] = recording.seen
            recording.drop()
        self.faults[type(error).__name__] += 1
        if len(self._reports) < FAULTS_MAX:
            self._reports.append((f"{room.robot}/{room.view}: the past", error))
