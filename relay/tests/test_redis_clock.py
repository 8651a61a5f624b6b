"""How long ago another process wrote something, by the clock of the Redis that both ask."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.redis.client import RedisClock

BEGAN_S = 1_800_000_000.0  # Redis's clock when this process's is 0


def test_nothing_is_known_before_redis_has_said_its_time() -> None:
    clock = RedisClock()
    assert clock.estimate_time(5.0) is None
    assert clock.compute_elapsed(BEGAN_S, 5.0) is None


def test_what_carries_no_time_is_of_no_known_age() -> None:
    clock = RedisClock()
    clock.record_time(BEGAN_S, 0.0, 0.0)
    assert clock.compute_elapsed(None, 1.0) is None


@given(st.lists(st.tuples(st.floats(0, 0.12), st.floats(0, 0.12), st.floats(0, 5)), min_size=1, max_size=30))
def test_the_error_is_at_most_half_of_the_quickest_exchange(
    exchanges: list[tuple[float, float, float]],
) -> None:
    clock, now = RedisClock(), 0.0
    for there_s, back_s, pause_s in exchanges:
        clock.record_time(BEGAN_S + now + there_s, now, now + there_s + back_s)
        now += there_s + back_s + pause_s
    at = clock.estimate_time(now)
    assert at is not None
    quickest_s = min(there_s + back_s for there_s, back_s, _ in exchanges)
    assert abs(at - BEGAN_S - now) <= quickest_s / 2 + 1e-4 * now + 1e-6


@pytest.mark.parametrize("step_s", [-3600.0, -1.0, 1.0, 3600.0])
def test_a_clock_that_was_set_counts_from_the_next_exchange(step_s: float) -> None:
    clock = RedisClock()
    for now in range(10):
        clock.record_time(BEGAN_S + now, now - 0.001, now + 0.001)
    clock.record_time(BEGAN_S + 10 + step_s, 9.99, 10.01)
    assert clock.estimate_time(10.0) == pytest.approx(BEGAN_S + 10 + step_s, abs=0.01)


def test_what_was_written_in_the_future_was_written_before_the_clock_was_set() -> None:
    clock = RedisClock()
    clock.record_time(BEGAN_S, -0.1, 0.1)
    assert clock.compute_elapsed(BEGAN_S + 5, 1.0) is None
    assert clock.compute_elapsed(BEGAN_S + 1.2, 1.0) == 0.0  # two exchanges were not equally quick
    assert clock.compute_elapsed(BEGAN_S - 5, 1.0) == 6.0
