"""Statistics of a few seconds of a source's samples, for the reports of `probe` and `doctor`."""

from __future__ import annotations

import logging
import math
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from posecast_wire.mapping import JOINT, JointMap

from posecast_edge.pipeline.inferred_channels import InferredChannels
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample, SourceError
from posecast_edge.sources.base import Source

log = logging.getLogger("posecast_edge")

WAIT_S = 5.0  # for the first sample
WATCH_MAX_S = 3600.0
MAX_CHANNELS = 4096  # per field; also the highest number of fields and of texts
MAX_BITS = 256
FINITE = sys.float_info.max
POSITION = ("pos", "ref")  # the first of these that exists sets the body's pose


@dataclass
class ChannelStats:
    """One channel's readings. `low`, `high`, `last`: in the source's unit; `bits`: bit names seen."""

    readings: int = 0
    low: float = math.inf
    high: float = -math.inf
    last: float | None = None
    bits: set[str] = field(default_factory=set)

    def add(self, value: Reading) -> None:
        """Count one reading; None and values that are not numbers count as no reading."""
        if isinstance(value, (list, tuple)):
            self.bits |= {str(name) for name in value[: MAX_BITS - len(self.bits)]}
            self.readings += 1
        elif (number := _number(value)) is not None:
            self.readings += 1
            self.low, self.high, self.last = min(self.low, number), max(self.high, number), number

    @property
    def largest(self) -> float:
        """The largest magnitude; 0 without a reading."""
        return max(abs(self.low), abs(self.high)) if math.isfinite(self.low) else 0.0

    @property
    def moves(self) -> bool:
        """Whether it had more than one value."""
        return self.low < self.high


