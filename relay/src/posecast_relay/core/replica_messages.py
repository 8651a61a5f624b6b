"""The messages that one relay sends another about a robot: stream updates, presence, and stored states.

`sent_s` is when a message was sent, in seconds of the shared store's clock as the sender estimates it; None
where it does not know that clock.
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
    """Whether a robot's edge is there, and how old its newest frames are, in seconds by view.

    An age is None before any live frame. `newest`: which frame that is, by run and seq.
    """

    token: bool
    ages_s: Mapping[str, float | None]
    newest: Mapping[str, tuple[int, int]] = {}
    sent_s: float | None = None


class StreamState(NamedTuple):
    """All that the store holds of a stream, of any age."""

    generation: int
    run_id: int
    stamp_ns: int  # edge's, since its run began, of the newest frame
    version: str
    numbering: str
    snapshot: Snapshot
    newest: bytes
    events: tuple[str, ...]
    is_heard: bool = True  # frames of this run have come, not only an answer
