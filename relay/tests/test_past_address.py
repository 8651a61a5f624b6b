"""What stands in an address of the past."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from posecast_relay.past.address import (
    AddressError,
    PastSpan,
    read_after,
    read_every,
    read_index,
    read_page,
    read_sha256,
    read_span,
    read_take,
    write_day,
    write_minute,
)
from posecast_relay.past.segment import DAY_MS, PAGE_MS


def test_days_and_pages_are_of_utc_and_come_back_as_they_were() -> None:
    assert read_span("2000-01-01") == PastSpan(946_684_800_000, 946_684_800_000 + DAY_MS)
    assert read_span("2024-02-29").is_day
    page = read_page("2026-11-18T11:20Z")
    assert page == read_span("2026-11-18T11:20Z") == PastSpan(1_795_000_800_000, 1_795_000_800_000 + PAGE_MS)
    assert not page.is_day
    for text in ("2000-01-01", "2099-12-31", "2024-02-29"):
        assert write_day(read_span(text).from_ms) == text
        assert write_day(read_span(text).to_ms - 1) == text
    for text in ("2000-01-01T00:00Z", "2026-11-18T23:50Z"):
        assert write_minute(read_page(text).from_ms) == text
    assert write_minute(page.from_ms + 60_000 - 1) == "2026-11-18T11:20Z"


@pytest.mark.parametrize(
    ("read", "texts"),
    [
        (
            read_span,
            ("", "2026", "2026-02-29", "2026-13-01", "2026-00-10", "1999-12-31", "2026-1-1", "x" * 99),
        ),
        (read_span, ("2026-11-18T11:20", "2026-11-18 11:20Z", "2026-11-18T11:21Z", "2026-11-18T24:00Z")),
        (read_span, ("2026-11-18T11:60Z", "2026-11-31T11:20Z", "２０２６-11-18", "2026-11-18\n")),
        (read_page, ("2026-11-18", "", "2026-02-30T00:00Z")),
        (read_take, ("", "0", "F" * 16, "0" * 15, "0" * 17, "0x" + "0" * 14, "0" * 15 + "\n")),
        (read_index, ("", "-1", "01", "+1", "4294967296", "9" * 500, "1.0", "٣", "0\n")),
        (read_every, ("", "0", "1001", "-1", "9" * 500)),
        (read_after, ("", ",", "0" * 16, "0" * 16 + ",", "0" * 16 + ",1,2", ",1")),
        (read_sha256, ("", "0" * 63, "A" * 64, "0" * 65, "0" * 63 + "g")),
    ],
)
def test_what_is_none_is_refused_in_one_line(read: Callable[[str], object], texts: tuple[str, ...]) -> None:
    for text in texts:
        with pytest.raises(AddressError) as error:
            read(text)
        assert str(error.value).isprintable()


def test_the_others() -> None:
    assert read_take("f" * 16) == (1 << 64) - 1
    assert (read_index("0"), read_index("4294967295")) == (0, 4294967295)
    assert read_after("000000000000000a,7") == (10, 7)
    assert (read_every("1"), read_every("150"), read_every("151"), read_every("1000")) == (1, 150, 150, 150)
    assert read_sha256("ab" * 32) == b"\xab" * 32


@pytest.mark.parametrize(
    ("read", "text", "said"),
    [
        (read_span, "2026-11-24T02:13Z", "the minute ends in 0"),
        (read_span, "1999-12-31", "from 2000 to 2099"),
        (read_page, "2026-11-24", "KEYs: want ten minutes"),
        (read_page, "000000000000000a", "KEYs: want ten minutes"),
        (read_span, "2026-02-29", "no such day"),
        (read_index, "0343", "without leading zeros"),
        (read_take, "A" * 16, "16 lower-case hexadecimal digits"),
        (read_after, "000000000000000a,", "after: an index"),
        (read_after, "a,1", "after: a take"),
    ],
)
def test_a_refusal_says_what_may_be_and_what_was_got(
    read: Callable[[str], object], text: str, said: str
) -> None:
    with pytest.raises(AddressError, match=said) as error:
        read(text)
    got = text if read is not read_after else text.split(",")["index" in said]
    assert str(error.value).endswith(f"; got '{got}'")


def test_what_was_got_is_shortened_and_can_be_shown() -> None:
    with pytest.raises(AddressError) as error:
        read_span("\x1b[2J\u202e" + "x" * 5000)
    assert str(error.value).isprintable()
    assert "x…'" in str(error.value)
    assert len(str(error.value)) < 220
