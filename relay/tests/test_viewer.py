"""Acknowledgements, silence, manners: who is held back and who is let go."""

from __future__ import annotations

import json
from collections import deque
from itertools import pairwise
from random import Random

import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.viewer import Viewer
from posecast_wire import Close

from .sim import Edge, World, schema


def watch(world: World, edge: Edge, viewer: Viewer, seconds: float, acks: bool = True) -> None:
    """A client like ours: acknowledges when a frame arrives and a second has passed since its last."""
    last_ack = world.now - 1.0
    for _ in range(round(seconds * 30)):
        world.pass_time(1 / 30)
        before = viewer.sent
        world.publish(edge)
        viewer.record_heard(world.now)
        if acks and viewer.sent > before and world.now - last_ack >= 1.0:
            world.say(viewer, type="ack", n=viewer.sent)
            last_ack = world.now


def test_two_seconds_unacknowledged_stop_frames_and_fifteen_cut() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join()
    watch(world, edge, viewer, 5.0)
    world.say(viewer, type="ack", n=viewer.sent)
    sent = len(screen.states)
    watch(world, edge, viewer, 10.0, acks=False)
    assert 50 <= len(screen.states) - sent <= 61  # at most two seconds' worth
    assert viewer.blocked
    assert screen.was_cut is None
    watch(world, edge, viewer, 6.0, acks=False)
    assert screen.was_cut is Close.NO_ACK
    assert world.hub.endings[Close.NO_ACK] == 1


def test_an_acknowledgement_brings_the_newest_frame_again() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join()
    watch(world, edge, viewer, 3.0)
    watch(world, edge, viewer, 5.0, acks=False)
    before = len(screen.states)
    world.say(viewer, type="ack", n=viewer.sent)
    world.run(edge, 0.1)
    assert len(screen.states) > before
    assert screen.states[-1].seq == edge.seq


def test_a_silent_robot_owes_its_viewers_no_acknowledgement() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join()
    watch(world, edge, viewer, 3.5)
    for _ in range(
        60
    ):  # frames that arrived within a second of the last acknowledgement are never acknowledged
        world.pass_time(1.0)
        viewer.record_heard(world.now)
    assert screen.was_cut is None
    assert not viewer.blocked
    world.publish(edge)
    assert screen.states[-1].seq == edge.seq


def test_a_viewer_that_never_acknowledges_is_served() -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join()
    watch(world, edge, viewer, 30.0, acks=False)
    assert screen.was_cut is None
    assert screen.states[-1].seq == edge.seq


@pytest.mark.parametrize(("acks", "cut_after_s"), [(False, 5.0), (True, 15.0)])
def test_a_buffer_left_unread_is_cut(acks: bool, cut_after_s: float) -> None:
    world = World()
    edge = world.on_air()
    viewer, screen = world.join(1.0)
    if acks:
        world.say(viewer, type="ack", n=viewer.sent)
    viewer.pause(world.now)
    began = world.now
    while screen.was_cut is None:
        world.pass_time(0.1)
        world.publish(edge)
        viewer.record_heard(world.now)
        if acks:  # it lies: acknowledges what it has not read
            world.say(viewer, type="ack", n=viewer.sent)
        assert world.now < began + 20
    assert screen.was_cut is Close.NO_ACK
    assert cut_after_s <= world.now - began <= cut_after_s + 0.7


def test_the_pose_comes_before_what_has_happened_and_pings_lie_between() -> None:
    """How long slow readers then have: test_slow_readers.py."""
    world = World()
    edge = world.on_air()
    for _ in range(100):
        doc = {"type": "event", "t": 1.0, "level": "fault", "source": "RKN", "text": "x" * 80, "state": "on"}
        said = json.dumps(doc).encode()
        world.do(world.hub.take_event("r", "public", said, edge.stamp(world.now), world.now, 0.0))
    _, screen = world.join(10.0)
    assert screen.writes == 1
    assert [text["type"] for text in screen.texts] == ["hello", "status", "schema", *["event"] * 100]
    assert len(screen.states) == 1
    assert screen.pings == 4  # in 18 kB


