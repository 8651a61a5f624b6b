"""Where samples come from. A source reads; it never commands.

A kind of source is a module beside this one with two functions:

* `open_source(address, profile) -> Source`: `address` is what stands after `KIND:` ("" when nothing does);
  raises `SourceError` with one line when the address or the profile does not fit.
* `defaults() -> Defaults` (optional): the profile and URDF the kind brings when the user gives none.
"""

from __future__ import annotations

import importlib
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, cast

if TYPE_CHECKING:
    from posecast_edge.profile import Profile

# One channel of one sample. A number in the field's unit; None or NaN: no reading; flags: an int mask or
# a list of bit names.
Reading = float | int | Sequence[str] | None
Values = Sequence[Reading] | Mapping[str, Reading]

KINDS = ("jsonl", "trajectory", "demo")


class SourceError(Exception):
    """A source that cannot open or cannot go on. The text is one line for a person."""


@dataclass(frozen=True)
class Sample:
    """What the robot reported at one instant.

    `t_s`: the robot's clock, seconds. `values`: field name → values in the order of the field's labels, or by
    label; the source does not touch them again. `info`: strings that change rarely (mode, battery name).
    `where` it was read, for messages ("line 12").
    """

    t_s: float
    values: Mapping[str, Values]
    info: Mapping[str, str] = field(default_factory=dict)
    where: str = ""


@dataclass(frozen=True)
class Defaults:
    """What a kind of source brings itself."""

    profile: Path | None = None
    urdf: Path | None = None
    model: Path | None = None  # the URDF, built; goes before it


class Source(Protocol):
    """Delivers samples from a thread of its own, at its own pace."""

    description: str

    def run(self, deliver: Callable[[Sample], None], stop: threading.Event) -> None:
        """Deliver every sample until the data ends or `stop` is set. Raises SourceError (one line)."""


class _Kind(Protocol):
    def open_source(self, address: str, profile: Profile | None) -> Source: ...


def split_spec(spec: str) -> tuple[str, str]:
    """`KIND[:ADDRESS]` → (kind, address). SourceError names the kinds when the kind is unknown."""
    kind, _, address = spec.partition(":")
    if kind not in KINDS:
        raise SourceError(f"unknown source {kind!r}: one of {', '.join(KINDS)}")
    return kind, address


def defaults_of(spec: str) -> Defaults:
    """The profile and URDF that the kind of `spec` brings itself. SourceError when the kind is unknown."""
    module = importlib.import_module(f"{__name__}.{split_spec(spec)[0]}")
    defaults = getattr(module, "defaults", Defaults)
    return cast(Defaults, defaults())


def open_source(spec: str, profile: Profile | None) -> Source:
    """Open `KIND[:ADDRESS]`. SourceError (one line) when the kind is unknown or the address does not open."""
    kind, address = split_spec(spec)
    module = cast(_Kind, importlib.import_module(f"{__name__}.{kind}"))
    return module.open_source(address, profile)
