"""What one relay tells another about a robot: that a stream has changed, how the robot is, and what there is.

`sent_s` in each is the clock of the store that they share, by the sender's reckoning; None where it did not
know that clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from posecast_wire import Snapshot


class StreamUpdate(NamedTuple):
    """A stream has changed. `version` names schema, info and model: another one means that they changed.
    `numbering` names the count of the events: another one began at 1.
    """

    view: str
    generation: int  # of the writer: a later one replaces it
    run_id: int
    version: str
    numbering: str
    late_s: float  # age of the newest frame when this was sent
    frames: tuple[tuple[int, bytes], ...]  # edge's ns since its run began, and the frame; bases come first
    events: tuple[str, ...]  # numbered, as viewers get them
    sent_s: float | None = None


class Presence(NamedTuple):
    """How a robot is. `ages_s`: of the newest frame by view, None before any live one. `newest`: which frame
    that is, by run and seq."""

    token: bool
    ages_s: Mapping[str, float | None]
    newest: Mapping[str, tuple[int, int]] = {}
    sent_s: float | None = None


class StreamState(NamedTuple):
    """All there is of a stream, of whatever age."""

    generation: int
    run_id: int
    stamp_ns: int  # edge's, since its run began, of the newest frame
    version: str
    numbering: str
    snapshot: Snapshot
    newest: bytes
    events: tuple[str, ...]
    is_heard: bool = True  # frames of this run have come, not only an answer