def test_a_newcomer_that_talks_and_does_not_read_is_cut_when_it_could_have_read_all() -> None:
    world = World()
    world.on_air(schema([f"joint_{i}" for i in range(2000)]))
    viewer, screen = world.join(10.0)
    began, reads_s = world.now, viewer.join_burst_read_by - world.now
    assert reads_s > 20.0
    viewer.pause(world.now)
    while screen.was_cut is None:
        world.pass_time(1.0)
        world.say(viewer, type="rate", hz=10)
    assert screen.was_cut is Close.NO_ACK
    assert reads_s + 5.0 <= world.now - began <= reads_s + 7.0


def test_a_newcomer_that_has_read_it_all_and_then_freezes_is_cut_like_everybody() -> None:
    world = World()
    edge = world.on_air(schema([f"joint_{i}" for i in range(2000)]))
    viewer, screen = world.join(10.0)
    assert viewer.join_burst_arrives_by > world.now + 7.0
    assert viewer.join_burst_read_by > world.now + 20.0
    watch(world, edge, viewer, 5.0)
    watch(world, edge, viewer, 14.0, acks=False)
    assert screen.was_cut is None
    watch(world, edge, viewer, 2.0, acks=False)
    assert screen.was_cut is Close.NO_ACK


def test_nothing_heard_is_asked_and_then_cut_within_twelve_seconds() -> None:
    world = World()
    world.on_air()
    viewer, screen = world.join()
    world.pass_time(5.6)
    assert screen.pings == 1
    viewer.record_heard(world.now)  # it answered
    world.pass_time(10.9)
    assert screen.was_cut is None
    assert screen.pings == 3
    world.pass_time(1.0)
    assert screen.was_cut is Close.HALF_OPEN
    assert viewer not in world.hub.viewers


def test_a_relay_that_stood_still_blames_no_viewer() -> None:
    world = World()
    edge = world.on_air()
    slow, slow_screen = world.join()
    viewer, screen = world.join()
    watch(world, edge, viewer, 3.5)
    slow.record_heard(world.now)
    slow.pause(world.now)
    world.now += 60.0  # the process was stopped, and its timer comes before what the viewers sent
    world.do(world.hub.tick(world.now, 0.0))
    assert screen.was_cut is None
    assert slow_screen.was_cut is None
    assert not viewer.held_back
    watch(world, edge, viewer, 1.0)
    assert screen.states[-1].seq == edge.seq
    assert slow_screen.was_cut is None


@pytest.mark.parametrize(
    ("payload", "close"),
    [
        (b"{", Close.NOT_ALLOWED),
        (b'{"type":"move","joint":"RKN"}', Close.NOT_ALLOWED),
        (b'{"type":"rate","hz":"fast"}', Close.NOT_ALLOWED),
        (b'{"type":"rate","hz":-1}', Close.NOT_ALLOWED),
        (b"\xff\xfe", Close.NOT_UTF8),
        (b'"' + b"x" * 4096 + b'"', Close.TOO_LONG),
    ],
)
def test_what_a_viewer_may_not_say(payload: bytes, close: Close) -> None:
    world = World()
    viewer, screen = world.join()
    world.do(world.hub.take_message(viewer, payload, world.now))
    assert screen.ended is not None
    assert screen.ended[0] is close
    assert viewer not in world.hub.viewers
    assert world.hub.endings[close] == 1
    assert world.hub.take_message(viewer, b'{"type":"ping","t":1}', world.now) == []


def test_too_many_messages() -> None:
    world = World()
    viewer, screen = world.join()
    for n in range(20):
        world.say(viewer, type="ping", t=n)
    assert len(screen.told("pong")) == 20
    world.pass_time(1.0)
    for n in range(10):
        world.say(viewer, type="ping", t=n)
    assert screen.ended is None
    world.say(viewer, type="ping", t=0)
    assert screen.ended is not None
    assert screen.ended[0] is Close.TOO_MANY