class SourceStats:
    """Collects statistics of samples. Does no I/O: arrival times are arguments, in monotonic seconds.

    `fields`: field → label → channel. `joints`: joint of the model → statistics of the values that the
    profile computes for it.
    """

    def __init__(self, profile: Profile | None = None) -> None:
        self.samples = 0
        self.ended = False  # the source ended on its own
        self.fields: dict[str, dict[str, ChannelStats]] = {}
        self.joints: dict[str, ChannelStats] = {}
        self.info: dict[str, str] = {}
        self.arrivals_s: tuple[float, float] = (0.0, 0.0)  # the first and the newest
        self.times_s: tuple[float, float] = (0.0, 0.0)  # the robot's clock then
        self.longest_gap_s = 0.0
        self.steps_back = 0
        self.wrong_lengths: dict[str, int] = {}  # field → number of values received
        self.quaternions: ChannelStats = ChannelStats()  # norms
        self.profile = profile  # the given one, or the one that an agent would infer
        self._channels = None if profile else InferredChannels("robot", log.warning)
        self._labels: dict[str, tuple[str, ...]] = {}
        self._maps: dict[str, JointMap] = {}
        if profile:
            self._learn(profile)

    @property
    def duration_s(self) -> float:
        """Seconds from the first sample to the last."""
        return self.arrivals_s[1] - self.arrivals_s[0]

    @property
    def rate_hz(self) -> float:
        """Mean sample rate in Hz; 0 for fewer than two samples."""
        return (self.samples - 1) / self.duration_s if self.samples > 1 and self.duration_s > 0 else 0.0

    def add(self, sample: Sample, now_s: float) -> None:
        """Count one sample that arrived at `now_s`."""
        if self._channels is not None:
            sample = self._channels.take(sample, now_s)
            if self._channels.profile is not None and self._channels.profile is not self.profile:
                self._learn(self._channels.profile)
        if self.samples == 0:
            self.arrivals_s, self.times_s = (now_s, now_s), (sample.t_s, sample.t_s)
        self.longest_gap_s = max(self.longest_gap_s, now_s - self.arrivals_s[1])
        self.steps_back += sample.t_s < self.times_s[1]
        self.arrivals_s = (self.arrivals_s[0], now_s)
        self.times_s = (self.times_s[0], sample.t_s)
        self.samples += 1
        if len(self.info) < MAX_CHANNELS:
            self.info |= sample.info
        by_field: dict[str, Mapping[str, Reading]] = {}
        for name, values in sample.values.items():
            labelled = values if isinstance(values, Mapping) else self._named(name, values)
            if name not in self.fields and len(self.fields) >= MAX_CHANNELS:
                continue
            by_field[name] = labelled
            channels = self.fields.setdefault(name, {})
            for label, value in labelled.items():
                if label not in channels and len(channels) < MAX_CHANNELS:
                    channels[label] = ChannelStats()
                if label in channels:
                    channels[label].add(value)
        self._quaternions(by_field)
        position = next((by_field[name] for name in POSITION if name in by_field), None)
        if position is not None:
            for joint, how in self._maps.items():
                self.joints.setdefault(joint, ChannelStats()).add(_position(how, position))

    def finish(self) -> None:
        """Without a given profile, keep only what `run` shows: not what can't become a channel."""
        if self._channels is None:
            return
        self._channels.grow()
        if self._channels.profile is not None:
            self._learn(self._channels.profile)
        self.fields = {
            name: {label: channel for label, channel in channels.items() if label in self._labels[name]}
            for name, channels in self.fields.items()
            if name in self._labels
        }

    def _learn(self, profile: Profile) -> None:
        self.profile = profile
        self._labels = {f.name: f.labels for f in profile.fields}
        self._maps = dict(profile.mapping.joints)
        for label in next((f.labels for f in profile.fields if f.label_set == JOINT), ()):
            self._maps.setdefault(label, JointMap(((label, 1.0),)))

    def _named(self, field_name: str, values: Sequence[Reading]) -> dict[str, Reading]:
        labels = self._labels.get(field_name)
        if labels is not None and len(labels) != len(values):
            self.wrong_lengths[field_name] = len(values)
            labels = None
        return dict(zip(labels or map(str, range(len(values))), values, strict=False))

    def _quaternions(self, by_field: Mapping[str, Mapping[str, Reading]]) -> None:
        for name in ("quat", "baseq"):
            parts = by_field.get(name, {})
            for site in {label.partition(".")[0] for label in parts}:
                found = [parts.get(f"{site}.{c}") for c in "wxyz"]
                numbers = [number for v in found if (number := _number(v)) is not None]
                if len(numbers) == 4:
                    self.quaternions.add(math.hypot(*numbers))


def _number(value: Reading) -> float | None:
    """The value as a finite float; None if it is not a number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= FINITE:
        return None
    return float(value)


def _position(how: JointMap, channels: Mapping[str, Reading]) -> float | None:
    total = how.offset
    for channel, gain in how.terms:
        value = _number(channels.get(channel))
        if value is None:
            return None
        total += gain * value
    return total


def observe_source(source: Source, seconds: float, profile: Profile | None = None) -> SourceStats:
    """Watch a source for `seconds` after its first sample, which may take up to WAIT_S to arrive.

    Raises SourceError when the source fails. For a source that ends early, returns the statistics so far.
    """
    seen = SourceStats(profile)
    stop = threading.Event()
    failure: list[Exception] = []
    began_s = time.monotonic()

    def deliver(sample: Sample) -> None:
        now_s = time.monotonic()
        seen.add(sample, now_s)
        if now_s - seen.arrivals_s[0] >= seconds:
            stop.set()

    def run() -> None:
        try:
            source.run(deliver, stop)
            seen.ended = not stop.is_set()
        except Exception as e:
            failure.append(e)
        stop.set()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    while not stop.wait(0.05):
        since_s, enough_s = (seen.arrivals_s[0], seconds) if seen.samples else (began_s, WAIT_S)
        if time.monotonic() - since_s >= enough_s:
            stop.set()
    thread.join(2.0)
    seen.finish()
    if failure:
        e = failure[0]
        raise e if isinstance(e, SourceError) else SourceError(f"{type(e).__name__}: {e}")
    return seen
