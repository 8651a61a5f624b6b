"""What a gateway makes of what other relays tell, by plain calls."""

from __future__ import annotations

import json
from typing import Any

import pytest
from posecast_relay.core.actions import RequestSnapshot
from posecast_relay.core.replica import Presence, ReplicaFeed, StreamState, StreamUpdate

from .sim import Edge, World, schema


def told(n: int, text: str = "jam") -> str:
    """An event as the relay that numbered it tells it."""
    return json.dumps({"type": "event", "n": n, "at": 1.0, "text": text})


@pytest.fixture
def world() -> World:
    """A robot on air at a relay that hears of it from others."""
    world = World()
    world.on_air()
    return world


def numbers(screen: Any) -> list[int]:
    """The events a viewer has been told."""
    return [event["n"] for event in screen.told("event")]


def test_events_come_once_and_in_their_order(world: World) -> None:
    said = ReplicaFeed(world.hub)
    _, screen = world.join()
    for n in (1, 2, 2, 1, 3):
        world.do(said.take_event("r", "public", "a", told(n)))
    assert numbers(screen) == [1, 2, 3]
    _, late = world.join()
    assert numbers(late) == [1, 2, 3]


def test_another_count_begins_again_and_leaves_nothing_of_the_one_before(world: World) -> None:
    said = ReplicaFeed(world.hub)
    _, screen = world.join()
    for n in range(1, 18):
        world.do(said.take_event("r", "public", "a", told(n)))
    world.do(said.take_event("r", "public", "b", told(1, "after the restart")))
    assert numbers(screen) == [*range(1, 18), 1]
    _, late = world.join()
    assert [(e["n"], e["text"]) for e in late.told("event")] == [(1, "after the restart")]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"n":null}', '{"n":"x"}', "[" * 100_000])
def test_what_is_no_numbered_event_changes_nothing(world: World, text: str) -> None:
    said = ReplicaFeed(world.hub)
    _, screen = world.join()
    with pytest.raises(ValueError, match=r"."):
        said.take_event("r", "public", "", text)
    assert screen.told("event") == []


def test_an_event_of_a_view_too_many_is_left_out(world: World) -> None:
    said = ReplicaFeed(world.hub)
    for n in range(world.limits.views + 3):
        world.do(said.take_event("r", f"view{n}", "a", told(1)))
    assert len(world.hub.robots["r"].rooms) == world.limits.views


def test_degraded_is_told_once_and_taken_back(world: World) -> None:
    said = ReplicaFeed(world.hub)
    _, screen = world.join()
    before = len(screen.texts)
    for _ in range(3):
        world.do(said.set_degraded(True, world.now))
    assert [doc.get("degraded") for doc in screen.texts[before:]] == [True]
    _, late = world.join()
    assert late.told("status")[0]["degraded"] is True
    world.do(said.set_degraded(True, world.now, "r"))  # by one more reason
    world.do(said.set_degraded(False, world.now))
    assert screen.told("status")[-1]["degraded"] is True
    world.do(said.set_degraded(False, world.now, "r"))
    assert "degraded" not in screen.told("status")[-1]


def standing(edge: Edge | None, age_s: float | None, token: bool = True) -> Presence:
    """As a relay that hears this edge tells it."""
    newest = {} if edge is None else {"public": (edge.run_id, edge.seq)}
    return Presence(token, {"public": age_s, "no such view": 1.0}, newest)


def state(edge: Edge, generation: int = 1, newest: bytes | None = None, is_heard: bool = True) -> StreamState:
    """What the store holds of it."""
    picture = newest or edge.snapshot().key
    return StreamState(generation, edge.run_id, 0, "p:1", "p:1", edge.snapshot(), picture, (), is_heard)


def update(edge: Edge, at_s: float, *frames: bytes, generation: int = 1, late_s: float = 0.0) -> StreamUpdate:
    """The last of these frames was made then; so was its KEY, for all that the stamps say."""
    stamped = tuple((edge.stamp(at_s).elapsed_ns, frame) for frame in frames)
    return StreamUpdate("public", generation, edge.run_id, "p:1", "p:1", late_s, stamped, ())


