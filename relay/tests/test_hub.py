"""Events, status, liveness as viewers hear of them, and who is forgotten."""

from __future__ import annotations

import json
from itertools import pairwise

import pytest
from posecast_relay.core.actions import Action
from posecast_relay.core.limits import Limits
from posecast_relay.core.room import Room
from posecast_wire import Close

from .sim import UNIX_S, Edge, World, schema


def event(world: World, edge: Edge, text: str = "jam", state: str = "on", **other: object) -> None:
    """An event from the edge arrives."""
    doc = {
        "type": "event",
        "t": 1.25,
        "level": "fault",
        "source": "RKN",
        "text": text,
        "state": state,
        **other,
    }
    stamp = edge.stamp(world.now)
    world.do(world.hub.take_event("r", "public", json.dumps(doc).encode(), stamp, world.now, UNIX_S))


def test_events_are_numbered_and_the_newest_hundred_are_told_at_join() -> None:
    world = World()
    edge = world.on_air()
    _, early = world.join()
    for n in range(150):
        event(world, edge, f"fault {n}")
    assert [e["n"] for e in early.told("event")] == list(range(1, 151))
    assert early.told("event")[0] | {"n": 0} == {
        "type": "event", "t": 1.25, "level": "fault", "source": "RKN", "text": "fault 0", "state": "on",
        "n": 0, "at": UNIX_S,
    }  # fmt: skip
    _, late = world.join()
    assert [e["n"] for e in late.told("event")] == list(range(51, 151))


def test_a_30_ms_fault_reaches_a_1_hz_viewer() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 0.5)
    _, screen = world.join(1.0)
    event(world, edge, state="on")
    world.pass_time(0.03)
    event(world, edge, state="off")
    assert [e["state"] for e in screen.told("event")] == ["on", "off"]


def test_events_wait_for_a_viewer_that_has_not_drained_and_come_first() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join()
    viewer.pause(world.now)
    for n in range(5):
        event(world, edge, f"fault {n}")
        world.publish(edge)
    assert screen.told("event") == []
    world.do(world.hub.resume_viewer(viewer))
    assert [e["n"] for e in screen.told("event")] == [1, 2, 3, 4, 5]
    assert not viewer.blocked


def test_a_full_event_queue_ends_the_viewer_with_its_reason_and_nobody_else() -> None:
    world = World(Limits(reliable_queue=10))
    edge = world.on_air()
    slow, slow_screen = world.join()
    _, screen = world.join()
    slow.pause(world.now)
    for _ in range(11):
        event(world, edge)
    assert slow_screen.ended is not None
    assert slow_screen.ended[0] is Close.EVENTS_FULL
    assert world.hub.endings[Close.EVENTS_FULL] == 1
    assert slow not in world.hub.viewers
    assert len(screen.told("event")) == 11


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"\xff",
        b"[]",
        b'{"type":"status"}',
        b'{"type":"event"}',
        b'{"type":"event","t":NaN,"level":"fault","source":"a","text":"b","state":"on"}',
        b'{"type":"event","t":0,"level":"fault","source":"a","text":"b","state":"on","x":1e999}',
        b'{"type":"info"}',
        b'{"type":"model"}',
        b'{"type":"model","hash":"../../etc/passwd"}',
        b'{"type":"info","kv":{"mode":1}}',
        b'{"type":"event","t":0,"level":"fault","source":"a","text":"b","state":"on","x":"'
        + b"y" * 2048
        + b'"}',
        b"[" * 100_000,
    ],
)
def test_what_is_no_event_is_counted_and_goes_nowhere(payload: bytes) -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    stamp = edge.stamp(world.now)
    assert world.hub.take_event("r", "public", payload, stamp, world.now, UNIX_S) == []
    assert world.hub.outcomes["bad"] == 1
    assert screen.told("event") == []


def test_events_of_a_retired_run_are_dropped() -> None:
    world = World()
    old = world.on_air()
    new = Edge(1, old.schema, began_s=world.now)
    world.publish(new)
    _, screen = world.join()
    event(world, old)
    assert screen.told("event") == []
    assert world.hub.outcomes["retired"] == 1


