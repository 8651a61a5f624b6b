"""The channels of a robot without a profile: those of its first sample, and those that later samples add.
Does no I/O; time is an argument.

Each addition gives viewers a new schema. So new names wait up to GROW_EVERY_S for others, and the number of
additions is limited, in case a source keeps inventing names. What can't become a channel is left out and
reported once, by its name; the rest of the sample counts.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from posecast_wire.checked import TEXT_MAX, is_text
from posecast_wire.schema import BITS_MAX, CHANNELS_MAX, FIELD_NAME, TEXT_BYTES_MAX, SchemaError

from posecast_edge.kit import many, quote
from posecast_edge.profile.defaults import DIAG_BITS, JOINT_FIELDS
from posecast_edge.profile.schema import (
    DIAG,
    FLAGS,
    MASK_BITS,
    MASKS,
    infer_profile,
    list_bits,
    make_schema_text,
)
from posecast_edge.profile.types import Profile
from posecast_edge.sample import Reading, Sample, SourceError, Values

GROW_EVERY_S = 1.0
GROWTHS_MAX = 32  # additions to one field
FIELDS_MAX = 128
GROWN_BYTES_MAX = 1 << 20  # of all schemas that additions made
NAMES_BYTES_MAX = TEXT_BYTES_MAX - (1 << 14)  # of the labels in one schema; fields and sensors take the rest
WAITING_MAX = 64  # names that wait although the newest sample lacks them
LARGE = CHANNELS_MAX // 4  # new labels of a field
LEFT_OUT_MAX = 2 * CHANNELS_MAX  # names
BITS_LOOKED_AT = 2 * BITS_MAX  # of one reading
NO_FIELD = ""  # of bits that are left out
REPORTS_MAX = 50
BAD_FIELD = "a field's name has letters, digits and _, no digit first"
BAD_NAME = f"a name has 1 to {TEXT_MAX} characters, none of them a control character"
TOO_MANY_FIELDS = f"new fields are left out: a robot has at most {FIELDS_MAX}"
TOO_LARGE = f"a robot has at most {CHANNELS_MAX} channels and {NAMES_BYTES_MAX >> 10} KiB of names"
TOO_OFTEN = f"new names came {GROWTHS_MAX} times"
TOO_MUCH = f"the schemas of all additions take {GROWN_BYTES_MAX >> 20} MiB"

Labels = Mapping[str, None]  # in order


@dataclass(frozen=True)
class _Channels:
    """`fields`: field → labels; all fields of joints have the same. `lists`: field → the labels of its list,
    if it comes as one. `bits`: the bits that the robot has named in its flags, and the MASK_BITS of those
    that it has set in a mask."""

    fields: Mapping[str, Labels]
    lists: Mapping[str, tuple[str, ...]]
    bits: Labels

    @property
    def joints(self) -> Labels:
        return next((labels for name, labels in self.fields.items() if name in JOINT_FIELDS), {})

    def add_labels(self, name: str, labels: Iterable[str]) -> _Channels:
        """With these labels in this field, which may be new."""
        if name not in JOINT_FIELDS:
            own = {**self.fields.get(name, {}), **dict.fromkeys(labels)}
            return replace(self, fields={**self.fields, name: own})
        joints = {**self.joints, **dict.fromkeys(labels)}
        fields = {n: joints if n in JOINT_FIELDS else own for n, own in self.fields.items()}
        return replace(self, fields={**fields, name: joints})

    def is_too_large(self) -> bool:
        """Whether no schema has room for these channels."""
        sets = [self.joints, *(labels for name, labels in self.fields.items() if name not in JOINT_FIELDS)]
        size = sum(len(label.encode()) + len('"",') for labels in sets for label in labels)
        return sum(map(len, self.fields.values())) > CHANNELS_MAX or size > NAMES_BYTES_MAX


class InferredChannels:
    """`profile`: the channels so far; None before the first. `say` is called with a line for each name that
    is left out. `sliding`: joints that slide, according to the robot's model; may be set from any thread."""

    def __init__(self, robot: str, say: Callable[[str], None]) -> None:
        self.profile: Profile | None = None
        self.sliding: frozenset[str] = frozenset()
        self._robot, self._say = robot, say
        self._channels = _Channels({}, {}, {})
        self._newest = Sample(0.0, {})  # with new names; its links and sliding joints count
        self._waiting: dict[tuple[str, str], None] = {}  # field, label
        self._waiting_lists: dict[str, tuple[str, ...]] = {}
        self._waiting_bits: dict[str, None] = {}
        self._left_out: set[tuple[str, str]] = set()  # valid names for which there is no room
        self._closed: set[str] = set()  # fields that get no more labels
        self._full = False  # there are no more additions at all
        self._sliding = self.sliding  # what `profile` was made with
        self._growths: Counter[str] = Counter()
        self._grown_s = -math.inf
        self._grown_bytes = 0
        self._reported: set[str] = set()

    def take(self, sample: Sample, now_s: float) -> Sample:
        """Learn the names of a sample that arrives at `now_s` (seconds). Returns the sample to show: in it, a
        list that is shorter than its field by now is a mapping by label, and a mask of a robot that names its
        bits is a list of names."""
        if not self._full:
            self._find_new(sample)
        if self._waiting or self._waiting_lists or self._waiting_bits or self.sliding is not self._sliding:
            self.grow(now_s)
        sample = self._label_lists(sample) if self._channels.lists else sample
        return self._name_masks(sample) if FLAGS in sample.values else sample

    def grow(self, now_s: float = math.inf) -> None:
        """Add the names that wait, unless others were added less than GROW_EVERY_S before `now_s`. A change
        of `sliding` counts at once, and so does a bit: a fault may last no longer than this sample, and a
        field has at most BITS_MAX of them."""
        is_due = now_s - self._grown_s >= GROW_EVERY_S or bool(self._waiting_bits)
        slides_otherwise = self.sliding is not self._sliding
        if not is_due and not slides_otherwise:
            return
        self._sliding = self.sliding
        news = self._take_waiting() if is_due else {}
        bits = list(self._waiting_bits)
        channels = self._channels
        for name in sorted(news, key=lambda name: len(news[name]) > LARGE):  # these last: they may not fit
            fitting = self._find_fitting(channels, name, news[name])
            if fitting:
                channels = channels.add_labels(name, fitting)
        if is_due:
            channels = self._add_bits(self._add_lists(channels))
            if self.profile is not None:
                self._grown_s = now_s
        if not channels.fields or (channels is self._channels and not slides_otherwise):
            return
        try:
            profile = self._infer(channels)
            size = len(make_schema_text(profile))
        except (SourceError, SchemaError) as e:
            self._report(f"new names are left out: {e}")
            for name, labels in news.items():
                self._leave_out(name, labels)
            self._leave_out(NO_FIELD, bits)
            return
        self._grown_s = now_s if is_due else self._grown_s
        self._grown_bytes += size if self.profile else 0
        self._growths.update(news.keys() & channels.fields.keys())
        self.profile, self._channels = profile, channels

    # --- what is new in a sample

    def _find_new(self, sample: Sample) -> None:
        if len(self._waiting) > WAITING_MAX:
            self._waiting.clear()
        waiting = len(self._waiting)
        lists = []
        for name, values in sample.values.items():
            known = self._channels.fields.get(name)
            if name in (FLAGS, DIAG):
                self._find_bits(name, values, sample)
            if not isinstance(values, Mapping):
                if known is None and name not in self._waiting_lists:
                    lists.append(name)
                continue
            if (known is None or not values.keys() <= known.keys()) and name not in self._closed:
                self._find_labels(name, values, known, sample)
        for name in lists:
            self._find_list(name, len(sample.values[name]), sample)
        if len(self._waiting) > waiting:
            links = {**sample.links, **self._newest.links}
            self._newest = sample._replace(links=links, sliding=sample.sliding | self._newest.sliding)

    def _find_labels(
        self, name: str, values: Mapping[str, Reading], known: Labels | None, sample: Sample
    ) -> None:
        if known is None:
            if not (isinstance(name, str) and FIELD_NAME.fullmatch(name)):
                self._report(f"{quote(name)} is left out: {BAD_FIELD}", sample)
                return
            if len(self._channels.fields) >= FIELDS_MAX:
                self._report(TOO_MANY_FIELDS, sample)
                return
        for label in values:
            if (known is not None and label in known) or (name, label) in self._left_out:
                continue
            if is_text(label):
                self._waiting[name, label] = None
            elif len(self._reported) < REPORTS_MAX:
                self._report(f"{name} of {quote(label)} is left out: {BAD_NAME}", sample)

    def _find_list(self, name: str, count: int, sample: Sample) -> None:
        """A list without names is that of the joints so far, if it is as long."""
        if name in JOINT_FIELDS:
            new = (label for field, label in self._waiting if field in JOINT_FIELDS)
            joints = tuple({**self._channels.joints, **dict.fromkeys(new)})
            if joints and count == len(joints):
                self._waiting_lists[name] = joints
                return
        self._report(f"{quote(name)} is left out: {_describe_unnamed(count)}", sample)

    def _find_bits(self, name: str, values: Values, sample: Sample) -> None:
        bits: Collection[str] = DIAG_BITS if name == DIAG else self._channels.bits
        for reading in values.values() if isinstance(values, Mapping) else values:
            for bit in list_bits(reading, BITS_LOOKED_AT):
                if bit in bits or bit in self._waiting_bits or (NO_FIELD, bit) in self._left_out:
                    continue
                if name == DIAG:
                    why = f"the bits are {', '.join(bits)}"
                elif not is_text(bit):
                    why = BAD_NAME
                elif len(bits) + len(self._waiting_bits) >= BITS_MAX:
                    why = f"a field has at most {BITS_MAX} bits"
                else:
                    self._waiting_bits[bit] = None
                    continue
                if len(self._reported) < REPORTS_MAX:
                    self._report(f"the bit {quote(bit)} of {name} is left out: {why}", sample)

    # --- what is added

    def _take_waiting(self) -> dict[str, list[str]]:
        """The new labels of each field."""
        news: dict[str, list[str]] = {}
        for name, label in self._waiting:
            news.setdefault(name, []).append(label)
        self._waiting.clear()
        return news

    def _find_fitting(self, channels: _Channels, name: str, labels: Sequence[str]) -> Sequence[str]:
        """The first of the labels, as many as fit in. The rest is reported and left out from now on."""
        if name not in channels.fields and len(channels.fields) >= FIELDS_MAX:
            self._report(TOO_MANY_FIELDS)
            return ()
        fitting = 0
        if self._grown_bytes >= GROWN_BYTES_MAX:
            self._full, why = True, TOO_MUCH
        elif self._growths[name] > GROWTHS_MAX:
            self._closed.add(name)
            why = TOO_OFTEN
        elif channels.add_labels(name, labels).is_too_large():
            numbers = range(len(labels))  # of labels; one more than the last that fits is too many
            is_too_many = bisect_left(
                numbers, True, key=lambda n: channels.add_labels(name, labels[:n]).is_too_large()
            )
            fitting, why = max(is_too_many - 1, 0), TOO_LARGE
        else:
            return labels
        rest = labels[fitting:]
        more = f" and {len(rest) - 1} more are" if len(rest) > 1 else " is"
        self._report(f"{name} of {quote(rest[0])}{more} left out: {why}")
        self._leave_out(name, rest)
        return labels[:fitting]

    def _leave_out(self, name: str, labels: Sequence[str]) -> None:
        if len(self._left_out) + len(labels) <= LEFT_OUT_MAX:
            self._left_out.update((name, label) for label in labels)
        else:
            self._closed.add(name)
            self._full = self._full or len(self._closed) > FIELDS_MAX

    def _add_lists(self, channels: _Channels) -> _Channels:
        for name, labels in self._waiting_lists.items():
            known = all(label in channels.joints for label in labels)
            if known and self._find_fitting(channels, name, labels) == labels:
                channels = channels.add_labels(name, ())
                channels = replace(channels, lists={**channels.lists, name: labels})
        self._waiting_lists.clear()
        return channels

    def _add_bits(self, channels: _Channels) -> _Channels:
        if not self._waiting_bits:
            return channels
        new, self._waiting_bits = self._waiting_bits, {}
        return replace(channels, bits={**channels.bits, **new})

    def _infer(self, channels: _Channels) -> Profile:
        values: dict[str, Values] = {name: dict.fromkeys(labels) for name, labels in channels.fields.items()}
        if FLAGS in values:
            values[FLAGS] = dict.fromkeys(channels.fields[FLAGS], tuple(channels.bits))
        return infer_profile(self._robot, self._newest._replace(values=values), self._sliding)

    # --- lists and masks

    def _label_lists(self, sample: Sample) -> Sample:
        """Give the lists by label that are not as long as their field, and leave out those of another length
        than at first."""
        values: dict[str, Values] = {}
        for name, labels in self._channels.lists.items():
            given = sample.values.get(name)
            if given is None or isinstance(given, Mapping):
                continue
            if len(given) != len(labels):
                values[name] = {}
                self._report(f"{name} is left out: {_describe_unnamed(len(given))}", sample)
            elif len(labels) < len(self._channels.fields[name]):
                values[name] = dict(zip(labels, given, strict=True))
        return sample._replace(values={**sample.values, **values}) if values else sample

    def _name_masks(self, sample: Sample) -> Sample:
        """Replace masks by the names of their bits if other bits have names: the robot's names must not get
        numbers that the robot did not give them, or it would be said to have faults that it never named."""
        flags = sample.values[FLAGS]
        readings = flags.values() if isinstance(flags, Mapping) else flags
        if not any(type(reading) is int and reading for reading in readings):
            return sample
        if not self._channels.bits.keys() - MASK_BITS.keys():
            return sample  # the bits have their numbers
        named = [list(list_bits(r)) if type(r) is int and r in MASKS else r for r in readings]
        new: Values = dict(zip(flags, named, strict=True)) if isinstance(flags, Mapping) else named
        return sample._replace(values={**sample.values, FLAGS: new})

    def _report(self, text: str, sample: Sample | None = None) -> None:
        if text in self._reported or len(self._reported) >= REPORTS_MAX:
            return
        self._reported.add(text)
        where = f"{sample.where}: " if sample is not None and sample.where else ""
        more = "; further names are not reported" if len(self._reported) == REPORTS_MAX else ""
        self._say(f"{where}{text}{more}")


def _describe_unnamed(count: int) -> str:
    return f"it has {many(count, 'value')} without names; name them, or give a profile"
