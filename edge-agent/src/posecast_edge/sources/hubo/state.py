"""Decodes `hubo_state`, the frame of the channel `hubo-state`, into values of the profile's fields. Pure.

Packed little-endian C structs of the daemon hubo-ach, the same for both robots; the daemon converts to SI. A
frame has no version number, but each version has its own length, from which this reader recognises it:

    imu[3] {a_x a_y a_z w_x w_y w_z}  ft[4] {m_x m_y f_z}
    joint[42] {ref comply pos cur vel duty heat tmp active zeroed}  status[42] {17 bytes}
    driver[54 or 38] {temp}  power {voltage current power}  time  refWait  multi

It runs once per frame, at 200 Hz, so masks are computed only when one of their bytes changes, and numbers are
unpacked only when their field is requested.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile
    from posecast_edge.sample import Values

# fmt: off
JOINTS = (  # by slot; slots 18 and 25 are not used
    "WST", "NKY", "NK1", "NK2", "LSP", "LSR", "LSY", "LEB", "LWY", "LWR", "LWP",
    "RSP", "RSR", "RSY", "REB", "RWY", "RWR", "RWP", "",
    "LHY", "LHR", "LHP", "LKN", "LAP", "LAR", "", "RHY", "RHR", "RHP", "RKN", "RAP", "RAR",
    "RF1", "RF2", "RF3", "RF4", "RF5", "LF1", "LF2", "LF3", "LF4", "LF5",
)
STATUS = (  # byte by byte
    "driverOn", "ctrlOn", "mode", "limitSwitch", "homeFlag", "jam", "pwmSaturated", "bigError", "encError",
    "driverFault", "motorFail0", "motorFail1", "posMinError", "posMaxError", "velError", "accError",
    "tempError",
)
# fmt: on
HOMED = {6}
HOMED_WRIST_ROLL = {6, 2}  # of a DRC-Hubo; a Hubo 2+ has none
WRIST_ROLLS = ("LWR", "RWR")
COMPLIANT = {1, 2}  # compliant, and on the way back to rigid
FINGERS = frozenset(name for name in JOINTS if name[1:2] == "F")
SITES_FT = ("RH", "LH", "RF", "LF")
SITES_IMU = ("RF", "LF", "torso")

IMU_SIZE, FT_SIZE, STATUS_SIZE = 48, 24, 17
JOINT_START = 3 * IMU_SIZE + 4 * FT_SIZE
SLOTS = len(JOINTS)
# bits of a mask, by name; `enabled` is called ctrlOn by other robots
BITS = ("homed", "enabled", "active", "comply", *(name for name in STATUS if name != "homeFlag"))


@dataclass(frozen=True)
class Layout:
    """One version of the struct. Offsets are in bytes; those of a joint count from the joint's first byte."""

    size: int
    joint_size: int
    joint_doubles: tuple[str, ...]  # f64 members in order
    comply: bool  # u8 after the first double
    power: int | None
    time: int

    @property
    def status(self) -> int:
        """Offset in the frame, bytes, at which the status bytes begin."""
        return JOINT_START + SLOTS * self.joint_size

    @property
    def active(self) -> int:
        """Offset in a joint's record, bytes, of its flag `active`."""
        return self.joint_size - 2

    def find_offset(self, double: str) -> int:
        """Offset in a joint's record, bytes, of its member `double`."""
        i = self.joint_doubles.index(double)
        return 8 * i + (self.comply if i else 0)


def _layout(comply: bool, duty: bool, drivers: int, power: bool, multi: bool) -> Layout:
    doubles = ("ref", "pos", "cur", "vel", *(("duty",) if duty else ()), "heat", "temp")
    joint_size = 8 * len(doubles) + comply + 2
    end = JOINT_START + SLOTS * (joint_size + STATUS_SIZE) + 8 * drivers
    time = end + (24 if power else 0)
    return Layout(time + 8 + 2 + multi, joint_size, doubles, comply, end if power else None, time)