def test_status_comes_right_after_hello_and_at_least_once_a_second_also_without_a_robot() -> None:
    world = World()
    viewer, screen = world.join(robot="nobody")
    assert [d["type"] for d in screen.texts] == ["hello", "status"]
    nobody = {"type": "status", "robot": "offline", "age_ms": None, "seq": None}
    assert screen.texts[1] == nobody | {"clock_ms": 1000 * world.now}
    for n in range(2, 20):
        world.pass_time(1.0)
        viewer.record_heard(world.now)
        assert len(screen.told("status")) >= n


@pytest.mark.parametrize(("robot_hz", "hz"), [(30, 30), (30, 10), (30, 1), (30, 0), (0.5, 30), (0.5, 0)])
def test_status_is_heard_every_second_at_every_rate(robot_hz: float, hz: float) -> None:
    world = World(Limits(messages_burst=1000))  # it acknowledges each hundredth of a second
    edge = world.on_air()
    viewer, screen = world.join(hz=hz)
    heard = [world.now]
    for _ in range(1000):
        world.pass_time(0.01)
        viewer.record_heard(world.now)
        world.say(viewer, type="ack", n=viewer.sent)
        if world.now - edge.began_s - 5.0 > (edge.seq + 1) / robot_hz:
            world.publish(edge)
        if len(screen.told("status")) > len(heard):
            heard.append(world.now)
    assert len(heard) >= 11
    assert max(b - a for a, b in pairwise(heard)) <= 1.0
    assert max(screen.told("status")[-1]["age_ms"], 0) < 3000


def test_status_travels_with_a_frame_and_costs_no_write_of_its_own() -> None:
    world = World()
    edge = world.on_air()
    screens = [world.join(hz=hz)[1] for hz in (30, 30, 15)]
    world.run(edge, 1.0)
    before = [(len(s.states), len(s.told("status")), s.writes) for s in screens]
    world.run(edge, 0.95)
    for screen, (frames, statuses, writes) in zip(screens, before, strict=True):
        assert len(screen.told("status")) > statuses
        assert screen.writes - writes == len(screen.states) - frames


def test_a_tick_looks_only_at_those_whose_moment_has_come() -> None:
    world = World()
    for n in range(50):
        world.on_air(robot=f"r{n}")
        world.join(robot=f"r{n}", hz=10)
    world.pass_time(0.6)
    edges = [Edge(0xABC, schema(), began_s=world.now - 5.0) for _ in range(50)]
    looked: list[Room] = []
    flush = Room.flush

    def look(room: Room, now: float) -> list[Action]:
        looked.append(room)
        return flush(room, now)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Room, "flush", look)
        for _ in range(3):
            world.pass_time(1 / 30)
            for n, edge in enumerate(edges):
                world.now += 1e-4  # each has a moment of its own
                world.publish(edge, robot=f"r{n}")
        world.pass_time(0.3)
    assert len(looked) <= 4 * 50  # and not 50 for each of them


def test_an_edge_that_went_before_it_answered_is_waited_for_in_peace() -> None:
    """`pass_time` asserts that no tick asks for another one at once."""
    world = World()
    edge = Edge(0xABC, schema(), began_s=world.now - 5.0)
    world.do(world.hub.set_token("r", True, world.now))
    world.publish(edge)
    world.pass_time(2.0)
    world.do(world.hub.set_token("r", False, world.now))
    world.pass_time(20.0)
    asked = len(world.asked)
    world.pass_time(5.0)
    assert len(world.asked) == asked
    world.do(world.hub.set_token("r", True, world.now))
    world.pass_time(0.2)
    assert len(world.asked) == asked + 1


def test_a_viewer_who_waits_sees_the_robot_come() -> None:
    world = World()
    _, screen = world.join()
    edge = world.on_air()
    assert screen.states[-1].seq == edge.seq
    assert screen.told("status")[-1]["robot"] == "online"


def test_silent_after_a_second_and_a_half_offline_at_once() -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    world.run(edge, 1.0)
    assert {s["robot"] for s in screen.told("status")} == {"online"}
    stopped = world.now
    while screen.told("status")[-1]["robot"] == "online":
        world.pass_time(0.05)
    assert 1.4 <= world.now - stopped <= 2.1
    assert screen.told("status")[-1]["robot"] == "silent"
    assert screen.told("status")[-1]["age_ms"] >= 1500
    before = len(screen.told("status"))
    world.do(world.hub.set_token("r", False, world.now))
    assert len(screen.told("status")) == before + 1
    assert screen.told("status")[-1]["robot"] == "offline"


