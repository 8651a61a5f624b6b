"""Makes the messages about a robot for other processes: updates of a stream, its whole state, and presence.

Does no I/O: `write_calls.py` makes calls to Redis from them.
"""

from __future__ import annotations

from typing import NamedTuple

from posecast_relay.core.replica import Presence, StreamUpdate
from posecast_relay.core.robot import Robot
from posecast_relay.core.stream import StoredFrame, Stream
from posecast_relay.redis.messages import dump

Value = bytes | str | int


class WrittenState(NamedTuple):
    """The part of a stream's state that was already sent."""

    generation: int
    key: StoredFrame
    version: int
    event_n: int
    is_heard: bool


def describe_written(stream: Stream, generation: int) -> WrittenState:
    """Return what others know of a stream after its whole state was sent. The stream must have a KEY."""
    assert stream.key is not None
    is_heard = stream.live_at is not None
    return WrittenState(generation, stream.key, stream.version, stream.event_n, is_heard)


def make_update(
    stream: Stream,
    before: WrittenState | None,
    generation: int,
    names: tuple[str, str],
    now: float,
    sent_s: float | None,
) -> StreamUpdate:
    """Make the message with the changes of a stream. The stream must have a KEY.

    `before`: what was sent last; None: nothing. `names`: the names of the version and the numbering.
    """
    key, newest = stream.key, stream.newest
    assert key is not None
    assert newest is not None
    # what others lack, the KEY first; frames that were never live here come by the whole state alone
    age_s = stream.compute_age_s(now)
    lacking: list[StoredFrame] = []
    if age_s is not None:
        knows_key = key is newest or (before is not None and key is before.key)
        lacking = [newest] if knows_key else [key, newest]
    told_n = before.event_n if before is not None else 0
    return StreamUpdate(
        stream.view,
        generation,
        stream.run_id,
        *names,
        max(0.0, age_s or 0.0),
        tuple((compute_ns(held), held.payload) for held in lacking),
        tuple(event.text for event in stream.events if event.n > told_n),
        sent_s,
    )


def list_lasting_values(stream: Stream, names: tuple[str, str], is_heard: bool) -> list[Value]:
    """List the parts of a state that seldom change: names and values in turns, as `unpack_state` reads."""
    assert stream.key is not None
    values: list[Value] = ["run", f"{stream.run_id:016x}"]
    values += ["schema", stream.schema.text if stream.schema else ""]
    values += ["key", stream.key.payload, "ref", b""]  # an older relay refuses a state without `ref`
    values += ["info", dump(stream.info), "model", stream.model or ""]
    values += ["events", "[" + ",".join(event.text for event in stream.events) + "]"]
    values += ["version", names[0], "numbering", names[1]]
    return [*values, "heard", "1" if is_heard else "0"]


def make_presence(robot: Robot, now: float, sent_s: float | None) -> Presence:
    """Make the message with a robot's presence and the age of its frames."""
    ages_s: dict[str, float | None] = {}
    newest: dict[str, tuple[int, int]] = {}
    for view, room in robot.rooms.items():
        age_s, held = room.stream.compute_age_s(now), room.stream.newest
        ages_s[view] = None if age_s is None else max(0.0, age_s)
        if held is not None:
            newest[view] = held.run_id, held.seq
    return Presence(robot.liveness.token, ages_s, newest, sent_s)


def compute_ns(held: StoredFrame) -> int:
    """Return a frame's time in nanoseconds since the agent's run began."""
    return round(held.stamp_s * 1e9)
