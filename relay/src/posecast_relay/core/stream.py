"""The newest state of one robot's view as sent by the edge: schema, KEY, newest frame, info, events.

Only headers are read. A frame is ignored if it is old, repeated, too large, of an unknown version, or coded
against a base that is not here. Its outcome is returned so that it can be counted.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from enum import StrEnum

from posecast_wire import BadFrame, Schema, SchemaError, Snapshot, fnv1a32, frame_id, parse_header
from posecast_wire.frame import VERSION, Header

from posecast_relay.core import messages
from posecast_relay.core.limits import Limits

SAMPLES = 16


class Cadence:
    """A stream's frame interval in seconds, from its stamps.

    A robot that does not change skips frames, so long steps don't count: it is the mean of those near the
    lower quartile.
    """

    def __init__(self) -> None:
        self.interval_s = 0.0  # 0 = not known yet
        # recent frames a second; not 1 / interval_s: an agent that takes 30 of a source's 50 samples a second
        # stamps frames 20 or 40 ms apart, so the quartile is 20 ms
        self.hz = 0.0
        self._last_s = 0.0
        self._steps: deque[float] = deque(maxlen=SAMPLES)

    def record_stamp(self, stamp_s: float) -> None:
        """Note the stamp, in seconds, of an accepted frame."""
        step = stamp_s - self._last_s
        self._last_s = stamp_s
        if 0.0 < step < 10.0:
            self._steps.append(step)
            if len(self._steps) >= 4:
                ordered = sorted(self._steps)
                near = [s for s in ordered if s <= 1.5 * ordered[len(ordered) // 4]]
                self.interval_s = sum(near) / len(near)
                self.hz = len(ordered) / sum(ordered)


SEQS = 1 << 32  # frame numbers wrap around


class FrameOutcome(StrEnum):
    """The outcome of a message from an edge."""

    TAKEN = "taken"
    LATE = "late"  # older than the newest frame here
    REPEATED = "repeated"
    OVERSIZED = "oversized"
    VERSION = "version"  # unknown version of the wire format
    BAD = "bad"
    RETIRED = "retired"  # its run was replaced by a newer one
    NO_BASE = "no base"  # coded against a frame that is not here: requests a snapshot
    NO_SCHEMA = "no schema"  # a KEY whose schema is not here: requests a snapshot
    CROWDED = "crowded"  # exceeds the limit on robots or views
    OVER_SHARE = "over share"  # its robot exceeds its share
    FAULT = "fault"  # the relay's own code failed on it


class StoredFrame:
    """A frame that is kept.

    `stamp_s`: seconds since the run began by the edge's clock; `t_s`: seconds of the robot's clock.
    """

    __slots__ = (
        "_packed",
        "id",
        "is_key",
        "key",
        "payload",
        "run_id",
        "seq",
        "stamp_s",
        "t_s",
    )

    def __init__(
        self, payload: bytes, run_id: int, stamp_s: float, header: Header, base: StoredFrame | None
    ) -> None:
        self.payload = payload
        self.run_id = run_id
        self.stamp_s = stamp_s
        self.is_key = header.is_key
        self.id = frame_id(payload) if header.is_key else 0
        self.seq: int = header.seq if base is None else (base.seq + header.seq) & 0xFFFFFFFF
        self.t_s: float = header.t if base is None else base.t_s + header.t / 1000
        self.key = base  # the KEY needed to decode it; None if it is one
        self._packed: bytes | None = None

    @property
    def packed(self) -> bytes:
        """The frame as one WebSocket message, made once for all viewers."""
        if self._packed is None:
            self._packed = messages.make_binary(self.payload)
        return self._packed


class Event:
    """A numbered event, kept as the bytes that every viewer gets."""

    __slots__ = ("n", "packed", "text")

    def __init__(self, n: int, text: str) -> None:
        self.n = n
        self.text = text
        self.packed = messages.make_text(text)


class Stream:
    """The state of one robot's view.

    `version` counts changes of schema, info or model; `schema_n` counts changes of the schema.
    """

    def __init__(self, robot: str, view: str, limits: Limits) -> None:
        self.robot = robot
        self.view = view
        self.limits = limits
        self.run_id = 0  # the run of the frames here
        self.schema: Schema | None = None
        self.key: StoredFrame | None = None
        self.newest: StoredFrame | None = None
        self.is_live = False  # the newest frame came directly from the edge, not with a snapshot
        self.live_at: float | None = None  # when the newest such frame arrived
        self.late_s = 0.0  # that frame's lateness
        self.info: dict[str, str] = {}
        self.model: str | None = None
        self.events: deque[Event] = deque(maxlen=limits.events)
        self.event_n = 0
        self.numbering = ""  # identifies the count that `event_n` continues, for relays that follow it
        self.version = 0
        self.schema_n = 0
        self.cadence = Cadence()
        self._schema_packed = b""
        self._info_packed = b""
        self._old_key_id: int | None = None
        self._waiting: tuple[bytes, int, float, float, float] | None = None  # newest frame without a base

    # ---- frames ----------------------------------------------------------

    def check_frame(self, payload: bytes) -> Header | FrameOutcome:
        """Return a frame's header, or why the frame is invalid."""
        if len(payload) > self.limits.frame_bytes:
            return FrameOutcome.OVERSIZED
        if payload and payload[0] >> 4 != VERSION:
            return FrameOutcome.VERSION
        try:
            return parse_header(payload)
        except BadFrame:
            return FrameOutcome.BAD

    def store_frame(
        self, payload: bytes, header: Header, run_id: int, stamp_s: float, now: float, late_s: float
    ) -> FrameOutcome:
        """Take a frame that just arrived, from a run that is not retired."""
        outcome = self._place(payload, header, run_id, stamp_s)
        if outcome is FrameOutcome.TAKEN:
            self.is_live = True
            self.live_at = now
            self.late_s = late_s
            self.cadence.record_stamp(stamp_s)
        elif outcome in (FrameOutcome.NO_BASE, FrameOutcome.NO_SCHEMA):
            self.hold_for_base(payload, run_id, stamp_s, now, late_s)
        return outcome

    def hold_for_base(self, payload: bytes, run_id: int, stamp_s: float, now: float, late_s: float) -> None:
        """Keep a frame that just arrived until an older snapshot brings its base."""
        self._waiting = (payload, run_id, stamp_s, now, late_s)

    def awaits_base(self, run_id: int) -> bool:
        """Whether a frame of this run is waiting for its base."""
        return self._waiting is not None and self._waiting[1] == run_id

    def _place(self, payload: bytes, header: Header, run_id: int, stamp_s: float) -> FrameOutcome:
        base: StoredFrame | None = None
        if not header.is_key:
            base = self.key
            if base is None or run_id != self.run_id or header.base_id != base.id:
                return FrameOutcome.LATE if header.base_id == self._old_key_id else FrameOutcome.NO_BASE
        elif self.schema is None or header.schema_id != self.schema.id:
            return FrameOutcome.NO_SCHEMA
        if self.schema is not None and self._is_too_long(payload, header):
            return FrameOutcome.OVERSIZED  # before any of it is hashed
        held = StoredFrame(payload, run_id, stamp_s, header, base)
        if self.newest is not None and self._is_old(run_id, held.seq):
            return (
                FrameOutcome.REPEATED
                if payload == self.newest.payload or held.id == self._get_key_id()
                else FrameOutcome.LATE
            )
        if held.is_key:
            if run_id != self.run_id:
                self.live_at = None  # belongs to the previous run
            self._old_key_id = self._get_key_id() if run_id == self.run_id else None
            self.key, self.run_id = held, run_id
        self.newest = held
        self.is_live = False
        return FrameOutcome.TAKEN

    def _is_too_long(self, payload: bytes, header: Header) -> bool:
        assert self.schema is not None
        return len(payload) > (self.schema.key_bytes_max if header.is_key else self.schema.frame_bytes_max)

    def _is_old(self, run_id: int, seq: int) -> bool:
        if self.newest is None or run_id != self.run_id:
            return False
        return (seq - self.newest.seq - 1) % SEQS >= SEQS // 2  # 0 follows the highest number

    def _get_key_id(self) -> int | None:
        return self.key.id if self.key else None

    # ---- the snapshot ----------------------------------------------------

    def apply_snapshot(
        self, snapshot: Snapshot, run_id: int, stamp_s: float, newest: bytes | None = None
    ) -> None:
        """Apply a snapshot. Raises ValueError and changes nothing if it is inconsistent.

        Its frames can be of any age. They count as a base and as a picture, never as a sign of life.
        """
        key_header = self.check_frame(snapshot.key)
        if isinstance(key_header, FrameOutcome) or not key_header.is_key:
            raise ValueError("snapshot: its KEY is invalid")
        self._check_info(snapshot.info)
        schema = self.schema
        if schema is None or schema.text != snapshot.schema:
            if fnv1a32(snapshot.schema.encode()) != key_header.schema_id:
                raise ValueError("snapshot: its KEY belongs to another schema")
            try:
                schema = Schema.parse(snapshot.schema)
            except SchemaError as e:
                raise ValueError(f"snapshot: {e}") from None
            if self._is_old(run_id, key_header.seq):
                raise ValueError("snapshot: older than the stream's state")
        self._set_description(schema, snapshot.info, snapshot.model)
        self._place(snapshot.key, key_header, run_id, stamp_s)
        header = self.check_frame(newest) if newest is not None else None
        if newest is not None and isinstance(header, Header):
            self._place(newest, header, run_id, stamp_s)
        if self._waiting is not None:
            payload, waiting_run, waiting_stamp_s, arrived, late_s = self._waiting
            self._waiting = None
            if waiting_run == run_id:
                self._place(payload, parse_header(payload), run_id, waiting_stamp_s)
                if self.newest is not None and self.newest.payload == payload:  # set now, or by the snapshot
                    self.is_live = True
                    self.live_at = arrived
                    self.late_s = late_s

    def _set_description(self, schema: Schema, info: dict[str, str], model: str | None) -> None:
        if schema is self.schema and info == self.info and model == self.model:
            return
        self.version += 1
        if schema is not self.schema:
            self.schema = schema
            self.schema_n += 1
            self._schema_packed = messages.make_text(schema.text)
        self.info = info
        self._info_packed = messages.make_info(info) if info else b""
        self.model = model

    def set_info(self, info: dict[str, str]) -> None:
        """Replace the robot's info texts. Raises ValueError if they are too long."""
        self._check_info(info)
        if self.schema is not None:  # otherwise the snapshot brings it
            self._set_description(self.schema, info, self.model)

    def set_model(self, model: str) -> None:
        """Replace the robot's model, named by the SHA-256 of its manifest."""
        if self.schema is not None:
            self._set_description(self.schema, self.info, model)

    def _check_info(self, info: dict[str, str]) -> None:
        if sum(len(k) + len(v) for k, v in info.items()) > self.limits.info_bytes:
            raise ValueError(f"info over {self.limits.info_bytes} bytes")

    def make_description(self, schema_n: int, with_model: bool = True) -> bytes:
        """Return schema, info and model as WebSocket messages, for a viewer with an older `version`.

        `schema_n`: the schema that the viewer has. The current schema is not sent again.
        """
        schema = self._schema_packed if schema_n != self.schema_n else b""
        model = messages.make_model(self.model) if self.model and with_model else b""
        return schema + self._info_packed + model

    # ---- events ----------------------------------------------------------

    def number_event(self, doc: dict[str, object], unix_s: float) -> Event:
        """Give an event the next number and keep it with the newest events."""
        self.event_n += 1
        numbered = doc | {"n": self.event_n, "at": round(unix_s, 3)}
        event = Event(self.event_n, json.dumps(numbered, separators=(",", ":"), ensure_ascii=False))
        self.events.append(event)
        return event

    def append_numbered(self, numbering: str, text: str) -> Event | None:
        """Keep an event that another relay has numbered; returns None if it is already here.

        A changed `numbering` means that the count restarted at 1: older events are dropped. Raises ValueError
        if the event has no number.
        """
        n = _read_number(text)
        if numbering != self.numbering:
            self.numbering = numbering
            self.events.clear()
            self.event_n = 0
        if n <= self.event_n:
            return None
        self.event_n = n
        event = Event(n, text)
        self.events.append(event)
        return event

    def set_numbering(self, numbering: str) -> None:
        """Set the identifier of the count that `event_n` belongs to."""
        self.numbering = numbering

    def resume_events(self, numbering: str, texts: Sequence[str], told_n: int = 0) -> None:
        """Continue the count of another process: its events come first, then this process's own, renumbered.

        `told_n`: the newest event of this process that was already stored. An event that both processes
        received is kept once. Raises ValueError and changes nothing if one of `texts` has no number.
        """
        for text in texts:
            _read_number(text)
        own = [json.loads(event.text) for event in self.events if event.n > told_n]
        self.events.clear()
        self.event_n = 0
        self.numbering = numbering
        for text in texts:
            self.append_numbered(numbering, text)
        known = {_identify_event(json.loads(text)) for text in texts}
        for doc in own:
            if _identify_event(doc) not in known:
                self.number_event(doc, doc["at"])

    @property
    def frame_bytes(self) -> int:
        """The size of the newest frame or its KEY, whichever is larger; 0 before the first."""
        newest = self.newest
        if newest is None:
            return 0
        return max(len(newest.payload), len(newest.key.payload) if newest.key is not None else 0)

    # ---- age -------------------------------------------------------------

    def set_age_unless_live(self, age_s: float, now: float) -> None:
        """Set the age of the newest frame, in seconds, unless a live frame has arrived."""
        if self.live_at is None and self.newest is not None:
            self.set_age(age_s, now)

    def set_age(self, age_s: float, now: float) -> None:
        """Set the age of the newest frame, in seconds, and count it as live."""
        self.live_at, self.late_s = now - age_s, 0.0

    def compute_age_s(self, now: float) -> float | None:
        """Return the newest frame's age in seconds, including transit; None before any live frame."""
        return None if self.live_at is None else now - self.live_at + self.late_s


def _read_number(text: str) -> int:
    """Return the number of a numbered event. Raises ValueError when it has none."""
    try:
        return int(json.loads(text)["n"])
    except (TypeError, LookupError, RecursionError) as e:
        raise ValueError(f"not a numbered event: {type(e).__name__}") from None


def _identify_event(event: dict[str, object]) -> str:
    """Return the event without its number and time. This text is the same at every relay that heard it."""
    return json.dumps(
        {name: value for name, value in event.items() if name not in ("n", "at")}, sort_keys=True
    )
