"""One view of a robot, from sample to frame, in the order that a sample takes: flattener (one list in the
schema's channel order), sampler (the newest at the sampling rate), and the stream with its schema, events and
encoder. Does no I/O; time is an argument.

The source's thread calls `deliver`, the network's threads call `make_snapshot`, and `tick` is called by one
thread at a time. Times are seconds of kit.now_s(), except for robot time.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from operator import index
from typing import NamedTuple, SupportsFloat, SupportsIndex, cast

from posecast_wire.encoder import Encoder
from posecast_wire.keys import Snapshot
from posecast_wire.quantiser import Quantiser
from posecast_wire.schema import CODE_MAX, Field, Schema

from posecast_edge.kit import WORD_MAX, PartLog, make_visible, many, quote
from posecast_edge.pipeline.events import Event, EventLimit, EventWatch
from posecast_edge.profile.schema import make_schema_text
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample

# --- flattener

Flat = list[float | None]

MAX_NAMED = 50  # unknown names that are logged; a source could invent names for ever
_FLOATS = {float, type(None)}
_INTS = {int, type(None)}


class SampleFlattener:
    """Turns the values of a sample, given by name or in order, into one list in the schema's channel order.
    Knows the position of each label of each field. Not thread-safe: the source's thread uses it."""

    def __init__(
        self,
        schema: Schema,
        say: Callable[[str], None],
        says_unknown: bool = True,
        wrong: PartLog | None = None,
    ) -> None:
        """`says_unknown`: whether to log names that the schema lacks. `wrong`: where wrong values are named,
        if other schemas of the same view have named some before."""
        self._say = say
        self._says_unknown = says_unknown
        self._size = schema.size
        self._fields = {f.name: f for f in schema.fields}
        self._offsets = {f.name: {label: i for i, label in enumerate(f.labels)} for f in schema.fields}
        self._masks = {f.name: {bit: 1 << i for i, bit in enumerate(f.bits)} for f in schema.fields}
        self._largest = {f.name: CODE_MAX * f.scale for f in schema.fields}  # readings that have a code
        self._good_masks: dict[str, Sequence[Reading]] = {}  # the newest of each field of bits
        self._unknown: set[str] = set()
        self._wrong = wrong or PartLog(say, "wrong values")

    def flatten(self, sample: Sample) -> Flat:
        """Values in channel order, None where the sample has no usable reading. Lists of bit names become an
        integer mask.

        A value that does not fit the schema, or is too large for it, is named once and becomes "no reading";
        values are never shifted, cut or guessed.
        """
        flat: Flat = [None] * self._size
        for name, values in sample.values.items():
            field = self._fields.get(name)
            if field is None:
                self._unknown_name("field", name, sample)
            elif isinstance(values, Mapping):
                flat[field.start : field.start + field.size] = self._by_label(field, values, sample)
            elif len(values) != field.size:
                given = many(len(values), "value")
                self._complain(sample, name, f"has {given}, {field.size} expected")
            else:
                flat[field.start : field.start + field.size] = self._in_order(field, values, sample)
        return flat

    def _in_order(self, field: Field, values: Sequence[Reading], sample: Sample) -> Flat:
        if values is self._good_masks.get(field.name):
            return list(values)  # type: ignore[arg-type]  # most sources hand out the same masks again
        # handle the common cases without checking each value: sources may run at 200 Hz
        kinds = set(map(type, values))
        if not field.bits and kinds <= _FLOATS:
            return self.drop_too_large(field, cast("Sequence[float | None]", values), sample)
        if field.bits and kinds <= _INTS:
            masks = [v for v in cast("Sequence[int | None]", values) if v is not None]
            if not masks or (min(masks) >= 0 and max(masks) < 1 << len(field.bits)):
                self._good_masks[field.name] = values
                return cast(Flat, list(values))
        return [self._number(field, v, i, sample) for i, v in enumerate(values)]

    def drop_too_large(self, field: Field, values: Sequence[float | None], sample: Sample) -> Flat:
        """The values of a field, None for those that are too large for its codes: a code at the end of the
        range would look like a reading."""
        most = self._largest[field.name]
        if field.bits or all(v is None or -most <= v <= most for v in values):
            return list(values)
        return [self._number(field, v, i, sample) for i, v in enumerate(values)]

    def _by_label(self, field: Field, values: Mapping[str, Reading], sample: Sample) -> Flat:
        offsets, is_number = self._offsets[field.name], not field.bits
        most = self._largest[field.name]
        flat: Flat = [None] * field.size
        for label, value in values.items():
            i = offsets.get(label)
            if i is None:
                self._unknown_name(f"label of {field.name}", label, sample)
            elif is_number and type(value) is float and -most <= value <= most:
                flat[i] = value
            else:
                flat[i] = self._number(field, value, i, sample)
        return flat

    def _number(self, field: Field, value: object, i: int, sample: Sample) -> float | None:
        if value is None:
            return None
        if isinstance(value, bool):  # Python treats it as a number, but its author did not mean one
            pass
        elif field.bits:
            if isinstance(value, (list, tuple)):
                return self._mask(field, value, i, sample)
            if isinstance(value, (int, SupportsIndex)) and 0 <= (mask := index(value)) < 1 << len(field.bits):
                return mask
        elif isinstance(value, (float, int, SupportsFloat)):  # includes NumPy scalars, excludes strings
            with suppress(OverflowError):
                number, most = float(value), self._largest[field.name]
                if not most < abs(number) < math.inf:
                    return number
                self._complain(
                    sample, _channel(field, i), f"is {number:g}, beyond ±{most:g} {field.unit}".rstrip()
                )
                return None
        wanted = "a list or mask of its bits" if field.bits else "a number"
        self._complain(sample, _channel(field, i), f"is {quote(value, 40)}, not {wanted}")
        return None

    def _mask(self, field: Field, names: Sequence[object], i: int, sample: Sample) -> int:
        masks = self._masks[field.name]
        mask = 0
        for name in names:
            bit = masks.get(name) if isinstance(name, str) else None
            if bit is not None:
                mask |= bit
            elif isinstance(name, str):
                self._unknown_name(f"bit of {field.name}", name, sample)
            else:
                self._complain(sample, _channel(field, i), f"has {quote(name, 40)}, not the name of a bit")
        return mask

    def _complain(self, sample: Sample, part: str, text: str) -> None:
        kind = text.rpartition(", ")[2]  # what it should be; the value before differs each time
        text = f"{part} {text}"
        self._wrong.add(f"{part}, {kind}", f"{sample.where}: {text}" if sample.where else text)

    def _unknown_name(self, what: str, name: str, sample: Sample) -> None:
        if not self._says_unknown or len(self._unknown) >= MAX_NAMED:
            return
        key = f"{what} {name}"
        if key in self._unknown:
            return
        self._unknown.add(key)
        more = "; further unknown names are not logged" if len(self._unknown) == MAX_NAMED else ""
        where = f"{sample.where}: " if sample.where else ""
        self._say(f"{where}unknown {what} {quote(name)} is ignored{more}")


