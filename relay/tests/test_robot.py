"""One word for every viewer."""

from __future__ import annotations

import pytest
from posecast_relay.core.limits import Limits
from posecast_relay.core.robot import OVER_FOR_S, RETURN_AFTER_S, Lateness, Liveness, Runs, Share
from posecast_relay.core.stream import FrameOutcome
from posecast_relay.kit import TokenBucket
from posecast_wire import Stamp

from .sim import UNIX_S, World


@pytest.mark.parametrize(
    ("token", "age_s", "word"),
    [
        (True, 0.1, "online"),
        (True, 1.5, "online"),
        (True, 1.6, "silent"),
        (True, None, "silent"),
        (False, None, "offline"),
        (False, 0.1, "offline"),
    ],
)
def test_token_and_age(token: bool, age_s: float | None, word: str) -> None:
    liveness = Liveness()
    liveness.set_token()
    if not token:
        liveness.clear_token(100.0)
    live_at = None if age_s is None else 99.9
    assert liveness.compute_status(live_at, age_s, 1.5) == word


def test_frames_long_after_the_token_left_come_from_another_edge_with_this_id() -> None:
    liveness = Liveness()
    liveness.set_token()
    liveness.clear_token(100.0)
    assert liveness.compute_status(100.5, 0.1, 1.5) == "offline"  # was on its way
    assert liveness.compute_status(101.5, 0.1, 1.5) == "online"
    assert liveness.compute_status(101.5, 3.0, 1.5) == "offline"


# ---- runs: who is current, who is retired, who returns -------------------------------


def hear(runs: Runs, run_id: int, now: float) -> None:
    """A frame of the current run."""
    runs.record_arrival(Stamp(run_id, round(now * 1e9)), now)


def test_the_newest_run_wins_and_the_one_before_stays_retired() -> None:
    runs = Runs()
    runs.adopt(5, 0.0)
    runs.adopt(3, 10.0)  # a smaller number: runs have no order by value
    assert runs.current == 3
    assert runs.is_retired(5, 10.1)
    assert not runs.is_retired(3, 10.1)
    assert not runs.is_retired(99, 10.1)
    assert runs.adopted == 2


def test_a_retired_run_that_goes_on_is_a_conflict_for_a_while() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 10.0)
    hear(runs, 2, 10.4)
    assert runs.is_retired(1, 10.5)  # was still on its way
    assert not runs.is_in_conflict(10.5)
    hear(runs, 2, 11.9)
    assert runs.is_retired(1, 12.0)
    assert runs.is_in_conflict(12.0)
    assert runs.is_in_conflict(14.9)
    assert not runs.is_in_conflict(15.1)


def test_a_run_returns_when_the_newer_one_has_ended() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 10.0)
    hear(runs, 2, 20.0)
    assert runs.is_retired(1, 20.0 + RETURN_AFTER_S)
    assert not runs.is_retired(1, 20.1 + RETURN_AFTER_S)
    runs.adopt(1, 24.0)
    assert runs.current == 1
    assert runs.is_retired(2, 24.1)  # the newer one, should it go on: one of them, not both in turns
    hear(runs, 1, 40.0)
    assert runs.is_retired(2, 40.1)


def test_two_edges_of_one_name_that_both_send_do_not_take_turns() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.adopt(2, 1.0)
    for n in range(1, 600):
        now = 1.0 + n / 10
        hear(runs, 2, now)
        assert runs.is_retired(1, now)
    assert runs.adopted == 2


def test_retired_runs_are_bounded() -> None:
    runs = Runs()
    for run_id in range(1, 200):
        runs.adopt(run_id, float(run_id))
    assert sum(runs.is_retired(run_id, 199.5) for run_id in range(1, 200)) == 64


def test_a_new_run_has_its_own_minimum() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.record_arrival(Stamp(1, 0), 0.0)
    runs.adopt(2, 50.0)
    assert runs.record_arrival(Stamp(2, 0), 50.0) == 0.0


