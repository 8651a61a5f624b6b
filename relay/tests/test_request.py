"""What an address asks for, whatever stands in it."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from posecast_relay.net.request import BadRequest, NoSuchStream, StreamRequest, read_bearer, read_target

LIVE = "/api/v1/robots/r/live"


RATES = {"30": 30, "0": 0, "0.0": 0, "-0": 0, "1e-320": 0.1, "7e-320": 0.1, "0.05": 0.1, ".5": 0.5}
LARGE = {"1000": 1000, "1e3": 1000, "%2B5": 5}
NO_RATES = ("nan", "inf", "-inf", "infinity", "-1", "1000.1", "1e999", "1_0", "0x1", "1,5", "1e", "--1")
STRANGE = ("", "%20", "%00", "%D9%A3", "9" * 33, "9" * 5000)


@pytest.mark.parametrize(("wish", "hz"), (RATES | LARGE).items())
def test_rates(wish: str, hz: float) -> None:
    assert read_target(f"{LIVE}?hz={wish}").hz == hz


@pytest.mark.parametrize("wish", NO_RATES + STRANGE, ids=lambda wish: wish[:12])
def test_rates_that_are_none(wish: str) -> None:
    with pytest.raises(BadRequest, match="hz must be a number"):
        read_target(f"{LIVE}?hz={wish}")


def test_no_rate_is_the_usual_one_and_the_first_of_several_counts() -> None:
    assert read_target(LIVE).hz == 30
    assert read_target(f"{LIVE}?hz=5&hz=x").hz == 5


@given(st.text(st.characters(codec="latin-1"), max_size=300))
def test_whatever_the_address_is_it_is_refused_or_sound(query: str) -> None:
    for target in (query, f"{LIVE}?{query}", f"{LIVE}?hz={query}", f"/api/v1/robots/{query}/live"):
        try:
            asked = read_target(target)
        except BadRequest:
            continue
        assert asked.hz == 0 or 0.1 <= asked.hz <= 1000


def test_an_older_page_that_asks_for_a_preview_gets_a_stream_like_any_other() -> None:
    assert read_target(f"{LIVE}?hz=30&preview=1") == read_target(f"{LIVE}?hz=30")


def test_names_are_checked_and_shown_as_what_they_are() -> None:
    with pytest.raises(NoSuchStream) as refused:
        StreamRequest("r\u202e" * 100, None, 1.0, False).check()
    assert str(refused.value).isprintable()
    with pytest.raises(NoSuchStream):
        StreamRequest("r", "*", 1.0, False).check()


def test_too_many_parameters() -> None:
    with pytest.raises(BadRequest, match="16"):
        read_target(f"{LIVE}?" + "&".join(f"a{n}=1" for n in range(17)))


@pytest.mark.parametrize(
    ("header", "token"), [("Bearer x", "x"), ("bearer  x ", "x"), ("Basic x", None), ("Bearer", None)]
)
def test_tokens(header: str, token: str | None) -> None:
    assert read_bearer(header) == token
