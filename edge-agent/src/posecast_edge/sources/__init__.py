"""Where samples come from. A source reads; it never commands.

A kind of source is a module beside this one (`hubo-ach` is hubo_ach.py), listed in KINDS, with two functions:

* `open_source(address, profile) -> Source`: `address` is what stands after `KIND:` ("" when nothing does);
  raises `SourceError` with one line when the address or the profile does not fit.
* `defaults(address) -> Defaults` (optional): the profile and URDF the kind brings when the user gives none.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import TYPE_CHECKING, NamedTuple, Protocol, cast, runtime_checkable

if TYPE_CHECKING:
    from posecast_edge.profile import Profile

# One channel of one sample. A number in the field's unit; None or NaN: no reading; flags: an int mask or
# a list of bit names.
Reading = float | int | Sequence[str] | None
Values = Sequence[Reading] | Mapping[str, Reading]

KINDS = ("jsonl", "csv", "mcap", "trajectory", "mujoco", "demo", "hubo-ach", "ros2", "rosbridge")


TIME_MAX_S = 1e12  # robot time: beyond it milliseconds are lost in a double


class SourceError(Exception):
    """A source that cannot open or cannot go on. The text is one line for a person."""


NOTHING: Mapping[str, str] = MappingProxyType({})


class Sample(NamedTuple):
    """What the robot reported at one instant.

    `t_s`: the robot's clock, seconds. `values`: field name → values in the order of the field's labels, or by
    label; the source does not touch them again. `info`: strings that change rarely (mode, battery name).
    `where` it was read, for messages ("line 12"). `exact`: the source had a profile and keeps to it,
    with sequences of floats (masks: ints) and None in the order of its labels; then a field is asked for only
    when it is needed. `links`: site → link of the model, where the robot itself says where its sensors sit.
    `newest`: False when one that came after it follows at once; then it makes events, but no frame.
    """

    t_s: float
    values: Mapping[str, Values]
    info: Mapping[str, str] = NOTHING
    where: str = ""
    exact: bool = False
    links: Mapping[str, str] = NOTHING
    newest: bool = True


# Takes a sample. The answer: from when on (monotonic seconds) the next one would make a frame, None for at
# once. A source that can wait for several may sleep until then, but delivers them all: each is looked at for
# faults.
Deliver = Callable[[Sample], float | None]


@dataclass(frozen=True)
class Defaults:
    """What a kind of source brings itself."""

    profile: Path | None = None
    urdf: Path | None = None
    model: Path | None = None  # the URDF, built; goes before it


class Source(Protocol):
    """Delivers samples from a thread of its own, at its own pace."""

    description: str

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every sample until the data ends or `stop` is set. Raises SourceError (one line)."""


@runtime_checkable
class Discovering(Source, Protocol):
    """A source that finds out by itself what there is."""

    @property
    def offers(self) -> list[str]:
        """Lines for `probe`: what was found, and as what it is read."""

    def describe_to(self, take: Callable[[str], None]) -> None:
        """Hand every new robot_description (URDF) to `take`, which returns at once. Before `run`."""


class _Kind(Protocol):
    def open_source(self, address: str, profile: Profile | None) -> Source: ...


def split_spec(spec: str) -> tuple[str, str]:
    """`KIND[:ADDRESS]` → (kind, address). SourceError names the kinds when the kind is unknown."""
    kind, _, address = spec.partition(":")
    if kind not in KINDS:
        raise SourceError(f"unknown source {kind!r}: one of {', '.join(KINDS)}")
    return kind, address


def _module(kind: str) -> ModuleType:
    """Loaded only when wanted: a kind may bring what the others do without."""
    return importlib.import_module(f"{__name__}.{kind.replace('-', '_')}")


def defaults_of(spec: str) -> Defaults:
    """The profile and URDF that the kind of `spec` brings itself. SourceError when the kind is unknown."""
    kind, address = split_spec(spec)
    defaults = getattr(_module(kind), "defaults", None)
    return Defaults() if defaults is None else cast(Defaults, defaults(address))


def open_source(spec: str, profile: Profile | None) -> Source:
    """Open `KIND[:ADDRESS]`. SourceError (one line) when the kind is unknown or the address does not open."""
    kind, address = split_spec(spec)
    return cast(_Kind, _module(kind)).open_source(address, profile)