def test_an_answer_of_another_run_says_nothing_of_this_ones_clock() -> None:
    runs = Runs()
    runs.adopt(1, 0.0)
    runs.record_arrival(Stamp(1, 0), 0.0)
    runs.record_answer(Stamp(2, 0), 0.0, 60.0)
    assert runs.record_arrival(Stamp(1, 10 * 10**9), 70.0) > 59.0


# ---- how late one run's messages are -------------------------------------------------


def test_lateness_is_above_the_least_of_the_run() -> None:
    lateness = Lateness()
    at = [(0.0, 100.2), (1.0, 101.1), (2.0, 102.6), (3.0, 103.1)]  # stamp, arrival
    late = [lateness.record_arrival(stamp_s, now) for stamp_s, now in at]
    assert late == [pytest.approx(x, abs=1e-3) for x in (0.0, 0.0, 0.5, 0.0)]


def test_clocks_that_drift_apart_do_not_make_a_robot_late() -> None:
    lateness = Lateness()
    for hour in range(24):  # the edge's clock loses 80 ppm
        now = hour * 3600.0
        late = lateness.record_arrival(now * (1 - 80e-6), now)
    assert late < 0.01


def test_a_clock_that_stood_still_is_learned_anew_by_one_answer() -> None:
    lateness = Lateness()
    lateness.record_arrival(10.0, 110.0)
    assert not lateness.should_ask(110.0)
    assert lateness.record_arrival(10.03, 170.03) == pytest.approx(60.0, abs=0.01)  # asleep for a minute
    assert lateness.should_ask(170.03)
    lateness.record_answer(10.05, 0.02, 170.07)
    assert lateness.record_arrival(10.1, 170.1) == pytest.approx(0.0, abs=0.03)
    assert not lateness.should_ask(175.0)


def test_frames_that_are_late_stay_late_since_the_answer_is_late_as_well() -> None:
    lateness = Lateness()
    lateness.record_arrival(10.0, 110.0)
    assert lateness.record_arrival(10.03, 115.03) == pytest.approx(5.0, abs=0.01)  # a queue of five seconds
    assert lateness.should_ask(115.03)
    lateness.record_answer(15.1, 5.0, 120.1)  # it had to stand in the queue, too
    assert lateness.record_arrival(15.2, 120.2) == pytest.approx(5.0, abs=0.01)


def test_lateness_that_grows_without_a_step_raises_no_question() -> None:
    lateness = Lateness()
    for n in range(300):  # a full uplink
        lateness.record_arrival(n * 0.03, 100.0 + n * 0.04)
    assert lateness.seconds > 2.0
    assert not lateness.should_ask(120.0)


def test_questions_come_more_and_more_seldom_and_anew_after_a_quiet_minute() -> None:
    lateness = Lateness()
    lateness.record_arrival(0.0, 100.0)
    asked = []
    for n in range(2000):  # late for 200 s, and nobody answers
        now = 105.0 + n / 10
        lateness.record_arrival(n / 10, now)
        if lateness.should_ask(now):
            lateness.record_question(now)
            asked.append(now - 105.0)
    assert asked == [pytest.approx(x, abs=0.15) for x in (0, 1, 3, 7, 15, 31, 63, 95, 127, 159, 191)]
    lateness.record_arrival(400.0, 500.0)  # in time again
    lateness.record_arrival(400.1, 560.0)
    for now in (560.0, 561.1):
        assert lateness.should_ask(now)
        lateness.record_question(now)
        assert not lateness.should_ask(now + 0.9)


def test_a_message_with_a_stamp_from_the_far_end_of_the_clock_is_only_late_or_in_time() -> None:
    lateness = Lateness()
    for stamp_s in (0.0, 2**64 / 1e9, 1.0, 2**64 / 1e9):
        assert 0.0 <= lateness.record_arrival(stamp_s, 100.0) < float("inf")


# ---- a robot's share of the relay ----------------------------------------------------


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
