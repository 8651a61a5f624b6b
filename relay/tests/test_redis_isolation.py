"""Each call on the way through Redis fails at one robot: the viewers of the other one don't notice."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from posecast_relay.core.hub import Hub
from posecast_relay.core.replica import ReplicaFeed
from posecast_relay.core.robot import Robot
from posecast_relay.core.stream import Stream
from posecast_relay.redis import store as redis_store
from posecast_relay.redis.directory import RedisDirectory
from posecast_relay.redis.gateway import RedisGateway, RedisSubscriber
from posecast_relay.redis.store import RedisStore

from .fleet import HZ
from .histories import History

FAULTY_S = 6.0
HURT, INNOCENT = "a", "b"


class Fault(Exception):
    """Of the relay's own code."""


def of_robot(*args: Any, **_: Any) -> bool:
    """Whether a call is about the robot that is to be hurt."""
    return any(_names(arg) for arg in args)


def _names(arg: Any) -> bool:
    if isinstance(arg, Robot):
        return arg.name == HURT
    if isinstance(arg, Stream):
        return arg.robot == HURT
    return bool(arg == HURT)


def always(*_args: Any, **_: Any) -> bool:
    """Any call."""
    return True


Place = tuple[Any, str, Callable[..., bool]]
AT_THE_GATEWAY: list[Place] = [
    (RedisGateway, "_read_message", of_robot),
    (RedisGateway, "_take_states", of_robot),
    (RedisGateway, "_check_silence", of_robot),
    (RedisGateway, "_maintain", of_robot),
    (RedisGateway, "_watch_pinned", always),
    (RedisGateway, "_exchange", always),
    (RedisSubscriber, "_ask", of_robot),
    (ReplicaFeed, "take_update", of_robot),
    (ReplicaFeed, "take_state", of_robot),
    (ReplicaFeed, "take_presence", of_robot),
    (ReplicaFeed, "set_generation", of_robot),
    (ReplicaFeed, "take_event", of_robot),
    (Hub, "receive_frame", of_robot),
    (Hub, "take_snapshot", of_robot),
    (Stream, "append_numbered", of_robot),
]
AT_THE_INGEST: list[Place] = [
    (redis_store, "make_state_call", of_robot),
    (redis_store, "make_presence_call", of_robot),
    (redis_store, "unpack_events", always),
    (RedisStore, "_is_current", of_robot),
    (RedisStore, "_hears_frames", of_robot),
    (RedisStore, "_resume_from", of_robot),
    (RedisStore, "_renew_lease", of_robot),
    (RedisDirectory, "exchange", always),
    (Stream, "resume_events", of_robot),
]


@pytest.fixture
def history() -> Iterator[History]:
    """Two robots on air, each with a page at a gateway."""
    history = History()
    history.play(("ingest",), ("gateway",), ("edge", HURT, 0), ("edge", INNOCENT, 0), ("wait", 2.0))
    yield history
    history.end()


def raising(owner: Any, name: str, where: Callable[..., bool], hits: list[str]) -> Any:
    """As before, but not about the robot that is to be hurt."""
    whole = getattr(owner, name)

    def call(*args: Any, **kwargs: Any) -> Any:
        if where(*args, **kwargs):
            hits.append(name)
            raise Fault(name)
        return whole(*args, **kwargs)

    return call


@pytest.mark.parametrize(
    ("owner", "name", "where"),
    AT_THE_GATEWAY + AT_THE_INGEST,
    ids=lambda about: getattr(about, "__name__", str(about)),
)
def test_a_fault_at_one_robot_is_no_other_robots(
    history: History, monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, where: Callable[..., bool]
) -> None:
    (gateway,), (ingest,) = history.fleet.gateways, history.fleet.ingests
    page = gateway.pages[INNOCENT]
    said, shown = len(page.shown), len(page.poses)
    hits: list[str] = []
    with monkeypatch.context() as patch:
        of = gateway.hub if owner is Hub else owner  # the ingest's is not what is to fail
        patch.setattr(of, name, raising(of, name, where, hits))
        hurt = ingest.hub.robots[HURT]
        for room in hurt.rooms.values():
            doc: dict[str, object] = {"type": "event", "text": "jam"}
            ingest.dispatcher.carry_out(ingest.hub.announce_event(hurt, room, doc, 1.0, 1.0))
        history.wait(1.0)
        # what is done only now and then is done now
        for room in ingest.hub.robots[HURT].rooms.values():
            ingest.store._resumed.discard(room.stream)
            room.stream.version += 1
        history.redis.lose(f"posecast:{{{HURT}}}:writer")
        ingest.store._superseded[HURT] = 0.0
        gateway.store._plan_subscription(HURT)
        history.wait(FAULTY_S)
    assert hits, "it was never called"
    assert {shown.word for shown in page.shown[said:]} == {"LIVE"}
    assert len(page.poses) - shown >= 0.95 * (1.0 + FAULTY_S) * HZ
    assert ingest.hub.outcomes["fault"] + gateway.hub.outcomes["fault"] > 0
    assert not history.loop.faults
    history.wait(2.0)  # once the fault has passed it is as if it had never been
    assert gateway.pages[HURT].look().word == "LIVE"
    for task in (ingest.store._task, gateway.store._task, gateway.store._reader):
        assert task is not None
        assert not task.done()


@pytest.mark.parametrize("owner", [RedisGateway, RedisStore])
def test_a_task_that_fails_begins_anew(
    history: History, monkeypatch: pytest.MonkeyPatch, owner: type[Any]
) -> None:
    """Where the fault is at no robot: the others' viewers are told, and it heals by itself."""
    hits: list[str] = []
    with monkeypatch.context() as patch:
        for name in ("_beat", "_connect"):
            patch.setattr(owner, name, raising(owner, name, always, hits))
        history.wait(3.0)
    assert hits
    history.wait(2.0)
    for robot in (HURT, INNOCENT):
        assert history.fleet.gateways[0].pages[robot].look().word == "LIVE"
    assert not history.loop.faults


def test_a_reader_that_fails_begins_anew(history: History, monkeypatch: pytest.MonkeyPatch) -> None:
    store = history.fleet.gateways[0].store
    hits: list[str] = []
    with monkeypatch.context() as patch:
        patch.setattr(RedisGateway, "_take_next", raising(RedisGateway, "_take_next", always, hits))
        store._plan_subscription(HURT)
        history.wait(1.0)
    assert hits
    history.wait(2.0)
    assert history.fleet.gateways[0].pages[INNOCENT].look().word == "LIVE"
