"""Who is to be looked at when."""

from __future__ import annotations

from posecast_relay.kit import NEVER, TimerQueue


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
