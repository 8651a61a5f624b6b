"""Records what a hub accepts, for viewers who may look back: turns what each stream accepts into consecutive
segments.

A failure here ends one recording and does not affect live data. The open segment is lost and a new take
begins.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from posecast_wire import Schema, parse_header
from posecast_wire.messages import COUNT_MAX, RobotStatus
from posecast_wire.segment import SegmentStart, SegmentWriter
from posecast_wire.segment.records import OPEN_FAULTS_MAX

from posecast_relay.core.policy import Audience, Policy
from posecast_relay.core.robot import Robot
from posecast_relay.core.room import Room
from posecast_relay.core.stream import SEQS, Event, StoredFrame
from posecast_relay.kit import NEVER, TimerQueue
from posecast_relay.past.segment import KeptSegment, PastEvent, PastWord, SegmentName


class OpenFaults:
    """Follows the events of one stream. Beyond a hundred open faults it forgets the oldest."""

    def __init__(self, events: Iterable[Event] = ()) -> None:
        """`events`: earlier events, oldest first."""
        self._texts: dict[tuple[object, object], str] = {}  # by source and text
        for event in events:
            self.record_event(json.loads(event.text), event.text)

    def record_event(self, doc: Mapping[str, object], text: str) -> None:
        """Record an event. `text`: its JSON, as every viewer got it."""
        key = doc.get("source"), doc.get("text")
        self._texts.pop(key, None)
        if doc.get("state") == "on":
            self._texts[key] = text
            if len(self._texts) > OPEN_FAULTS_MAX:
                del self._texts[next(iter(self._texts))]

    def list_texts(self) -> tuple[str, ...]:
        """Return the events that began the open faults, oldest first."""
        return tuple(self._texts.values())


KEY_US = 1_000_000  # the first KEY after this time ends the segment
LENGTH_S = 6.0  # it ends after this time in any case
RECORD_BYTES = 24  # a record's overhead, at most


class OpenSegment:
    """One segment until it is closed. Times are unix µs of its take's clock and never go back.

    `began_at`: seconds of the core's clock; `schema`: the one whose hash is `start.schema`.
    """

    def __init__(self, start: SegmentStart, at_us: int, began_at: float, schema: Schema | None) -> None:
        self.due_at = began_at + LENGTH_S
        self.schema = schema
        self._from_us = 1000 * start.from_ms
        self._began_us = at_us
        self._writer = SegmentWriter(start)
        self._key: StoredFrame | None = None  # the segment's newest KEY
        self._first_seq = 0
        self._events: list[PastEvent] = []
        self._words = [PastWord(start.from_ms, start.word)]
        self._faults = 0

    @property
    def frames(self) -> int:
        """How many frames it holds, not counting copies."""
        return self._writer.frames

    def takes_frame(self, frame: StoredFrame, at_us: int) -> bool:
        """Whether this frame continues the segment; otherwise it begins the next one."""
        size = len(frame.payload)
        if frame.is_key:
            if at_us - self._began_us >= KEY_US:
                return False
        elif self._writer.frames:
            if frame.key is not self._key:
                return False  # its KEY came with a snapshot
        elif frame.key is not None:
            size += RECORD_BYTES + len(frame.key.payload)
        return self._writer.has_room(size)

    def has_room(self, payload_bytes: int) -> bool:
        """Whether a record with this many bytes of content fits."""
        return self._writer.has_room(payload_bytes)

    def append_frame(self, frame: StoredFrame, last_seq: int | None, at_us: int, late_s: float) -> None:
        """Append a frame for which `takes_frame` is true.

        `last_seq`: of the previous frame in this take; `late_s`: its lateness in seconds.
        """
        writer, at_us = self._writer, at_us - self._from_us
        if not writer.frames:
            self._first_seq = frame.seq
            if last_seq is not None and (missing := (frame.seq - last_seq - 1) % SEQS):
                writer.set_missing(missing)
            if frame.key is not None:
                self._key = frame.key
                writer.append_copy(frame.key.payload, at_us)
        writer.append_frame(frame.payload, at_us, min(max(0, round(late_s * 1e6)), COUNT_MAX))
        if frame.is_key:
            self._key = frame

    def append_event(self, text: str, at_us: int, is_fault: bool) -> None:
        """Append an event. `is_fault`: it begins a fault."""
        self._writer.append_event(text, at_us - self._from_us)
        self._events.append(PastEvent(at_us // 1000, text))
        self._faults += is_fault

    def append_info(self, info: dict[str, str], at_us: int) -> None:
        """Append the new info."""
        self._writer.append_info(info, at_us - self._from_us)

    def append_model(self, model: str | None, at_us: int) -> None:
        """Append the new model."""
        self._writer.append_model(model, at_us - self._from_us)

    def append_word(self, word: RobotStatus, at_us: int) -> None:
        """Append the robot's new status."""
        self._writer.append_word(word, at_us - self._from_us)
        self._words.append(PastWord(at_us // 1000, word))

    def close(self, at_us: int, audiences: frozenset[Audience]) -> KeptSegment:
        """Close the segment at `at_us`, or earlier if it was due earlier, and return it.

        `audiences`: those that could see all of it live.
        """
        writer, start = self._writer, self._writer.start
        end_us = max(min(at_us, self._began_us + round(LENGTH_S * 1e6)), self._from_us + writer.at_us)
        data = writer.close(end_us // 1000)
        last_seq = writer.last_seq
        return KeptSegment(
            name=SegmentName(start.robot, start.view, start.take, start.index),
            run=start.run_id,
            from_ms=start.from_ms,
            to_ms=end_us // 1000,
            frames=writer.frames,
            first_seq=self._first_seq,
            last_seq=0 if last_seq is None else last_seq,
            missing=start.missing,
            schema=None if start.schema is None else bytes.fromhex(start.schema),
            model=start.model,
            data=data,
            sha256=hashlib.sha256(data).digest(),
            events=tuple(self._events),
            words=tuple(self._words),
            faults=self._faults,
            audiences=audiences,
            schema_text=None if self.schema is None else self.schema.text,
        )


STEP_US = 1_000_000  # how far the wall clock may drift from the monotonic clock within a take


class RecordingPorts(NamedTuple):
    """What a recording needs from outside.

    `keep` takes each closed segment and the core's time; `draw` returns a random u64; `read_unix_s` reads the
    wall clock.
    """

    keep: Callable[[KeptSegment, float], object]
    draw: Callable[[], int]
    read_unix_s: Callable[[], float]


class StreamRecording:
    """One stream's recording. Call each `take_…` when the stream has just accepted something.

    `word`: the robot's current status; `event_n`: the newest event that will not come through `take_event`;
    `seen`: the audiences that could see the KEY that its newest frames name. For other audiences the past
    begins with the next KEY.
    """

    def __init__(
        self,
        room: Room,
        ports: RecordingPorts,
        audiences: frozenset[Audience],
        word: RobotStatus,
        event_n: int,
        now: float,
        seen: frozenset[Audience],
    ) -> None:
        self.room = room
        self._stream = stream = room.stream
        self._ports = ports
        self._audiences = audiences
        self._seen = seen & audiences  # who may see the open segment
        self._word = word
        self._info = stream.info
        self._model = stream.model
        self._schema: Schema | None = None  # the last one hashed
        self._schema_hash: str | None = None
        self._open: OpenSegment | None = None
        self._at_us = 0
        self._last_seq: int | None = None  # in this take
        self._begin_take(now)
        self._name = f"{self._take:016x}"  # names the count of events if nobody else does
        self._follow_events(event_n)

    @property
    def due_at(self) -> float:
        """When to close the open segment, in seconds of the core's clock; NEVER if there is none."""
        return NEVER if self._open is None else self._open.due_at

    @property
    def seen(self) -> frozenset[Audience]:
        """The audiences that may look back and could see the KEY that the newest frames name."""
        return self._seen

    def set_audiences(self, audiences: frozenset[Audience], now: float) -> None:
        """Set which audiences may look back on live data.

        A segment that no audience could see completely is dropped. A new audience starts with the next KEY:
        earlier frames would show the last pose that was hidden from it.
        """
        self._audiences = audiences
        self._seen &= audiences
        if not self._seen:  # the old take would report withheld frames as lost
            self._open = None
            self._begin_take(now)

    def append_frame(self, frame: StoredFrame, late_s: float, now: float) -> None:
        """Record a frame. `late_s`: its lateness in seconds, as sent to viewers."""
        at_us = self._follow(now, self._stream.event_n)
        if frame.is_key and self._seen != self._audiences:
            self.close(now)
            self._seen = self._audiences
        if not self._seen:
            return
        before = self._open
        if before is not None and (
            before.schema is not self._stream.schema or not before.takes_frame(frame, at_us)
        ):
            self.close(now)
            before = None
        if before is None or not before.frames:
            key = frame if frame.key is None else frame.key
            schema = self._stream.schema
            if schema is None or parse_header(key.payload).schema_id != schema.id:
                return  # nobody could decode it
        segment = self._enter(at_us, now)
        segment.append_frame(frame, self._last_seq, at_us, late_s)
        self._last_seq = frame.seq

    def take_event(self, event: Event, doc: dict[str, object], now: float) -> None:
        """Record an event that the stream has just numbered. `doc`: its content."""
        at_us = self._follow(now, event.n - 1)
        if self._seen:
            self._make_room(2 * len(event.text), now)
            is_fault = doc.get("level") == "fault" and doc.get("state") == "on"
            self._enter(at_us, now).append_event(event.text, at_us, is_fault)
        self._event_n = event.n
        self._faults.record_event(doc, event.text)

    def take_description(self, now: float) -> None:
        """Record the stream's info and model if they have changed."""
        info, model = self._stream.info, self._stream.model
        if not self._seen:
            self._info, self._model = info, model
            return
        if info is not self._info and info != self._info:
            at_us = self._follow(now, self._stream.event_n)
            self._make_room(sum(2 * (len(name) + len(text)) + 8 for name, text in info.items()), now)
            self._enter(at_us, now).append_info(info, at_us)
            self._info = info
        if model != self._model:
            at_us = self._follow(now, self._stream.event_n)
            self._make_room(64, now)
            self._enter(at_us, now).append_model(model, at_us)
            self._model = model

    def take_word(self, word: RobotStatus, now: float) -> None:
        """Record the robot's status, if it has changed."""
        if word == self._word or not self._seen:
            self._word = word
            return
        at_us = self._follow(now, self._stream.event_n)
        self._make_room(8, now)
        self._enter(at_us, now).append_word(word, at_us)
        self._word = word
        if word != "online":
            self.close(now)

    def drop(self) -> None:
        """Drop the open segment, which nobody may see or can read."""
        self._open = None

    def close(self, now: float) -> None:
        """Close the open segment, if any, and hand it over."""
        segment, self._open = self._open, None
        if segment is not None:
            self._index += 1
            self._ports.keep(segment.close(self._compute_at_us(now), self._seen), now)

    def _follow(self, now: float, event_n: int) -> int:
        """Return the time of a new record in µs of the take, after closing what has ended."""
        if self._open is not None and now >= self._open.due_at:
            self.close(now)
        stream = self._stream
        is_renumbered = stream.numbering != self._said_numbering
        stepped_us = int(self._ports.read_unix_s() * 1e6) - int(now * 1e6) - self._offset_us
        if stream.run_id != self._run_id or is_renumbered or abs(stepped_us) > STEP_US:
            self.close(now)
            self._begin_take(now)
        if is_renumbered:
            self._follow_events(event_n)
        self._at_us = self._compute_at_us(now)
        return self._at_us

    def _compute_at_us(self, now: float) -> int:
        return max(self._at_us, int(now * 1e6) + self._offset_us)

    def _begin_take(self, now: float) -> None:
        self._take = self._ports.draw()
        self._index = 0
        self._run_id = self._stream.run_id
        self._last_seq = None
        self._offset_us = int(self._ports.read_unix_s() * 1e6) - int(now * 1e6)
        self._at_us = 0

    def _follow_events(self, event_n: int) -> None:
        """Take over the stream's events up to this number, as they are counted now."""
        self._said_numbering = self._stream.numbering
        self._event_n = event_n
        self._faults = OpenFaults(event for event in self._stream.events if event.n <= event_n)

    def _make_room(self, payload_bytes: int, now: float) -> None:
        if self._open is not None and not self._open.has_room(payload_bytes):
            self.close(now)

    def _enter(self, at_us: int, now: float) -> OpenSegment:
        """Return the open segment, started now if there is none."""
        if self._open is None:
            stream = self._stream
            schema = stream.schema
            if schema is not self._schema:
                self._schema = schema
                text = None if schema is None else schema.text.encode()
                self._schema_hash = None if text is None else hashlib.sha256(text).hexdigest()
            start = SegmentStart(
                robot=stream.robot,
                view=stream.view,
                take=self._take,
                index=self._index,
                run_id=self._run_id,
                from_ms=at_us // 1000,
                schema=self._schema_hash,
                model=self._model,
                word=self._word,
                numbering=self._said_numbering or self._name,
                event_n=self._event_n,
                info=self._info,
                open_faults=self._faults.list_texts(),
            )
            self._open = OpenSegment(start, at_us, now, schema)
        return self._open


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
                recording.append_frame(frame, late_s, now)
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
