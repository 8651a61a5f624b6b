"""When a recorder closes, what it keeps for whom, and that its faults are nobody else's."""

from __future__ import annotations

from typing import Any

import pytest
from posecast_relay.core.actions import Fault
from posecast_relay.core.policy import Audience, Policy, Rule
from posecast_relay.past.recorder import OpenSegment, StreamRecording
from posecast_relay.past.segment import KeptSegment
from posecast_wire.segment import CopyRecord, decode_segment

from .sim import UNIX_S
from .taped_world import TapedWorld, on_air, read_alone

OPEN = {Audience.ANYONE: Rule(), Audience.LINK: Rule()}
BLACK = {Audience.ANYONE: Rule(blackout=True), Audience.LINK: Rule()}


def stream(world: TapedWorld, edge: Any, seconds: float, key_every: int = 30) -> None:
    for n in range(round(seconds * 30)):
        world.pass_time(1 / 30)
        world.hear(edge, edge.frame(world.now, force_key=n % key_every == 0))


def fail(*_: object) -> None:
    raise ZeroDivisionError("injected")


def test_a_segment_ends_with_a_key_a_second_after_its_beginning_or_after_six() -> None:
    world = TapedWorld()
    edge = on_air(world)
    stream(world, edge, 4.0, key_every=45)
    assert [each.frames for each in world.segments] == [46, 45]
    stream(world, edge, 14.0, key_every=1000)
    spans = [each.to_ms - each.from_ms for each in world.segments]
    assert spans[3:] == [6000, 6000]
    assert len({each.name.take for each in world.segments}) == 1
    assert [each.name.index for each in world.segments] == list(range(len(world.segments)))


def test_silence_closes_at_once_and_time_closes_what_waits() -> None:
    world = TapedWorld()
    edge = on_air(world)
    stream(world, edge, 0.5)
    world.pass_time(2.5)
    assert [word for _, word in world.segments[-1].words][-1] == "silent"
    world.hear_event(edge, source="RKN", text="jam", state="on")
    world.pass_time(5.9)
    assert len(world.segments) == 1
    world.pass_time(0.2)
    assert (world.segments[1].frames, len(world.segments[1].events), world.segments[1].faults) == (0, 1, 1)
    stream(world, edge, 0.1)
    start = decode_segment(world.close()[-1].data).start
    assert start.open_faults == (world.texts[0],)
    assert start.word == "silent"


def test_a_mebibyte_is_the_most() -> None:
    world = TapedWorld()
    edge = on_air(world)
    for _ in range(700):
        world.pass_time(0.005)
        world.hear_event(edge, source="RKN", text="x" * 1900, state="on")
    segments = world.close()
    assert len(segments) == 2
    assert all(len(each.data) < 1_400_000 for each in segments)
    assert sum(len(each.events) for each in segments) == len(world.texts) == 700
    assert len(decode_segment(segments[1].data).start.open_faults) == 1


def test_a_frame_that_waited_is_recorded_with_copies_of_what_it_waited_for() -> None:
    world = TapedWorld()
    edge = on_air(world)
    edge.frame(world.now, force_key=True)  # lost
    assert world.hear(edge, edge.frame(world.now)) == "no base"
    world.pass_time(0.2)
    world.hear_answer(edge)
    segment, frames = read_alone(world.close()[-1])
    assert [type(record) for record in segment.records[:1]] == [CopyRecord]
    assert [each.seq for each in frames] == [2]
    assert segment.start.missing == 1
    assert segment.frames[0].late_us >= 200_000


def test_only_those_who_could_see_all_of_it_may_look_back() -> None:
    world = TapedWorld()
    world.recorder.set_policy(Policy({"r": OPEN}), world.now)
    edge = on_air(world)
    stream(world, edge, 0.9)
    world.recorder.set_policy(Policy({"r": BLACK}), world.now)
    world.recorder.set_policy(Policy({"r": OPEN}), world.now)
    stream(world, edge, 2.2)
    both = frozenset((Audience.ANYONE, Audience.LINK))
    assert [each.audiences for each in world.close()] == [frozenset((Audience.LINK,)), both, both, both]


def leave_the_dark(dark: dict[Audience, Rule]) -> tuple[TapedWorld, Any]:
    """A robot that is seen again, after half a second in the dark that begins with a KEY."""
    world = TapedWorld()
    world.recorder.set_policy(Policy({"r": OPEN}), world.now)
    edge = on_air(world)
    stream(world, edge, 1.0)
    world.recorder.set_policy(Policy({"r": dark}), world.now)
    stream(world, edge, 0.5, key_every=1000)
    world.recorder.set_policy(Policy({"r": OPEN}), world.now)
    return world, edge


def close_after_next_key(world: TapedWorld, edge: Any, frames: int) -> KeptSegment:
    """The one segment that anyone may see, which begins with the first KEY after so many frames without."""
    for _ in range(frames):
        world.pass_time(1 / 30)
        world.hear(edge, edge.frame(world.now))
    lit_ms = 1000 * world.read_unix_s()
    stream(world, edge, 0.5)
    (shown,) = [each for each in world.close() if Audience.ANYONE in each.audiences]
    assert (shown.frames, shown.from_ms >= lit_ms - 1) == (15, True)
    return shown


