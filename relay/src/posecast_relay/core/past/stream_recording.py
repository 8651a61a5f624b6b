"""Records one stream: turns what it accepts into consecutive segments."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import NamedTuple

from posecast_wire import Schema, parse_header
from posecast_wire.messages import RobotStatus
from posecast_wire.segment import SegmentStart

from posecast_relay.core.past.kept_segment import KeptSegment
from posecast_relay.core.past.open_faults import OpenFaults
from posecast_relay.core.past.open_segment import OpenSegment
from posecast_relay.core.policy import Audience
from posecast_relay.core.room import Room
from posecast_relay.core.stream import Event, StoredFrame
from posecast_relay.kit import NEVER

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

    def take_frame(self, frame: StoredFrame, late_s: float, now: float) -> None:
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
