from __future__ import annotations

from posecast_edge.kit import NAMED_MAX, PART_MAX, PartLog, kind_of


def test_a_part_is_named_once_and_repeats_are_counted_by_powers_of_ten() -> None:
    said: list[str] = []
    log = PartLog(said.append, "bad lines")
    for i in range(2000):
        log.add("a", f"line {i}: a is bad")
    log.add("b", "line 2000: b is bad")
    log.flush()
    log.flush()
    assert said == [
        "line 0: a is bad",
        "10 more bad lines, the newest: line 10: a is bad",
        "100 more bad lines, the newest: line 100: a is bad",
        "1000 more bad lines, the newest: line 1000: a is bad",
        "line 2000: b is bad",
        "1999 more bad lines, the newest: line 1999: a is bad",
    ]


def test_parts_without_end_are_bounded() -> None:
    said: list[str] = []
    log = PartLog(said.append, "bad lines")
    for i in range(100_000):
        log.add(f"{i} {'x' * 1000}", f"{i} is bad")
    assert len(said) == NAMED_MAX + 4
    assert said[NAMED_MAX - 1] == "99 is bad; further bad lines are only counted"
    assert sum(map(len, log._named)) <= NAMED_MAX * PART_MAX


def test_a_kind_has_no_numbers() -> None:
    assert kind_of("12 bytes at 0x1F4 of 5") == kind_of("7 bytes at 0x2F9 of 11")
    assert kind_of("name is str") != kind_of("position is str")