def test_rate_is_granted_within_the_limit_and_takes_effect() -> None:
    world = World()
    edge = world.on_air()
    world.run(edge, 1.0)
    viewer, screen = world.join(30.0)
    world.say(viewer, type="rate", hz=10)
    world.say(viewer, type="rate", hz=500)
    world.say(viewer, type="rate", hz=5)
    assert [(m["hz"], m["reason"]) for m in screen.told("rate")] == [
        (10.0, "asked"),
        (60.0, "limit"),
        (5.0, "asked"),
    ]
    before = len(screen.states)
    world.run(edge, 4.0)
    assert len(screen.states) - before in (20, 21)
    world.say(viewer, type="rate", hz=0)
    before = len(screen.states)
    world.run(edge, 1.0)
    assert len(screen.states) == before


def test_the_next_one_is_told_that_the_relay_is_full() -> None:
    world = World(Limits(viewers=2))
    world.join()
    first, _ = world.join()
    _, screen = world.join()
    assert screen.ended == (Close.FULL, "the relay has no room for more viewers", 30.0)
    assert screen.texts == []
    world.hub.remove_viewer(first)
    _, screen = world.join()
    assert screen.ended is None


def test_connections_are_renewed_before_their_age_limit() -> None:
    world = World(Limits(max_age_s=60.0))
    edge = world.on_air()
    viewer, screen = world.join()
    assert screen.told("hello")[0]["limits"]["max_age_s"] == 60.0
    viewer.until = world.now + 55.0  # by the adapter's dice
    watch(world, edge, viewer, 54.0)
    assert screen.ended is None
    watch(world, edge, viewer, 2.0)
    assert screen.ended == (Close.AGE_LIMIT, "maximum connection age reached", 1.0)
    assert viewer not in world.hub.viewers
    assert world.hub.endings[Close.AGE_LIMIT] == 1


@pytest.mark.parametrize(("robot_hz", "asked_hz"), [(30.0, 10.0), (2.0, 30.0)])
def test_four_hundred_milliseconds_of_jitter_hold_nothing_back_for_long(
    robot_hz: float, asked_hz: float
) -> None:
    """Each way takes 400 ± 400 ms, in order. A page so far away acknowledges twice a second; between two
    frames then lies less than the 1.5 s after which it would call the robot stale."""
    world, random = World(), Random(3)
    edge = world.on_air()
    viewer, screen = world.join(asked_hz)
    to_page, to_relay = deque[tuple[float, int]](), deque[tuple[float, int]]()
    arrivals = [world.now]
    acked_at, acked, next_at = world.now, 0, world.now
    began = world.now
    while world.now < began + 300:
        viewer.record_heard(world.now)
        seen = len(screen.frames)
        world.pass_time(1 / 60)
        if world.now >= next_at:
            next_at += 1 / robot_hz
            world.publish(edge)
        if len(screen.frames) > seen:
            last = to_page[-1][0] if to_page else 0.0
            to_page.append((max(last, world.now + random.uniform(0.0, 0.8)), len(screen.frames)))
        while to_page and to_page[0][0] <= world.now:
            _, n = to_page.popleft()
            arrivals.append(world.now)
            if world.now - acked_at >= 0.5 and n > acked:
                acked_at, acked = world.now, n
                last = to_relay[-1][0] if to_relay else 0.0
                to_relay.append((max(last, world.now + random.uniform(0.0, 0.8)), n))
        while to_relay and to_relay[0][0] <= world.now:
            world.say(viewer, type="ack", n=to_relay.popleft()[1])
    assert len(arrivals) > 0.95 * 300 * min(robot_hz, asked_hz)
    assert max(b - a for a, b in pairwise(arrivals)) < 1.5