class Far:
    """A gateway's hub; edges are heard elsewhere."""

    def __init__(self) -> None:
        self.world = World()
        self.said = ReplicaFeed(self.world.hub)
        self.said.get_source("r")
        self.edge = Edge(0xE, schema(), began_s=self.world.now)
        self.key = self.edge.frame(self.world.now)
        _, self.screen = self.world.join()

    @property
    def now(self) -> float:
        """The world's."""
        return self.world.now

    def reads(self, found: StreamState, told: Presence | None = None, under_way_s: float = 0.0) -> None:
        """What the store holds, and what was told last."""
        self.said.set_generation("r", found.generation, self.said.get_source("r").generation)
        self.world.do(self.said.take_state("r", "public", found, self.now))
        if told is not None:
            self.world.do(self.said.take_presence("r", told, under_way_s, self.now))
        self.world.flush()

    def hears(self, said: StreamUpdate | Presence, under_way_s: float | None = 0.0) -> None:
        """A message of the robot's channel."""
        if isinstance(said, Presence):
            self.world.do(self.said.take_presence("r", said, under_way_s, self.now))
        else:
            self.world.do(self.said.take_update("r", said, under_way_s, self.now))
        self.world.flush()

    def status(self) -> dict[str, Any]:
        """As a viewer was told last."""
        return self.screen.told("status")[-1]


def test_the_standing_brings_the_token_and_the_age_of_the_frame_that_it_names() -> None:
    far = Far()
    assert far.status()["robot"] == "offline"
    far.hears(standing(None, None))
    clock_ms = int(1000 * far.world.now)
    silent = {"type": "status", "robot": "silent", "age_ms": None, "seq": None}
    assert far.status() == silent | {"clock_ms": clock_ms}
    far.reads(state(far.edge), standing(far.edge, 7.5), under_way_s=0.25)
    far.world.pass_time(1.0)
    assert (far.status()["robot"], far.status()["seq"]) == ("silent", far.edge.seq)
    assert 7750 <= far.status()["age_ms"] <= 8750
    far.hears(standing(far.edge, 8.5, token=False))
    assert far.status()["robot"] == "offline"


def test_a_standing_that_is_read_again_says_nothing_new() -> None:
    """Redis keeps it for a while, and for longer when its clock is set back; nobody has told it again."""
    far = Far()
    told = standing(far.edge, 0.0)._replace(sent_s=5.0)
    far.reads(state(far.edge), told)
    assert far.status()["robot"] == "online"
    far.world.pass_time(3.0)
    heard_at = far.said.get_source("r").told_at
    far.reads(state(far.edge), told)
    assert far.status()["robot"] == "silent"
    assert far.said.get_source("r").told_at == heard_at


def test_an_age_says_nothing_of_an_older_frame_than_the_one_it_was_told_of() -> None:
    """The state was evicted, or is a replica's: the picture here is old, whatever its relay hears by now."""
    far = Far()
    far.reads(state(far.edge))
    far.edge.frame(far.now)
    far.hears(standing(far.edge, 0.02))
    assert (far.status()["robot"], far.status()["age_ms"]) == ("silent", None)
    another = Edge(0xF, schema())
    another.frame(far.now)
    far.hears(standing(another, 0.02))
    assert far.status()["age_ms"] is None


def test_a_picture_that_was_read_is_told_as_such_in_the_write_that_brings_it() -> None:
    """A page takes a frame that is newer than its status for a sign of life."""
    far = Far()
    far.reads(state(far.edge), standing(far.edge, 0.0))
    assert far.status()["robot"] == "online"
    far.world.pass_time(1.0)
    newer, writes = far.edge.frame(far.now), far.screen.writes
    far.reads(state(far.edge, newest=newer))
    assert far.screen.writes == writes + 1
    assert (far.status()["seq"], far.status()["age_ms"]) == (1, 1000)
    assert far.screen.states[-1].seq == 1


