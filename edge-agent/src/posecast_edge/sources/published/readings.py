"""What a program publishes: its values are copied in its own thread, and a one-place buffer keeps the newest
of them for the thread that sends."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import islice
from operator import index
from typing import NamedTuple, cast

from posecast_wire.schema import BITS_MAX, CHANNELS_MAX

from posecast_edge.kit import many, quote
from posecast_edge.sample import WORDS, Reading
from posecast_edge.sources.base import has_lists, split_lists
from posecast_edge.sources.merge import STATE_S, STREAM_S, LatestReadings

SHOWN = 40  # characters of a value in a message
BASE, BASEQ = ("base.x", "base.y", "base.z"), ("base.x", "base.y", "base.z", "base.w")
NAMES_MAX = 2 * CHANNELS_MAX  # of one field of one call; the agent shows as many as fit
FIELDS_MAX = 256  # fields whose labels are remembered
_FLOATS = frozenset((float, type(None)))


class UnusableError(ValueError):
    """Values of one field that can't be read at all; the text gives the reason."""


class Copied(NamedTuple):
    """One field of one call. It is never changed."""

    name: str
    labels: tuple[str, ...]
    readings: Sequence[Reading]


class ReadingsCopier:
    """Copies the values that a program passes, in the program's thread: afterwards the program may change
    them.

    The usual cases (a dict of floats, a NumPy array) take a few microseconds; values are checked one by one
    only if something is unusual. NumPy is not imported: any object with `shape` and `tolist` is read as an
    array.

    `orders`: field → labels, in the order of a list; `bit_fields`: the fields with masks or
    lists of names; `report` is called with a line for each problem. May be used from any thread.
    """

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
        unreadable value is reported and becomes None. Raises UnusableError when nothing can be read."""
        if type(values) is dict or isinstance(values, Mapping):
            return self._copy_mapping(name, values)
        if isinstance(values, (*WORDS, set, frozenset)) or not hasattr(values, "__len__"):
            raise UnusableError(f"{name} is {_describe(values)}: give a dict by name, a list or an array")
        order = self._orders.get(name, ())
        return self._check_readings(name, order, _copy_list(name, values, order))

    def _copy_mapping(self, name: str, values: Mapping[object, object]) -> Copied:
        known = self._labels.get(name)
        # another thread may change it meanwhile
        copied = values.copy() if type(values) is dict else dict(islice(values.items(), 2 * NAMES_MAX))
        if len(copied) > NAMES_MAX:
            self._report(f"{name} has more than {NAMES_MAX} names; the rest is left out")
            before = {label: copied[label] for label in known or () if label in copied}
            copied = dict(islice({**before, **copied}.items(), NAMES_MAX))  # those that were there stay
        labels = tuple(copied)
        if labels == known:
            labels = known
        elif not _are_texts(labels):
            for label in labels:
                if not _are_texts((label,)):
                    self._report(f"{name} has the name {quote(label, SHOWN)}, which is not a valid string")
                    del copied[label]
            labels = tuple(map(str, copied))
        elif len(self._labels) < FIELDS_MAX or name in self._labels:
            self._labels[name] = labels
        by_label = cast("Mapping[str, object]", copied)
        if has_lists(name, by_label):
            found = split_lists(name, by_label, lambda _site, text: self._report(text))
            return self._check_readings(name, tuple(found), list(found.values()))
        return self._check_readings(name, labels, list(copied.values()))

    def _check_readings(self, name: str, labels: tuple[str, ...], values: list[object]) -> Copied:
        if name in self._bit_fields:
            return Copied(
                name, labels, [self._read_bits(name, *pair) for pair in zip(labels, values, strict=True)]
            )
        kinds = set(map(type, values))
        if not kinds <= _FLOATS:
            try:
                if any(issubclass(kind, WORDS) for kind in kinds):
                    raise TypeError
                values = [None if value is None else float(value) for value in values]  # type: ignore[arg-type]
            except Exception:  # a foreign __float__ may raise anything; find the value that did
                values = [self._read(name, *pair, _number) for pair in zip(labels, values, strict=True)]
        return Copied(name, labels, values)  # type: ignore[arg-type]

    def _read_bits(self, name: str, label: str, value: object) -> Reading:
        if not isinstance(value, (list, tuple, set, frozenset)):
            return self._read(name, label, value, _mask)
        items = list(islice(value, CHANNELS_MAX))
        names = [item for item in items if isinstance(item, str)]
        for item in items if len(names) < len(items) else ():
            if not isinstance(item, str):
                self._report(f"{name} of {quote(label)} has {_describe_item(item)}, not the name of a bit")
        return sorted(names)

    def _read(self, name: str, label: str, value: object, read: Callable[[object], Reading]) -> Reading:
        try:
            return read(value)
        except Exception:  # a foreign __float__ or __index__ may raise anything
            wanted = "a number" if read is _number else "a mask or a list of names"
            self._report(f"{name} of {quote(label)} is {_describe(value)}, not {wanted}")
            return None


def copy_base(values: object) -> list[Copied]:
    """Copy the root link's pose: x, y, z in metres, then a quaternion x, y, z, w. Raises UnusableError."""
    numbers: list[Reading] = []
    try:
        if isinstance(values, (Mapping, *WORDS)):
            raise TypeError
        most = len(BASE) + len(BASEQ) + 1
        numbers = [_number(v) for v in islice(values, most)]  # type: ignore[call-overload]
    except Exception:
        numbers = []
    if len(numbers) != len(BASE) + len(BASEQ):
        raise UnusableError("base: give 7 numbers, x, y, z in metres and a quaternion x, y, z, w")
    return [Copied("base", BASE, numbers[:3]), Copied("baseq", BASEQ, numbers[3:])]


