"""Moments as people write them, and back."""

from __future__ import annotations

import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest
from posecast_relay.past_command.moments import read_moment, write_moment
from posecast_relay.past_command.times import TimeError


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
    "text", ["", "now", "24:00", "12:60", "1", "12", "2026-02-30", "2026-02-30T12:00", "2026-1-1", "٠٩:٠٥"]
)
def test_what_is_none(text: str) -> None:
    with pytest.raises(TimeError) as caught:
        read_moment(text)
    assert "use 2026-11-22T14:20, with or without a zone, 14:20 of today" in str(caught.value)
