"""The kinds of sources, by their name in `--source`.

A kind is a module with two functions:

* `open_source(address, profile) -> Source`: `address` is the text after `KIND:` ("" if there is none); raises
  `SourceError` with one line when the address or the profile does not fit. A module of several kinds has one
  for each, which the table names.
* `find_defaults(address) -> Defaults` (optional): the kind's own profile and model, used if none is given.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import TYPE_CHECKING, Protocol, cast

from posecast_wire.command_line.parser import suggest

from posecast_edge.sample import SourceError
from posecast_edge.sources.base import Defaults, Source

if TYPE_CHECKING:
    from posecast_edge.profile.types import Profile

# kind → its module below posecast_edge.sources, and after a colon the function that opens it
KINDS = {
    "jsonl": "jsonl",
    "csv": "files.csv",
    "mcap": "files.ros_recording:open_mcap",
    "bag": "files.ros_recording:open_bag",
    "trajectory": "files.trajectory",
    "mujoco": "mujoco.source",
    "demo": "demo",
    "hubo-ach": "hubo.source",
    "ros2": "ros.ros2",
    "rosbridge": "ros.rosbridge",
}


class _Open(Protocol):
    def __call__(self, address: str, profile: Profile | None) -> Source: ...


def split_spec(spec: str) -> tuple[str, str]:
    """Split `KIND[:ADDRESS]` into (kind, address). Raises SourceError, which lists the kinds, when it is
    unknown."""
    kind, _, address = spec.partition(":")
    if kind not in KINDS:
        raise SourceError(f"unknown source {kind!r}{suggest(kind, KINDS)}: one of {', '.join(KINDS)}")
    return kind, address


def _module(kind: str) -> ModuleType:
    """Load a kind only when needed: it may import packages that the others don't need."""
    return importlib.import_module(f"posecast_edge.sources.{KINDS[kind].partition(':')[0]}")


def find_defaults(spec: str) -> Defaults:
    """The own profile and model of the kind of source in `spec`. Raises SourceError when the kind is
    unknown."""
    kind, address = split_spec(spec)
    defaults = getattr(_module(kind), "find_defaults", None)
    return Defaults() if defaults is None else cast(Defaults, defaults(address))


def open_source(spec: str, profile: Profile | None) -> Source:
    """Open `KIND[:ADDRESS]`. Raises SourceError (one line) when the kind is unknown or the address can't be
    opened."""
    kind, address = split_spec(spec)
    opening = KINDS[kind].partition(":")[2] or "open_source"
    return cast(_Open, getattr(_module(kind), opening))(address, profile)