def _copy_list(name: str, values: object, order: Sequence[str]) -> list[object]:
    size = len(order)
    if not size:
        raise UnusableError(f"{name} is a list without names: give joints=[…], or use a dict by name")
    shape = getattr(values, "shape", None)
    if isinstance(shape, tuple):
        if shape != (size,):
            raise UnusableError(f"{name} has the shape {quote(tuple(shape), SHOWN)}, not ({size},)")
        copied = values.tolist()  # type: ignore[attr-defined]
    else:
        copied = list(islice(values, size + 1)) if len(values) == size else values  # type: ignore[arg-type, call-overload]
    if len(copied) != size:
        raise UnusableError(f"{name} has {many(len(copied), 'value')}, not {size}")
    return list(copied)


def _number(value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, WORDS):
        raise TypeError
    return float(value)  # type: ignore[arg-type]


def _mask(value: object) -> int | None:
    if value is None:
        return None
    if isinstance(value, bool) or not 0 <= (mask := index(value)) < 1 << BITS_MAX:  # type: ignore[arg-type]
        raise ValueError
    return mask


def _are_texts(labels: tuple[object, ...]) -> bool:
    """Whether all are strings that can be sent: without lone surrogates."""
    try:
        "".join(labels).encode()  # type: ignore[arg-type]
    except (TypeError, UnicodeEncodeError):
        return False
    return True


def _describe(value: object) -> str:
    """Describe a value so that the message is the same each time: only strings are quoted."""
    return quote(value, SHOWN) if isinstance(value, (str, bytes)) else f"of type {type(value).__name__}"


def _describe_item(item: object) -> str:
    return "None" if item is None else f"an item of type {type(item).__name__}"


# --- the buffer

Readings = dict[str, Reading]  # by label

PUBLISHERS_MAX = 64  # combinations of a field and its labels
KEPT_MAX = 64
STREAMS = frozenset(("pos", "vel", "effort", "base", "baseq", "ftf", "ftm", "quat", "tilt", "gyro", "acc"))
FLAGS = "flags"


class Taken(NamedTuple):
    """The content of the slot. `t_s`: the robot's time, seconds. `flags`: (robot time, readings) of flags
    that were replaced before they were read, the oldest first."""

    t_s: float
    values: dict[str, Readings]
    info: Mapping[str, str]
    flags: list[tuple[float, Readings]]


class PublishedSlot:
    """A one-place buffer between the program that publishes and the thread that sends: the newest readings
    win.

    A program may write here at 1 kHz; the reader takes the content when a frame is due. Readings that a call
    leaves out keep their value for a while. So positions and temperatures, or left and right arm, may come at
    different rates and from different threads. Only faults are not replaced: changed flags are kept, the
    newest KEPT_MAX of them, and checked one by one.

    Any thread may call `put`; one thread calls `take` and `wait`. Times are seconds of kit.now_s(), `t_s` is
    the robot's.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bell = threading.Event()
        self._waiting = False
        self._fresh = False
        self._t_s = 0.0
        self._last = LatestReadings[Sequence[Reading]](PUBLISHERS_MAX)  # by field
        self._info: Mapping[str, str] = {}
        self._flags: deque[tuple[float, Readings]] = deque(maxlen=KEPT_MAX)
        self.published = 0  # calls

    def put(self, t_s: float, copies: Sequence[Copied], info: Mapping[str, str], now_s: float) -> None:
        """Replace these readings and texts."""
        with self._lock:
            self.published += 1
            for name, labels, readings in copies:
                life_s = STREAM_S if name in STREAMS else STATE_S
                before = self._last.replace(name, labels, readings, life_s, now_s)
                if name == FLAGS and self._fresh and before is not None and before != readings:
                    self._flags.append((self._t_s, dict(zip(labels, before, strict=True))))
            if info:
                self._info = info
            self._t_s, self._fresh = t_s, True
            wake, self._waiting = self._waiting, False
        if wake:
            self._bell.set()

    def wait(self, seconds: float) -> None:
        """Return when there is something new, or after `seconds`. `put` wakes only a waiting reader, so at
        most one call per frame has that cost."""
        with self._lock:
            if self._fresh:
                return
            self._bell.clear()
            self._waiting = True
        self._bell.wait(seconds)

    def take(self, now_s: float) -> Taken | None:
        """All valid readings; None when nothing has been published since the last call."""
        with self._lock:
            if not self._fresh:
                return None
            self._fresh = False
            values: dict[str, Readings] = {}
            for name, labels, readings in self._last.list_valid(now_s):
                values.setdefault(name, {}).update(zip(labels, readings, strict=True))
            flags = list(self._flags)
            self._flags.clear()
            return Taken(self._t_s, values, self._info, flags)
