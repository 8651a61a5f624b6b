"""A robot's share of the relay."""

from __future__ import annotations

import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.robot import OVER_FOR_S, Share
from posecast_relay.core.stream import FrameOutcome
from posecast_relay.kit import TokenBucket

from .sim import UNIX_S, World


def taken(share: Share, frames_per_s: int, seconds: int, size: int = 100, hashed: bool = False) -> int:
    """How many frames of one view are taken in."""
    at = (100.0 + n / frames_per_s for n in range(frames_per_s * seconds))
    return sum(share.allow_frame("public", size, hashed, now) for now in at)


def test_a_bucket_holds_a_second_of_its_rate_and_fills_at_it() -> None:
    bucket = TokenBucket(10.0)
    for _ in range(10):
        assert bucket.has(1, 5.0)
        bucket.take(1)
    assert not bucket.has(1, 5.0)
    assert not bucket.has(1, 4.0)  # no clock goes back
    assert bucket.has(1, 5.11)
    assert bucket.has(10, 1e9)
    assert not bucket.has(11, 2e9)


@pytest.mark.parametrize("hz", [1, 30, 120])
def test_within_its_share_a_robot_loses_nothing(hz: int) -> None:
    share = Share(Limits())
    assert taken(share, hz, 20) == 20 * hz
    assert share.find_exceeded_limit(120.0) == ""
    assert share.dropped == 0


def test_beyond_it_frames_go_at_the_rate_that_is_allowed() -> None:
    share = Share(Limits())
    assert taken(share, 3000, 10) == pytest.approx(120 * 11, abs=5)  # and a second's worth at first
    assert share.find_exceeded_limit(110.0) == "120 frames a second in a view"
    assert share.dropped == pytest.approx(3000 * 10 - 120 * 11, abs=5)


def test_a_robot_that_sends_less_again_is_within_its_share_by_itself() -> None:
    share = Share(Limits())
    taken(share, 3000, 2)
    assert not share.find_exceeded_limit(102.0 + OVER_FOR_S)
    assert all(share.allow_frame("public", 100, False, 110.0 + n / 30) for n in range(300))


def test_bytes_count_and_those_that_are_hashed_twice() -> None:
    limits = Limits(robot_bytes_per_s=1e6)
    assert taken(Share(limits), 100, 10, size=60_000) == pytest.approx(1e6 * 11 / 60_000, abs=2)
    share = Share(limits)
    assert taken(share, 100, 10, size=60_000, hashed=True) == pytest.approx(1e6 * 11 / 120_000, abs=2)
    assert share.find_exceeded_limit(110.0) == "1,000,000 bytes a second"


def test_views_have_rates_of_their_own_and_the_robot_one_for_all() -> None:
    share = Share(Limits())
    took = [share.allow_frame(f"v{n % 8}", 100, False, 100.0 + n / 960) for n in range(9600)]
    assert sum(took) == pytest.approx(600 * 11, abs=5)
    assert share.find_exceeded_limit(110.0) == "600 messages a second"


def test_the_largest_frame_there_is_fits_into_any_share() -> None:
    assert Share(Limits(robot_bytes_per_s=1000.0)).allow_frame("public", 1 << 16, True, 0.0)


def test_a_flood_is_counted_told_and_over_by_itself() -> None:
    world = World()
    edge = world.on_air()
    world.on_air(robot="innocent")
    _, screen = world.join()
    _, other = world.join(robot="innocent")
    outcomes = []
    for _ in range(3000):
        world.pass_time(1 / 3000)
        outcomes.append(
            world.hub.take_edge_frame("r", "public", edge.frame(world.now), edge.stamp(world.now), world.now)
        )
        world.flush()
    world.pass_time(1.0)
    assert outcomes.count(FrameOutcome.OVER_SHARE) == pytest.approx(3000 - 240, abs=5)
    assert world.hub.outcomes["over share"] == outcomes.count(FrameOutcome.OVER_SHARE)
    assert screen.told("status")[-1]["over_share"] is True
    assert not any("over_share" in status for status in other.told("status"))
    world.run(edge, 5.0)
    assert "over_share" not in screen.told("status")[-1]


def test_events_beyond_the_share_are_dropped_and_told() -> None:
    world = World(Limits(robot_events_per_s=10.0, robot_events_burst=10.0))
    edge = world.on_air()
    _, screen = world.join()
    doc = b'{"type":"event","t":1,"level":"fault","source":"a","text":"b","state":"on"}'
    for _ in range(50):
        world.do(world.hub.take_event("r", "public", doc, edge.stamp(world.now), world.now, UNIX_S))
    assert len(screen.told("event")) == 10
    assert world.hub.robots["r"].share.find_exceeded_limit(world.now) == "10 events a second"


def test_snapshots_beyond_the_share_are_not_parsed() -> None:
    world = World()
    world.on_air()
    refused = 0
    for _ in range(100):
        try:
            world.hub.check_snapshot("r", 1 << 18, world.now)
        except ValueError:
            refused += 1
    assert refused == 100 - (1 << 22) // (1 << 18)
