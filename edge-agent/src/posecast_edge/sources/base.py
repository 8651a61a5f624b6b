"""The interface of a source. A source only reads from the robot and never commands it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast, runtime_checkable

from posecast_edge.kit import quote
from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.sample import WORDS, Sample, SourceError

# Takes a sample. Returns the time (monotonic seconds) from which the next sample would be sent as a frame;
# None: at once. A source that can collect samples may sleep until then, but must deliver all of them: each is
# checked for faults.
Deliver = Callable[[Sample], float | None]


@dataclass(frozen=True)
class Defaults:
    """The profile and model that a kind of source brings with it."""

    profile: Path | None = None
    urdf: Path | None = None
    model: Path | None = None  # the built model; preferred to the URDF


class Source(Protocol):
    """Delivers samples from its own thread, at its own pace."""

    description: str

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every sample until the data ends or `stop` is set. Raises SourceError (one line)."""


@runtime_checkable
class Discovering(Source, Protocol):
    """A source that discovers which data the robot offers."""

    @property
    def offers(self) -> list[str]:
        """Lines for `probe`: what was found, and how each is read."""

    def watch_frames(self) -> None:
        """Read the transforms of /tf even if no profile asks for them, so that `offers` can list their
        frames. Call it before `run`."""

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass every new robot_description (URDF text) to `take`, which must return at once. Call it before
        `run`."""

    def take_joints(self, joints: Sequence[MovingJoint]) -> None:
        """Take the joints of the shown model. They are read from /tf if no joint states arrive. May be called
        from any thread, also while the source runs."""

    def expect_joints(self) -> None:
        """The model is still being built, and `take_joints` will follow. A recording that has only transforms
        waits for it. Call it before `run`."""


@runtime_checkable
class Troubled(Source, Protocol):
    """A source that can tell viewers why no samples arrive."""

    @property
    def trouble(self) -> str:
        """A few words for the page, normally "". May be called from any thread."""


@runtime_checkable
class Tabular(Source, Protocol):
    """A source that reads named columns."""

    @property
    def columns(self) -> list[str]:
        """Lines for `probe`: what each column is read as, or why it is left out."""


# --- options after an address


def split_options(kind: str, address: str, known: Mapping[str, str]) -> tuple[str, dict[str, str]]:
    """Split `ADDRESS[?key=value&flag]` into the address and its options. `known`: option → what to write as
    its value, such as "SECONDS"; "" for one without. Raises SourceError with one line for any other."""
    address, _, words = address.partition("?")
    found: dict[str, str] = {}
    for word in words.split("&") if words else ():
        key, _, value = word.partition("=")
        if key not in known or (word != key and not known[key]):
            use = " and ".join(f"{key}={value}" if value else key for key, value in known.items())
            raise SourceError(f"{kind}: unknown option {word[:40]!r}; after ? use {use}")
        found[key] = value
    return address, found


def to_seconds(kind: str, key: str, value: str) -> float:
    """A number of seconds, 0 or more. Raises SourceError with one line."""
    try:
        value_s = float(value)
    except ValueError:
        value_s = math.nan
    if not 0 <= value_s < math.inf:
        raise SourceError(f"{kind}: {key}={value[:40]!r} is not a number of seconds")
    return value_s


# --- sensors whose parts a program gives as a list

# field of a sensor → the parts of its list
PARTS = {
    "ftf": ("fx", "fy", "fz"),
    "ftm": ("mx", "my", "mz"),
    "quat": ("x", "y", "z", "w"),
    "gyro": ("x", "y", "z"),
    "acc": ("x", "y", "z"),
}


def has_lists(name: str, values: Mapping[str, object]) -> bool:
    """Whether the field is that of a sensor, and any of its values is a list or an array."""
    return name in PARTS and any(hasattr(value, "__len__") for value in values.values())


def split_lists(
    name: str, values: Mapping[str, object], report: Callable[[str, str], None]
) -> dict[str, object]:
    """The values by label. `report` is called with the site and a line for a list of another length, which is
    left out."""
    parts = PARTS[name]
    found: dict[str, object] = {}
    for site, value in values.items():
        numbers = cast("Sequence[object]", value)
        if not hasattr(value, "__len__") or isinstance(value, (Mapping, *WORDS)):
            found[site] = value
        elif len(numbers) != len(parts):
            report(site, f"{name} of {quote(site)}: give {len(parts)} numbers, {', '.join(parts)}")
        else:
            found |= zip((f"{site}.{part}" for part in parts), numbers, strict=False)
    return found