# 2013-08 to 2015 (the last), back to 2013-03. The layout of the older 3,632 bytes is undocumented.
LAYOUTS = {
    layout.size: layout
    for layout in (
        _layout(comply=True, duty=True, drivers=54, power=True, multi=False),  # 3898
        _layout(comply=True, duty=True, drivers=54, power=False, multi=False),  # 3874
        _layout(comply=True, duty=True, drivers=54, power=False, multi=True),  # 3875
        _layout(comply=True, duty=True, drivers=38, power=False, multi=False),  # 3746
        _layout(comply=False, duty=True, drivers=38, power=False, multi=False),  # 3704
        _layout(comply=False, duty=False, drivers=38, power=False, multi=False),  # 3368
        _layout(comply=False, duty=False, drivers=38, power=False, multi=True),  # 3369
    )
}

JOINT_FIELDS = ("ref", "pos", "vel", "cur", "duty", "heat", "temp")
# other fields, channel by channel: which f64 of the frame's head (imu, ft), in order
_IMU_MEMBERS = {"tilt": {"roll": 0, "pitch": 1}, "gyro": {"x": 3, "y": 4}}
_FT_MEMBERS = {"ftm": {"mx": 0, "my": 1}, "ftf": {"fz": 2}}
HEAD = {
    name: {f"{site}.{c}": 6 * i + at for i, site in enumerate(SITES_IMU) for c, at in members.items()}
    for name, members in _IMU_MEMBERS.items()
} | {
    name: {f"{site}.{c}": 18 + 3 * i + at for i, site in enumerate(SITES_FT) for c, at in members.items()}
    for name, members in _FT_MEMBERS.items()
}
POWER = {"volt": 0, "amp": 1, "watt": 2}  # label `main`


class UnknownFrame(ValueError):
    """A frame whose length belongs to no known version."""


class HuboDecoder:
    """Decodes frames into values. Keeps masks and layouts of earlier frames; not thread-safe."""

    def __init__(self, profile: Profile | None) -> None:
        """With a profile, decodes its fields in the order of its labels; without one, everything by name.

        `self.unknown`: labels and bits of the profile that hubo-ach has no reading for, as `field.label`.
        """
        self.exact = profile is not None
        self.unknown: list[str] = []
        self._profile = profile
        self._plans: dict[int, _Plan] = {}

    def decode(self, frame: bytes) -> tuple[float, Mapping[str, Values]]:
        """Return robot time (seconds) and values. Raises UnknownFrame when no layout in LAYOUTS has the
        frame's length."""
        plan = self._plans.get(len(frame))
        if plan is None:
            layout = LAYOUTS.get(len(frame))
            if layout is None:
                known = ", ".join(map(str, sorted(LAYOUTS)))
                raise UnknownFrame(f"a frame of {len(frame)} bytes is not a known hubo_state ({known})")
            wanted = list_wanted_fields(self._profile)
            plan = self._plans[len(frame)] = _Plan(layout, wanted, named=self._profile is None)
            self.unknown = plan.unknown
        return plan.decode(frame)


@dataclass(frozen=True)
class Wanted:
    """One field to be filled. `bits`: bit names, not empty for a mask."""

    name: str
    labels: tuple[str, ...]
    bits: tuple[str, ...] = ()


def list_wanted_fields(profile: Profile | None) -> list[Wanted]:
    """The fields to fill: those of the profile that hubo-ach can provide, or all of them without a
    profile."""
    if profile is not None:
        offered = {*JOINT_FIELDS, *HEAD, *POWER}
        return [Wanted(f.name, f.labels, f.bits) for f in profile.fields if f.bits or f.name in offered]
    joints = tuple(name for name in JOINTS if name)
    return [
        *(Wanted(name, joints) for name in JOINT_FIELDS),
        *(Wanted(name, tuple(channels)) for name, channels in HEAD.items()),
        *(Wanted(name, ("main",)) for name in POWER),
        Wanted("flags", joints, BITS),
    ]


