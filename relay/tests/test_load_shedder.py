"""Overload, on a clock of the test's own: rates fall before anybody is refused, and come back."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from posecast_relay.core.load import NO_CEILING, LoadShedder
from posecast_wire import Close

from .sim import Edge, World


@dataclass
class Machine:
    """How the process does, second by second."""

    load: LoadShedder
    now: float = 1000.0

    def second(
        self, lag_s: float = 0.0, busy: float = 0.2, behind: int = 0, fastest_hz: float = 30.0
    ) -> float:
        """One second of this; the ceiling after it."""
        self.now += 1.0
        for _ in range(10):
            self.load.record_lag(lag_s)
        self.load.measure_load(busy, behind, 100, fastest_hz, self.now)
        return self.load.ceiling_hz


@pytest.mark.parametrize("bad", [{"lag_s": 0.2}, {"busy": 0.99}, {"behind": 80}])
def test_three_bad_seconds_lower_the_ceiling_and_five_calm_ones_raise_it(bad: dict[str, float]) -> None:
    machine = Machine(LoadShedder())
    assert [machine.second(**bad) for _ in range(3)] == [NO_CEILING, NO_CEILING, 15.0]  # type: ignore[arg-type]
    assert [machine.second() for _ in range(5)] == [15.0] * 4 + [NO_CEILING]


def test_single_bad_seconds_and_one_long_stop_mean_nothing() -> None:
    machine = Machine(LoadShedder())
    for _ in range(20):
        assert machine.second(lag_s=0.5) == NO_CEILING
        assert machine.second(busy=1.0) == NO_CEILING
        assert machine.second() == NO_CEILING
    for lag_s in [0.001] * 5 + [30.0] + [0.001] * 4:
        machine.load.record_lag(lag_s)
    for _ in range(3):
        assert not machine.load.measure_load(0.1, 0, 100, 30.0, machine.now)


def test_it_goes_down_as_far_as_it_must_and_no_further() -> None:
    machine = Machine(LoadShedder())
    assert [machine.second(busy=1.0) for _ in range(21)][2::3] == [15.0, 10.0, 5.0, 2.0, 1.0, 1.0, 1.0]
    pressed = Machine(LoadShedder())  # which is the viewers' own doing
    assert [pressed.second(behind=100) for _ in range(12)][2::3] == [
        15.0,
        10.0,
        10.0,
        10.0,
    ]
    slow = Machine(LoadShedder())
    assert [slow.second(busy=1.0, fastest_hz=10.0) for _ in range(3)][-1] == 5.0  # a step that is felt
    nobody = Machine(LoadShedder())
    assert [nobody.second(busy=1.0, fastest_hz=0.0) for _ in range(3)][-1] == NO_CEILING


def test_between_overload_and_calm_nothing_changes() -> None:
    machine = Machine(LoadShedder())
    for _ in range(3):
        machine.second(busy=1.0)
    assert {machine.second(busy=0.8, lag_s=0.08) for _ in range(60)} == {15.0}


def test_steps_up_that_prove_too_early_come_ever_later_and_settle() -> None:
    """A machine that carries 15 Hz and not 30."""
    machine = Machine(LoadShedder())
    changes = []
    before = NO_CEILING
    for second in range(600):
        ceiling = machine.second(busy=0.99 if before > 15.0 else 0.4)
        if ceiling != before:
            changes.append((second, ceiling))
        before = ceiling
    assert {ceiling for _, ceiling in changes} == {15.0, NO_CEILING}
    ups = [second for second, ceiling in changes if ceiling == NO_CEILING]
    assert ups[1] - ups[0] < ups[3] - ups[2]
    assert ups[-1] - ups[-2] >= 80
    assert len(ups) < 13
    for _ in range(200):  # the cause is gone
        machine.second()
    assert machine.load.ceiling_hz == NO_CEILING


def overload(world: World, busy: float, seconds: int, edge: Edge) -> None:
    for _ in range(seconds):
        world.run(edge, 1.0)
        for viewer in world.hub.viewers:
            viewer.record_heard(world.now)
        world.do(world.hub.measure_load(busy, world.now))


def test_viewers_are_told_and_served_less_often_then_as_they_asked() -> None:
    world = World()
    edge = world.on_air()
    fast, fast_screen = world.join(30.0)
    slow, slow_screen = world.join(10.0)
    blocked, blocked_screen = world.join(30.0)
    blocked.pause(world.now)
    overload(world, 0.99, 3, edge)
    assert [(m["hz"], m["reason"]) for m in fast_screen.told("rate")] == [(15.0, "overload")]
    assert slow_screen.told("rate") == []
    _, late_screen = world.join(30.0)
    assert late_screen.told("hello")[0]["hz"] == 15.0  # taken, not refused
    world.say(slow, type="rate", hz=60)
    assert slow_screen.told("rate")[-1] == {"type": "rate", "hz": 15.0, "reason": "overload"}
    world.do(world.hub.resume_viewer(blocked))
    assert blocked_screen.told("rate")[-1]["hz"] == 15.0
    before = len(fast_screen.states)
    overload(world, 0.8, 4, edge)
    assert 58 <= len(fast_screen.states) - before <= 62
    overload(world, 0.1, 11, edge)
    assert fast_screen.told("rate")[-1] == {"type": "rate", "hz": 30.0, "reason": "recovered"}
    assert [(m["hz"], m["reason"]) for m in slow_screen.told("rate")[-2:]] == [
        (30.0, "recovered"),
        (60.0, "recovered"),
    ]
    before = len(fast_screen.states)
    world.run(edge, 2.0)
    assert 59 <= len(fast_screen.states) - before <= 61
    assert fast_screen.states[-1].seq == edge.seq
    assert world.hub.endings[Close.FULL] == 0
    assert fast.hz == 30.0


@pytest.mark.parametrize("way", ["socket", "proxy"])
def test_a_crowd_that_takes_no_frames_lowers_the_ceiling_also_behind_a_proxy(way: str) -> None:
    """A proxy takes everything, so no socket of the relay is ever full: only acknowledgements are late."""
    world = World()
    edge = world.on_air()
    crowd = [world.join(30.0)[0] for _ in range(30)]
    reading, screen = world.join(30.0)
    for second in range(5):
        for viewer in crowd:
            if way == "socket":
                viewer.pause(world.now)
            elif second == 0:
                world.say(viewer, type="ack", n=1)
        world.say(reading, type="ack", n=reading.sent)
        overload(world, 0.1, 1, edge)
    room = world.hub.viewers[reading]
    assert room.skipped > 30 * 30
    assert world.hub.load.ceiling_hz == 15.0
    assert [(m["hz"], m["reason"]) for m in screen.told("rate")] == [(15.0, "overload")]


def test_a_frame_that_is_tried_again_is_skipped_once() -> None:
    world = World()
    edge = world.on_air()
    viewer, _ = world.join(30.0)
    viewer.pause(world.now)
    world.run(edge, 1.0)
    room = world.hub.viewers[viewer]
    before = room.skipped
    assert 29 <= before <= 31
    world.pass_time(3.0)  # no further frame: the last one is tried again all the time
    assert room.skipped == before
