"""The send rule: whatever happens, every frame a viewer gets decodes at once, and to the newest state."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from posecast_relay.core.actions import Send
from posecast_relay.core.viewer import Viewer
from posecast_testing import count_examples

from .sim import Edge, Screen, World, schema

SCHEMAS = (schema(), schema(("RKN", "LKN", "WST")), schema(scale=0.5))
RATES = (0.0, 1.0, 5.0, 10.0, 12.5, 30.0, 60.0)


@dataclass
class Story:
    """A relay, one robot that may restart, and viewers that come, go, stall and change their rate."""

    world: World = field(default_factory=World)
    runs: int = 0
    edge: Edge = field(init=False)
    truth: dict[tuple[int, int], tuple[int, ...]] = field(default_factory=dict)
    watching: list[tuple[Viewer, Screen]] = field(default_factory=list)
    seen: dict[Screen, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.world.do(self.world.hub.set_token("r", True, self.world.now))
        self.restart(0, 30.0)

    def restart(self, which: int, key_every_s: float) -> None:
        self.runs += 1
        self.edge = Edge(self.runs, SCHEMAS[which], began_s=self.world.now, key_every_s=key_every_s)

    def publish(self, codes: list[int], lost: bool, force_key: bool) -> None:
        edge = self.edge
        payload = edge.frame(self.world.now, codes[: edge.schema.size], force_key)
        self.truth[edge.run_id, edge.seq] = tuple(edge.codes)
        if not lost:
            self.world.publish(edge, payload)
            self.check()

    def answer(self) -> None:
        if self.edge.seq >= 0:
            self.world.answer(self.edge)
            self.check()

    def pass_time(self, seconds: float) -> None:
        self.world.pass_time(seconds)
        self.check()

    def check(self) -> None:
        """What was written since the last look is the newest state there is, true to the robot."""
        newest = self.world.hub.robots["r"].get_room("public").stream.newest
        for _, screen in self.watching:
            if len(screen.states) == self.seen.get(screen, 0):
                continue
            self.seen[screen] = len(screen.states)
            assert newest is not None
            shown = screen.states[-1]
            assert shown.seq == newest.seq
            assert shown.codes == self.truth[newest.run_id, newest.seq]

    def viewer(self, n: int) -> tuple[Viewer, Screen] | None:
        return self.watching[n % len(self.watching)] if self.watching else None


codes = st.lists(st.integers(-2000, 2000), min_size=3, max_size=3)
step = st.one_of(
    st.tuples(st.just("publish"), codes, st.booleans(), st.integers(0, 9)),
    st.tuples(st.just("publish"), codes, st.just(False), st.just(1)),
    st.tuples(st.just("time"), st.sampled_from([0.001, 0.02, 1 / 30, 0.1, 0.4, 1.2])),
    st.tuples(st.just("answer")),
    st.tuples(st.just("restart"), st.integers(0, 2), st.sampled_from([30.0, 0.5, 0.05])),
    st.tuples(st.just("join"), st.sampled_from(RATES)),
    st.tuples(st.just("leave"), st.integers(0, 9)),
    st.tuples(st.just("pause"), st.integers(0, 9)),
    st.tuples(st.just("drain"), st.integers(0, 9)),
    st.tuples(st.just("ack"), st.integers(0, 9)),
    st.tuples(st.just("rate"), st.integers(0, 9), st.sampled_from(RATES)),
)


def play(story: Story, name: str, args: tuple[object, ...]) -> None:
    match name, args:
        case "publish", (list() as some, bool() as lost, int() as chance):
            story.publish(some, lost, chance == 0)
        case "time", (float() as seconds,):
            story.pass_time(seconds)
        case "answer", ():
            story.answer()
        case "restart", (int() as which, float() as key_every_s):
            story.restart(which, key_every_s)
        case "join", (float() as hz,):
            story.watching.append(story.world.join(hz))
            story.check()
        case (_, (int() as n, *rest)) if found := story.viewer(n):
            viewer, _ = found
            world = story.world
            viewer.record_heard(world.now)
            if name == "leave":
                world.hub.remove_viewer(viewer)
                story.watching.remove(found)
            elif name == "pause":
                viewer.pause(world.now)
            elif name == "drain":
                world.do(world.hub.resume_viewer(viewer))
            elif name == "ack" and viewer in world.hub.viewers:
                world.say(viewer, type="ack", n=viewer.sent)
            elif name == "rate" and viewer in world.hub.viewers:
                world.say(viewer, type="rate", hz=rest[0])
            story.check()


@settings(max_examples=count_examples(300), deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.lists(step, min_size=5, max_size=80))
def test_every_delivered_frame_decodes_to_the_newest_state(steps: list[tuple[object, ...]]) -> None:
    story = Story()
    for name, *args in steps:
        play(story, str(name), tuple(args))
    # at last the robot speaks once more, and everybody who still watches and drains sees it within a period
    story.publish([1, 2, 3], False, True)
    story.answer()
    world = story.world
    for viewer, screen in story.watching:
        if viewer in world.hub.viewers:
            world.do(world.hub.resume_viewer(viewer))
            viewer.record_heard(world.now)
            if viewer.acknowledges:
                viewer.record_ack(viewer.sent, world.now)
                world.do(world.hub.resume_viewer(viewer))
            assert screen.was_cut is None
    story.pass_time(1.01)
    for viewer, screen in story.watching:
        if viewer in world.hub.viewers and viewer.hz > 0:
            assert screen.states[-1].codes == tuple(story.edge.codes)


@pytest.mark.parametrize(("hz", "stride"), [(30.0, 1), (10.0, 3), (15.0, 2), (1.0, 30)])
def test_ten_of_thirty_is_exactly_every_third_frame(hz: float, stride: int) -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    _, screen = world.join(hz)
    world.run(edge, 6.0)
    seqs = [frame.seq for frame in screen.states]
    assert {b - a for a, b in itertools.pairwise(seqs)} == {stride}


def test_the_newest_frame_arrives_within_a_period_although_no_further_one_comes() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    _, screen = world.join(5.0)
    world.run(edge, 1.0 + 1 / 30)
    last, came_at = edge.seq, world.now
    while screen.states[-1].seq != last:
        world.pass_time(0.01)
        assert world.now - came_at <= 0.2 + 0.011


def test_a_viewer_that_drains_late_gets_the_newest_within_a_period() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join(10.0)
    viewer.pause(world.now)
    world.run(edge, 1.0)
    assert screen.states[-1].seq == 0
    world.do(world.hub.resume_viewer(viewer))
    world.pass_time(0.101)
    assert screen.states[-1].seq == edge.seq


def test_one_stuck_viewer_does_not_change_what_its_group_gets() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    stuck, _ = world.join(10.0)
    _, screen = world.join(10.0)
    stuck.pause(world.now)
    world.run(edge, 4.0)
    seqs = [frame.seq for frame in screen.states]
    assert {b - a for a, b in itertools.pairwise(seqs)} == {3}


def test_hz_0_gets_status_events_and_descriptions_only() -> None:
    world = World()
    edge = world.on_air()
    _, screen = world.join(0.0)
    world.run(edge, 3.0)
    assert screen.frames == []
    assert len(screen.told("schema")) == 1
    assert len(screen.told("status")) >= 3
    edge.info = {"mode": "walking"}
    world.answer(edge)
    assert screen.told("info") == [{"type": "info", "kv": {"mode": "walking"}}]


def test_a_join_is_one_write_in_order() -> None:
    world = World()
    edge = world.on_air()
    edge.info, edge.model = {"mode": "walking"}, "0" * 64
    world.answer(edge)
    world.do(
        world.hub.take_event(
            "r",
            "public",
            b'{"type":"event","t":1.5,"level":"fault","source":"RKN","text":"jam","state":"on"}',
            edge.stamp(world.now),
            world.now,
            1.0,
        )
    )
    world.run(edge, 1 / 6)
    _, screen = world.join()
    assert [doc["type"] for doc in screen.texts] == ["hello", "status", "schema", "info", "event"]
    assert screen.texts[0]["model"] == "0" * 64
    assert screen.texts[4]["n"] == 1
    assert len(screen.states) == 1
    assert [f.seq for f in screen.frames] == [0, 5]  # KEY, newest


def test_one_frame_is_packed_once_for_all() -> None:
    world = World()
    edge = world.on_air()
    viewers = [world.join() for _ in range(50)]
    world.run(edge, 0.2)
    world.pass_time(1 / 30)
    world.hub.receive_frame("r", "public", edge.frame(world.now), edge.stamp(world.now), world.now)
    sends = [a for a in world.hub.flush(world.now, 0.0) if isinstance(a, Send)]
    assert [len(s.viewers) for s in sends] == [len(viewers)]
    newest = world.hub.robots["r"].rooms["public"].stream.newest
    assert newest is not None
    assert sends[0].data is newest.packed
