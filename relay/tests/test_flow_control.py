"""One viewer's flow alone: no hub, no room, no socket, and the clock a number."""

from __future__ import annotations

from collections import deque
from random import Random

import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.viewer import FlowControl
from posecast_wire import Close

LIMITS = Limits()


def offer(viewer: FlowControl, now: float) -> bool:
    """Send it a message if that may be, as the walk over a crowd does."""
    if viewer.blocked or (now >= viewer.check_at and not viewer.may_send(now)):
        return False
    viewer.sent += 1
    return True


def test_nothing_is_owed_before_the_first_acknowledgement() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    assert all(offer(viewer, n / 10) for n in range(600))
    viewer.record_heard(60.0)
    assert viewer.find_overdue(60.0) is None


def test_what_is_sent_a_second_after_an_acknowledgement_is_owed_one() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    offer(viewer, 0.0)
    viewer.record_ack(1, 0.1)
    assert offer(viewer, 1.0)
    assert viewer.owed_at is None
    assert offer(viewer, 1.2)
    assert viewer.owed_at == 1.2
    assert offer(viewer, 2.0)
    assert not offer(viewer, 2.2)  # ack_hold_s later
    assert viewer.held_back
    assert viewer.blocked
    viewer.record_heard(16.0)
    assert viewer.find_overdue(15.1) is None
    assert viewer.find_overdue(15.3) is Close.NO_ACK
    viewer.record_ack(4, 15.4)
    assert viewer.find_overdue(15.4) is None
    assert offer(viewer, 15.5)


def test_acknowledgements_of_messages_of_two_seconds_ago_hold_the_next_one_back() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    offer(viewer, 0.0)
    viewer.record_ack(1, 0.0)
    assert offer(viewer, 1.1)  # number 2, the oldest of those that are not acknowledged
    for now in (1.9, 2.7, 3.5):
        assert viewer.oldest_at == 1.1
        viewer.record_ack(1, now)
    assert not offer(viewer, 3.6)
    assert not viewer.held_back
    viewer.record_ack(2, 3.7)
    assert offer(viewer, 3.8)


@pytest.mark.parametrize(
    ("acks", "patience_s"), [(False, LIMITS.undrained_s), (True, LIMITS.undrained_acking_s)]
)
def test_an_undrained_socket_blocks_and_is_cut(acks: bool, patience_s: float) -> None:
    viewer = FlowControl(LIMITS, 0.0, speaks=False)
    if acks:
        viewer.record_ack(0, 0.0)
    viewer.pause(1.0)
    assert not offer(viewer, 1.0)
    assert viewer.find_overdue(0.9 + patience_s) is None
    assert viewer.find_overdue(1.0 + patience_s) is Close.NO_ACK
    assert viewer.release() is None
    viewer.resume()
    assert viewer.blocked  # until what waits has been written
    assert viewer.release() == b""
    assert offer(viewer, 2.0)


def test_what_must_arrive_waits_in_order_and_goes_first() -> None:
    viewer = FlowControl(Limits(reliable_queue=3), 0.0)
    viewer.pause(0.0)
    assert [viewer.enqueue(data) for data in (b"a", b"b", b"c", b"d")] == [True, True, True, False]
    viewer.record_ack(0, 0.5)
    assert viewer.release() is None
    viewer.resume()
    viewer.record_ack(0, 0.6)
    assert viewer.blocked  # that queue is not empty
    assert viewer.release() == b"abcd"
    assert not viewer.blocked


def test_a_viewer_held_back_is_not_released_by_its_socket() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    viewer.record_ack(0, 0.0)
    for n in range(40):
        offer(viewer, n / 10)
    viewer.pause(4.0)
    viewer.resume()
    assert viewer.held_back
    assert viewer.release() is None
    viewer.record_ack(viewer.sent, 4.1)
    assert viewer.release() == b""


def test_silence_is_pinged_and_then_cut() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    assert [now for now in range(13) if viewer.take_ping(now)] == [5, 10]
    assert viewer.find_overdue(10.9) is None
    assert viewer.find_overdue(11.0) is Close.HALF_OPEN
    viewer.record_heard(11.0)
    assert viewer.find_overdue(21.9) is None
    mute = FlowControl(LIMITS, 0.0, speaks=False)
    assert not mute.take_ping(100.0)
    assert mute.find_overdue(100.0) is None


