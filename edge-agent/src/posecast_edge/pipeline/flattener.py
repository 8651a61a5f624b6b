"""Turns the values of a sample, given by name or in order, into one list in the schema's channel order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import inf
from operator import index
from typing import SupportsFloat, SupportsIndex, cast

from posecast_wire.schema import CODE_MAX, Field, Schema

from posecast_edge.kit import WORD_MAX, PartLog, make_visible, many, quote
from posecast_edge.sample import Reading, Sample

Flat = list[float | None]

MAX_NAMED = 50  # unknown names that are logged; a source could invent names for ever
_FLOATS = {float, type(None)}
_INTS = {int, type(None)}


class SampleFlattener:
    """Knows the position of each label of each field. Not thread-safe: the source's thread uses it."""

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
                if not most < abs(number) < inf:
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
