"""What a gateway makes of what other relays tell, by plain calls."""

from __future__ import annotations

import json
from typing import Any

import pytest
from posecast_relay.core.secondhand import Secondhand

from .sim import World


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
    said = Secondhand(world.hub)
    _, screen = world.join()
    for n in (1, 2, 2, 1, 3):
        world.do(said.event("r", "public", "a", told(n)))
    assert numbers(screen) == [1, 2, 3]
    _, late = world.join()
    assert numbers(late) == [1, 2, 3]


def test_another_count_begins_again_and_leaves_nothing_of_the_one_before(world: World) -> None:
    said = Secondhand(world.hub)
    _, screen = world.join()
    for n in range(1, 18):
        world.do(said.event("r", "public", "a", told(n)))
    world.do(said.event("r", "public", "b", told(1, "after the restart")))
    assert numbers(screen) == [*range(1, 18), 1]
    _, late = world.join()
    assert [(e["n"], e["text"]) for e in late.told("event")] == [(1, "after the restart")]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"n":null}', '{"n":"x"}', "[" * 100_000])
def test_what_is_no_numbered_event_changes_nothing(world: World, text: str) -> None:
    said = Secondhand(world.hub)
    _, screen = world.join()
    with pytest.raises(ValueError, match=r"."):
        said.event("r", "public", "", text)
    assert screen.told("event") == []


def test_an_event_of_a_view_too_many_is_left_out(world: World) -> None:
    said = Secondhand(world.hub)
    for n in range(world.limits.views + 3):
        world.do(said.event("r", f"view{n}", "a", told(1)))
    assert len(world.hub.robots["r"].rooms) == world.limits.views


def test_degraded_is_told_once_and_taken_back(world: World) -> None:
    said = Secondhand(world.hub)
    _, screen = world.join()
    before = len(screen.texts)
    for _ in range(3):
        world.do(said.degrade(True, world.now))
    assert [doc.get("degraded") for doc in screen.texts[before:]] == [True]
    _, late = world.join()
    assert late.told("status")[0]["degraded"] is True
    world.do(said.degrade(True, world.now, "r"))  # by one more reason
    world.do(said.degrade(False, world.now))
    assert screen.told("status")[-1]["degraded"] is True
    world.do(said.degrade(False, world.now, "r"))
    assert "degraded" not in screen.told("status")[-1]


def test_the_standing_brings_the_token_and_the_age_of_what_was_never_live_here() -> None:
    world = World()
    said = Secondhand(world.hub)
    _, screen = world.join()
    assert screen.told("status")[-1]["robot"] == "offline"
    world.do(said.standing("r", True, {"public": None}, world.now))
    assert screen.told("status")[-1] == {"type": "status", "robot": "silent", "age_ms": None, "seq": None}
    edge = world.on_air(robot="other")
    world.hub.snapshot("r", "public", edge.snapshot(), edge.stamp(world.now), world.now)
    world.flush()
    world.do(said.standing("r", True, {"public": 7.5, "no such view": 1.0}, world.now))
    world.pass_time(1.0)
    status = screen.told("status")[-1]
    assert (status["robot"], status["seq"]) == ("silent", edge.seq)
    assert 7500 <= status["age_ms"] <= 8500
    world.do(said.standing("r", False, {"public": 8.5}, world.now))
    assert screen.told("status")[-1]["robot"] == "offline"


def test_what_is_lacking_is_asked_for_and_only_of_known_robots(world: World) -> None:
    said = Secondhand(world.hub)
    world.pass_time(2.0)
    world.asked.clear()
    said.lacks("r")
    said.lacks("nobody")
    world.pass_time(0.1)
    assert world.asked == ["r"]


def test_a_watched_robot_is_not_forgotten(world: World) -> None:
    said = Secondhand(world.hub)
    viewer, _ = world.join()
    said.forget("r")
    said.forget("nobody")
    assert "r" in world.hub.robots
    world.hub.leave(viewer)
    said.forget("r")
    assert world.hub.robots == {}
