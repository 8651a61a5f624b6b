"""Copies what a program hands over, in the program's own thread: afterwards the program may change it.

The usual cases (a dict of floats, a numpy array) take a few microseconds; each value is looked at only where
something is unusual. numpy is not imported: whatever has `shape` and `tolist` is read as an array.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import islice
from operator import index
from typing import NamedTuple, cast

from posecast_wire.schema import BITS_MAX, CHANNELS_MAX

from posecast_edge.sample import Reading
from posecast_edge.visible import quote

SHOWN = 40  # characters of a value in a message
WORDS = (str, bytes, bytearray, bool)  # float() takes them, and who wrote them meant no number
# what of a sensor a sequence holds, part by part
PARTS = {
    "ftf": ("fx", "fy", "fz"),
    "ftm": ("mx", "my", "mz"),
    "quat": ("x", "y", "z", "w"),
    "gyro": ("x", "y", "z"),
    "acc": ("x", "y", "z"),
}
BASE, BASEQ = ("base.x", "base.y", "base.z"), ("base.x", "base.y", "base.z", "base.w")
FIELDS_MAX = 256  # whose labels are remembered
_FLOATS = frozenset((float, type(None)))


class UnusableError(ValueError):
    """Values of one field that can't be read at all; the text says why."""


class Copied(NamedTuple):
    """One field of one call. Nobody changes it any more."""

    name: str
    labels: tuple[str, ...]
    readings: Sequence[Reading]


class ReadingsCopier:
    """`orders`: field → whose values a list holds; `bit_fields`: those whose readings are masks or lists of
    names; `report` takes lines about what is wrong. May be used from any thread."""

    def __init__(
        self,
        orders: Mapping[str, tuple[str, ...]],
        bit_fields: Collection[str],
        report: Callable[[str], None],
    ) -> None:
        self._orders, self._bit_fields, self._report = orders, frozenset(bit_fields), report
        self._labels: dict[str, tuple[str, ...]] = {}  # of each field's newest mapping

    def copy_field(self, name: str, values: object) -> Copied:
        """Copy the values of one field: a mapping by label, or a list or array in the field's order. A single
        value that is no reading is reported and becomes None. Raises UnusableError when nothing can be
        read."""
        if type(values) is dict or isinstance(values, Mapping):
            return self._copy_mapping(name, values)
        if isinstance(values, (*WORDS, set, frozenset)) or not hasattr(values, "__len__"):
            raise UnusableError(f"{name} is {_describe(values)}: want a dict by name, a list or an array")
        order = self._orders.get(name, ())
        return self._check_readings(name, order, _copy_list(name, values, order))

    def _copy_mapping(self, name: str, values: Mapping[object, object]) -> Copied:
        if len(values) > CHANNELS_MAX:
            raise UnusableError(f"{name} names over {CHANNELS_MAX} channels")
        # another thread may be changing it
        copied = values.copy() if type(values) is dict else dict(islice(values.items(), CHANNELS_MAX))
        known = self._labels.get(name)
        labels = tuple(copied)
        if labels == known:
            labels = known
        elif not _are_texts(labels):
            for label in labels:
                if not _are_texts((label,)):
                    self._report(f"{name} names {quote(label, SHOWN)}: a name is a text")
                    del copied[label]
            labels = tuple(map(str, copied))
        elif len(self._labels) < FIELDS_MAX or name in self._labels:
            self._labels[name] = labels
        if name in PARTS and any(hasattr(value, "__len__") for value in copied.values()):
            return self._copy_sites(name, copied)
        return self._check_readings(name, labels, list(copied.values()))

    def _copy_sites(self, name: str, values: Mapping[object, object]) -> Copied:
        """`{"wrist": (1, 2, 3)}` as `{"wrist.fx": 1, …}`."""
        parts = PARTS[name]
        found: dict[str, object] = {}
        for site, value in values.items():
            numbers = cast("Sequence[object]", value)
            if not hasattr(value, "__len__") or isinstance(value, (Mapping, *WORDS)):
                found[str(site)] = value
            elif len(numbers) != len(parts):
                self._report(f"{name} of {quote(site)}: want {len(parts)} numbers, {', '.join(parts)}")
            else:
                found |= zip((f"{site}.{part}" for part in parts), numbers, strict=False)
        return self._check_readings(name, tuple(found), list(found.values()))

    def _check_readings(self, name: str, labels: tuple[str, ...], values: list[object]) -> Copied:
        if name in self._bit_fields:
            return Copied(
                name, labels, [self._read(name, *pair, _mask) for pair in zip(labels, values, strict=True)]
            )
        kinds = set(map(type, values))
        if not kinds <= _FLOATS:
            try:
                if any(issubclass(kind, WORDS) for kind in kinds):
                    raise TypeError
                values = [None if value is None else float(value) for value in values]  # type: ignore[arg-type]
            except Exception:  # whatever a stranger's __float__ raises: which one is it?
                values = [self._read(name, *pair, _number) for pair in zip(labels, values, strict=True)]
        return Copied(name, labels, values)  # type: ignore[arg-type]

    def _read(self, name: str, label: str, value: object, read: Callable[[object], Reading]) -> Reading:
        try:
            return read(value)
        except Exception:  # the same
            wanted = "a number" if read is _number else "a mask or a list of names"
            self._report(f"{name} of {quote(label)} is {_describe(value)}, not {wanted}")
            return None


