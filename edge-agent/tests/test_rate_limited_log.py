from __future__ import annotations

from posecast_edge.kit import RateLimitedLog


def test_the_first_at_once_then_a_count_a_second() -> None:
    said: list[str] = []
    c = RateLimitedLog(said.append, "bad lines")
    for i in range(31):
        c.add(f"line {i}", i / 10)
    assert said == [
        "line 0",
        "10 more bad lines, the newest: line 10",
        "10 more bad lines, the newest: line 20",
        "10 more bad lines, the newest: line 30",
    ]
    c.tick(100.0)
    assert len(said) == 4
    c.add("line 99", 200.0)
    assert said[-1] == "line 99"


def test_what_is_held_is_said_when_its_time_comes_or_at_the_end() -> None:
    said: list[str] = []
    c = RateLimitedLog(said.append, "bad lines")
    c.add("a", 0.0)
    c.add("b", 0.1)
    c.tick(0.9)
    assert said == ["a"]
    c.tick(1.0)
    assert said == ["a", "1 more bad lines, the newest: b"]
    c.add("c", 1.1)
    c.flush(1.2)
    assert said[-1] == "1 more bad lines, the newest: c"
