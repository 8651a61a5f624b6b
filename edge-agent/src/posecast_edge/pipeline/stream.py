"""One view of a robot, from sample to frame: schema, layout, sampler, events and encoder. Does no I/O; time
is an argument.

The source's thread calls `deliver`, the network's threads call `make_snapshot`, and `tick` is called by one
thread at a time. Times are seconds of clock.now_s(), except for robot time.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import cast

from posecast_wire.encoder import Encoder
from posecast_wire.keys import Snapshot
from posecast_wire.quantiser import Quantiser
from posecast_wire.schema import Schema

from posecast_edge.part_log import PartLog
from posecast_edge.pipeline.events import Event, EventLimit, EventWatch
from posecast_edge.pipeline.flattener import SampleFlattener
from posecast_edge.pipeline.sampler import NEVER, LeftOver, Sampler
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Sample
from posecast_edge.visible import quote

INFO_MAX = 64  # texts kept of a robot; further names are ignored
INFO_BYTES = 12_000  # of all of them together: a relay refuses much more
PICTURE_S = 1.0  # a sample unsent for this long is still shown in snapshots, as a still picture


@dataclass(frozen=True)
class Frame:
    """An encoded frame, ready to send. `taken_s`: when its sample came from the source, seconds."""

    data: bytes
    seq: int
    taken_s: float


class Stream:
    """Encodes one view of one robot, with the channels of that view's profile."""

    def __init__(
        self,
        profile: Profile,
        key_interval_s: float,
        say: Callable[[str], None],
        says_unknown: bool = True,
    ) -> None:
        """`say` is called with lines about bad input; `says_unknown`: also about names that the profile
        lacks. Raises SchemaError when the wire format can't carry the profile."""
        self.schema = Schema.parse(make_schema_text(profile))
        self._say, self._says_unknown = say, says_unknown
        self._wrong = PartLog(say, "wrong values")
        self._flattener = SampleFlattener(self.schema, say, says_unknown, self._wrong)
        self._untimed = PartLog(say, "samples without a time")
        self._key_interval_s = key_interval_s
        self._deadbands = {f.name: f.deadband for f in profile.fields}
        self._strides = {f.name: f.strides for f in profile.fields}
        self._sampler = Sampler(self._make_quantiser())
        self._encoder = Encoder(self.schema, key_interval_s)
        self._watch = EventWatch(self.schema)
        self._limit = EventLimit()
        self._events_lock = threading.Lock()
        self._frames_lock = threading.Lock()
        self._picture: tuple[int, bytes] | None = None  # number of the sample, its KEY
        self._info: dict[str, str] = {}
        self._info_bytes = 0
        self._said: Mapping[str, str] = {}  # texts of the newest sample that had some
        self._too_much = PartLog(say, "texts too many")
        self._texts = profile.info  # None: all
        self._seq = -1  # of the newest frame

    @property
    def started(self) -> bool:
        """Whether the source has delivered at least one sample."""
        return self._watch.started

    @property
    def fresh(self) -> bool:
        """Whether the newest sample has not been sent yet."""
        return self._sampler.fresh

    @property
    def silent(self) -> bool:
        """Whether the source has stopped delivering."""
        return self._watch.silent

    @property
    def info(self) -> dict[str, str]:
        """The robot's texts by name. Each change of a text makes a new mapping, so compare by identity."""
        return self._info

    def change_profile(self, profile: Profile) -> None:
        """Switch to the fields, labels, units and steps of `profile`. Viewers get a new schema with the next
        sample; reported faults are not reported again. Call it in the source's thread, between two frames.

        Raises SchemaError when the wire format can't carry the profile.
        """
        schema = Schema.parse(make_schema_text(profile))
        if schema.text == self.schema.text:
            return
        with self._frames_lock:
            self.schema = schema
            self._deadbands = {f.name: f.deadband for f in profile.fields}
            self._strides = {f.name: f.strides for f in profile.fields}
            self._sampler = Sampler(self._make_quantiser())
            self._encoder = Encoder(schema, self._key_interval_s)
            self._picture = None
        self._flattener = SampleFlattener(schema, self._say, self._says_unknown, self._wrong)
        with self._events_lock:
            self._watch.change_schema(schema)

    def _make_quantiser(self) -> Quantiser:
        return Quantiser(self.schema, self._deadbands, self._strides)

    def deliver(self, sample: Sample, now_s: float) -> list[Event]:
        """Take a sample that arrives at `now_s` and return the events that it causes."""
        if not math.isfinite(sample.t_s):
            self._untimed.add("time", f"a sample with time {sample.t_s} is dropped")
            return []
        if sample.exact:
            values = cast("Mapping[str, Sequence[float | None]]", sample.values)
            if sample.newest:
                self._sampler.offer(sample.t_s, partial(self._flat, values, sample), now_s)
        else:
            flat = self._flattener.flatten(sample)
            values = {f.name: flat[f.start : f.start + f.size] for f in self.schema.fields}
            if sample.newest:
                self._sampler.offer(sample.t_s, flat, now_s)
        if sample.info:
            self._take_info(sample)
        with self._events_lock:
            events = self._watch.check_sample(sample.t_s, values.get, now_s)
            return self._limit.admit(events, now_s) if events else events

    def _take_info(self, sample: Sample) -> None:
        said, self._said = self._said, sample.info
        if sample.info == said:  # the common case
            return
        for name, text in sample.info.items():
            before = self._info.get(name)
            if (self._texts is not None and name not in self._texts) or before == text:
                continue
            size = self._info_bytes + len(text.encode())
            size += len(name.encode()) if before is None else -len(before.encode())
            if size <= INFO_BYTES and (before is not None or len(self._info) < INFO_MAX):
                self._info, self._info_bytes = {**self._info, name: text}, size
                continue
            if said.get(name) == text:  # left out before
                continue
            where = f"{sample.where}: " if sample.where else ""
            most = f"{INFO_MAX} texts, {INFO_BYTES} bytes in all"
            self._too_much.add(name, f"{where}info {quote(name)} is left out: at most {most}")

    def _flat(self, values: Mapping[str, Sequence[float | None]], sample: Sample) -> list[float | None]:
        """Values in channel order."""
        flat: list[float | None] = []
        for f in self.schema.fields:
            of_field = values.get(f.name)
            flat += (
                [None] * f.size if of_field is None else self._flattener.drop_too_large(f, of_field, sample)
            )
        return flat

    def check_time(self, now_s: float, trouble: str = "") -> list[Event]:
        """Return events caused by the passing of time alone, such as a silent source. Call it regularly."""
        with self._events_lock:
            return self._limit.admit(self._watch.check_time(now_s, trouble), now_s)

    def force_key(self) -> None:
        """Make the next frame a KEY that is sent at once, because a new listener has joined."""
        self._sampler.force_key()

    def tick(self, now_s: float, oldest_s: float = NEVER) -> Frame | None:
        """The frame to send now, or None. A sample taken before `oldest_s` is not sent."""
        due = self._sampler.tick(now_s, oldest_s)
        if due is None:
            return None
        with self._frames_lock:
            data = self._encoder.encode(due.codes, self._next_seq(), due.t_s, now_s, due.force_key)
            return Frame(data, self._seq, due.taken_s)

    def recover(self) -> None:
        """Start again with a KEY at the next sample, after encoding or sending a frame has failed."""
        self._sampler.skip_sample()
        self._sampler.force_key()

    def make_snapshot(self, model: str | None, now_s: float) -> Snapshot | None:
        """All that a late joiner needs, or None before the first frame. `model`: SHA-256 of the model's
        manifest.

        If the newest sample became too old to be sent, the snapshot contains its KEY: it shows the last known
        pose without counting as a sign of life.
        """
        with self._frames_lock:
            key = self._encoder.key
            left = self._sampler.find_unsent(now_s - PICTURE_S)
            if left is not None:
                key = self._picture_of(left, now_s)
        if key is None:
            return None
        return Snapshot(self.schema.text, self._info, key, model)

    def _picture_of(self, left: LeftOver, now_s: float) -> bytes:
        if self._picture is None or self._picture[0] != left.number:
            codes = self._make_quantiser().quantise(left.values)
            key = Encoder(self.schema).encode(codes, self._next_seq(), left.t_s, now_s)
            self._picture = left.number, key
            self._sampler.force_key()  # a still picture is no base for delta frames
        return self._picture[1]

    def _next_seq(self) -> int:
        self._seq = (self._seq + 1) & 0xFFFFFFFF
        return self._seq
