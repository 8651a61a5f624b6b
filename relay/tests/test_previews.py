"""Cards of lists: served at 1 Hz at most, counted as nobody, and the first to go."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import httpx
from posecast_relay.core.limits import Limits
from posecast_relay.core.policy import ANYONE, FULL, ROBOT_FULL, Audience, Grant
from posecast_relay.core.viewer import Viewer
from posecast_testing import until
from posecast_wire import Close

from .sim import UNIX_S, Screen, World
from .stage import Watcher

OPEN = Grant("r", "public", 60.0, 0.0, None, Audience.ANYONE, ANYONE)
PREVIEW = replace(OPEN, hz=1.0, is_preview=True)


def join(world: World, grant: Grant) -> tuple[Viewer, Screen]:
    screen = Screen()
    viewer = Viewer(screen, "r", "public", 30.0, world.limits, world.now, grant=grant)
    world.do(world.hub.join(viewer, world.now, UNIX_S))
    return viewer, screen


def how_ended(screen: Screen) -> Any:
    return None if screen.ended is None else screen.ended[1]


def why_ended(screen: Screen) -> Close | None:
    return None if screen.ended is None else screen.ended[0]


def test_a_full_hall_drops_previews_first_the_oldest_before_the_others() -> None:
    world = World(Limits(viewers=3))
    world.on_air()
    join(world, OPEN)
    previews = [join(world, PREVIEW)[1] for _ in range(2)]
    _, refused = join(world, PREVIEW)
    assert why_ended(refused) == Close.FULL
    assert [why_ended(each) for each in previews] == [None, None]
    assert world.hub.robots["r"].count_viewers() == 1
    for gone in previews:
        _, comes = join(world, OPEN)
        assert (why_ended(gone), why_ended(comes)) == (Close.FULL, None)
    _, last = join(world, OPEN)
    assert why_ended(last) == Close.FULL
    assert (world.hub.robots["r"].count_viewers(), len(world.hub.viewers)) == (3, 3)
    assert not world.hub.previews
    assert not world.hub.robots["r"].get_room("public").previews
    assert how_ended(previews[0]) == how_ended(last) == FULL.reason
    assert (world.hub.endings, world.hub.preview_endings) == ({Close.FULL: 1}, {Close.FULL: 3})


def test_a_robot_that_takes_so_many_ends_a_preview_of_its_own() -> None:
    world = World()
    world.on_air()
    few = replace(OPEN, viewers=1)
    viewer, screen = join(world, replace(few, hz=1.0, is_preview=True))
    _, elsewhere = join(world, replace(PREVIEW, by=Audience.LINK))
    _, comes = join(world, few)
    assert (why_ended(screen), why_ended(elsewhere), why_ended(comes)) == (Close.FULL, None, None)
    _, second = join(world, few)
    assert why_ended(second) == Close.FULL
    assert how_ended(screen) == how_ended(second) == ROBOT_FULL.reason
    assert (world.hub.endings, world.hub.preview_endings) == ({Close.FULL: 1}, {Close.FULL: 1})
    world.hub.remove_viewer(viewer)  # again, as its connection does: nothing is counted twice
    assert world.hub.admitted_previews["r", Audience.ANYONE] == 0
    assert world.hub.admitted["r", Audience.ANYONE] == 1


def test_previews_go_with_a_sweep_where_viewers_of_another_hub_need_the_place() -> None:
    world = World(Limits(viewers=2))
    world.on_air()
    _, screen = join(world, PREVIEW)
    others = {1, 2}
    world.hub.headcount.include(others, ())
    world.pass_time(1.0)
    assert why_ended(screen) == Close.FULL
    assert not world.hub.viewers


def test_previews_go_with_a_sweep_where_the_limit_of_their_robot_was_lowered() -> None:
    world = World()
    world.on_air()
    _, screen = join(world, OPEN)
    preview, goes = join(world, PREVIEW)
    _, stays = join(world, replace(PREVIEW, by=Audience.LINK))
    world.do(world.hub.replace_grant(preview, replace(PREVIEW, viewers=2), world.now))
    world.pass_time(1.0)
    assert why_ended(goes) is None
    world.do(world.hub.replace_grant(preview, replace(PREVIEW, viewers=1), world.now))
    world.pass_time(1.0)
    assert (why_ended(goes), how_ended(goes)) == (Close.FULL, ROBOT_FULL.reason)
    assert [why_ended(each) for each in (screen, stays)] == [None, None]


def test_a_preview_gets_1_hz_whatever_it_asks_for_and_no_events() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = join(world, PREVIEW)
    world.say(viewer, type="rate", hz=30)
    assert screen.told("rate") == [{"type": "rate", "hz": 1.0, "reason": "limit"}]
    world.run(edge, 2.0)  # until the robot's own rate is known
    before = len(screen.states)
    world.run(edge, 5.0)
    assert 5 <= len(screen.states) - before <= 6
    doc = b'{"type":"event","t":1.0,"level":"fault","source":"RKN","text":"jam","state":"on"}'
    world.do(world.hub.take_event("r", "public", doc, edge.stamp(world.now), world.now, UNIX_S))
    _, later = join(world, PREVIEW)
    assert screen.told("event") == later.told("event") == []
    assert join(world, OPEN)[1].told("event") != []


async def test_over_a_socket_it_is_asked_for_by_the_address(relays: Any, edges: Any) -> None:
    relay = relays("--max-viewers", "1")
    edges(relay.zenoh)
    listed = f"http://{relay.address}/api/v1/robots"

    def count_viewers() -> list[int]:
        return [robot["viewers"] for robot in httpx.get(listed).json()["robots"]]

    async with Watcher(relay.url(query="?hz=30&preview=1")) as preview:
        await preview.until("a frame", lambda v: v.frames)
        assert preview.told("hello")[0]["hz"] == 1.0
        await asyncio.to_thread(until, "counted as nobody", lambda: count_viewers() == [0])
        async with Watcher(relay.url()) as viewer:
            await viewer.until("frames", lambda v: len(v.frames) > 3)
            await preview.until("its end", lambda v: v.told("bye"))
            assert preview.told("bye")[0]["code"] == Close.FULL
            await asyncio.to_thread(until, "counted", lambda: count_viewers() == [1])