def test_a_newcomer_has_time_to_read_what_it_was_given() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    viewer.sent = 2
    viewer.begin_join_burst(16_000, 0.0)  # 20 s at 800 bytes a second
    viewer.pause(0.0)
    assert viewer.find_overdue(LIMITS.join_burst_s + LIMITS.undrained_s - 0.1) is None
    assert viewer.find_overdue(LIMITS.join_burst_s + LIMITS.undrained_s) is Close.NO_ACK  # never heard of
    viewer.record_heard(19.0)  # a pong, from among the events
    assert viewer.find_overdue(23.9) is None
    assert viewer.find_overdue(25.1) is Close.NO_ACK


def test_an_acknowledgement_beyond_the_first_burst_ends_its_privilege() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    viewer.sent = 2
    viewer.begin_join_burst(80_000, 0.0)
    viewer.record_ack(2, 1.0)
    assert viewer.join_burst_read_by == 100.0
    viewer.record_ack(3, 2.0)
    assert viewer.join_burst_arrives_by == viewer.join_burst_read_by == 2.0


def test_a_relay_that_stood_still_moves_every_deadline() -> None:
    viewer, other = FlowControl(LIMITS, 0.0), FlowControl(LIMITS, 0.0)
    for each in (viewer, other):
        each.record_ack(0, 0.0)
        each.begin_join_burst(8000, 0.0)
        offer(each, 1.5)
        each.pause(1.6)
    viewer.shift_deadlines(60.0, 61.6)
    for now in range(2, 40):
        assert viewer.find_overdue(now + 60.0) == other.find_overdue(now), now
    assert viewer.check_at == other.check_at + 60.0
    assert viewer.heard_at == 60.0


def test_a_relay_that_stood_still_gives_as_long_to_acknowledge_as_ever() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    viewer.record_ack(0, 0.0)
    assert offer(viewer, 1.5)
    viewer.shift_deadlines(60.0, 61.6)
    viewer.record_heard(75.0)
    assert viewer.owed_at == 61.5
    assert viewer.find_overdue(75.4) is None
    assert viewer.find_overdue(75.6) is Close.NO_ACK


def test_a_relay_that_stood_still_takes_no_message_for_an_old_one() -> None:
    viewer = FlowControl(LIMITS, 0.0)
    viewer.record_ack(0, 0.0)
    assert offer(viewer, 1.5)
    viewer.shift_deadlines(60.0, 61.6)
    viewer.record_ack(0, 61.7)  # number 1 is still on its way: the relay has only just sent it
    assert offer(viewer, 61.8)


def test_messages_are_counted_by_a_bucket() -> None:
    viewer = FlowControl(Limits(messages_burst=3, messages_per_s=2.0), 0.0)
    assert [viewer.allow_message(0.0) for _ in range(4)] == [True, True, True, False]
    assert [viewer.allow_message(1.0) for _ in range(3)] == [True, True, False]


@pytest.mark.parametrize(("hz", "way_s", "pause_s"), [(30, 0.001, 0.25), (10, 0.03, 0.25), (60, 0.2, 0.9)])
def test_a_viewer_that_reads_in_gulps_is_never_cut(hz: int, way_s: float, pause_s: float) -> None:
    """It acknowledges on a frame, a second after its last: what it reads in one go has one acknowledgement,
    sent with the first frame of it, and the rest of the gulp owes none."""
    viewer = FlowControl(Limits(), 0.0)
    random, under_way, acks = Random(1), deque[tuple[float, int]](), deque[tuple[float, int]]()
    acked_at, reads_at, gulp_at = -9.0, 0.0, random.expovariate(0.2)
    skipped = 0
    for i in range(60 * 120):
        now = i / 60
        while acks and acks[0][0] <= now:
            viewer.record_ack(acks.popleft()[1], now)
        if i % (60 // hz) == 0:
            viewer.record_heard(now)
            assert viewer.find_overdue(now) is None, f"cut at {now:.1f} s"
            if viewer.blocked or (now >= viewer.check_at and not viewer.may_send(now)):
                skipped += 1
            else:
                viewer.sent += 1
                under_way.append((now + way_s, viewer.sent))
        if now >= gulp_at:
            reads_at, gulp_at = now + pause_s, now + pause_s + random.expovariate(0.2)
        while now >= reads_at and under_way and under_way[0][0] <= now:
            _, n = under_way.popleft()
            if now - acked_at >= 1.0:
                acked_at = now
                acks.append((now + way_s, n))
    assert skipped < 0.1 * 120 * hz