def copy_base(values: object) -> list[Copied]:
    """Copy where the root link is: x, y, z in metres, then a quaternion x, y, z, w. Raises UnusableError."""
    numbers: list[Reading] = []
    try:
        if isinstance(values, (Mapping, *WORDS)):
            raise TypeError
        most = len(BASE) + len(BASEQ) + 1
        numbers = [_number(v) for v in islice(values, most)]  # type: ignore[call-overload]
    except Exception:
        numbers = []
    if len(numbers) != len(BASE) + len(BASEQ):
        raise UnusableError("base: want 7 numbers, x, y, z in metres and a quaternion x, y, z, w")
    return [Copied("base", BASE, numbers[:3]), Copied("baseq", BASEQ, numbers[3:])]


def _copy_list(name: str, values: object, order: Sequence[str]) -> list[object]:
    size = len(order)
    if not size:
        raise UnusableError(f"{name} is a list, and nobody said whose: joints=[…], or a dict by name")
    shape = getattr(values, "shape", None)
    if isinstance(shape, tuple):
        if shape != (size,):
            raise UnusableError(f"{name} has the shape {quote(tuple(shape), SHOWN)}, want ({size},)")
        copied = values.tolist()  # type: ignore[attr-defined]
    else:
        copied = list(islice(values, size + 1)) if len(values) == size else values  # type: ignore[arg-type, call-overload]
    if len(copied) != size:
        raise UnusableError(f"{name} has {len(copied)} values, want {size}")
    return list(copied)


def _number(value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, WORDS):
        raise TypeError
    return float(value)  # type: ignore[arg-type]


def _mask(value: object) -> Reading:
    if value is None:
        return None
    if isinstance(value, (list, tuple, set, frozenset)):
        names = [name for name in islice(value, BITS_MAX + 1) if isinstance(name, str)]
        if len(names) != len(value):
            raise ValueError
        return sorted(names)
    if isinstance(value, bool) or not 0 <= (mask := index(value)) < 1 << BITS_MAX:  # type: ignore[arg-type]
        raise ValueError
    return mask


def _are_texts(labels: tuple[object, ...]) -> bool:
    """Whether all are strings without half a surrogate pair, which can't be sent."""
    try:
        "".join(labels).encode()  # type: ignore[arg-type]
    except (TypeError, UnicodeEncodeError):
        return False
    return True


def _describe(value: object) -> str:
    """For a message that is to be the same each time: without the value, unless that is what was mistyped."""
    return quote(value, SHOWN) if isinstance(value, (str, bytes)) else f"of type {type(value).__name__}"
