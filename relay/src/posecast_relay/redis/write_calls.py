"""Makes the script calls by which a process that hears a robot writes to Redis."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from posecast_relay.core.replica_messages import Presence, StreamUpdate
from posecast_relay.core.state.robot import Robot
from posecast_relay.core.state.runs import RETURN_AFTER_S
from posecast_relay.core.state.stream import StoredFrame, Stream
from posecast_relay.redis.client import (
    Call,
    channel,
    generation_key,
    state_key,
    status_key,
    writer_key,
)
from posecast_relay.redis.guard import GUARD, STATUS
from posecast_relay.redis.messages import dump, pack, unpack


class WrittenState(NamedTuple):
    """The part of a stream's state that is in Redis."""

    generation: int
    key: StoredFrame
    ref: StoredFrame | None
    version: int
    event_n: int
    is_heard: bool


def make_state_call(
    stream: Stream,
    before: WrittenState | None,
    generation: int,
    writer: str,
    now: float,
    sent_s: float | None,
) -> tuple[WrittenState, Call]:
    """Make the call that writes a stream's newest state and publishes what changed; also returns that state.

    `before`: what this process wrote last; None: write it whole. `writer` names the process; `sent_s`
    is Redis's clock.
    """
    key, newest, ref = stream.key, stream.newest, stream.ref
    assert key is not None
    assert newest is not None
    state = WrittenState(generation, key, ref, stream.version, stream.event_n, stream.live_at is not None)
    light = before is not None and before == state._replace(ref=before.ref)
    version = f"{writer}:{stream.version}"
    values: list[bytes | str | int] = ["frame", newest.payload, "stamp", _ns(newest)]
    if before is None or ref is not before.ref or not light:
        values += ["ref", ref.payload if ref else b""]
    if not light:
        values += ["run", f"{stream.run_id:016x}", "schema", stream.schema.text if stream.schema else ""]
        values += ["key", key.payload, "info", dump(stream.info), "model", stream.model or ""]
        values += ["events", "[" + ",".join(event.text for event in stream.events) + "]"]
        values += ["version", version, "numbering", stream.numbering]
        values += ["heard", "1" if state.is_heard else "0"]
    # what others lack, bases first; frames that were never live here come by the snapshot alone
    age_s = stream.compute_age_s(now)
    lacking: list[StoredFrame] = []
    if age_s is not None:
        bases = [key if before is None or key is not before.key else None]
        bases.append(ref if ref is not None and (before is None or ref is not before.ref) else None)
        lacking = [base for base in bases if base is not None and base is not newest] + [newest]
    told_n = before.event_n if before is not None else 0
    update = StreamUpdate(
        stream.view,
        generation,
        stream.run_id,
        version,
        stream.numbering,
        max(0.0, age_s or 0.0),
        tuple((_ns(held), held.payload) for held in lacking),
        tuple(event.text for event in stream.events if event.n > told_n),
        sent_s,
    )
    names = [state_key(stream.robot, stream.view), generation_key(stream.robot)]
    names += [channel(stream.robot), writer_key(stream.robot)]
    args = [generation, newest.seq, "0" if light else "1", key.id, pack(update), *values]
    return state, (GUARD, names, args)


def make_presence_call(
    robot: Robot, generation: int, written: Iterable[str], now: float, sent_s: float | None
) -> Call:
    """Make the call that publishes a robot's presence.

    `written`: the views whose states should be in Redis.
    """
    ages_s: dict[str, float | None] = {}
    newest: dict[str, tuple[int, int]] = {}
    for view, room in robot.rooms.items():
        age_s, held = room.stream.compute_age_s(now), room.stream.newest
        ages_s[view] = None if age_s is None else max(0.0, age_s)
        if held is not None:
            newest[view] = held.run_id, held.seq
    said = pack(Presence(robot.liveness.token, ages_s, newest, sent_s))
    name = robot.name
    names = [status_key(name), channel(name), writer_key(name), generation_key(name)]
    return STATUS, [*names, *(state_key(name, view) for view in written)], [generation, said]


def gives_way(told: object, has_token: bool) -> bool:
    """Whether this presence is of a relay that hears so little of the robot that another one takes over.

    It has heard no frame for long, or sees no edge of the robot while the other one does (`has_token`).
    """
    try:
        said = unpack(told) if isinstance(told, bytes) else None
    except ValueError:
        return False
    if not isinstance(said, Presence):
        return False
    if has_token and not said.token:
        return True
    return all(age_s is None or age_s > RETURN_AFTER_S for age_s in said.ages_s.values())


def _ns(held: StoredFrame) -> int:
    return round(held.stamp_s * 1e9)
