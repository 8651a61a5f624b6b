"""What repeats is said a few times, then counted. The clock is passed in."""

from __future__ import annotations

import logging
import re

from posecast_relay.logging import KINDS_MAX, LINES_PER_S, OF_A_KIND, WINDOW_S, RepeatFilter


def record(line: int, text: str = "it broke", level: int = logging.WARNING) -> logging.LogRecord:
    """One that is written at this line of a file."""
    return logging.LogRecord("x", level, "file.py", line, text, None, None)


def counted(records: list[logging.LogRecord]) -> int:
    """How many lines these say were left out."""
    found = [re.search(r"… and ([\d,]+) more in", each.getMessage()) for each in records]
    return sum(int(each[1].replace(",", "")) for each in found if each is not None)


def test_a_flood_of_one_kind_is_said_a_few_times_and_counted() -> None:
    repeats, said, told = RepeatFilter(), 0, list[logging.LogRecord]()
    for number in range(5000):
        now_s = number / 100
        told += repeats.take_summaries(now_s)
        said += repeats.allow_record(record(1, f"name {number}"), now_s)
    told += repeats.take_summaries(50 + WINDOW_S)
    assert said == OF_A_KIND * 50 / WINDOW_S
    assert said + counted(told) == 5000
    assert told[0].getMessage() == "name 0 … and 990 more in 10 s"
    assert told[0].levelno == logging.WARNING
    assert not repeats.owes


def test_no_attack_writes_more_than_ten_lines_a_second_and_each_is_counted() -> None:
    repeats, written, sums = RepeatFilter(), list[float](), list[logging.LogRecord]()
    lines = 0
    for number in range(20_000):
        now_s = number / 500
        found = repeats.take_summaries(now_s)
        sums += found
        written += [now_s] * len(found)
        if repeats.allow_record(record(number % 200), now_s):  # 200 kinds
            written.append(now_s)
            lines += 1
    now_s = 40.0
    while repeats.owes:
        now_s += 1.0
        sums += repeats.take_summaries(now_s)
    assert lines + counted(sums) == 20_000
    for second in range(40):
        assert sum(1 for at in written if second <= at < second + 1) <= LINES_PER_S
    assert len(repeats._kinds) <= KINDS_MAX + 1


def test_a_kind_is_a_place_and_an_error_and_not_a_name() -> None:
    repeats = RepeatFilter()

    def failed(error: Exception) -> logging.LogRecord:
        try:
            raise error
        except Exception as e:
            made = record(1)
            made.exc_info = (type(e), e, e.__traceback__)
            return made

    for number in range(OF_A_KIND):
        assert repeats.allow_record(failed(ValueError(f"name {number}")), 0.1 * number)
    assert not repeats.allow_record(failed(ValueError("another")), 1.5)
    assert repeats.allow_record(failed(KeyError("another")), 1.5)


def test_who_asks_for_level_debug_gets_it_all() -> None:
    repeats = RepeatFilter()
    assert all(repeats.allow_record(record(1, level=logging.DEBUG), 0.0) for _ in range(1000))


def test_what_is_remembered_holds_no_error() -> None:
    repeats = RepeatFilter()
    made = record(1)
    made.exc_info = (ValueError, ValueError("x"), None)
    repeats.allow_record(made, 0.0)
    (window,) = repeats._kinds.values()
    assert made not in vars(window).values()
    assert isinstance(window.first, str)
