"""Makes the script calls that write a robot to Redis."""

from __future__ import annotations

from collections.abc import Iterable

from posecast_relay.core.replica import Presence
from posecast_relay.core.robot import RETURN_AFTER_S, Robot
from posecast_relay.core.stream import Stream
from posecast_relay.redis.client import (
    Call,
    channel,
    generation_key,
    state_key,
    status_key,
    writer_key,
)
from posecast_relay.redis.messages import pack, unpack
from posecast_relay.redis.scripts import GUARD, STATUS
from posecast_relay.redis.stream_updates import (
    Value,
    WrittenState,
    compute_ns,
    describe_written,
    list_lasting_values,
    make_presence,
    make_update,
)


def make_state_call(
    stream: Stream,
    before: WrittenState | None,
    generation: int,
    writer: str,
    now: float,
    sent_s: float | None,
) -> tuple[WrittenState, Call]:
    """Make the call that writes a stream's newest state and publishes its changes; also return that state.

    `before`: what this process wrote last; None: write the whole state. `writer`: the process's name.
    `sent_s`: Redis's clock.
    """
    newest, state = stream.newest, describe_written(stream, generation)
    assert newest is not None
    light = before == state
    names = f"{writer}:{stream.version}", stream.numbering
    values: list[Value] = ["frame", newest.payload, "stamp", compute_ns(newest)]
    if not light:
        values += list_lasting_values(stream, names, state.is_heard)
    update = make_update(stream, before, generation, names, now, sent_s)
    keys = [state_key(stream.robot, stream.view), generation_key(stream.robot)]
    keys += [channel(stream.robot), writer_key(stream.robot)]
    args = [generation, newest.seq, "0" if light else "1", state.key.id, pack(update), *values]
    return state, (GUARD, keys, args)


def make_presence_call(
    robot: Robot, generation: int, written: Iterable[str], now: float, sent_s: float | None
) -> Call:
    """Make the call that publishes a robot's presence.

    `written`: the views whose states should be in Redis.
    """
    said = pack(make_presence(robot, now, sent_s))
    name = robot.name
    names = [status_key(name), channel(name), writer_key(name), generation_key(name)]
    return STATUS, [*names, *(state_key(name, view) for view in written)], [generation, said]


def gives_way(told: object, has_token: bool) -> bool:
    """Whether this presence comes from a relay that should give the robot to another one.

    It has heard no frame for long, or does not see the robot's agent while the other one does (`has_token`).
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