def test_a_viewer_who_joins_a_dead_robot_never_sees_it_online() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    world.do(world.hub.set_token("r", False, world.now))
    world.pass_time(60.0)
    _, screen = world.join()
    viewer_words = screen.told("status")
    assert screen.states[-1].seq == edge.seq  # the last pose, to be shown grey
    world.pass_time(5.0)
    assert {s["robot"] for s in viewer_words + screen.told("status")} == {"offline"}
    assert viewer_words[0]["age_ms"] >= 60_000


def test_an_old_pose_never_comes_without_the_status_that_says_so() -> None:
    world = World()
    world.do(world.hub.set_token("r", True, world.now))
    edge = Edge(0xABC, schema(), began_s=world.now - 60.0)
    edge.frame(world.now - 60.0)  # nobody was there to hear it
    _, screen = world.join()
    assert screen.told("status")[-1]["seq"] is None
    writes = screen.writes
    world.answer(edge)
    assert screen.states[-1].seq == edge.seq
    assert screen.told("status")[-1]["robot"] == "silent"
    assert screen.told("status")[-1]["seq"] == edge.seq, "a newer frame than that in the status is a live one"
    assert screen.writes == writes + 2, "the description, then both at once"


def test_a_robot_that_comes_on_air_is_asked_at_once_and_then_once_a_second() -> None:
    world = World()
    world.do(world.hub.set_token("r", True, world.now))
    world.pass_time(0.06)
    assert world.asked == ["r"]
    world.pass_time(3.0)  # no answer yet: its source has not spoken
    assert world.asked == ["r"] * 4
    edge = Edge(1, schema(), began_s=world.now)
    world.publish(edge)
    world.answer(edge)
    world.asked.clear()
    world.run(edge, 20.0)
    assert world.asked == []


def test_a_watched_robot_is_asked_now_and_then_for_info_and_model() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 2.0)
    viewer, screen = world.join()
    edge.model = "a" * 64
    world.asked.clear()
    for _ in range(300):
        world.run(edge, 0.1)
        viewer.record_heard(world.now)
        if world.asked:
            world.answer(edge)
            world.asked.clear()
    assert screen.told("model") == [{"type": "model", "hash": "a" * 64}]


def test_only_a_changed_description_is_told_again() -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join()
    world.answer(edge)
    world.answer(edge)
    assert len(screen.told("schema")) == 1


def test_changed_info_is_told_at_once_and_alone() -> None:
    world = World()
    edge = world.on_air()
    screens = [world.join(hz)[1] for hz in (30.0, 0.0)]
    said = b'{"type":"info","kv":{"mode":"walking"}}'
    for stamp in (edge.stamp(world.now), Edge(9, edge.schema).stamp(world.now)):  # the latter: of no run yet
        world.do(world.hub.take_event("r", "public", said, stamp, world.now, UNIX_S))
        said = said.replace(b"walking", b"flying")
    world.run(edge, 0.5)
    for screen in screens:
        assert screen.told("info") == [{"type": "info", "kv": {"mode": "walking"}}]
        assert len(screen.told("schema")) == 1
        assert screen.told("event") == []


def test_another_model_is_told_at_once_and_alone() -> None:
    world = World()
    edge = world.on_air()
    screens = [world.join(hz)[1] for hz in (30.0, 0.0)]
    digest = "a" * 64
    for stamp in (edge.stamp(world.now), Edge(9, edge.schema).stamp(world.now)):  # the latter: of no run yet
        said = b'{"type":"model","hash":"%s"}' % digest.encode()
        world.do(world.hub.take_event("r", "public", said, stamp, world.now, UNIX_S))
        digest = "b" * 64
    world.run(edge, 0.5)
    for screen in screens:
        assert screen.told("model") == [{"type": "model", "hash": "a" * 64}]
        assert len(screen.told("schema")) == 1
    _, late = world.join()
    assert late.told("hello")[0]["model"] == "a" * 64