def _channel(field: Field, i: int) -> str:
    return make_visible(f"{field.name}.{field.labels[i]}", WORD_MAX)


# --- sampler

Offered = Sequence[float | None] | Callable[[], Sequence[float | None]]
CONFIRM_S = 0.5  # how often unchanged codes are sent again
NEVER = -math.inf


@dataclass(frozen=True)
class Due:
    """A frame to encode. `codes`: all channels in the schema's order; `t_s`: robot clock; `force_key`: the
    frame must be a KEY; `taken_s`: when the sample was read from the source. Times are seconds."""

    codes: list[int]
    t_s: float
    force_key: bool
    taken_s: float


class LeftOver(NamedTuple):
    """A sample that was never sent. `number`: its position among all samples."""

    number: int
    t_s: float
    values: Sequence[float | None]


class Sampler:
    """Keeps the newest sample and hands it out as codes at the sampling rate. This is the only place where
    samples of a source faster than the ticks are dropped.

    `offer` and `force_key` may be called from other threads than `tick`.
    """

    def __init__(self, quantiser: Quantiser) -> None:
        self._quantiser = quantiser
        # Other threads only replace these two, and ticks remember which they have seen, so no lock is needed.
        self._newest: tuple[int, float, Offered, float] = (0, 0.0, (), NEVER)
        self._force = 1
        self._seen_sample = self._sent_sample = 0
        self._seen_force = 0
        self._codes: list[int] | None = None  # of the last frame
        self._sent_s = 0.0

    def offer(self, t_s: float, values: Offered, taken_s: float) -> None:
        """Replace the held sample. `values`: in channel order, or a function that returns them; `t_s`: robot
        time, and `taken_s`: when it came from the source, both in seconds."""
        self._newest = (self._newest[0] + 1, t_s, values, taken_s)

    @property
    def fresh(self) -> bool:
        """Whether the newest sample has not been sent yet."""
        return self._newest[0] != self._seen_sample

    def find_unsent(self, oldest_s: float) -> LeftOver | None:
        """The newest sample, if it was never sent and was taken before `oldest_s`; otherwise None."""
        number, t_s, values, taken_s = self._newest
        if number == self._sent_sample or taken_s >= oldest_s:
            return None
        return LeftOver(number, t_s, values() if callable(values) else values)

    def skip_sample(self) -> None:
        """Drop the newest sample, which can't be sent, and wait for the next."""
        self._seen_sample = self._newest[0]

    def force_key(self) -> None:
        """Make the next frame a KEY and send it even if nothing has changed, provided the source still
        delivers samples."""
        self._force += 1

    def tick(self, now_s: float, oldest_s: float = NEVER) -> Due | None:
        """What to send now. None without a new sample or while the codes do not change; unchanged codes are
        still sent every CONFIRM_S. Time and sequence number are not compared.

        A sample taken before `oldest_s` is not sent, because viewers would mistake it for a new one.
        """
        number, t_s, values, taken_s = self._newest
        force = self._force
        if number == self._seen_sample:
            return None
        if taken_s < oldest_s:
            self._seen_sample = number
            return None
        codes = self._quantiser.quantise(values() if callable(values) else values)
        force_key = force != self._seen_force
        if not force_key and codes == self._codes and now_s - self._sent_s < CONFIRM_S:
            return None
        self._seen_sample = self._sent_sample = number
        self._seen_force = force
        self._codes, self._sent_s = codes, now_s
        return Due(codes, t_s, force_key, taken_s)


# --- stream

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
        self, profile: Profile, key_interval_s: float, say: Callable[[str], None], says_unknown: bool = True
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
        self._newest_info: Mapping[str, str] = {}  # texts of the newest sample that had some
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
        last_info, self._newest_info = self._newest_info, sample.info
        if sample.info == last_info:  # the common case
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
            if last_info.get(name) == text:  # left out before
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
