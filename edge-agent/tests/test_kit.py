"""Text from outside stays one line, logs can't be flooded, time asleep counts, rates are bounded."""

from __future__ import annotations

import time

import pytest
from posecast_edge import kit
from posecast_edge.kit import (
    LINE_MAX,
    NAMED_MAX,
    PART_MAX,
    ExceptionLog,
    OnceLog,
    PartLog,
    RateLimitedLog,
    TokenBucket,
    kind_of,
    make_visible,
    quote,
)
from posecast_edge.uplink.session import Run

# --- text from outside


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("left knee", "left knee"),
        ("Knie, 왼쪽 무릎, ركبة", "Knie, 왼쪽 무릎, ركبة"),
        ("a\nposecast-edge: on air", "a\\nposecast-edge: on air"),
        ("\x1b[2J", "\\x1b[2J"),
        ("abc\u202edef\u2066", "abc\\u202edef\\u2066"),  # what turns the direction
        ("a\u200bb\ufeff\u3164\u2800\ufe0f", "a\\u200bb\\ufeff\\u3164\\u2800\\ufe0f"),  # what can't be seen
        ("half \ud800 a pair", "half \\ud800 a pair"),
        ("\U000e0041\U000e0100", "\\U000e0041\\U000e0100"),
    ],
)
def test_what_is_hidden_is_written_out(text: str, shown: str) -> None:
    assert make_visible(text) == shown
    make_visible(text).encode()


def test_every_line_has_an_end() -> None:
    assert len(make_visible("x" * 10_000_000)) == LINE_MAX
    assert len(make_visible("\u202e" * 10_000)) <= LINE_MAX
    assert make_visible("x" * 5, 5) == "xxxxx"
    assert make_visible("x" * 6, 5) == "xxxx…"


def test_any_value_can_be_quoted() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert quote("a\u202e") == "'a\\u202e'"
    assert quote(10**5000) == "a number with thousands of digits"
    assert quote(deep) == "a list nested too deep"
    assert len(quote("x" * 10_000_000)) <= 60
    assert len(quote(list(range(10_000)))) <= 60


# --- the clock


def test_time_asleep_counts_where_the_platform_can_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "clock_gettime_ns", {7: 60_000_000_000}.__getitem__)
    monkeypatch.setattr(kit, "_BOOTTIME", 7)
    assert (kit.now_ns(), kit.now_s()) == (60_000_000_000, 60.0)


def test_elsewhere_it_is_the_monotonic_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kit, "_BOOTTIME", None)
    monkeypatch.setattr(time, "monotonic_ns", lambda: 5_000_000_000)
    assert kit.now_s() == 5.0


def test_a_stamp_says_when_its_sample_was_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    now_ns = [1_000_000_000]
    monkeypatch.setattr(kit, "now_ns", lambda: now_ns[0])
    run = Run()
    now_ns[0] = 61_500_000_000  # a minute asleep
    assert run.make_stamp().elapsed_ns == 60_500_000_000
    assert run.make_stamp(3.0).elapsed_ns == 2_000_000_000
    assert run.make_stamp(0.5).elapsed_ns == 0, "of before the run began"


# --- logs


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


def test_a_callback_that_raises_is_counted_and_said_once() -> None:
    said: list[str] = []
    exceptions = ExceptionLog(said.append)

    def read(text: str) -> None:
        int(text)

    call = exceptions.guard("a snapshot", read)
    for _ in range(1000):
        call("nonsense\u202e")
    call("5")
    assert exceptions.count("a snapshot") == 1000
    assert exceptions.count("the link") == 0
    assert said == ["a snapshot: ValueError: invalid literal for int() with base 10: 'nonsense\\u202e'"]


# --- rates


def test_so_many_at_once_and_then_so_many_a_second() -> None:
    allowance = TokenBucket(per_s=10.0, most=20.0)
    assert sum(allowance.take(0.0) for _ in range(10_000)) == 20
    assert sum(allowance.take(i / 1024) for i in range(1, 10_241)) == 100
    assert sum(allowance.take(1e6) for _ in range(100)) == 20, "it does not fill without end"


def test_what_costs_more_than_there_can_be_waits_for_all() -> None:
    allowance = TokenBucket(per_s=1.0, most=4.0)
    assert allowance.take(0.0, 10.0)
    assert allowance.compute_wait_s(1.0, 10.0) == 9.0
    assert not allowance.take(9.0, 10.0)
    assert allowance.take(10.0, 10.0)