def test_robots_that_only_viewers_named_are_forgotten_with_them() -> None:
    world = World()
    viewers = [world.join(robot=f"x{n}")[0] for n in range(20)]
    assert len(world.hub.robots) == 20
    for viewer in viewers:
        world.hub.remove_viewer(viewer)
        world.hub.remove_viewer(viewer)
    assert world.hub.robots == {}


def test_a_robot_gone_for_an_hour_is_forgotten_unless_watched() -> None:
    world = World(Limits(forget_s=60.0))
    world.on_air(robot="gone")
    world.on_air(robot="watched")
    viewer, _ = world.join(robot="watched")
    for robot in ("gone", "watched"):
        world.do(world.hub.set_token(robot, False, world.now))
    for _ in range(90):
        world.pass_time(1.0)
        viewer.record_heard(world.now)
    assert set(world.hub.robots) == {"watched"}


def test_a_robot_that_came_sent_nothing_and_went_is_soon_forgotten() -> None:
    world = World()
    world.do(world.hub.set_token("name", True, world.now))
    world.do(world.hub.set_token("name", False, world.now))
    world.pass_time(20.0)
    assert world.hub.robots == {}


def test_an_edge_returns_when_the_newer_one_of_its_name_has_ended() -> None:
    world = World()
    first = world.on_air()
    _, screen = world.join()
    world.run(first, 1.0)
    second = Edge(0xDEF, schema(), began_s=world.now)
    for _ in range(30):
        world.pass_time(1 / 30)
        world.publish(second)
        assert world.publish(first) == "retired"
    world.answer(second)
    world.pass_time(1.0)
    seen = len(screen.states)
    while world.publish(first) == "retired":  # the second is gone
        world.pass_time(1 / 30)
        assert world.now < 1010.0
    asked = len(world.asked)
    world.pass_time(1.0)
    assert len(world.asked) > asked  # the first goes on without a KEY of its own
    world.answer(first)
    assert world.publish(first) == "taken"
    assert len(screen.states) > seen
    assert world.hub.robots["r"].runs.current == first.run_id
    world.pass_time(4.0)
    assert not world.hub.robots["r"].in_conflict


def test_an_edge_whose_clock_stood_still_is_asked_and_online_again() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    world.pass_time(60.0)
    _, screen = world.join()
    edge.began_s += 60.0  # its clock did not run, and goes on where it stopped
    world.publish(edge)
    assert world.hub.robots["r"].runs.lateness_s == pytest.approx(60.0, abs=0.1)
    asked = len(world.asked)
    world.run(edge, 1.0)
    assert len(world.asked) == asked + 1
    world.hub.take_snapshot("r", "public", edge.snapshot(), edge.stamp(world.now), world.now, waited_s=0.01)
    world.run(edge, 2.0)
    assert [s["robot"] for s in screen.told("status")][-2:] == ["online", "online"]
    assert screen.told("status")[-1]["age_ms"] < 100


def test_robots_that_never_answer_are_asked_in_turns_and_more_and_more_seldom() -> None:
    world = World()
    for n in range(500):
        world.do(world.hub.set_token(f"r{n}", True, world.now))
    asked_at = []
    for _ in range(6000):
        before = len(world.asked)
        world.pass_time(0.01)
        assert len(world.asked) - before <= 3 * 8
        asked_at += [world.now - 1000.0] * world.asked[before:].count("r7")
    assert len(asked_at) == 8
    assert asked_at[-1] - asked_at[-2] == pytest.approx(16.0, abs=1.5)


def test_a_full_relay_forgets_robots_that_are_gone_for_one_that_comes() -> None:
    world = World(Limits(robots=3))
    for name in ("a", "b", "c"):
        world.on_air(robot=name)
    newcomer = Edge(0xDEF, schema(), began_s=world.now)
    assert world.publish(newcomer, robot="d") == "crowded"
    world.do(world.hub.set_token("b", False, world.now))
    world.pass_time(10.0)
    assert set(world.hub.robots) == {"a", "c"}
    assert world.publish(newcomer, newcomer.frame(world.now, force_key=True), robot="d") == "no schema"
