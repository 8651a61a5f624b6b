"""The interface of a source. A source only reads from the robot and never commands it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

from posecast_edge.model.moving_joints import MovingJoint
from posecast_edge.sample import Sample

# Takes a sample. The answer: from when on (monotonic seconds) the next one would make a frame, None for at
# once. A source that can wait for several may sleep until then, but delivers them all: each is looked at for
# faults.
Deliver = Callable[[Sample], float | None]


@dataclass(frozen=True)
class Defaults:
    """The profile and model that a kind of source brings with it."""

    profile: Path | None = None
    urdf: Path | None = None
    model: Path | None = None  # the URDF, built; goes before it


class Source(Protocol):
    """Delivers samples from a thread of its own at the source's own pace."""

    description: str

    def run(self, deliver: Deliver, stop: threading.Event) -> None:
        """Deliver every sample until the data ends or `stop` is set. Raises SourceError with a one-line
        text."""


@runtime_checkable
class Discovering(Source, Protocol):
    """A source that discovers by itself which data the robot offers."""

    @property
    def offers(self) -> list[str]:
        """Lines for `probe`: what was found, and as what each is read."""

    def watch_frames(self) -> None:
        """Read the transforms of /tf also where no profile asks for them, so that `offers` can list their
        frames. Call it before `run`."""

    def send_urdf_to(self, take: Callable[[str], None]) -> None:
        """Pass every new robot_description (URDF text) to `take`, which must return at once. Call it before
        `run`."""

    def take_joints(self, joints: Sequence[MovingJoint]) -> None:
        """Take the joints of the model that is shown: where no joint states come they are read from /tf. May
        be called from any thread, also while it runs."""

    def expect_joints(self) -> None:
        """The model is still being built, and `take_joints` will be called: a recording of nothing but
        transforms waits for it. Call it before `run`."""


@runtime_checkable
class Troubled(Source, Protocol):
    """A source that can tell viewers why samples do not come through."""

    @property
    def trouble(self) -> str:
        """A few words for the page, "" at most times. May be asked for from any thread."""


@runtime_checkable
class Tabular(Source, Protocol):
    """A source that reads named columns."""

    @property
    def columns(self) -> list[str]:
        """Lines for `probe`: what each column is read as, or why it is left out."""