@pytest.mark.parametrize("late_s", [0.0, 2.0])
def test_a_message_is_as_old_as_its_frame_and_its_time_under_way(late_s: float) -> None:
    far = Far()
    far.reads(state(far.edge), standing(None, None))
    far.hears(update(far.edge, far.now, far.edge.frame(far.now), late_s=late_s), under_way_s=2.0)
    assert (far.status()["robot"], far.status()["age_ms"]) == ("silent", 2000 + late_s * 1000)
    far.hears(update(far.edge, far.now, far.edge.frame(far.now)), under_way_s=0.01)
    assert (far.status()["robot"], far.status()["age_ms"]) == ("online", 10)


def test_a_base_that_comes_along_is_no_sign_of_life() -> None:
    """The newest frame is refused for once: then its KEY, which may be old, is not shown as live."""
    far = Far()
    far.reads(state(far.edge), standing(None, None))
    far.world.pass_time(3.0)
    key_at, key = far.now, far.edge.frame(far.now, force_key=True)
    far.world.pass_time(3.0)
    said = update(far.edge, far.now, key, b"\x10 no frame")
    frames = ((far.edge.stamp(key_at).elapsed_ns, key), said.frames[1])
    far.hears(said._replace(frames=frames))
    assert (far.status()["robot"], far.status()["age_ms"]) == ("silent", 3000)


def test_a_clock_that_stood_still_counts_once_its_relay_has_learned_it() -> None:
    """The gateway can ask nobody: what the relay tells, and how long that took, is what it knows."""
    far = Far()
    far.reads(state(far.edge), standing(None, None))
    stood_at = far.now
    far.hears(update(far.edge, stood_at, far.edge.frame(far.now)))
    far.world.pass_time(8.0)
    far.hears(update(far.edge, stood_at + 0.1, far.edge.frame(far.now), late_s=7.9))
    assert far.status()["robot"] == "silent"
    far.hears(update(far.edge, stood_at + 0.2, far.edge.frame(far.now), late_s=0.01))
    assert (far.status()["robot"], far.status()["age_ms"]) == ("online", 10)


def test_after_an_outage_nothing_from_before_it_is_shown_as_live() -> None:
    far = Far()
    far.reads(state(far.edge), standing(far.edge, 0.0))
    far.hears(update(far.edge, far.now, far.edge.frame(far.now)))
    assert far.status()["robot"] == "online"
    far.world.do(far.said.mark_disconnected(far.now))
    assert far.status()["degraded"] is True
    far.world.pass_time(0.4)  # a pose is not stale yet
    far.world.do(far.said.mark_connected(far.now))
    assert far.status()["degraded"] is True
    far.hears(standing(far.edge, 0.4))  # of the very frame that stands here
    assert far.status()["degraded"] is True
    writes = far.screen.writes
    far.hears(update(far.edge, far.now, far.edge.frame(far.now)))
    assert far.screen.writes == writes + 1  # the pose and the word in one
    assert "degraded" not in far.status()
    assert (far.status()["robot"], far.screen.states[-1].seq) == ("online", far.edge.seq)


@pytest.mark.parametrize("told", ["too old", "never", "gone"])
def test_after_an_outage_a_robot_that_sends_nothing_is_said_to_be_silent(told: str) -> None:
    far = Far()
    far.reads(state(far.edge), standing(far.edge, 0.0))
    far.world.do(far.said.mark_disconnected(far.now))
    far.world.do(far.said.mark_connected(far.now))
    age_s = {"too old": 3.0, "never": None, "gone": 3.0}[told]
    far.hears(standing(far.edge, age_s, token=told != "gone"))
    assert "degraded" not in far.status()
    assert far.status()["robot"] == {"too old": "online", "never": "online", "gone": "offline"}[told]


