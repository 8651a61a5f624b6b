"""A server that does not answer is left alone, and tried again."""

from __future__ import annotations

from posecast_relay.kit import FAILURES, PAUSE_MAX_S, PAUSE_S, Breaker


def test_it_opens_after_some_failures_and_pauses_longer_and_longer() -> None:
    breaker, now = Breaker(), 100.0
    assert [breaker.record_failure(now) for _ in range(FAILURES)] == [False] * (FAILURES - 1) + [True]
    pauses = []
    for _ in range(6):
        assert not breaker.allow(now)
        pauses.append(breaker.open_until - now)
        now = breaker.open_until
        assert breaker.allow(now)
        assert not breaker.record_failure(now)  # known already
        assert breaker.is_open
    assert pauses == [PAUSE_S, 10.0, 20.0, 40.0, PAUSE_MAX_S, PAUSE_MAX_S]


def test_one_try_that_works_closes_it() -> None:
    breaker = Breaker()
    assert not breaker.record_success()
    for _ in range(FAILURES + 2):
        breaker.record_failure(0.0)
    assert breaker.record_success()
    assert not breaker.is_open
    for _ in range(FAILURES - 1):
        assert not breaker.record_failure(50.0)
        assert breaker.allow(50.0)
    breaker.record_failure(50.0)
    assert breaker.open_until == 50.0 + PAUSE_S


def test_failures_count_only_in_a_row() -> None:
    breaker = Breaker()
    for _ in range(10):
        breaker.record_failure(0.0)
        breaker.record_failure(0.0)
        breaker.record_success()
    assert not breaker.is_open
