from __future__ import annotations

from posecast_edge.kit import LINE_MAX, NAMED_MAX, PART_MAX, OnceLog, PartLog, kind_of


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


def test_a_thing_that_is_logged_once_is_not_counted() -> None:
    logged: list[str] = []
    log = OnceLog(logged.append)
    for i in range(3):
        log.add(f"the base has no pose: {i} frames are missing")
        log.add(f"knee is {i} mm off", "misfit")
        log.add(f"{i}\n{'x' * 1000}", "long")
    assert logged[:2] == ["the base has no pose: 0 frames are missing", "knee is 0 mm off"]
    assert len(logged) == 3
    assert logged[2].startswith("0\\nxxx")
    assert len(logged[2]) == LINE_MAX
    assert log.has_logged("misfit")
    assert not log.has_logged("knee")