class _Plan:
    """How frames of one layout are read for one set of wanted fields."""

    def __init__(self, layout: Layout, wanted: Sequence[Wanted], named: bool) -> None:
        self._layout = layout
        self.unknown: list[str] = []
        self._time = struct.Struct("<d")
        self._marks: tuple[bytes, bytes, bytes] = (
            b"",
            b"",
            b"",
        )  # active, comply, status: of the masks below
        self._masks: dict[str, list[int | None]] = {}
        self._dead: frozenset[int] = frozenset()  # slots without a motor
        self._numbers: dict[str, _Numbers] = {}
        self._flags: list[tuple[Wanted, list[int | None]]] = []
        for field in wanted:
            self._take(field)
        self._labels = {field.name: field.labels for field in wanted} if named else None

    def _take(self, field: Wanted) -> None:
        slots = [JOINTS.index(label) if label in JOINTS and label else None for label in field.labels]
        layout = self._layout
        if field.bits:
            self._unknown(field, slots)
            self.unknown += [f"{field.name}: bit {bit}" for bit in field.bits if bit not in BITS]
            self._flags.append((field, slots))
        elif field.name in JOINT_FIELDS:
            self._unknown(field, slots)
            if field.name in layout.joint_doubles:
                # for fingers the daemon multiplies by its period instead of dividing: 40,000 times too fast
                wrong = FINGERS if field.name == "vel" else frozenset[str]()
                places = [None if s is None or JOINTS[s] in wrong else s for s in slots]
                before = layout.find_offset(field.name)
                one = f"{before}xd{layout.joint_size - before - 8}x"
                self._numbers[field.name] = numbers = _Numbers("<" + one * SLOTS, JOINT_START, places, True)
                # a board without a thermometer reports 0 °C
                numbers.zero_is_none = field.name == "temp"
        elif field.name in HEAD:
            heads = [HEAD[field.name].get(label) for label in field.labels]
            self._unknown(field, heads)
            used = [at for at in heads if at is not None] or [0]
            first, count = min(used), max(used) + 1 - min(used)
            places = [None if at is None else at - first for at in heads]
            self._numbers[field.name] = _Numbers(f"<{count}d", 8 * first, places)
        elif layout.power is not None:
            member = POWER[field.name]
            self._numbers[field.name] = _Numbers("<3d", layout.power, [member] * len(field.labels))

    def _unknown(self, field: Wanted, places: Sequence[int | None]) -> None:
        self.unknown += [
            f"{field.name}.{x}" for x, at in zip(field.labels, places, strict=True) if at is None
        ]

    def decode(self, frame: bytes) -> tuple[float, Mapping[str, Values]]:
        self._look_at_marks(frame)
        values: Mapping[str, Values] = Readings(frame, self._numbers, self._masks, self._dead)
        if self._labels is not None:
            values = {name: dict(zip(self._labels[name], values[name], strict=True)) for name in values}
        return self._time.unpack_from(frame, self._layout.time)[0], values

    def _look_at_marks(self, frame: bytes) -> None:
        """Update the masks and the joints without a motor, if one of their bytes has changed."""
        layout = self._layout
        status = frame[layout.status : layout.status + SLOTS * STATUS_SIZE]
        of_joint = slice(JOINT_START + layout.active, layout.status, layout.joint_size)
        active = frame[of_joint]
        comply = frame[JOINT_START + 8 : layout.status : layout.joint_size] if layout.comply else bytes(SLOTS)
        marks = (active, comply, status)
        if marks == self._marks:
            return
        self._marks = marks
        # a daemon marks the joints in its table; a simulator may mark none, which means all
        anyone = any(active)
        self._dead = dead = frozenset(s for s in range(SLOTS) if anyone and not active[s])
        of_slot = [
            _bits_of(JOINTS[s], active[s], comply[s], status[s * STATUS_SIZE : (s + 1) * STATUS_SIZE])
            for s in range(SLOTS)
        ]
        self._masks = {
            field.name: [None if s is None or s in dead else _mask(field.bits, of_slot[s]) for s in slots]
            for field, slots in self._flags
        }


