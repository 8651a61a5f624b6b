"""The segment that a recording is currently writing."""

from __future__ import annotations

import hashlib

from posecast_wire import Schema
from posecast_wire.messages import COUNT_MAX, RobotStatus
from posecast_wire.segment import SegmentStart, SegmentWriter

from posecast_relay.core.past.kept_segment import KeptSegment, PastEvent, PastWord, SegmentName
from posecast_relay.core.policy import Audience
from posecast_relay.core.stream import SEQS, StoredFrame

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
