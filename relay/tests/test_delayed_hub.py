"""What is shown late: everything decodes, in order, and never a moment early."""

from __future__ import annotations

import json
from random import Random

import pytest
from posecast_relay.core import delayed
from posecast_relay.core.actions import Persist
from posecast_relay.core.delayed import DelayedHub
from posecast_relay.core.limits import Limits
from posecast_relay.core.viewer import Viewer

from .sim import UNIX_S, Edge, Screen, World, schema

DELAY_S = 5.0


class Late(World):
    """A world whose hub is watched by a second one, as the adapter does it."""

    def __init__(self) -> None:
        super().__init__()
        self.past = World()
        self.past.hub = self.late = DelayedHub(Limits())
        self.past.now = self.now
        self.late.set_delays({("r", "public"): DELAY_S})

    def do(self, actions: object) -> None:
        """Also what the adapter does with a Keep."""
        found = list(actions)  # type: ignore[call-overload]
        super().do(found)
        for action in found:
            if isinstance(action, Persist):
                robot = self.hub.robots.get(action.stream.robot)
                token = robot is not None and robot.liveness.token
                self.late.record_stream(action.stream, token, self.now)

    def pass_time(self, seconds: float) -> None:
        """Both clocks are one."""
        super().pass_time(seconds)
        if hasattr(self, "late"):
            self.past.pass_time(seconds)

    def watch(self, hz: float = 60.0) -> tuple[Viewer, Screen]:
        """A viewer of the past, who need not give a sign of life."""
        viewer, screen = self.past.join(hz)
        viewer.speaks = False
        return viewer, screen


def test_nothing_is_seen_early_and_all_of_it_late() -> None:
    world = Late()
    edge = world.on_air(key_every_s=1.0)
    _, screen = world.watch()
    world.run(edge, DELAY_S - 0.1)
    assert screen.states == []
    assert screen.told("status")[-1]["robot"] == "offline"
    world.run(edge, 10.0)
    assert screen.told("status")[-1]["robot"] == "online"
    seen = [frame.seq for frame in screen.states]
    assert seen == sorted(set(seen))
    assert len(seen) > 250
    # the robot's clock is the world's: the newest frame is from a delay ago, or a little more
    assert DELAY_S <= world.now - screen.states[-1].t_s < DELAY_S + 0.1
    age_ms = screen.told("status")[-1]["age_ms"]
    assert age_ms < 200


def test_events_info_runs_and_the_end_come_late_and_in_their_order() -> None:
    world = Late()
    edge = world.on_air()
    _, screen = world.watch()
    world.run(edge, 1.0)
    doc = {"type": "event", "t": 1.0, "level": "fault", "source": "RKN", "text": "jam", "state": "on"}
    stamp = edge.stamp(world.now)
    world.do(world.hub.take_event("r", "public", json.dumps(doc).encode(), stamp, world.now, UNIX_S))
    said = {"type": "info", "kv": {"mode": "walk"}}
    world.do(world.hub.take_event("r", "public", json.dumps(said).encode(), stamp, world.now, UNIX_S))
    at = world.now
    world.run(edge, 0.5)
    again = Edge(0xDEF, schema(("A", "B", "C")), began_s=world.now)
    world.publish(again)
    world.answer(again)
    world.run(again, 1.0)
    world.do(world.hub.set_token("r", False, world.now))
    left_at = world.now

    world.pass_time(at + DELAY_S - 0.01 - world.now)
    assert screen.told("event") == []
    assert screen.told("info") == []
    world.pass_time(0.05)
    assert [event["text"] for event in screen.told("event")] == ["jam"]
    assert [event["n"] for event in screen.told("event")] == [1]
    assert screen.told("info")[-1]["kv"] == {"mode": "walk"}
    world.pass_time(left_at + DELAY_S - 0.2 - world.now)
    assert screen.states[-1].schema.size == 3
    assert screen.told("status")[-1]["robot"] == "online"
    world.pass_time(0.3)
    assert screen.told("status")[-1]["robot"] == "offline"
    assert screen.states[-1].seq == again.seq
    assert screen.ended is None


def test_who_comes_late_to_the_past_gets_it_in_one_write() -> None:
    world = Late()
    edge = world.on_air(key_every_s=1.0)
    world.run(edge, 8.0)
    _, screen = world.watch()
    assert screen.writes == 1
    assert [doc["type"] for doc in screen.texts][:3] == ["hello", "status", "schema"]
    assert DELAY_S <= world.now - screen.states[-1].t_s < DELAY_S + 0.1


def test_a_full_ring_leaves_out_and_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delayed, "ENTRIES_MAX", 60)  # two seconds of five
    world = Late()
    edge = world.on_air(key_every_s=1.0)
    _, screen = world.watch()
    world.run(edge, 20.0)
    assert world.late.left_out > 100
    seen = [frame.seq for frame in screen.states]
    assert seen == sorted(set(seen))
    assert world.now - screen.states[-1].t_s < 2 * DELAY_S
    assert world.now - screen.states[-1].t_s >= DELAY_S


def test_a_ring_is_bounded_in_bytes_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delayed, "BYTES_MAX", 3000)
    world = Late()
    edge = world.on_air()
    world.run(edge, 20.0)
    (ring,) = world.late._rings.values()
    assert ring._bytes <= 3000
    assert ring.left_out > 100
    world.pass_time(10.0)
    assert ring._bytes == 0


@pytest.mark.parametrize("seed", range(20))
def test_whatever_the_edge_does_the_past_decodes(seed: int) -> None:
    random = Random(seed)
    world = Late()
    edge = world.on_air(key_every_s=random.choice([30.0, 1.0, 0.3]))
    screens = [world.watch(random.choice([1, 10, 60]))[1] for _ in range(3)]
    for _ in range(400):
        world.pass_time(random.choice([0.0, 0.02, 0.1, 1.0]))
        what = random.random()
        if what < 0.03:
            names = ["A", "B", "C", "D"][: random.randint(1, 4)]
            key_every_s = random.choice([30.0, 0.3])
            edge = Edge(random.getrandbits(60) + 1, schema(names), world.now, key_every_s)
            world.publish(edge)
            if random.random() < 0.7:
                world.answer(edge)
        elif what < 0.05 and edge.seq >= 0:
            world.answer(edge)
        elif what < 0.07:
            world.do(world.hub.set_token("r", random.random() < 0.5, world.now))
        else:
            data = edge.frame(world.now, force_key=random.random() < 0.1)
            if random.random() < 0.9:
                world.publish(edge, data)
        if random.random() < 0.05:
            screens.append(world.watch(random.choice([1, 10, 60]))[1])
    world.answer(edge)
    world.run(edge, DELAY_S + 2.0)
    for screen in screens:  # a screen decodes all it is given, or the test ends there
        assert screen.states[-1].seq >= edge.seq - 250
        assert world.now - screen.states[-1].t_s >= DELAY_S


def test_delays_may_change_while_it_runs() -> None:
    world = Late()
    edge = world.on_air()
    _, screen = world.watch()
    world.run(edge, 7.0)
    world.late.set_delays({("r", "public"): 1.0})
    world.run(edge, 1.0)
    assert 1.0 <= world.now - screen.states[-1].t_s < 1.2
    world.late.set_delays({})
    seen = len(screen.states)
    world.run(edge, 3.0)
    assert len(screen.states) == seen
    assert world.late.list_robots() == set()