class Readings(Mapping[str, "Values"]):
    """The fields of one frame. Numbers are unpacked only when requested: of 200 frames a second about 30 are
    sent."""

    __slots__ = ("_dead", "_frame", "_masks", "_numbers")

    def __init__(
        self,
        frame: bytes,
        numbers: Mapping[str, _Numbers],
        masks: Mapping[str, list[int | None]],
        dead: frozenset[int],
    ) -> None:
        self._frame = frame
        self._numbers = numbers
        self._masks = masks
        self._dead = dead

    def __getitem__(self, name: str) -> Values:
        if name in self._masks:
            return self._masks[name]
        return self._numbers[name].read(self._frame, self._dead)

    def get(self, name: str, default: Any = None) -> Any:
        """Same as Mapping.get, but in one step because it is called for every frame."""
        masks = self._masks.get(name)
        if masks is not None:
            return masks
        numbers = self._numbers.get(name)
        return default if numbers is None else numbers.read(self._frame, self._dead)

    def __iter__(self) -> Iterator[str]:
        yield from self._numbers
        yield from self._masks

    def __len__(self) -> int:
        return len(self._numbers) + len(self._masks)


def _bits_of(name: str, active: int, comply: int, status: bytes) -> set[str]:
    found = {bit for bit, byte in zip(STATUS, status, strict=True) if byte and bit != "homeFlag"}
    if status[STATUS.index("homeFlag")] in (HOMED_WRIST_ROLL if name in WRIST_ROLLS else HOMED):
        found.add("homed")
    if "ctrlOn" in found:
        found.add("enabled")
    if active:
        found.add("active")
    if comply in COMPLIANT:
        found.add("comply")
    return found


def _mask(bits: Sequence[str], present: set[str]) -> int:
    return sum(1 << i for i, bit in enumerate(bits) if bit in present)


class _Numbers:
    """The numbers of one field: unpacked by one struct, picked by one itemgetter."""

    def __init__(self, form: str, start: int, places: Sequence[int | None], per_slot: bool = False) -> None:
        """`places`: for each label the position of its number in the struct, None for none; `per_slot`: the
        positions are slots."""
        self._struct = struct.Struct(form)
        self._start = start
        self._places = places
        self._per_slot = per_slot
        self._get: Callable[[Any], Any] = itemgetter(*(0 if at is None else at for at in places))
        self._none = [i for i, at in enumerate(places) if at is None]
        self._dead: tuple[frozenset[int], list[int]] = (frozenset(), self._none)
        self._last: tuple[Any, frozenset[int], list[float | None]] = ((), frozenset(), [])
        self.zero_is_none = False

    def read(self, frame: bytes, dead: frozenset[int]) -> list[float | None]:
        numbers = self._struct.unpack_from(frame, self._start)
        last_numbers, last_dead, last = self._last
        if dead is last_dead and numbers == last_numbers:
            return last
        # itemgetter returns no tuple for a single item
        found = list(self._get(numbers)) if len(self._places) > 1 else [self._get(numbers)]
        for i in self._without(dead) if self._per_slot else self._none:
            found[i] = None
        if self.zero_is_none:
            found = [v or None for v in found]
        self._last = (numbers, dead, found)
        return found

    def _without(self, dead: frozenset[int]) -> list[int]:
        """Labels without a reading, given the slots without a motor."""
        known, found = self._dead
        if known is not dead:
            found = [i for i, at in enumerate(self._places) if at is None or at in dead]
            self._dead = (dead, found)
        return found