def test_after_an_outage_a_newer_picture_of_which_the_age_is_told_is_news() -> None:
    far = Far()
    far.reads(state(far.edge), standing(far.edge, 0.0))
    far.world.do(far.said.mark_disconnected(far.now))
    far.world.pass_time(3.0)
    far.reads(state(far.edge, newest=far.edge.frame(far.now)), standing(far.edge, 0.1))
    far.world.do(far.said.mark_connected(far.now))
    assert (far.status()["robot"], far.status()["seq"]) == ("online", far.edge.seq)
    assert far.screen.states[-1].seq == far.edge.seq


def test_the_highest_generation_says_which_run_is_current() -> None:
    far = Far()
    other = Edge(0xF, schema(), began_s=far.now)
    far.hears(update(far.edge, far.now, far.key, generation=5))
    far.reads(state(far.edge, 5))
    far.hears(update(other, far.now, other.frame(far.now), generation=6))
    assert far.world.hub.robots["r"].runs.current == 0xF
    far.hears(update(far.edge, far.now, far.edge.frame(far.now), generation=5))
    assert far.world.hub.outcomes["retired"] == 1
    # the other has ended, and the ingest has another one by now, which has never heard of it
    far.hears(update(far.edge, far.now, far.key, far.edge.frame(far.now), generation=7))
    assert far.world.hub.robots["r"].runs.current == 0xE
    assert far.screen.states[-1].seq == far.edge.seq
    assert far.status()["robot"] == "online"


def test_a_view_that_the_newest_run_does_not_send_changes_no_run() -> None:
    """A gateway that starts later reads both; each one in turn would retire the other for good."""
    far = Far()
    other = Edge(0xF, schema(), began_s=far.now)
    other.frame(far.now)
    far.said.set_generation("r", 6, 0)
    far.world.do(far.said.take_state("r", "public", state(other, 6), far.now))
    far.world.do(far.said.take_state("r", "old", state(far.edge, 5), far.now))
    assert far.world.hub.robots["r"].runs.current == 0xF


def test_what_only_an_answer_brought_takes_the_place_of_no_pose() -> None:
    far = Far()
    other = Edge(0xF, schema(), began_s=far.now)
    other.frame(far.now)
    far.reads(state(far.edge, 5))
    far.reads(state(other, 6, is_heard=False))
    assert far.world.hub.robots["r"].runs.current == 0xE
    far.reads(state(other, 7))
    assert far.world.hub.robots["r"].runs.current == 0xF


def test_a_store_that_has_lost_count_is_believed() -> None:
    """But not an answer that a message has overtaken."""
    said = ReplicaFeed(World().hub)
    said.get_source("r").generation = 9
    said.set_generation("r", 8, asked=7)
    assert said.get_source("r").generation == 9
    said.set_generation("r", 3, asked=9)
    assert said.get_source("r").generation == 3


def test_what_is_lacking_is_asked_for_at_once_and_then_not_too_often() -> None:
    far = Far()
    assert far.said.request_state("nobody", far.now) == []

    def asks() -> bool:
        return any(isinstance(action, RequestSnapshot) for action in far.said.request_state("r", far.now))

    assert asks()
    assert not asks()
    far.world.pass_time(0.3)  # nothing came: that was too early
    assert asks()
    far.reads(state(far.edge))
    far.world.pass_time(0.3)
    assert not asks()
    far.world.pass_time(0.8)
    assert asks()


def test_nobody_hears_the_robot_any_more() -> None:
    far = Far()
    far.reads(state(far.edge), standing(far.edge, 0.0))
    far.world.do(far.said.set_degraded(True, far.now, "r"))
    far.world.do(far.said.clear_token("r", far.now))
    assert (far.status()["robot"], far.status().get("degraded")) == ("offline", None)


def test_a_watched_robot_is_not_forgotten(world: World) -> None:
    said = ReplicaFeed(world.hub)
    viewer, _ = world.join()
    said.forget_robot("r")
    said.forget_robot("nobody")
    assert "r" in world.hub.robots
    world.hub.remove_viewer(viewer)
    said.forget_robot("r")
    assert world.hub.robots == {}
