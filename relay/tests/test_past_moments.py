"""Moments as people write them, and back."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from posecast_relay.past_command.common import (
    TimeError,
    read_moment,
    write_moment,
    write_moment_utc,
    write_span,
)


@pytest.fixture(autouse=True)
def seoul(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine nine hours ahead."""
    monkeypatch.setenv("TZ", "Asia/Seoul")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def unix_ms(text: str) -> int:
    return round(datetime.fromisoformat(text).timestamp() * 1000)


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("2026-11-22T14:20", "2026-11-22T05:20Z"),
        ("2026-11-22 14:20:07.250", "2026-11-22T05:20:07.250Z"),
        ("2026-11-22t14:20:07Z", "2026-11-22T14:20:07Z"),
        ("2026-11-22T14:20+01:00", "2026-11-22T13:20Z"),
        ("2026-11-22T14:20+0000", "2026-11-22T14:20Z"),
        ("2026-11-22 14:20:00.5-0130", "2026-11-22T15:50:00.500Z"),
        ("2026-11-22", "2026-11-21T15:00Z"),
    ],
)
def test_with_and_without_a_zone(text: str, means: str) -> None:
    assert read_moment(text) == unix_ms(means)
    assert read_moment(write_moment(read_moment(text))) == read_moment(text) // 1000 * 1000


def test_a_time_of_today_and_the_end_of_a_day() -> None:
    now = datetime.now(UTC).astimezone()
    for text in ("9:05", "09:05", "09:05:30", "23:59:59.999"):
        hour, minute, *rest = text.split(":")
        second = float(rest[0]) if rest else 0.0
        at = now.replace(hour=int(hour), minute=int(minute), second=0, microsecond=0)
        assert read_moment(text) == round((at.timestamp() + second) * 1000)
    assert read_moment("2026-11-22", is_end=True) == unix_ms("2026-11-22T15:00Z")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "now",
        "24:00",
        "12:60",
        "1",
        "12",
        "2026-02-30",
        "2026-02-30T12:00",
        "2026-1-1",
        "٠٩:٠٥",
        "18.11.2026",
        "2026-11-18T25:00Z",
        "2026-11-18T11:20:00.1234Z",
    ],
)
def test_what_is_none(text: str) -> None:
    with pytest.raises(TimeError) as caught:
        read_moment(text)
    assert "use 2026-11-22T14:20 with or without a zone, 14:20 for today" in str(caught.value)


@pytest.mark.parametrize("text", ["1969-12-30", "9999-12-31T23:59:59Z"])
def test_what_is_too_long_ago_or_to_come(text: str) -> None:
    with pytest.raises(TimeError, match=r"^use a time in 1970 or later$"):
        read_moment(text)


def test_a_span_is_written_in_both_zones(monkeypatch: pytest.MonkeyPatch) -> None:
    at_ms = unix_ms("2026-11-22T05:20Z")
    utc = "2026-11-22T05:20:00Z to 2026-11-22T05:20:01Z"
    both = f"2026-11-22T14:20:00+09:00 to 2026-11-22T14:20:01+09:00 ({utc})"
    assert write_span(at_ms, at_ms + 1000) == both
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    assert write_span(at_ms, at_ms) == "2026-11-22T05:20:00Z to 2026-11-22T05:20:00Z"
    assert read_moment(write_moment_utc(at_ms)) == at_ms
