"""Who is to be looked at when."""

from __future__ import annotations

import json
import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.kit import (
    CALM_S,
    FAILURES,
    NEVER,
    PAUSE_MAX_S,
    PAUSE_S,
    Breaker,
    OutageLog,
    TimerQueue,
    json_bytes,
)


def test_the_earliest_moment_counts_and_each_comes_once() -> None:
    agenda = TimerQueue[str]()
    assert agenda.next_at == NEVER
    agenda.put("b", 2.0)
    agenda.put("a", 3.0)
    agenda.put("a", 1.0)
    agenda.put("a", 4.0)
    agenda.put("c", NEVER)
    assert agenda.next_at == 1.0
    assert agenda.take_due(0.9) == []
    assert agenda.take_due(2.0) == ["a", "b"]
    assert agenda.take_due(9.0) == []
    agenda.put("a", 5.0)
    agenda.put("b", 5.0)
    assert agenda.take_due(5.0) == ["a", "b"]
    assert agenda.next_at == NEVER


def test_no_more_come_at_once_than_are_wanted() -> None:
    agenda = TimerQueue[int]()
    for n in range(10):
        agenda.put(n, float(n))
    assert agenda.take_due(20.0, 4) == [0, 1, 2, 3]
    assert agenda.take_due(20.0, 4) == [4, 5, 6, 7]
    assert agenda.take_due(20.0) == [8, 9]


# ---- what the log says of a server that comes and goes -------------------------------


def test_a_server_that_is_late_again_and_again_is_one_trouble() -> None:
    log, said = OutageLog(), []
    for at in range(7):  # twice in 7 s, as on a busy machine
        if at in (0, 6):
            said.append(log.note_failure(TimeoutError(), at))
        else:
            assert not log.note_success(at)
    assert said == ["TimeoutError", None]
    assert not log.note_success(6 + CALM_S - 0.1)
    assert log.is_open
    assert log.note_success(6 + CALM_S)
    assert not log.is_open
    assert not log.note_success(7 + CALM_S), "that it is over is said once"


def test_another_reason_and_another_trouble_are_said() -> None:
    log = OutageLog()
    assert log.note_failure(TimeoutError(), 0.0) == "TimeoutError"
    assert log.note_failure(ConnectionError("refused"), 1.0) == "refused"
    assert log.note_failure(ConnectionError("reset"), 2.0) is None
    assert log.note_success(2.0 + CALM_S)
    assert log.note_failure(TimeoutError(), 100.0) == "TimeoutError"


def test_without_a_failure_there_is_nothing_to_say() -> None:
    assert not OutageLog().note_success(1e9)


# ---- JSON that everybody can read, whatever was put in -------------------------------


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(st.characters()),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(st.characters()), inner, max_size=4),
)


def refuse(name: str) -> Any:
    """NaN, Infinity."""
    raise AssertionError(name)


@given(ANYTHING)
def test_it_is_utf8_and_finite(document: object) -> None:
    json.loads(json_bytes(document).decode(), parse_constant=refuse)


def test_what_cannot_be_said() -> None:
    assert (
        json_bytes({"a": [1.5, math.nan, -math.inf, "x\ud800", "ü"]})
        == '{"a":[1.5,null,null,"x?","ü"]}'.encode()
    )


# ---- a server that does not answer is left alone, and tried again --------------------


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
