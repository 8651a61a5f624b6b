"""One robot's stream from sample to frame: schema, layout, sampler, events, encoder. No I/O, time comes in.

`deliver` is called by the source's thread, `snapshot` by the network's, `tick` by one thread at a time.
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

from posecast_edge.complaints import Complaints
from posecast_edge.events import Event, EventLimit, EventWatch
from posecast_edge.layout import Layout
from posecast_edge.profile import Profile
from posecast_edge.sampler import Sampler
from posecast_edge.schema_build import schema_text
from posecast_edge.sources import Sample

INFO_MAX = 64  # texts kept of a robot; further names are ignored


@dataclass(frozen=True)
class Frame:
    """An encoded frame, ready to send."""

    data: bytes
    seq: int


class Stream:
    """The public view of one robot."""

    def __init__(self, profile: Profile, key_interval_s: float, say: Callable[[str], None]) -> None:
        """SchemaError when the wire cannot carry the profile. `say` takes lines about bad input."""
        self.schema = Schema.parse(schema_text(profile))
        self._layout = Layout(self.schema, say)
        self._untimed = Complaints(say, "samples without a time")
        self._sampler = Sampler(Quantiser(self.schema, {f.name: f.deadband for f in profile.fields}))
        self._encoder = Encoder(self.schema, key_interval_s)
        self._watch = EventWatch(self.schema)
        self._limit = EventLimit()
        self._events_lock = threading.Lock()
        self._frames_lock = threading.Lock()
        self._info: dict[str, str] = {}
        self._texts = profile.info  # None: all
        self._seq = 0

    @property
    def started(self) -> bool:
        """The source has delivered at least once."""
        return self._watch.started

    @property
    def fresh(self) -> bool:
        """A sample waits that no frame has carried."""
        return self._sampler.fresh

    @property
    def silent(self) -> bool:
        """The source has stopped delivering."""
        return self._watch.silent

    @property
    def info(self) -> dict[str, str]:
        """The texts of the robot; another object whenever one has changed."""
        return self._info

    def deliver(self, sample: Sample, now_s: float) -> list[Event]:
        """Take a sample; returns the events it makes."""
        if not math.isfinite(sample.t_s):
            self._untimed.add(f"a sample of time {sample.t_s} is dropped", now_s)
            return []
        if sample.exact:
            values = cast("Mapping[str, Sequence[float | None]]", sample.values)
            if sample.newest:
                self._sampler.offer(sample.t_s, partial(self._flat, values))
        else:
            flat = self._layout.flatten(sample, now_s)
            values = {f.name: flat[f.start : f.start + f.size] for f in self.schema.fields}
            if sample.newest:
                self._sampler.offer(sample.t_s, flat)
        if sample.info:
            self._take_info(sample.info)
        with self._events_lock:
            events = self._watch.sample(sample.t_s, values.get, now_s)
            return self._limit.admit(events, now_s) if events else events

    def _take_info(self, info: Mapping[str, str]) -> None:
        for name, text in info.items():
            if self._texts is not None and name not in self._texts:
                continue
            if self._info.get(name) != text and (name in self._info or len(self._info) < INFO_MAX):
                self._info = {**self._info, name: text}

    def _flat(self, values: Mapping[str, Sequence[float | None]]) -> list[float | None]:
        """Values in channel order."""
        flat: list[float | None] = []
        for f in self.schema.fields:
            of_field = values.get(f.name)
            flat += [None] * f.size if of_field is None else of_field
        return flat

    def idle(self, now_s: float) -> list[Event]:
        """Events that time alone makes; to be called now and then."""
        with self._events_lock:
            return self._limit.admit(self._watch.tick(now_s), now_s)

    def force_key(self) -> None:
        """Somebody new listens: the next frame stands alone and comes at once."""
        self._sampler.force_key()

    def tick(self, now_s: float) -> Frame | None:
        """The frame that is due, or None."""
        due = self._sampler.tick(now_s)
        if due is None:
            return None
        with self._frames_lock:
            data = self._encoder.encode(due.codes, self._seq, due.t_s, now_s, due.force_key)
            seq, self._seq = self._seq, (self._seq + 1) & 0xFFFFFFFF
        return Frame(data, seq)

    def snapshot(self, model: str | None) -> Snapshot | None:
        """All a late joiner needs, None before the first frame. `model`: the manifest's hash."""
        with self._frames_lock:
            key, ref = self._encoder.key, self._encoder.ref
        if key is None:
            return None
        return Snapshot(self.schema.text, self._info, key, ref, model)