@pytest.mark.parametrize("dark", [BLACK, {}], ids=["some saw it", "nobody saw it"])
def test_no_pose_of_the_dark_is_shown_to_who_may_look_again(dark: dict[Audience, Rule]) -> None:
    world, edge = leave_the_dark(dark)
    world.hear_event(edge, source="RKN", text="jam", state="on")
    shown = close_after_next_key(world, edge, 240)  # longer than a segment
    assert not [record for record in decode_segment(shown.data).records if isinstance(record, CopyRecord)]


@pytest.mark.parametrize("dark", [BLACK, {}], ids=["some saw it", "nobody saw it"])
def test_a_fault_shows_no_pose_of_the_dark_either(
    dark: dict[Audience, Rule], monkeypatch: pytest.MonkeyPatch
) -> None:
    world, edge = leave_the_dark(dark)
    with monkeypatch.context() as patch:
        patch.setattr(StreamRecording, "append_frame", fail)
        world.hear(edge, edge.frame(world.now))
    assert len(world.recorder.take_faults()) == world.recorder.faults.pop("ZeroDivisionError") == 1
    close_after_next_key(world, edge, 30)
    assert {each.audiences for each in world.segments if not dark} <= {frozenset(OPEN)}


def test_what_is_withheld_between_two_audiences_is_not_told_as_lost() -> None:
    world = TapedWorld()
    world.recorder.set_policy(Policy({"r": {Audience.ANYONE: Rule()}}), world.now)
    edge = on_air(world)
    stream(world, edge, 0.5)
    world.pass_time(2.5)  # it is silent, so nothing is open
    world.recorder.set_policy(Policy({"r": {Audience.LINK: Rule()}}), world.now)
    for _ in range(30):  # each names a KEY that those with a link did not see
        world.pass_time(1 / 30)
        world.hear(edge, edge.frame(world.now))
    stream(world, edge, 0.5)
    before, after = world.close()
    assert [*before.audiences, *after.audiences] == [Audience.ANYONE, Audience.LINK]
    assert before.name.take != after.name.take
    assert (after.name.index, after.missing, after.frames) == (0, 0, 15)


def test_what_nobody_may_see_is_not_recorded() -> None:
    world = TapedWorld()
    edge = on_air(world)
    stream(world, edge, 0.9)
    world.recorder.set_policy(Policy({}), world.now)
    stream(world, edge, 3.0)
    assert world.close() == []
    world.recorder.set_policy(Policy(), world.now)
    stream(world, edge, 0.5, key_every=1000)
    (kept,) = world.close()
    assert kept.name.index == 0
    assert read_alone(kept)[1]


def test_a_clock_that_was_set_begins_a_take() -> None:
    world = TapedWorld()
    edge = on_air(world)
    stream(world, edge, 0.5)
    world.stepped_s = 0.9
    stream(world, edge, 0.3)
    assert world.segments == []
    world.stepped_s = -60.0
    stream(world, edge, 0.2)
    before, after = world.close()
    assert before.name.take != after.name.take
    assert before.to_ms - before.from_ms < 1000
    assert after.from_ms < before.from_ms
    assert abs(after.to_ms - 1000 * world.read_unix_s()) < 2


def test_another_count_of_events_begins_a_take() -> None:
    world = TapedWorld()
    edge = on_air(world)
    world.hear_event(edge, source="RKN", text="jam", state="on")
    first = world.hub.robots["r"].rooms["public"].stream
    first.resume_events("other:1", ['{"type":"event","n":40,"at":1,"state":"on","text":"a","source":"b"}'])
    world.hear_event(edge, source="RKN", text="jam", state="off")
    before, after = [decode_segment(each.data).start for each in world.close()]
    assert before.take != after.take
    assert (before.event_n, after.event_n, after.numbering) == (0, 41, "other:1")


def test_a_fault_ends_one_recording_and_nothing_live(monkeypatch: pytest.MonkeyPatch) -> None:
    world = TapedWorld()
    edge = on_air(world)
    _, screen = world.join()
    stream(world, edge, 0.5)
    with monkeypatch.context() as patch:
        patch.setattr(OpenSegment, "append_frame", fail)
        world.hear(edge, edge.frame(world.now))
    shown = len(screen.states)
    stream(world, edge, 0.0)
    reported = [each for each in world.hub.tick(world.now + 1, UNIX_S) if isinstance(each, Fault)]
    assert [str(each.error) for each in reported] == ["injected"]
    assert reported[0].where == "r/public: the past"
    assert world.recorder.faults == {"ZeroDivisionError": 1}
    world.recorder.faults.clear()
    for _ in range(5):
        world.pass_time(0.1)
        world.hear(edge, edge.frame(world.now))
    assert len(screen.states) > shown
    (kept,) = world.close()
    assert (kept.name.index, kept.frames) == (0, 5)


def test_a_relay_that_stops_closes_what_is_open() -> None:
    world = TapedWorld()
    edge = on_air(world)
    stream(world, edge, 0.5)
    world.do(world.hub.drain([], world.now))
    assert [each.frames for each in world.segments] == [16]


def test_a_robot_that_is_forgotten_leaves_nothing_open() -> None:
    world = TapedWorld()
    on_air(world)
    world.do(world.hub.set_token("r", False, world.now))
    world.hub.drop_robot(robot := world.hub.robots["r"])
    world.recorder.forget_robot(robot, world.now)
    assert world.recorder.count == 0
    assert world.close()[-1].words[-1].word == "offline"
