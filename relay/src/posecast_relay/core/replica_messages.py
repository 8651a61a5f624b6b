"""The messages that relays exchange about a robot: stream updates, presence, and stored states.

`sent_s` is when a message was sent, in seconds of the shared store's clock as estimated by the sender; None
if it does not know that clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from posecast_wire import Snapshot


class StreamUpdate(NamedTuple):
    """A stream has changed.

    `version` identifies schema, info and model: a new value means that they changed. `numbering` identifies
    the count of events: a new value means that it restarted at 1.
    """

    view: str
    generation: int  # of the writer: a higher one takes over
    run_id: int
    version: str
    numbering: str
    late_s: float  # the age of the newest frame when this was sent
    frames: tuple[
        tuple[int, bytes], ...
    ]  # ns since the run began by the edge's clock, and the frame; a KEY comes first
    events: tuple[str, ...]  # numbered, as sent to viewers
    sent_s: float | None = None


class Presence(NamedTuple):
    """Whether a robot's edge is present, and the age of its newest frame in seconds, by view.

    An age is None before any live frame. `newest`: the run and seq of that frame.
    """

    token: bool
    ages_s: Mapping[str, float | None]
    newest: Mapping[str, tuple[int, int]] = {}
    sent_s: float | None = None


class StreamState(NamedTuple):
    """The complete stored state of a stream, of any age."""

    generation: int
    run_id: int
    stamp_ns: int  # of the newest frame, since the run began by the edge's clock
    version: str
    numbering: str
    snapshot: Snapshot
    newest: bytes
    events: tuple[str, ...]
    is_heard: bool = True  # frames of this run have arrived, not only an answer
